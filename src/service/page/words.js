// Names of the formats as people say them, and what the terms of the field mean.

/** Parameters of causes: a pattern of names; then words, the unit, and how the number is shown. */
const SIDES = { low: "lower", high: "upper" };
const same = (v) => v;
const toPercent = (v) => 100 * v;
const CAUSE_PARAMETERS = [
  [/^(low|high)_([xyz])_mm$/, (m) => `${SIDES[m[1]]} end along ${m[2]}`, "mm", same],
  [/^(diameter|radius)_error_mm$/, (m) => `${m[1]}, more than drawn`, "mm", same],
  [/^center_error_([xyz])_mm$/, (m) => `centre, shifted along ${m[1]}`, "mm", same],
  [/^center_([xyz])_mm$/, (m) => `centre along ${m[1]}`, "mm", same],
  [/^radius_mm$/, () => "radius", "mm", same],
  [/^log_stiffness_factor$/, () => "stiffness, against the rest", "times", Math.exp],
  [/^log_volume_ratio$/, () => "volume, against that at bonding", "times", Math.exp],
  [/^bulk_over_shear_modulus$/, () => "bulk modulus over shear modulus", "", same],
  [/^friction_n$/, () => "friction", "N", same],
  [/^offset_n$/, () => "load cell reads too much by", "N", same],
  [/^jump_mm$/, () => "jump of the displacement", "mm", same],
  [/^mm_per_n$/, () => "the load train gives", "mm/N", same],
  [/^slack_mm$/, () => "travel lost before the sample is loaded", "mm", same],
  [/^modulus_kpa$/, () => "modulus along the fibres", "kPa", same],
  [/^turn_(\d)_degrees$/, (m) => `direction of the fibres, turn ${m[1]}`, "°", same],
  [/^rotation_([xyz])_degrees$/, (m) => `image turned about ${m[1]}`, "°", same],
  [/^shift_([xyz])_mm$/, (m) => `image shifted along ${m[1]}`, "mm", same],
  [/^degrees_at_full_drive_about_([xyz])$/, (m) => `turn about ${m[1]} at full drive`, "°", same],
  [/^degrees_about_([xyz])$/, (m) => `turned about ${m[1]}`, "°", same],
  [/^([xyz])_mm_at_full_drive$/, (m) => `moved along ${m[1]} at full drive`, "mm", same],
  [/^([xyz])_mm$/, (m) => `shifted along ${m[1]}`, "mm", same],
  [/^step_(\d+)_(fixed|moved)_([xyz])_mm$/, (m) => `drive ${m[1]}: ${m[2]} plate moved along ${m[3]}`, "mm", same],
  [
    /^step_(\d+)_(fixed|moved)_degrees_about_([xyz])$/,
    (m) => `drive ${m[1]}: ${m[2]} plate turned about ${m[3]}`,
    "°",
    same,
  ],
  [/^(fixed|moved)_plate_mm_per_kpa$/, (m) => `bond at the ${m[1]} plate gives`, "mm/kPa", same],
  [
    /^(fixed|moved)_depth_?(.*)_mm$/,
    (m) => `layer at the ${m[1]} plate, depth${m[2] ? ` (part ${m[2]})` : ""}`,
    "mm",
    same,
  ],
  [
    /^(low|high)_([xyz])_slope_([xyz])_mm$/,
    (m) => `${SIDES[m[1]]} face along ${m[2]}, slope along ${m[3]}`,
    "mm",
    same,
  ],
  [/^(low|high)_([xyz])_bow_([xyz]+)_mm$/, (m) => `${SIDES[m[1]]} face along ${m[2]}, bow ${m[3]}`, "mm", same],
  [
    /^u_([xyz])_(.+)_mm$/,
    (m) => `background of the displacement along ${m[1]}, ${m[2].replaceAll("_", " ")}`,
    "mm",
    same,
  ],
  [/^relative_gain_error_([xyz])$/, (m) => `displacement along ${m[1]} reads too much by`, "%", toPercent],
  [
    /^relative_change_center_to_face_([xyz])$/,
    (m) => `modulus, from the centre to the face along ${m[1]}`,
    "%",
    toPercent,
  ],
  [/^g$/, () => "part of the stress that relaxes", "%", toPercent],
  [/^tau_s$/, () => "time in which it relaxes", "s", same],
  [/^rho$/, () => "part of the stiffness lost at most", "%", toPercent],
  [/^m_over_largest_work$/, () => "work that softens, over the largest work", "", same],
  [/^mu_?(\d*)_?(kpa)?$/, (m) => `μ of the further term ${m[1]}`.trim(), "kPa", same],
  [/^alpha_?(\d*)$/, (m) => `α of the further term ${m[1]}`.trim(), "", same],
];

