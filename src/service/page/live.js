// What the present sketch would give, on the search's mesh, while it is being edited; against the base.

import { getBlob, getJson, post, remove } from "./api.js";
import { fill, h, term } from "./dom.js";
import { digits, percent, sensitivityUnit, symbol, withUnit } from "./numbers.js";
import { subjectOf } from "./plan_study.js";
import { GLOSSARY } from "./words.js";
import { view3d } from "./view3d.js";

const WAIT_MS = 500; // Typing and dragging end before anything is computed.
const POLL_MS = 120;
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Evaluates a sketch; its job is deleted again, for it is nobody's result. */
async function evaluated(request, isStale) {
  let job = await post("/v1/evaluations", request);
  try {
    while (["queued", "running"].includes(job.state)) {
      await pause(POLL_MS);
      if (isStale()) {
        await post(`/v1/jobs/${job.id}/cancel`);
        return null;
      }
      job = await getJson(`/v1/jobs/${job.id}`);
    }
    if (job.state !== "succeeded") throw new Error(job.problem?.detail ?? "The sketch could not be evaluated.");
    const result = await getJson(`/v1/jobs/${job.id}/result`);
    const surface = request.has_files
      ? JSON.parse(await (await getBlob(`/v1/jobs/${job.id}/artefacts/surface.json`)).text())
      : null;
    return { result, surface };
  } finally {
    remove(`/v1/jobs/${job.id}`).catch(() => {});
  }
}

/** The figures of an evaluation: [key, words, meaning, value, text, whether less is better (null: neither)]. */
function figures(result) {
  const last = result.steps.at(-1);
  const found = [
    ["force", `Force at ${digits(last.drive_mm, 3)} mm`, "", last.force_n, `${digits(last.force_n, 3)} N`, null],
    [
      "stretch",
      "Median stretch",
      GLOSSARY["median stretch"],
      last.median_stretch,
      digits(last.median_stretch, 3),
      null,
    ],
    [
      "largest",
      "Largest stretch",
      GLOSSARY["largest stretch"],
      result.largest_principal_stretch,
      digits(result.largest_principal_stretch, 3),
      null,
    ],
  ];
  for (const one of last.integrated_sensitivity) {
    found.push([
      `s ${one.parameter}`,
      `𝒮 of ${symbol(one.parameter)}`,
      GLOSSARY["integrated sensitivity 𝒮"],
      one.sum,
      withUnit(digits(one.sum, 3), sensitivityUnit(one.parameter)),
      false,
    ]);
  }
  for (const one of result.promised_sd) {
    found.push([
      `sd ${one.parameter}`,
      `Promised deviation of ${symbol(one.parameter)}`,
      GLOSSARY["promised deviation"],
      one.relative_sd,
      one.identifiable ? percent(one.relative_sd, 2) : "not identifiable",
      true,
    ]);
  }
  return found;
}

function change([, , , value, , isLessBetter], base) {
  if (!base || !Number.isFinite(value) || !Number.isFinite(base[3]) || base[3] === 0) return "–";
  const part = value / base[3] - 1;
  if (Math.abs(part) < 0.0005) return "as the base";
  const kind = isLessBetter === null ? null : part < 0 === isLessBetter ? "good" : "bad";
  const word = kind === null ? "" : kind === "good" ? ", better" : ", worse";
  return h("span", { class: kind }, `${part > 0 ? "+" : "−"}${digits(Math.abs(100 * part), 2)} %${word}`);
}

/** The panel: `element`; `hold()` after an edit, `update()` once it was checked. `isSound()`: it can be evaluated. */
export function livePanel(model, signal, isSound) {
  const state = { isOn: true, hasMap: false, turn: 0, base: { key: "", figures: null } };
  const body = h("div", { "aria-live": "polite" }, h("p", { class: "quiet" }, "The figures follow."));
  const status = h("p", { class: "quiet", role: "status" });
  const map = h("div", {});
  let timer;
  signal.addEventListener("abort", () => {
    clearTimeout(timer);
    state.turn += 1;
  });

  const request = (specimen, has_files) => ({ ...subjectOf(model, specimen), mesh: "search", has_files });

  async function baseFigures(isStale) {
    const wanted = request(model.base, false);
    const key = JSON.stringify(wanted);
    if (state.base.key !== key) {
      const found = await evaluated(wanted, isStale);
      if (!found) return null;
      state.base = { key, figures: new Map(figures(found.result).map((f) => [f[0], f])) };
    }
    return state.base.figures;
  }

  function show(found, base) {
    fill(
      body,
      h(
        "table",
        { id: "live" },
        h(
          "thead",
          {},
          h(
            "tr",
            {},
            ["Now", "Value", "Base", "Change"].map((t, i) => h("th", { scope: "col", class: i ? "number" : null }, t)),
          ),
        ),
        h(
          "tbody",
          {},
          figures(found.result).map((f) =>
            h(
              "tr",
              {},
              h("td", {}, term(f[1], f[2])),
              h("td", { class: "number" }, f[4]),
              h("td", { class: "number quiet" }, base?.get(f[0])?.[4] ?? "–"),
              h("td", { class: "number" }, change(f, base?.get(f[0]))),
            ),
          ),
        ),
      ),
    );
    fill(map, found.surface && view3d([[found.surface, "Sketch"]]));
  }

  async function run() {
    const mine = (state.turn += 1);
    const isStale = () => mine !== state.turn;
    if (!state.isOn) return;
    if (!isSound()) {
      status.textContent = "The sketch cannot be evaluated; see the check.";
      return;
    }
    status.textContent = "Computing …";
    try {
      const found = await evaluated(request(structuredClone(model.specimen), state.hasMap), isStale);
      if (!found || isStale()) return;
      const base = await baseFigures(isStale).catch(() => null);
      if (isStale()) return;
      show(found, base);
      status.textContent = "";
    } catch (error) {
      if (!isStale()) status.textContent = error.message;
    }
  }

  /** After an edit: what is being computed is out of date. */
  const hold = () => {
    clearTimeout(timer);
    state.turn += 1;
    if (state.isOn) status.textContent = "The figures below are those before the last edit.";
    document.getElementById("live")?.classList.add("stale");
  };
  const update = (wait = WAIT_MS) => {
    hold();
    timer = setTimeout(run, wait);
  };
  const tick = (label, key) =>
    h(
      "label",
      { class: "tick" },
      h("input", {
        type: "checkbox",
        checked: state[key],
        onchange: (e) => {
          state[key] = e.target.checked;
          update(0);
        },
      }),
      label,
    );
  const element = h(
    "div",
    {},
    h(
      "div",
      { class: "row" },
      tick("While editing", "isOn"),
      tick("With the stretch map", "hasMap"),
      h(
        "button",
        {
          type: "button",
          id: "make-base",
          onclick: () => {
            model.base = structuredClone(model.specimen);
            update(0);
          },
        },
        "Take this as the base",
      ),
    ),
    status,
    body,
    map,
    h("p", { class: "quiet" }, "On the coarse mesh of the search; an evaluation below is on the standard mesh."),
  );
  return { element, hold, update };
}
