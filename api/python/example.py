"""Plan and sweep a specimen over the service; run it as `python3 example.py http://127.0.0.1:8080 [TOKEN]`."""

import sys

from lambdak_client import Client, ProblemError

service = Client(*sys.argv[1:3])
library = service.library()
study = library["studies"][0]
specimen, material, scan = study["base"], library["materials"][0]["material"], study["scan"]

# %% Can it be made, and what would it cost?
found = service.check(specimen, study["limits"], voxel_mm=scan["voxel_mm"])
print("can be made:", found["is_valid"], "· closest limit:", found["margins"][0]["name"])

# %% A mistake is pointed at.
wrong = {**specimen, "drive_mm": [-1.0]}
try:
    service.evaluate(wrong, material)
except ProblemError as error:
    print("refused:", error.kind, error.pointers)
    assert error.pointers == ["/specimen/drive_mm/0"]

# %% What would the scan tell?
job = service.evaluate(specimen, material, scan=scan, drive_mm=[5.0], mesh="search")
evaluation = job.result()
for p in evaluation["promised_sd"]:
    print(f"promised standard deviation of {p['parameter']}: {p['value']}")
print("files:", ", ".join(a["name"] for a in job.artefacts()))

# %% How does it depend on the holes' diameter?
base = {"specimen": specimen, "material": material, "scan": scan, "drive_mm": [5.0], "mesh": "search"}
diameters = [3.0, 4.0, 5.0]
sweep = service.sweep(base, {"/specimen/holes/0/diameter_mm": diameters}).result()
for diameter, entry in zip(diameters, sweep["evaluations"]):
    print(f"first hole {diameter} mm: force {entry['evaluation']['steps'][0]['force_n']:.3f} N")

# %% A better one, with a small budget.
small = {**study, "materials": study["materials"][:1], "verification": {"is_on": False, "draws": 1}}
small["budget"] = {"explore": 6, "refine": 1, "iterations": 1, "confirm": 1}
design = service.design(small)
result = design.result()
print("gain of the best over the base:", round(result["best"]["objective"], 3))
print("drawing:", len(design.file("best-specimen.dxf")), "bytes of DXF")
