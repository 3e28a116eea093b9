// The forms of a study: scan, limits, goal of a search.

import { choice, field, fields } from "./field.js";
import { GLOSSARY, OBJECTIVES } from "./words.js";

/** The scan's fields. */
export const scanForm = (model, edited) =>
  fields(
    field({
      label: "Voxel x, y, z, mm",
      kind: "triple",
      value: model.scan.voxel_mm.join(", "),
      example: "1, 0.19, 0.75",
      pointer: "/scan/voxel_mm",
      put: (v) => {
        model.scan.voxel_mm = v;
      },
      changed: edited,
    }),
    field({
      label: "Noise x, y, z, mm",
      kind: "triple",
      value: model.scan.noise_sd_mm.join(", "),
      example: "0.05, 0.05, 0.05",
      pointer: "/scan/noise_sd_mm",
      put: (v) => {
        model.scan.noise_sd_mm = v;
      },
      meaning: "Standard deviation of a voxel's displacement along each axis.",
      changed: edited,
    }),
    field({
      label: "Displacement per phase x, y, z, mm/rad",
      kind: "optionalTriple",
      value: model.scan.mm_per_radian?.join(", "),
      example: "0.1, 0.1, 0.1",
      pointer: "/scan/mm_per_radian",
      put: (v) => {
        if (v === undefined) delete model.scan.mm_per_radian;
        else model.scan.mm_per_radian = v;
      },
      meaning:
        "Empty: every voxel has the noise above. Given, voxels count by the signal that is left where the displacement " +
        "changes within them, and those whose phase cannot be unwrapped do not count.",
      changed: edited,
    }),
    field({
      label: "Noise of the force, N",
      value: model.scan.force_sd_n,
      example: "0.02",
      pointer: "/scan/force_sd_n",
      put: (v) => {
        model.scan.force_sd_n = v;
      },
      changed: edited,
    }),
    choice({
      label: "The grid lies",
      value: model.scan.grid ?? "centred",
      options: [
        ["centred", "in the middle"],
        ["anywhere", "anywhere"],
      ],
      put: (v) => {
        if (v === "centred") delete model.scan.grid;
        else model.scan.grid = v;
      },
      meaning: "Anywhere: what is promised is the mean over all places, and no row of voxels at a free face decides.",
      changed: edited,
    }),
  );

const hasPlates = ({ specimen }) => specimen.test === "double_lap_shear";

/** The limits of a plan, without those that only plates have where there are none. */
export function limitsOf(model) {
  const { max_normal_force_n: across, ...limits } = model.limits;
  return hasPlates(model) && across !== undefined ? { ...limits, max_normal_force_n: across } : limits;
}

/** What the designs of a plan may have, without what only plates have where there are none. */
export function varyOf(model) {
  const { precompression_mm: nearer, ...vary } = { ...model.vary, tests: [model.specimen.test] };
  return hasPlates(model) && nearer !== undefined ? { ...vary, precompression_mm: nearer } : vary;
}

/** Limits that may be left out: key, words, an example. */
const OPTIONAL = [
  ["min_voxels_across_ligament", "Voxels across a ligament", "2"],
  ["max_force_n", "Largest force, N", "40"],
  ["max_normal_force_n", "Largest force across the plates, N", "30"],
  ["max_drive_mm", "Largest drive, mm", "7"],
  ["max_local_stretch", "Largest local stretch", "3.5"],
  ["max_holes", "Most holes", "5"],
];

const MEANINGS = {
  max_normal_force_n: "What pulls the plates together or pushes them apart at the largest drive, all samples together.",
};

export function limitsForm(model, edited) {
  const { limits } = model;
  const limit = (key, label, example) =>
    field({
      label,
      value: limits[key],
      example,
      pointer: `/limits/${key}`,
      put: (v) => {
        limits[key] = v;
      },
      changed: edited,
    });
  const diameter = (end, label) =>
    limits.diameter_mm &&
    field({
      label,
      value: limits.diameter_mm[end],
      example: "2",
      pointer: `/limits/diameter_mm/${end}`,
      put: (v) => {
        limits.diameter_mm[end] = v;
      },
      changed: edited,
    });
  return fields(
    limit("min_ligament_hole_hole_mm", "Ligament between holes, mm", "1.5"),
    limit("min_ligament_hole_edge_mm", "Ligament to an edge, mm", "1.2"),
    diameter("min", "Smallest diameter, mm"),
    diameter("max", "Largest diameter, mm"),
    OPTIONAL.filter(([key]) => key !== "max_normal_force_n" || hasPlates(model)).map(([key, label, example]) =>
      field({
        label,
        kind: "optional",
        value: limits[key],
        example,
        pointer: `/limits/${key}`,
        put: (v) => {
          if (v === undefined) delete limits[key];
          else limits[key] = v;
        },
        placeholder: "no limit",
        meaning: MEANINGS[key],
        changed: edited,
      }),
    ),
    choice({
      label: "Symmetry",
      value: limits.symmetry ?? "none",
      options: [
        ["none", "none"],
        ["mirror_x", "x"],
        ["mirror_z", "z"],
        ["mirror_x_and_z", "x and z"],
        ["point", "about the centre"],
      ],
      put: (v) => {
        limits.symmetry = v;
      },
      changed: edited,
    }),
  );
}

