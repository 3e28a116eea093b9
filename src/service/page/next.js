// The next scan: what to do, what each candidate is worth, and what is known so far.

import { h, sheet } from "./dom.js";
import { usePlan } from "./draft.js";
import { figureSheet } from "./figures.js";
import { digits, interval, known, percent, symbol, unitOf, withUnit } from "./numbers.js";
import { callout, table } from "./parts.js";

/** How each verdict on a precision is shown. */
const CALLOUTS = { reached: "good", more_scans: "good", out_of_reach: "warn" };

/** The specimen of a candidate as the request spells it out; a recording's own is not in it. */
function specimenOf(candidate, request) {
  const all = [request?.study?.base, ...(request?.specimens ?? [])];
  const found = all.find((specimen) => specimen?.name === candidate.specimen);
  return found && { ...found, drive_mm: candidate.drive_mm };
}

function candidateRow(candidate, index, request) {
  const specimen = specimenOf(candidate, request);
  const isBest = index === 0;
  return [
    isBest ? h("strong", {}, candidate.name) : candidate.name,
    ...candidate.promised_relative_sd.map((sd) => percent(sd, 2)),
    digits(candidate.minutes, 3),
    digits(candidate.gain_per_minute, 2),
    digits(candidate.force_n, 3),
    percent(candidate.part_beyond, 2),
    candidate.num_scans_to_precision ?? "–",
    specimen &&
      h(
        "button",
        { type: "button", onclick: () => usePlan({ specimen }), "aria-label": `Plan ${candidate.name}` },
        "Plan",
      ),
  ];
}

function candidates(result, request) {
  const heads = [
    "Candidate",
    ...result.parameters.map((p) => `sd of ${symbol(p.name)}`),
    "Minutes",
    "Gain, nats/min",
    "Force, N",
    "Voxels beyond what was seen",
    "Scans to the precision",
    "",
  ];
  return table(
    heads,
    result.candidates.map((c, index) => candidateRow(c, index, request)),
    [heads.length - 1],
  );
}

const parameters = (result) =>
  table(
    ["Parameter", "Value", "sd by scans", "sd by the mesh", "95 % interval", "Asked"],
    result.parameters.map((p) => [
      symbol(p.name),
      withUnit(known(p.value, p.interval_95), unitOf(p.name)),
      percent(p.relative_sd, 2),
      percent(p.discretisation_relative_sd, 2),
      interval(p.interval_95, unitOf(p.name)),
      percent(p.precision, 2),
    ]),
  );

export function next(result, files, request) {
  return [
    h(
      "section",
      { class: "sheet" },
      callout(CALLOUTS[result.stop?.verdict] ?? "good", result.sentence),
      candidates(result, request),
    ),
    figureSheet(files, [["promised.svg", "Relative standard deviations now and after each candidate"]]),
    sheet("Known so far", h("p", { class: "quiet" }, `From ${result.recordings.join(", ")}.`), parameters(result)),
    result.left_out.length > 0 &&
      sheet(
        "What may not be scanned",
        table(
          ["Candidate", "Reason"],
          result.left_out.map((l) => [l.name, l.reason]),
          [1],
        ),
      ),
    result.notes.length > 0 &&
      sheet(
        "Remarks",
        h(
          "ul",
          { class: "findings" },
          result.notes.map((note) => h("li", {}, note)),
        ),
      ),
  ];
}
