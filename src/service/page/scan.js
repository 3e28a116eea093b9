// A recording that a job made: a synthetic scan, or an import of raw phases.

import { h } from "./dom.js";
import { digits, many } from "./numbers.js";
import { bigNumbers, numbered, table } from "./parts.js";
import { slicesView } from "./slices.js";
import { startButton } from "./start.js";

/** The ways on from a recording that was made. */
export const onward = (recording) =>
  recording &&
  h(
    "div",
    { class: "row" },
    startButton("Calibrate on it", "calibrations", () => ({ recordings: [recording] })),
    startButton("Diagnose it", "diagnoses", () => ({ recording }), {}),
    h("a", { href: "#/recordings" }, "All recordings"),
  );

export function scan(result, files) {
  const drives = numbered(files, /^u_(\d+)\.nii\.gz$/).map(([name, n]) => ({
    label: `drive ${digits(result.steps[n - 1].drive_mm, 3)} mm`,
    panels: [{ label: "Displacement", href: files.get(name).href }],
  }));
  return [
    h(
      "section",
      { class: "sheet" },
      bigNumbers([
        [many(result.num_voxels), "voxels"],
        [String(result.steps.length), "drives"],
        [
          result.noise_sd_mm ? `${result.noise_sd_mm.map((v) => digits(v, 2)).join(", ")} mm` : "–",
          "noise found along x, y, z",
        ],
      ]),
      table(
        ["Drive, mm", "Force, N", "True force, N", "Error rms x, y, z, mm"],
        result.steps.map((s) => [
          digits(s.drive_mm, 3),
          digits(s.force_n),
          digits(s.true_force_n),
          s.error ? s.error.map((e) => digits(e.rms_mm, 2)).join(", ") : "raw phases",
        ]),
      ),
      onward(result.recording),
    ),
    slicesView("Displacements as scanned", drives),
  ];
}
