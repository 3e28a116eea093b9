// A design search: the chosen specimen against the base, and the ways on from it.

import { h, sheet, term } from "./dom.js";
import { usePlan } from "./draft.js";
import { figureSheet } from "./figures.js";
import { digits, symbol, unitOf, withUnit } from "./numbers.js";
import { bigNumbers, promised, shapes, table } from "./parts.js";
import { GLOSSARY, limitWords } from "./words.js";

const lastStep = (entry) => entry.evaluation.steps.at(-1);

/** What a plan takes over from a study. */
const planOf = (study, specimen) => ({
  specimen,
  base: study?.base,
  material: study?.materials?.[0]?.material,
  scan: study?.scan,
  protocol: study?.protocol ?? {},
  limits: study?.limits,
  vary: study?.vary,
  objective: study?.objective,
});

function row(label, entry, study) {
  const [limit, distance] = entry.closest_limit.split(":");
  return [
    label,
    entry.specimen.holes.length,
    digits(entry.specimen.drive_mm.at(-1), 3),
    digits(lastStep(entry).force_n, 3),
    digits(lastStep(entry).normal_force_n, 3),
    digits(lastStep(entry).median_stretch, 3),
    digits(entry.objective, 3),
    `${limitWords(limit)}${distance ? `: ${distance.trim()}` : ""}`,
    h(
      "button",
      {
        type: "button",
        onclick: () => usePlan(planOf(study, entry.specimen)),
        "aria-label": `Use this design: ${label}`,
      },
      "Use",
    ),
  ];
}

function verification(result) {
  const rows = result.verification.best.map((p) => {
    const unit = unitOf(p.parameter);
    return [
      symbol(p.parameter),
      withUnit(digits(p.truth), unit),
      withUnit(digits(p.mean), unit),
      withUnit(digits(p.found_sd, 2), unit),
      withUnit(digits(p.promised_sd, 2), unit),
      p.draws,
      p.doubts?.length ? `no: ${p.doubts.join("; ")}` : "yes",
    ];
  });
  return (
    rows.length > 0 &&
    sheet(
      "Verification on synthetic noisy scans, chosen design",
      table(["Parameter", "Truth", "Mean", "Found deviation", "Promised", "Draws", "To be trusted"], rows),
    )
  );
}

export function design(result, files, study) {
  const { base, best } = result;
  return [
    h(
      "section",
      { class: "sheet" },
      bigNumbers([
        [`× ${digits(best.objective, 3)}`, "gain over the base specimen", GLOSSARY.gain],
        [String(best.specimen.holes.length), "holes"],
        [`${digits(best.specimen.drive_mm.at(-1), 3)} mm`, "drive"],
        [`${digits(lastStep(best).force_n, 3)} N`, "force"],
      ]),
      h(
        "div",
        { class: "row" },
        h(
          "button",
          { type: "button", class: "main", id: "use-design", onclick: () => usePlan(planOf(study, best.specimen)) },
          "Use this design",
        ),
      ),
      ...Object.values(result.recommendation ?? {}).map((said) => h("p", {}, said)),
      h(
        "ul",
        { class: "findings" },
        result.findings.map((f) => h("li", {}, f)),
      ),
      table(
        [
          "Design",
          "Holes",
          "Drive, mm",
          "Force, N",
          "Across the plates, N",
          "Median stretch",
          term("Gain", GLOSSARY.gain),
          "Closest limit",
          "",
        ],
        [
          row("base", base, study),
          row("chosen", best, study),
          ...result.ranked.slice(1, 5).map((e, i) => row(`${i + 2}.`, e, study)),
        ],
        [7, 8],
      ),
    ),
    shapes(files, [
      ["surface-base.json", "Base"],
      ["surface-best.json", "Chosen"],
    ]),
    h(
      "div",
      { class: "halves" },
      sheet("Base: promised deviations", promised(base.evaluation.promised_sd)),
      sheet("Chosen: promised deviations", promised(best.evaluation.promised_sd)),
    ),
    verification(result),
    figureSheet(files, [
      ["histogram.svg", "Voxels in (λ, k): base against chosen"],
      ["best-specimen.svg", "Drawing of the chosen specimen"],
    ]),
  ];
}
