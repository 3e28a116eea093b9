// A sweep or a list of evaluations: every point as a row, and as a dot that can be opened as a plan.

import { h, sheet } from "./dom.js";
import { usePlan } from "./draft.js";
import { digits, percent, symbol } from "./numbers.js";
import { table } from "./parts.js";
import { scatter } from "./plot.js";
import { wordsOf } from "./sweep.js";

const MOST_ROWS = 500;
const at = (value, pointer) =>
  pointer
    .slice(1)
    .split("/")
    .reduce((v, key) => v?.[key.replaceAll("~1", "/").replaceAll("~0", "~")], value);
const planButton = (request, label) =>
  h("button", { type: "button", "aria-label": `Plan from ${label}`, onclick: () => usePlan(request) }, "Plan");

function rowOf(entry, varied) {
  const last = entry.evaluation.steps.at(-1);
  const row = { force: last.force_n, stretch: last.median_stretch, drive: last.drive_mm, request: entry.request };
  varied.forEach((p) => {
    row[p] = at(entry.request, p);
  });
  entry.evaluation.promised_sd.forEach((p) => {
    row[p.parameter] = p.relative_sd === null ? NaN : 100 * p.relative_sd;
  });
  return row;
}

function swept(result, varied) {
  const rows = result.evaluations.filter((e) => e.evaluation).map((e) => rowOf(e, varied));
  const named = varied.map((p) => [p, wordsOf(p, result.evaluations[0].request)]);
  const parameters = (result.evaluations.find((e) => e.evaluation)?.evaluation.promised_sd ?? []).map((p) => [
    p.parameter,
    `promised deviation of ${symbol(p.parameter)}, %`,
  ]);
  const figures = [["force", "force, N"], ["stretch", "median stretch"], ...parameters];
  const failed = result.evaluations.length - rows.length;
  const cells = (r, i) => [
    ...varied.map((p) => digits(r[p])),
    digits(r.force),
    digits(r.stretch),
    ...parameters.map((p) => digits(r[p[0]], 3)),
    planButton(r.request, `point ${i + 1}`),
  ];
  return [
    sheet(
      `${rows.length} evaluations${failed ? `, ${failed} without a solution` : ""}`,
      scatter(rows, [...named, ...figures], figures, (row) => usePlan(row.request)),
    ),
    sheet(
      "Table",
      table(
        [...named.map((n) => n[1]), "Force, N", "Median stretch", ...parameters.map((p) => p[1]), ""],
        rows.slice(0, MOST_ROWS).map(cells),
      ),
      rows.length > MOST_ROWS &&
        h("p", { class: "quiet" }, `The first ${MOST_ROWS}; all are in table.csv and table.parquet.`),
    ),
  ];
}

function listed(result) {
  return [
    sheet(
      `${result.evaluations.length} evaluations`,
      table(
        ["Specimen", "Drive, mm", "Force, N", "Median stretch", "Promised", ""],
        result.evaluations.slice(0, MOST_ROWS).map((e) => {
          const last = e.evaluation?.steps.at(-1);
          const holes = e.request.specimen.holes.map((o) => digits(o.diameter_mm, 3)).join(", ");
          const name = `${e.request.specimen.name}${holes ? ` (⌀ ${holes} mm)` : ""}`;
          if (!last) return [name, e.problem?.detail ?? "", "", "", "", planButton(e.request, name)];
          const found = e.evaluation.promised_sd.filter((p) => p.parameter !== "kappa");
          return [
            name,
            digits(last.drive_mm, 3),
            digits(last.force_n),
            digits(last.median_stretch),
            found.map((p) => `${symbol(p.parameter)} ${percent(p.relative_sd)}`).join(", "),
            planButton(e.request, name),
          ];
        }),
      ),
    ),
  ];
}

export function evaluationList(result) {
  const varied = result.varied ?? [];
  return varied.length > 0 ? swept(result, varied) : listed(result);
}
