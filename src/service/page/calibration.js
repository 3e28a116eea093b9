// A calibration: first whether its fit can be believed, then intervals, then maps.

import { h, sheet, term } from "./dom.js";
import { usePlan } from "./draft.js";
import { figureSheet } from "./figures.js";
import { digits, interval, isHardlyKnown, many, symbol, unitOf, withUnit } from "./numbers.js";
import { bigNumbers, callout, materialRow, numbered, table } from "./parts.js";
import { slicesView } from "./slices.js";
import { startButton } from "./start.js";
import { GLOSSARY } from "./words.js";

const CAPTIONS = {
  convergence: "How the fit converged",
  correlation: "Which parameters the data tell apart",
  "residuals-1": "Measured, model and misfit through the sample",
  "residual-histogram": "Misfit in units of the noise, against what noise alone gives",
};

/** Whether a part of the misfit is neither noise nor what meshes leave. */
const leavesSomething = (result) => result.parameters.some((p) => p.possible_shift > 0);

/** The verdict, before any number of the material. */
function verdict(result, request) {
  const chi2 = digits(result.chi2_per_datum, 3);
  if (!leavesSomething(result)) {
    return callout(
      "good",
      "The model fits the recording up to its noise and what meshes leave.",
      h("p", {}, `χ² per datum is ${chi2}, where noise alone gives 1.`),
    );
  }
  return callout(
    "bad",
    `The fit is worse than the noise: do not use this material yet.`,
    h(
      "p",
      {},
      `χ² per datum is ${chi2}, where noise alone gives 1: the misfit is ` +
        `${digits(Math.sqrt(result.chi2_per_datum), 2)} times the noise. Something that was not told of the ` +
        "experiment moved the sample, or the material is another one. The intervals below say how far that can have " +
        "shifted every parameter.",
    ),
    diagnoseButton(request),
  );
}

const diagnoseButton = (request) =>
  request?.recordings?.length > 0 &&
  h(
    "p",
    {},
    startButton("Diagnose: find what was left out", "diagnoses", () => ({
      ...(request.recordings.length === 1 ? { recording: request.recordings[0] } : { recordings: request.recordings }),
      ...(request.mesh_factor ? { mesh_factor: request.mesh_factor } : {}),
    })),
  );

function parameterRow(p) {
  const isLoose = !p.identifiable || isHardlyKnown(p.value, p.interval_95);
  return [
    symbol(p.name),
    isLoose ? h("span", { class: "quiet" }, "–") : materialRow(p.name, p.value, p.interval_95),
    interval(p.interval_95, unitOf(p.name)),
    isLoose
      ? h(
          "span",
          { class: "bad" },
          p.value === null ? "not determined" : "not determined: the interval is wider than the value",
        )
      : "",
  ];
}

/** What is known without a force. */
const ratios = (result) =>
  result.ratios.length > 0 && [
    h("p", {}, "No force was recorded: displacements tell exponents and ratios of moduli, and no modulus."),
    table(
      ["Ratio or exponent", "Value", "From noise alone, sd"],
      result.ratios.map((r) => [r.name.replaceAll("_", " "), digits(r.value, 3), digits(r.sd, 2)]),
    ),
  ];

/** Estimates as they came out, for those who want them. */
const estimates = (result) =>
  h(
    "details",
    {},
    h("summary", {}, "Estimates and what widens their intervals"),
    table(
      ["Parameter", "Estimate", "From noise alone, sd", "Mesh", "Misfit, at most"],
      result.parameters.map((p) => {
        const unit = unitOf(p.name);
        return [
          symbol(p.name),
          ...[
            [p.value, 4],
            [p.sd, 2],
            [p.mesh_error, 2],
            [p.possible_shift, 2],
          ].map(([v, n]) => (v === null ? "–" : withUnit(digits(v, n), unit))),
        ];
      }),
    ),
  );

function shear(result) {
  const found = result.initial_shear_modulus_kpa;
  if (!found) return [];
  const isLoose = isHardlyKnown(found.value, found.interval_95);
  return [
    [
      isLoose ? "not determined" : materialRow("mu", found.value, found.interval_95),
      `initial shear modulus, ${interval(found.interval_95, "kPa")} (95 %)`,
      GLOSSARY["95 % interval"],
    ],
  ];
}

function fitPerDrive(result) {
  return sheet(
    "Fit per drive",
    table(
      ["Drive, mm", "Voxels", "Misfit rms x, y, z, mm", "Force, N", "Model's force, N", "Difference, %"],
      result.steps.map((s) => [
        digits(s.drive_mm, 3),
        many(s.num_voxels),
        s.rms_mm.map((v) => digits(v, 2)).join(", "),
        digits(s.force_n, 4),
        digits(s.model_force_n, 4),
        s.force_n && s.model_force_n !== null
          ? (100 * (s.model_force_n / s.force_n - 1)).toFixed(1).replace(/^-(0\.0)$/, "$1")
          : "–",
      ]),
    ),
  );
}

function maps(result, files) {
  const panel = (label, name) => ({ label, href: files.get(name).href });
  const steps = numbered(files, /^measured_(\d+)_(\d+)\.nii\.gz$/).map(([, r, n], i) => {
    const s = result.steps[i];
    const drive = s ? `drive ${digits(s.drive_mm, 3)} mm` : `${r}.${n}`;
    return { r, n, label: s && result.recordings.length > 1 ? `${s.recording}, ${drive}` : drive };
  });
  return slicesView(
    "Measured, model and what is left",
    steps.flatMap(({ r, n, label }) => [
      {
        label: `${label}: measured and model`,
        panels: [panel("Measured", `measured_${r}_${n}.nii.gz`), panel("Model", `model_${r}_${n}.nii.gz`)],
      },
      {
        label: `${label}: measured and what is left`,
        panels: [
          panel("Measured", `measured_${r}_${n}.nii.gz`),
          panel("Measured less model", `misfit_${r}_${n}.nii.gz`),
        ],
      },
    ]),
    { scale: 1, aimed: 1 },
  );
}

export function calibration(result, files, request) {
  const pictures = [...files.keys()].filter((f) => f.endsWith(".svg"));
  return [
    h(
      "section",
      { class: "sheet" },
      verdict(result, request),
      bigNumbers([
        ...shear(result),
        [String(result.num_terms), result.num_terms === 1 ? "Ogden term" : "Ogden terms"],
        [digits(result.chi2_per_datum, 3), "χ² per datum", GLOSSARY["χ² per datum"]],
      ]),
      table(
        ["Parameter", "Value", term("95 % interval", GLOSSARY["95 % interval"]), ""],
        result.parameters.map(parameterRow),
        [3],
      ),
      h(
        "ul",
        { class: "findings" },
        result.notes.map((n) => h("li", {}, n)),
      ),
      ratios(result),
      estimates(result),
      h(
        "p",
        {},
        h(
          "button",
          { type: "button", onclick: () => usePlan({ material: result.material }) },
          "Plan with this material",
        ),
      ),
    ),
    fitPerDrive(result),
    maps(result, files),
    figureSheet(
      files,
      pictures.map((f) => [f, CAPTIONS[f.slice(0, -4)] ?? f.slice(0, -4).replaceAll("-", " ")]),
    ),
  ];
}
