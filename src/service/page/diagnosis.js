// A diagnosis: what was wrong in plain words, what to do about it, the material with it modelled, and the evidence.

import { getJson } from "./api.js";
import { h, more, sheet, term } from "./dom.js";
import { usePlan } from "./draft.js";
import { evidence } from "./evidence.js";
import { figureSheet } from "./figures.js";
import { digits, interval, isHardlyKnown, known, percent, symbol, unitOf, withUnit } from "./numbers.js";
import { bigNumbers, callout, numbered, parametersOf, shearModulus, table } from "./parts.js";
import { slicesView } from "./slices.js";
import { together } from "./together.js";
import { CATEGORIES, GLOSSARY, ORIGINS, VERDICTS, causeParameter } from "./words.js";

const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);
/** Before and after; one number where nothing changed. */
const change = (pair, unit) =>
  withUnit(
    pair.before === pair.after ? digits(pair.after, 3) : `${digits(pair.before, 3)} → ${digits(pair.after, 3)}`,
    unit,
  );

/** A cause's parameter as a row: words, value, interval. */
function parameterRow(p) {
  const { words, unit, shown } = causeParameter(p.name);
  const ends = p.interval_95?.map(shown);
  return [words, withUnit(known(shown(p.value), ends), unit), interval(ends, unit)];
}

const place = (l) =>
  `At the ${l.region}: centre x, y, z ${l.center_mm.map((v) => digits(v, 3)).join(", ")} mm, extent ` +
  `${l.extent_mm.map((v) => digits(v, 3)).join(", ")} mm.`;

function causeSheet(cause, note) {
  return sheet(
    sentence(cause.description || cause.name),
    note && h("p", { class: "quiet" }, note),
    h(
      "p",
      {},
      `In ${CATEGORIES[cause.category] ?? cause.category} (${cause.name}). It moved what was recorded by ` +
        `${digits(cause.effect_rms_mm, 2)} mm rms.`,
    ),
    cause.remedy && callout("note", "What can be done", h("p", {}, cause.remedy)),
    table(["Parameter", "Value", "95 % interval"], cause.parameters.map(parameterRow)),
    cause.location && h("p", { class: "quiet" }, place(cause.location)),
    cause.experiments?.length > 0 &&
      h(
        "p",
        {},
        "A further scan of the same sample would tell: ",
        cause.experiments
          .slice(0, 3)
          .map(
            (e) => `at a drive of ${digits(e.drive_mm, 3)} mm by ${digits(e.distance_sd, 2)} standard ` + "deviations",
          )
          .join("; "),
        ".",
      ),
  );
}

/** Whether a recording holds a force. One that is no longer there is taken to have held one. */
async function hasForce(id) {
  const recording = await getJson(`/v1/recordings/${id}`).catch(() => null);
  return !recording || recording.summary.steps.some((s) => Number.isFinite(s.force_n));
}

/** The material with the causes against the one without. */
async function materialSheet(result, recording) {
  const isWeighed = await hasForce(recording);
  const before = parametersOf(result.nominal_material);
  const rows = result.material_parameters.map((p) => {
    const unit = unitOf(p.name);
    const isLoose = isHardlyKnown(p.value, p.interval_95) || (unit !== "" && !isWeighed);
    return [
      symbol(p.name),
      before[p.name] === undefined ? "–" : withUnit(digits(before[p.name], 3), unit),
      isLoose ? "not determined" : withUnit(known(p.value, p.interval_95), unit),
      interval(p.interval_95, unit),
    ];
  });
  const [from, to] = [result.nominal_material, result.material].map(shearModulus);
  if (isWeighed) rows.push(["½ Σ μα", `${digits(from, 3)} kPa`, `${digits(to, 3)} kPa`, ""]);
  const belief = result.modulus_against_belief;
  return sheet(
    "The material",
    table(
      [
        "Parameter",
        "As if nothing were wrong",
        "With what was found",
        term("95 % interval", GLOSSARY["95 % interval"]),
      ],
      rows,
    ),
    h(
      "p",
      {},
      isWeighed
        ? result.causes.length > 0 &&
            `With what was found taken into account the initial shear modulus changes by ${percent(to / from - 1, 2)}.`
        : "No force was recorded: displacements tell exponents and ratios of moduli, and no modulus.",
    ),
    h(
      "p",
      {},
      h("button", { type: "button", onclick: () => usePlan({ material: result.material }) }, "Plan with this material"),
    ),
    belief &&
      h(
        "p",
        {},
        `The sample is ${percent(Math.abs(belief.as_relative_cell_gain_error), 2)} ` +
          `${belief.as_relative_cell_gain_error > 0 ? "stiffer" : "softer"} than believed ` +
          `(${digits(belief.found_kpa, 3)} against ${digits(belief.believed_kpa, 3)} kPa). A load cell that reads ` +
          "as much wrong would look the same: a known weight hung on it tells.",
      ),
  );
}