/** A cause's parameter in words: { words, unit, shown(value) }. */
export function causeParameter(name) {
  for (const [pattern, words, unit, shown] of CAUSE_PARAMETERS) {
    const found = name.match(pattern);
    if (found) return { words: words(found), unit, shown };
  }
  return { words: name.replaceAll("_", " "), unit: "", shown: same };
}

/** Where a cause acts. */
export const CATEGORIES = {
  material: "the material",
  boundary: "plates and bonds",
  geometry: "the sample's shape",
  acquisition: "the scan",
  load: "drive and load cell",
};

/** What the interior test found. */
export const ORIGINS = {
  set_up: "The set-up was not as told: driven by the displacement measured around it, the inside of the sample fits.",
  inside: "The misfit is inside: it is the material's or the scan's, not the set-up's.",
  both: "A part of the misfit is the set-up's, a part is inside.",
};

/** How a diagnosis ended: words, and whether they warn. */
export const VERDICTS = {
  no_mismatch: [
    "Nothing was found to be wrong: the experiment as told explains the recording up to its noise and what " +
      "meshes leave.",
    "good",
  ],
  explained: ["The misfit is explained: with what was found, nothing is left but noise and what meshes leave.", "good"],
  explained_ambiguously: [
    "The misfit is explained, but not by one cause alone: this recording cannot tell the causes " + "below apart.",
    "warn",
  ],
  unexplained: [
    "Something is left that no known cause explains. The material below can be wrong by more than its " +
      "intervals say.",
    "bad",
  ],
};

/** Kinds of job: one of them, and what it is called in a title. */
export const KINDS = {
  evaluations: "evaluation",
  designs: "design search",
  sweeps: "sweep",
  "sweep-studies": "sweep study",
  scans: "synthetic scan",
  imports: "import",
  calibrations: "calibration",
  diagnoses: "diagnosis",
  "next-scans": "next scan",
  solves: "solution",
  "load-curve-diagnoses": "load-curve diagnosis",
  "curve-fits": "fit of curves",
  "uniaxial-fits": "uniaxial fit",
  "material-exports": "material export",
  "model-exports": "model export",
  "recording-exports": "recording export",
  comparisons: "comparison",
  "paper-tables": "tables",
  proofs: "proof",
};

/** What a place in a request is called; its number counts from 1, as in the drawing. */
const place = (pointer, other) =>
  pointer.replace(/^\/(?:specimen|base)\/holes\/(\d+).*$/, (_, n) => `Hole ${Number(n) + 1}`).replace(/^\/.*$/, other);

/** An error of the service in words; `other` stands for places that have no name. */
export function inWords({ pointer, detail, allowed, remedy }, other) {
  const name = place(pointer ?? "", other);
  const text = detail || [allowed, remedy].filter(Boolean).join("; ");
  return text.replace(pointer || /^$/, name).replace(/holes\[(\d+)\]/g, (_, n) => `hole ${Number(n) + 1}`);
}

/** Kinds whose results stand side by side. */
export const COMPARED = new Set(["evaluations", "designs", "calibrations", "diagnoses"]);

