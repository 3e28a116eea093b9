// Planning: a specimen, a material, a scan, limits, an objective; then an evaluation, a sweep of the diameter, or a design.

import { Failure, getJson, post } from "./api.js";
import { fill, h, say } from "./dom.js";
import { digits, duration } from "./numbers.js";
import { editor, section } from "./editor.js";
import { sweepForm } from "./sweep.js";

const copy = (value) => structuredClone(value);
const numberList = (text) => text.split(/[\s,;]+/).filter(Boolean).map(Number);

const LABELS = {
  min_ligament_hole_hole_mm: "ligament between holes, mm (at least)", min_ligament_hole_edge_mm: "ligament to an edge, mm (at least)",
  "diameter_mm.min": "diameter, mm (at least)", "diameter_mm.max": "diameter, mm (at most)", min_voxels_across_ligament: "voxels across a ligament (at least)",
  max_holes: "holes (at most)", max_drive_mm: "drive, mm (at most)",
};

let kept = null; // What was being planned survives a look at the jobs.

export async function planView(content, signal, from) {
  const library = await getJson("/v1/library");
  if (from) kept = { ...fresh(library), ...fromRequest(await getJson(`/v1/jobs/${from}/request`), library) };
  const model = kept ??= fresh(library);
  const report = h("div", { role: "region", "aria-label": "Limits and cost" });
  let timer;
  let number = 0;
  // A sweep's form follows the specimen, but not while somebody types into it.
  const changed = () => { clearTimeout(timer); timer = setTimeout(() => { check(); if (!sweep.element.contains(document.activeElement)) sweep.render(); }, 180); };
  signal.addEventListener("abort", () => clearTimeout(timer));
  const draw = editor(model, changed);
  const sweep = sweepForm(model);

  async function check() {
    const mine = number += 1;
    try {
      const found = await post("/v1/specimens/check", { specimen: model.specimen, limits: model.limits, voxel_mm: model.scan.voxel_mm, material: model.material });
      if (mine !== number) return;
      model.wrong = new Set(found.errors.flatMap((e) => [...`${e.pointer} ${e.detail}`.matchAll(/holes?[\/\[ ]?(\d+)/g)].map((m) => Number(m[1]))));
      showReport(found);
    } catch (error) {
      if (mine === number) fill(report, h("p", { class: "bad" }, error.message));
    }
  }

  function showReport(found) {
    const state = found.errors.length ? ["bad", "This specimen cannot be evaluated."] : !found.is_valid ? ["bad", "A limit is broken."] : found.unchecked.length ? ["good", "Every limit that was checked is kept."] : ["good", "Every limit is kept."];
    fill(report,
      h("p", { class: state[0], role: "status" }, state[1]),
      found.errors.map((e) => h("p", { class: "bad" }, e.detail)),
      found.margins.map((m) => h("div", { class: `meter${m.is_satisfied ? "" : " broken"}` },
        h("span", {}, LABELS[m.name] ?? m.name.replaceAll("_", " ")),
        h("span", {}, m.name === "symmetry" ? (m.is_satisfied ? "kept" : "broken") : `${digits(m.value, 3)} / ${digits(m.limit, 3)}`),
        h("div", { class: "bar" }, h("i", { width_percent: Math.max(2, Math.min(100, 50 * (1 + m.margin_relative))) })))),
      found.unchecked.map((u) => h("p", { class: "quiet" }, `${LABELS[u.name] ?? u.name.replaceAll("_", " ")} (limit ${digits(u.limit, 3)}) was not checked: ${u.detail}`)),
      found.cost && h("p", { class: "quiet" }, `${found.cost.num_voxels.toLocaleString("en")} voxels, ${found.cost.num_elements.toLocaleString("en")} elements, about ${duration(1000 * found.cost.seconds_per_drive)} per drive, ${duration(1000 * found.cost.seconds)} for an evaluation (a job may take ${duration(1000 * found.cost.most_seconds)}); ${digits(found.volume_mm3, 4)} mm³ of material.`));
  }

  const form = h("div", {});
  const field = (label, value, put, more = {}) => h("label", { class: more.class }, label, h("input", {
    value, ...more, class: null,
    onchange: (event) => { put(more.type === "number" ? Number(event.target.value) : event.target.value); changed(); draw.draw(); },
  }));
  const number_ = (label, get, put, more = {}) => field(label, get, put, { type: "number", step: "any", ...more });
  const pick = (label, options, value, put, more = {}) => h("label", more, label, h("select", { onchange: (event) => { put(event.target.value); changed(); draw.draw(); render(); } },
    options.map(([key, text]) => h("option", { value: key, selected: key === value }, text))));
  const optional = (label, key) => field(label, model.limits[key] ?? "", (v) => { if (v === "" || !Number.isFinite(Number(v))) delete model.limits[key]; else model.limits[key] = Number(v); }, { inputmode: "decimal" });

  function render() {
    const sp = model.specimen;
    const axis = section(sp).axis;
    fill(form,
      h("div", { class: "fields" },
        pick("Start from", [["", "this specimen"], ...library.specimens.map((v, i) => [String(i), v.name])], "", (i) => { if (i !== "") model.specimen = copy(library.specimens[Number(i)]); }, { class: "wide" }),
        field("Name", sp.name, (v) => { sp.name = v; }, { class: "wide", maxlength: 200 }),
        pick("Test", [["double_lap_shear", "double-lap shear"], ["uniaxial", "uniaxial"]], sp.test, (v) => { sp.test = v; if (v !== "uniaxial") delete sp.outline; }),
        pick("Holes run along", [["thickness", "thickness (y)"], ["width", "width (z)"]], axis, (v) => { sp.holes.forEach((o) => { o.axis = v; }); }),
        number_("Length, mm", sp.block.length_mm, (v) => { sp.block.length_mm = v; }),
        number_("Thickness, mm", sp.block.thickness_mm, (v) => { sp.block.thickness_mm = v; }),
        number_("Width, mm", sp.block.width_mm, (v) => { sp.block.width_mm = v; }),
        number_("Samples in parallel", sp.samples_in_parallel ?? 1, (v) => { sp.samples_in_parallel = v; }, { step: 1, min: 1 }),
        field("Drives, mm", sp.drive_mm.join(", "), (v) => { sp.drive_mm = numberList(v); })));
  }
  render();

  const limits = h("div", { class: "fields" },
    number_("Ligament between holes, mm", model.limits.min_ligament_hole_hole_mm, (v) => { model.limits.min_ligament_hole_hole_mm = v; }),
    number_("Ligament to an edge, mm", model.limits.min_ligament_hole_edge_mm, (v) => { model.limits.min_ligament_hole_edge_mm = v; }),
    number_("Smallest diameter, mm", model.limits.diameter_mm?.min, (v) => { model.limits.diameter_mm.min = v; }),
    number_("Largest diameter, mm", model.limits.diameter_mm?.max, (v) => { model.limits.diameter_mm.max = v; }),
    optional("Voxels across a ligament", "min_voxels_across_ligament"), optional("Largest force, N", "max_force_n"),
    optional("Largest drive, mm", "max_drive_mm"), optional("Largest local stretch", "max_local_stretch"), optional("Most holes", "max_holes"),
    pick("Symmetry", [["none", "none"], ["mirror_x", "x"], ["mirror_z", "z"], ["mirror_x_and_z", "x and z"]], model.limits.symmetry ?? "none", (v) => { model.limits.symmetry = v; }));

  const scan = h("div", { class: "fields" },
    field("Voxel x, y, z, mm", model.scan.voxel_mm.join(", "), (v) => { model.scan.voxel_mm = numberList(v); }),
    field("Noise x, y, z, mm", model.scan.noise_sd_mm.join(", "), (v) => { model.scan.noise_sd_mm = numberList(v); }),
    number_("Noise of the force, N", model.scan.force_sd_n, (v) => { model.scan.force_sd_n = v; }));

  const material = h("div", {}, materialFields(model, library));
  const goal = h("div", { class: "fields" },
    pick("Objective", [["integrated_sensitivity", "integrated sensitivity"], ["d_optimal", "D-optimal"], ["a_optimal", "A-optimal"], ["e_optimal", "E-optimal"], ["worst_relative_sd", "worst relative deviation"], ["tell_apart", "telling materials apart"]], model.objective.kind, (v) => { model.objective.kind = v; }, { class: "wide" }),
    number_("Holes, at least", model.vary.hole_count.min, (v) => { model.vary.hole_count.min = v; }, { step: 1, min: 0, max: 8 }),
    number_("Holes, at most", model.vary.hole_count.max, (v) => { model.vary.hole_count.max = v; }, { step: 1, min: 0, max: 8 }),
    number_("Drive, at least, mm", model.vary.drive_mm.min, (v) => { model.vary.drive_mm.min = v; }),
    number_("Drive, at most, mm", model.vary.drive_mm.max, (v) => { model.vary.drive_mm.max = v; }),
    number_("Designs sampled", model.budget.explore, (v) => { model.budget.explore = v; }, { step: 1, min: 1 }),
    number_("Designs improved", model.budget.refine, (v) => { model.budget.refine = v; }, { step: 1, min: 1 }),
    number_("Steps of each", model.budget.iterations, (v) => { model.budget.iterations = v; }, { step: 1, min: 1 }),
    number_("Designs confirmed", model.budget.confirm, (v) => { model.budget.confirm = v; }, { step: 1, min: 1 }),
    number_("Verification draws (0: none)", model.draws, (v) => { model.draws = v; }, { step: 1, min: 0 }));
  const mesh = { value: "standard" };
  const problem = h("div", { role: "alert" });

  const start = async (event, kind, body) => {
    const button = event.currentTarget;
    button.disabled = true;
    fill(problem);
    try {
      const job = await post(`/v1/${kind}`, body, { "idempotency-key": crypto.randomUUID?.() ?? String(Math.random()).slice(2) });
      say("Started.");
      location.hash = `#/job/${job.id}`;
    } catch (error) {
      const errors = error instanceof Failure ? error.problem.errors ?? [] : [];
      fill(problem, h("p", { class: "bad" }, error.message), errors.length > 0 && h("p", { class: "quiet" }, `At ${errors.map((e) => e.pointer || "the whole").join(", ")}`));
    }
    button.disabled = false;
  };

  fill(content,
    h("h2", {}, "Plan a specimen"),
    h("div", { class: "columns" },
      h("div", {},
        h("section", { class: "sheet" },
          h("div", { class: "row end" }, h("h3", {}, "Section"), h("button", { type: "button", onclick: () => draw.add() }, "Add a hole")),
          draw.element),
        h("section", { class: "sheet" }, h("h3", {}, "Specimen"), form),
        h("section", { class: "sheet" }, h("h3", {}, "Material"), material),
        h("section", { class: "sheet" }, h("h3", {}, "Scan"), scan)),
      h("div", {},
        h("section", { class: "sheet" }, h("h3", {}, "Check"), report),
        h("section", { class: "sheet" },
          h("h3", {}, "Evaluate this specimen"),
          h("p", { class: "quiet" }, "What the scan would see, and how well it would tell the material."),
          h("div", { class: "row" },
            h("button", { class: "main", id: "evaluate", onclick: (e) => start(e, "evaluations", { specimen: model.specimen, material: model.material, scan: model.scan, mesh: mesh.value }) }, "Evaluate"),
            h("select", { "aria-label": "Mesh", style: null, onchange: (e) => { mesh.value = e.target.value; } }, ["standard", "search", "fine"].map((m) => h("option", { value: m }, `${m} mesh`))),
            h("button", { id: "scan", onclick: (e) => start(e, "scans", { specimen: model.specimen, material: model.material, voxel_mm: model.scan.voxel_mm, noise_sd_mm: model.scan.noise_sd_mm, force_sd_n: model.scan.force_sd_n, mesh: mesh.value }) }, "Scan it synthetically")),
          h("p", { class: "quiet" }, "A synthetic scan becomes a recording to calibrate on.")),
        h("section", { class: "sheet" }, h("h3", {}, "Sweep"), sweep.element,
          h("p", {}, h("button", { class: "main", id: "sweep", onclick: (e) => start(e, "sweeps", sweep.body(mesh.value)) }, "Sweep"))),
        h("section", { class: "sheet" }, h("h3", {}, "Search for a better one"), goal,
          h("details", {}, h("summary", {}, "Limits of what can be made"), limits),
          h("p", {}, h("button", { class: "main", id: "design", onclick: (e) => start(e, "designs", study(model)) }, "Search"))),
        problem)));
  draw.draw();
  check();
}

function materialFields(model, library) {
  const element = h("div", {});
  const render = () => fill(element,
    h("div", { class: "fields" },
      h("label", { class: "wide" }, "Start from", h("select", { onchange: (e) => { if (e.target.value !== "") { model.material = copy(library.materials[Number(e.target.value)].material); render(); } } },
        h("option", { value: "" }, "this material"), library.materials.map((m, i) => h("option", { value: i }, m.name)))),
      h("label", {}, "κ, kPa", h("input", { type: "number", step: "any", value: model.material.bulk_kpa, onchange: (e) => { model.material.bulk_kpa = Number(e.target.value); } })),
      model.material.terms.map((term, index) => [
        h("label", {}, `μ of term ${index + 1}, kPa`, h("input", { type: "number", step: "any", value: term.mu_kpa, onchange: (e) => { term.mu_kpa = Number(e.target.value); } })),
        h("label", {}, `α of term ${index + 1}`, h("input", { type: "number", step: "any", value: term.alpha, onchange: (e) => { term.alpha = Number(e.target.value); } })),
      ])),
    h("div", { class: "row" },
      h("button", { type: "button", onclick: () => { model.material.terms.push({ mu_kpa: 1, alpha: 4 }); render(); } }, "Add a term"),
      model.material.terms.length > 1 && h("button", { type: "button", onclick: () => { model.material.terms.pop(); render(); } }, "Remove the last")));
  render();
  return element;
}

function fresh(library) {
  const base = library.studies[0];
  return {
    specimen: copy(library.specimens[0]), material: copy(library.materials[0].material), scan: copy(base.scan), limits: copy(base.limits),
    vary: copy(base.vary), objective: copy(base.objective), budget: { explore: 40, refine: 3, iterations: 6, confirm: 4 }, draws: 0, chosen: -1,
  };
}

function fromRequest(request, library) {
  if (request.specimen) return { specimen: request.specimen, material: request.material, scan: request.scan ?? fresh(library).scan };
  if (request.base?.schema === "specimen/1") {
    return { specimen: request.base, material: request.materials[0].material, scan: request.scan, limits: request.limits, vary: request.vary, objective: request.objective ?? fresh(library).objective, budget: request.budget ?? fresh(library).budget };
  }
  return {};
}

function study(model) {
  return {
    schema: "study/1", name: model.specimen.name, base: model.specimen,
    materials: [{ name: "material", material: model.material, relative_sd: 0, weight: 1 }],
    scan: model.scan, vary: { ...model.vary, tests: [model.specimen.test] }, limits: model.limits, objective: model.objective, budget: model.budget,
    verification: { is_on: model.draws > 0, draws: Math.max(1, model.draws) }, seed: 1,
  };
}
