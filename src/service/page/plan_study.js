// A plan to begin with, and what a plan makes: what is evaluated, and a study.

import { apart } from "./draft.js";
import { limitsOf, varyOf } from "./study_forms.js";

/** A plan to begin with. */
export function fresh(library) {
  const study = library.studies[0];
  return apart({
    specimen: library.specimens[0],
    base: library.specimens[0],
    material: library.materials[0].material,
    scan: study.scan,
    protocol: {},
    limits: study.limits,
    vary: study.vary,
    objective: study.objective,
    budget: { explore: 40, refine: 3, iterations: 6, confirm: 4 },
    draws: 0,
  });
}

/** What an evaluation of the plan is of; of another specimen scanned likewise. */
export const subjectOf = (model, specimen = model.specimen) => ({
  specimen,
  material: model.material,
  scan: model.scan,
  protocol: model.protocol,
});

/** The budget of a plan: what errors can be found has no derivatives by the design, so that none is improved by them. */
const budgetOf = ({ budget, objective }) => (objective.kind === "detect" ? { ...budget, refine: 0 } : budget);

/** The study of a plan. */
export function studyOf(model) {
  return {
    schema: "study/1",
    name: model.specimen.name,
    base: model.specimen,
    materials: [{ name: "material", material: model.material, relative_sd: 0, weight: 1 }],
    scan: model.scan,
    protocol: model.protocol,
    vary: varyOf(model),
    limits: limitsOf(model),
    objective: model.objective,
    budget: budgetOf(model),
    verification: { is_on: model.draws > 0, draws: Math.max(1, model.draws) },
    seed: 1,
  };
}
