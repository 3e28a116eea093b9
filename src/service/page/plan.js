// Planning: a specimen, a material, a scan, limits, an objective; then an evaluation, a sweep, a scan, or a search.

import { Failure, getJson, post } from "./api.js";
import { showCheck } from "./check.js";
import { fill, h, more, sheet } from "./dom.js";
import { Past, apart, keep, kept, planOfFile, planOfLink } from "./draft.js";
import { editor } from "./editor.js";
import { markErrors, unreadField } from "./field.js";
import { livePanel } from "./live.js";
import { planBar, undoKeys } from "./plan_bar.js";
import { materialForm, specimenForm } from "./plan_forms.js";
import { fresh, studyOf, subjectOf } from "./plan_study.js";
import { protocolForm } from "./protocol_form.js";
import { startJob } from "./start.js";
import { goalForm, limitsForm, limitsOf, scanForm } from "./study_forms.js";
import { sweepForm } from "./sweep.js";
import { inWords } from "./words.js";

const CHECK_WAIT_MS = 180;

/** The plan of an address: of a job (its identifier), of a link (after ~), or the one that this browser keeps. */
async function planOf(from, library) {
  if (!from) return kept() ?? {};
  if (from.startsWith("~")) return planOfLink(from.slice(1));
  return planOfFile(JSON.stringify(await getJson(`/v1/jobs/${from}/request`)));
}

const evaluationOf = (model, mesh) => ({ ...subjectOf(model), mesh });
const scanOf = (model, mesh) => ({
  specimen: model.specimen,
  material: model.material,
  voxel_mm: model.scan.voxel_mm,
  noise_sd_mm: model.scan.noise_sd_mm,
  force_sd_n: model.scan.force_sd_n,
  mesh,
});

