// What can be started on recordings: a calibration, a diagnosis, the question what to scan next, an import of raw
// phases; and what they can be told.

import { h } from "./dom.js";
import { kept } from "./draft.js";
import { fresh, studyOf } from "./plan_study.js";
import { startJob } from "./start.js";

/** What several recordings are started with, and one. */
const several = (ids) => (ids.length === 1 ? { recording: ids[0] } : { recordings: ids });

const options = (label, list) =>
  h(
    "select",
    { "aria-label": label },
    list.map(([value, text]) => h("option", { value }, text)),
  );

/** What a fit can be told: mesh, number of terms, material as believed. */
function settings(library) {
  const mesh = options("Mesh", [
    ["", "default mesh"],
    ["2", "coarse mesh"],
    ["1", "standard mesh"],
  ]);
  const terms = options("Number of terms", [
    ["", "number of terms: chosen"],
    ["1", "one term"],
    ["2", "two terms"],
    ["3", "three terms"],
  ]);
  const material = options("Material as believed", [
    ["", "material unknown"],
    ...library.materials.map((m, i) => [i, m.name]),
  ]);
  const precision = options("Precision asked", [
    ["", "no precision asked"],
    ...[1, 2, 5, 10, 20].map((part) => [part / 100, `every parameter to ${part} %`]),
  ]);
  const count = () => (terms.value === "" ? {} : { num_terms: Number(terms.value) });
  const factor = () => (mesh.value === "" ? {} : { mesh_factor: Number(mesh.value) });
  return {
    mesh,
    terms,
    material,
    precision,
    calibration: (ids) => ({ recordings: ids, ...count(), ...factor() }),
    // Candidates, scan and limits are those of the plan.
    next: (ids) => ({
      recordings: ids,
      study: studyOf({ ...fresh(library), ...kept() }),
      ...count(),
      ...(precision.value === "" ? {} : { precision: Number(precision.value) }),
    }),
    diagnosis: (ids) => ({
      ...several(ids),
      ...(material.value === "" ? {} : { material: library.materials[Number(material.value)].material }),
      ...factor(),
    }),
  };
}

/** Buttons that start work on recordings; `ids()` are theirs. */
export function starters(library, ids, fail, isRaw = false) {
  const chosen = settings(library);
  const start = (label, cls, kind, body) =>
    h(
      "button",
      {
        type: "button",
        class: `main ${cls}`,
        onclick: async (event) => {
          const button = event.currentTarget;
          button.disabled = true;
          try {
            await startJob(kind, body());
          } catch (error) {
            fail(error);
            button.disabled = false;
          }
        },
      },
      label,
    );
  if (isRaw)
    return h(
      "div",
      { class: "row" },
      start("Import: unwrap the phases", "import", "imports", () => ({ recording: ids()[0] })),
    );
  const row = (...parts) => h("div", { class: "row starters" }, parts);
  return [
    row(
      start("Calibrate", "calibrate", "calibrations", () => chosen.calibration(ids())),
      h("div", {}, chosen.terms),
      start("Diagnose", "diagnose", "diagnoses", () => chosen.diagnosis(ids())),
      h("div", {}, chosen.material),
      h("div", {}, chosen.mesh),
    ),
    row(
      start("What to scan next", "next", "next-scans", () => chosen.next(ids())),
      h("div", {}, chosen.precision),
      h("span", { class: "quiet" }, "with the specimen, the scan, the protocol and the limits of the plan"),
    ),
  ];
}
