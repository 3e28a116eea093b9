// An evaluation: what the scan would see, and how well it would tell the material.

import { h, sheet, term } from "./dom.js";
import { usePlan } from "./draft.js";
import { figureSheet } from "./figures.js";
import { digits, many, symbol } from "./numbers.js";
import { bigNumbers, promised, sensitivities, shapes, table } from "./parts.js";
import { GLOSSARY } from "./words.js";

export function evaluation(result, files, request) {
  const last = result.steps.at(-1);
  // Bars have no plates, and no force across them.
  const across = Number.isFinite(last.normal_force_n) ? [["Across the plates, N", (s) => s.normal_force_n]] : [];
  const isBounded = result.steps.some((s) => Number.isFinite(s.force_discretisation_n));
  const mesh = isBounded ? [[term("Mesh, N", GLOSSARY["mesh error"]), (s) => `± ${digits(s.force_discretisation_n, 2)}`]] : [];
  const maps = [...files.keys()].filter((n) => /^map-sensitivity/.test(n));
  return [
    h(
      "section",
      { class: "sheet" },
      bigNumbers([
        [`${digits(last.force_n, 3)} N`, `force at ${digits(last.drive_mm, 3)} mm`],
        [many(last.num_voxels), "voxels"],
        [digits(last.median_stretch, 3), "median stretch", GLOSSARY["median stretch"]],
        [digits(result.largest_principal_stretch, 3), "largest stretch", GLOSSARY["largest stretch"]],
      ]),
      table(
        [
          "Drive, mm",
          "Force, N",
          ...mesh.map(([words]) => words),
          ...across.map(([words]) => words),
          "Voxels",
          "Median stretch",
        ],
        result.steps.map((s) => [
          digits(s.drive_mm, 3),
          digits(s.force_n, 4),
          ...mesh.map(([, of]) => of(s)),
          ...across.map(([, of]) => digits(of(s), 4)),
          many(s.num_voxels),
          digits(s.median_stretch, 4),
        ]),
      ),
      request?.specimen &&
        h(
          "div",
          { class: "row" },
          h("button", { type: "button", onclick: () => usePlan(request) }, "Change this specimen"),
        ),
    ),
    h(
      "div",
      { class: "halves" },
      sheet("What the scan promises", promised(result.promised_sd)),
      sheet(
        term("Integrated sensitivity 𝒮", GLOSSARY["integrated sensitivity 𝒮"]),
        h("p", { class: "quiet" }, `At ${digits(last.drive_mm, 3)} mm.`),
        sensitivities(last),
      ),
    ),
    shapes(files, [["surface.json", "Deformed specimen"]]),
    figureSheet(files, [
      ["histogram.svg", "Where the voxels lie in stretch amplitude λ and mode k"],
      ["integrated-sensitivity.svg", "Integrated sensitivities, sums over voxels"],
    ]),
    figureSheet(files, [["map-stretch-and-mode.svg", "λ and k through the specimen"]]),
    figureSheet(files, [["map-signal.svg", "Signal that is left, and voxels that are lost"]]),
    figureSheet(
      files,
      maps.map((n) => [n, `Sensitivity to ${symbol(n.slice(16, -4))}`]),
    ),
  ];
}