export async function planView(content, signal, from) {
  const library = await getJson("/v1/library");
  const model = { ...apart({ ...fresh(library), ...(await planOf(from, library)) }), chosen: -1, brokenLimits: [] };
  // A link or a job has given its plan; from here on it is the one that is kept, also over a reload.
  if (from) {
    keep(model);
    history.replaceState(null, "", "#/plan");
  }
  const past = new Past(model);
  const report = h("div", { role: "region", "aria-label": "Limits and cost" });
  const problem = h("div", { role: "alert" });
  const forms = {
    specimen: h("div", {}),
    material: h("div", {}),
    scan: h("div", {}),
    protocol: h("div", {}),
    limits: h("div", {}),
    goal: h("div", {}),
  };
  let [timer, number, isSound] = [undefined, 0, true];
  signal.addEventListener("abort", () => clearTimeout(timer));

  const draw = editor(model, () => edited(false));
  const sweep = sweepForm(model);
  const live = livePanel(model, signal, () => isSound);
  const renderForms = () => {
    fill(forms.specimen, specimenForm(model, library, edited));
    fill(forms.material, materialForm(model, library, edited));
    fill(forms.scan, scanForm(model, edited));
    fill(forms.protocol, protocolForm(model, edited));
    fill(forms.limits, limitsForm(model, edited));
    fill(forms.goal, goalForm(model, edited));
  };

  /** Forms are made anew, and the field that was being used is used again. */
  function refreshForms() {
    const place = document.activeElement;
    const form = Object.values(forms).find((one) => one.contains(place));
    const at = form ? [...form.querySelectorAll("input, select, button")].indexOf(place) : -1;
    renderForms();
    if (at >= 0) form.querySelectorAll("input, select, button")[at]?.focus();
  }

  /** After every edit: it is kept, checked and computed. */
  function edited(isForm = true) {
    past.push();
    keep(model);
    bar.update();
    if (isForm) {
      refreshForms();
      draw.draw();
    }
    clearTimeout(timer);
    timer = setTimeout(check, CHECK_WAIT_MS);
    live.hold();
  }

  /** After a step back or forth, or something new in place: everything is shown anew. */
  function shown() {
    keep(model);
    bar.update();
    renderForms();
    draw.draw();
    if (!sweep.element.contains(document.activeElement)) sweep.render();
    check();
    live.hold();
  }
  const replace = (parts) => {
    Object.assign(model, apart(parts));
    past.push();
    shown();
  };
  const bar = planBar(model, past, studyOf, { replace, restored: shown, fresh: () => replace(fresh(library)) });

  async function check() {
    const mine = (number += 1);
    const { specimen, material, scan } = model;
    const limits = limitsOf(model);
    try {
      const found = await post("/v1/specimens/check", { specimen, limits, voxel_mm: scan.voxel_mm, material });
      if (mine !== number) return;
      isSound = found.errors.length === 0;
      live.update();
      model.wrong = new Set(
        found.errors.flatMap((e) =>
          [...`${e.pointer} ${e.detail}`.matchAll(/holes?[/[ ]?(\d+)/g)].map((m) => Number(m[1])),
        ),
      );
      model.brokenLimits = found.margins.filter((m) => !m.is_satisfied).map((m) => m.name);
      showCheck(report, found, markErrors(content, found.errors));
      draw.draw();
      if (!sweep.element.contains(document.activeElement)) sweep.render();
    } catch (error) {
      if (mine !== number) return;
      isSound = false;
      showProblem(report, error);
    }
  }

  function showProblem(element, error) {
    const errors = error instanceof Failure ? (error.problem.errors ?? []) : [];
    const others = markErrors(content, errors);
    fill(
      element,
      h(
        "p",
        { class: "bad" },
        errors.length > others.length ? "Some fields hold what is not allowed; it is said at each." : error.message,
      ),
      others.map((e) => h("p", { class: "bad" }, inWords(e, e.pointer || "The whole"))),
    );
  }

  const mesh = { value: "standard" };
  const start = (label, id, kind, body, isMain = true) =>
    h(
      "button",
      {
        type: "button",
        class: isMain ? "main" : null,
        id,
        onclick: async (event) => {
          const button = event.currentTarget;
          fill(problem);
          const unread = unreadField(content);
          if (unread) {
            unread.focus();
            return;
          }
          button.disabled = true;
          try {
            await startJob(kind, body());
          } catch (error) {
            showProblem(problem, error);
            problem.scrollIntoView({ block: "nearest" });
          }
          button.disabled = false;
        },
      },
      label,
    );

  fill(
    content,
    h("h2", {}, "Plan a specimen"),
    bar.element,
    problem,
    h(
      "div",
      { class: "columns" },
      h(
        "div",
        {},
        h(
          "section",
          { class: "sheet first" },
          h(
            "div",
            { class: "row end" },
            h("h3", {}, "Section"),
            h("button", { type: "button", onclick: () => draw.add() }, "Add a hole"),
          ),
          draw.element,
        ),
        sheet("Specimen", forms.specimen),
        sheet("Material", forms.material),
        sheet("Scan", forms.scan),
        sheet("Protocol", forms.protocol),
      ),
      h(
        "div",
        {},
        h("section", { class: "sheet second" }, h("h3", {}, "What this sketch would give"), live.element),
        sheet("Check", report),
        sheet(
          "Evaluate this specimen",
          h("p", { class: "quiet" }, "What the scan would see, and how well it would tell the material."),
          h(
            "div",
            { class: "row" },
            start("Evaluate", "evaluate", "evaluations", () => evaluationOf(model, mesh.value)),
            h(
              "div",
              {},
              h(
                "select",
                {
                  "aria-label": "Mesh",
                  onchange: (e) => {
                    mesh.value = e.target.value;
                  },
                },
                ["standard", "search", "fine"].map((m) => h("option", { value: m }, `${m} mesh`)),
              ),
            ),
            start("Scan it synthetically", "scan", "scans", () => scanOf(model, mesh.value), false),
          ),
          h("p", { class: "quiet" }, "A synthetic scan becomes a recording to calibrate on."),
        ),
        sheet(
          "Sweep",
          sweep.element,
          h(
            "p",
            {},
            start("Sweep", "sweep", "sweeps", () => sweep.body(mesh.value)),
          ),
        ),
        sheet(
          "Search for a better one",
          forms.goal,
          more("Limits of what can be made", forms.limits),
          h(
            "p",
            {},
            start("Search", "design", "designs", () => studyOf(model)),
          ),
        ),
      ),
    ),
  );
  undoKeys(past, shown, signal);
  renderForms();
  draw.draw();
  check();
}
