"""Hides slack in a synthetic recording: what the actuator was told is more than what the sample felt.

    python3 hide_slack.py RECORDING SLACK_MM

changes the drives in recording.json and load.csv and nothing else. Only Python's standard library is needed.
"""

import json
import sys
from pathlib import Path

folder, slack_mm = Path(sys.argv[1]), float(sys.argv[2])

recording = json.loads((folder / "recording.json").read_text())
for step in recording["steps"]:
    step["drive_mm"] = round(step["drive_mm"] + slack_mm, 6)
recording["specimen"]["drive_mm"] = [step["drive_mm"] for step in recording["steps"]]
(folder / "recording.json").write_text(json.dumps(recording, indent=2))

header, *rows = (folder / "load.csv").read_text().splitlines()
told = []
for row in rows:
    time_s, drive_mm, force_n = row.split(",")
    moved = float(drive_mm) > 0.0
    told.append(f"{time_s},{float(drive_mm) + slack_mm * moved:.4f},{force_n}")
(folder / "load.csv").write_text("\n".join([header, *told]) + "\n")
print(f"{folder}: told {', '.join(str(step['drive_mm']) for step in recording['steps'])} mm")