/** What can be maximised. */
export const OBJECTIVES = [
  ["integrated_sensitivity", "integrated sensitivity 𝒮"],
  ["sensitivity_and_promised_sd", "𝒮 and promised deviation"],
  ["d_optimal", "D-optimal"],
  ["a_optimal", "A-optimal"],
  ["e_optimal", "E-optimal"],
  ["worst_relative_sd", "worst relative deviation"],
  ["tell_apart", "telling materials apart"],
  ["detect", "finding errors of the experiment"],
];

/** Limits: words, unit, and the side that is allowed. */
export const LIMITS = {
  min_ligament_hole_hole_mm: ["ligament between holes", "mm", "at least"],
  min_ligament_hole_edge_mm: ["ligament to an edge", "mm", "at least"],
  "diameter_mm.min": ["diameter", "mm", "at least"],
  "diameter_mm.max": ["diameter", "mm", "at most"],
  min_voxels_across_ligament: ["voxels across a ligament", "", "at least"],
  max_holes: ["holes", "", "at most"],
  max_drive_mm: ["drive", "mm", "at most"],
  max_force_n: ["force", "N", "at most"],
  max_normal_force_n: ["force across the plates", "N", "at most"],
  max_local_stretch: ["local stretch", "", "at most"],
  symmetry: ["symmetry", "", ""],
};

export function limitWords(name) {
  const [words, unit, side] = LIMITS[name] ?? [name.replaceAll("_", " "), "", ""];
  return [words, [unit, side].filter(Boolean).join(", ")].filter(Boolean).join(", ");
}

/** The terms of the field. */
export const GLOSSARY = {
  "stretch amplitude λ":
    "How far the material is stretched at a place, whatever the direction: 1 is unstretched, 2 is twice " +
    "as long in the direction of most stretch.",
  "mode k":
    "How the material is deformed at a place: 0 is uniaxial tension, 0.5 is pure or simple shear, 1 is equibiaxial " +
    "tension. Tests of one mode tell less of a material than a specimen whose voxels spread over k.",
  "integrated sensitivity 𝒮":
    "How much the displacement of the scan changes with a parameter, summed over its voxels. More is " +
    "better: the parameter leaves a larger mark.",
  "promised deviation":
    "The standard deviation with which a parameter would come out of a calibration on one scan, from the " +
    "noise of voxels and load cell alone. Less is better.",
  "χ² per datum":
    "The squared misfit in units of the noise, per number measured. Noise alone gives 1; more means that the " +
    "model or the data leave something out.",
  "95 % interval":
    "Nineteen times out of twenty the true value lies in it, from noise, discretisation and what the misfit " +
    "could hide. Read the interval, not the estimate alone.",
  "median stretch": "Half of the voxels are stretched more than this, half less.",
  "mesh error":
    "What the mesh may put a number wrong by: in 19 of 20 cases no more. Coarser meshes tell; a finer one makes it smaller.",
  "largest stretch": "The largest principal stretch anywhere in the sample. Where it is too large, the sample tears.",
  gain: "How much more a design tells than the base specimen, by the chosen objective: 1 is as much, 2 twice as much.",
  "D-optimal": "The volume of the region in which all parameters together would lie, per parameter.",
  "A-optimal": "The sum of the parameters' relative variances.",
  "E-optimal": "The combination of parameters that would be known worst.",
  "worst relative deviation": "The parameter that would be known worst, relative to its value.",
  "telling materials apart":
    "How far each material's scan is from the closest fit of a simpler one, in standard deviations.",
  evidence:
    "How much better a model with the cause fits: the fall of the deviance, less a price for every parameter. Above " +
    "about ten there is something to it.",
  "data kept back":
    "Voxels that were not used in the fit. What is predicted of them is a test that a model cannot bend to.",
  "κ, μ, α":
    "Parameters of the Ogden material: κ resists a change of volume (kPa); every term has a modulus μ (kPa) and an " +
    "exponent α. The initial shear modulus is ½ Σ μα.",
};