/** Sides for notches, as the study lists them. */
const NOTCHES = [
  ["none", "none"],
  ["ends", "in the ends"],
  ["sides", "in the sides"],
  ["ends+sides", "in ends and sides"],
];

export function goalForm(model, edited) {
  const count = (label, value, put, pointer, meaning) =>
    field({ label, kind: "whole", value, put, pointer, example: "4", meaning, changed: edited });
  const { vary, budget } = model;
  const drive = (end, label) =>
    field({
      label,
      value: vary.drive_mm[end],
      example: "5",
      pointer: `/vary/drive_mm/${end}`,
      put: (v) => {
        vary.drive_mm[end] = v;
      },
      changed: edited,
    });
  const nearer = (end, label) =>
    hasPlates(model) &&
    field({
      label,
      kind: "optional",
      value: vary.precompression_mm?.[end],
      example: "-1.6",
      pointer: `/vary/precompression_mm/${end}`,
      put: (v) => {
        // With one end alone the range goes to plates that stay where they are; without one there is none.
        if (v === undefined) delete vary.precompression_mm;
        else vary.precompression_mm = { min: Math.min(v, 0), max: Math.max(v, 0), ...vary.precompression_mm, [end]: v };
      },
      placeholder: "not varied",
      meaning: "Before they are driven, and kept so. Negative numbers pull them apart.",
      changed: edited,
    });
  const holes = (end, label) =>
    count(
      label,
      vary.hole_count[end],
      (v) => {
        vary.hole_count[end] = v;
      },
      `/vary/hole_count/${end}`,
    );
  const chosen = OBJECTIVES.find(([key]) => key === model.objective.kind)?.[1] ?? "";
  return fields(
    choice({
      label: "Objective",
      wide: true,
      value: model.objective.kind,
      options: OBJECTIVES,
      put: (v) => {
        model.objective.kind = v;
      },
      meaning: GLOSSARY[chosen] ?? GLOSSARY.gain,
      changed: edited,
    }),
    holes("min", "Holes, at least"),
    holes("max", "Holes, at most"),
    choice({
      label: "Notches in free sides",
      value: (vary.notches ?? []).join("+") || "none",
      options: NOTCHES,
      put: (v) => {
        if (v === "none") delete vary.notches;
        else vary.notches = v.split("+");
      },
      meaning: "Round, with their centres on the side; they count as holes. The symmetry must take one side to the other.",
      changed: edited,
    }),
    drive("min", "Drive, at least, mm"),
    drive("max", "Drive, at most, mm"),
    nearer("min", "Plates pressed together, at least, mm"),
    nearer("max", "Plates pressed together, at most, mm"),
    count(
      "Designs sampled",
      budget.explore,
      (v) => {
        budget.explore = v;
      },
      "/budget/explore",
      "Designs spread over the whole space before any is improved.",
    ),
    count(
      "Designs improved",
      budget.refine,
      (v) => {
        budget.refine = v;
      },
      "/budget/refine",
    ),
    count(
      "Steps of each",
      budget.iterations ?? 6,
      (v) => {
        budget.iterations = v;
      },
      "/budget/iterations",
    ),
    count(
      "Designs confirmed",
      budget.confirm,
      (v) => {
        budget.confirm = v;
      },
      "/budget/confirm",
      "The best designs, evaluated again on the standard mesh.",
    ),
    count(
      "Verification draws (0: none)",
      model.draws,
      (v) => {
        model.draws = v;
      },
      "/verification/draws",
      "Synthetic noisy scans on which the chosen design is calibrated: the proof of its promise.",
    ),
  );
}