/** The causes in words, each kind once with how often it was found. */
export const foundWords = (causes) =>
  [...new Set(causes.map((c) => c.description))].map((words) => {
    const count = causes.filter((c) => c.description === words).length;
    return count > 1 ? `${words} (${count} times)` : words;
  });

/** How far the noise differs over the image. */
const noiseRange = (range) =>
  range ? ` (over the image ${range.map((ends) => ends.map((v) => digits(v, 2)).join(" to ")).join(", ")} times as much)` : "";

/** What was wrong, in a few sentences. */
function summary(result) {
  const [words, kind] = VERDICTS[result.verdict] ?? [result.verdict, "warn"];
  const found = foundWords(result.causes);
  return h(
    "section",
    { class: "sheet" },
    callout(
      kind,
      words,
      found.length > 0 && h("p", {}, `What was found: ${found.join("; ")}.`),
      result.interior && h("p", {}, ORIGINS[result.interior.origin] ?? ""),
    ),
    bigNumbers([
      [change(result.chi2_per_datum, ""), "χ² per datum (noise alone: 1)", GLOSSARY["χ² per datum"]],
      [change(result.structured_rms_mm, "mm"), "misfit beyond noise, rms"],
      ...(result.kept_back_rms_mm
        ? [
            [
              change(result.kept_back_rms_mm, "mm"),
              "misfit of data kept back, rms, noise included",
              GLOSSARY["data kept back"],
            ],
          ]
        : []),
    ]),
    h(
      "p",
      { class: "quiet" },
      `Noise along x, y, z ${result.noise_sd_mm.map((v) => digits(v, 2)).join(", ")} mm` +
        `${result.is_noise_estimated ? ", estimated from the recording" : ", as the recording states it"}` +
        `${noiseRange(result.noise_relative_range)}; ` +
        `meshes may leave ${digits(result.allowance_mm, 2)} mm rms.`,
      result.num_outlying_voxels > 0 &&
        ` Voxels left out, since they agree with hardly any neighbour: ${result.num_outlying_voxels}.`,
    ),
    result.left_at && result.verdict === "unexplained" && h("p", {}, `Most is left here. ${place(result.left_at)}`),
  );
}

function maps(result, files, prefix) {
  const found = numbered(files, new RegExp(`^${prefix}residual_before_(\\d+)\\.nii\\.gz$`));
  const panels = [
    ["Before: material alone", "before"],
    ["After: with what was found", "after"],
  ];
  return slicesView(
    "What the model leaves: measured less predicted",
    found.map(([, n]) => ({
      label: `drive ${n}`,
      panels: panels.map(([label, when]) => ({ label, href: files.get(`${prefix}residual_${when}_${n}.nii.gz`).href })),
    })),
    { scale: 1 },
  );
}

export function diagnosis(result, files, request, prefix = "") {
  const isOpen = result.verdict === "unexplained";
  const others = isOpen
    ? "It was tried, and explains less than half of what is left."
    : "This recording cannot tell it from the cause above.";
  return [
    summary(result),
    result.causes.map((c) => causeSheet(c)),
    result.alternatives.length > 0 && h("h2", {}, isOpen ? "What was tried" : "What else it can have been"),
    result.alternatives.map((c) => causeSheet(c, others)),
    materialSheet(result, request?.recording),
    maps(result, files, prefix),
    sheet("What was suspected, and how much each would explain", evidence(result.ranked)),
    figureSheet(files, [[`${prefix}load-curve.svg`, "The load curve: measured, and with the effects found"]]),
    h(
      "section",
      { class: "sheet" },
      more(
        "How it was found",
        h("p", {}, `${result.num_solves} equilibria of ${result.num_unknowns} ` + "displacement unknowns were solved."),
      ),
    ),
  ];
}

/** Several recordings: all together, then each of them. */
export function diagnoses(result, files, request) {
  return [
    together(result.together),
    ...result.diagnoses.flatMap((one, i) => [
      h("h2", {}, one.recording),
      ...diagnosis(one, files, { recording: request.recordings[i] }, `${i + 1}-`),
    ]),
  ];
}
