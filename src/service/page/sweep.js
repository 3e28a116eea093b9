// The form of a sweep: what varies, from where to where, how many, which seed.

import { fill, h } from "./dom.js";
import { lawNumbers } from "./law.js";
import { digits, symbol } from "./numbers.js";
import { subjectOf } from "./plan_study.js";

/** What of an evaluation can vary: pointer, words, value now. */
function variables(model) {
  const { specimen, material, scan } = model;
  const found = [];
  const add = (pointer, words, value) => found.push({ pointer, words, value });
  specimen.holes.forEach((hole, i) => {
    const axes = hole.axis === "thickness" ? ["x", "z"] : ["x", "y"];
    add(`/specimen/holes/${i}/diameter_mm`, `diameter of hole ${i + 1}, mm`, hole.diameter_mm);
    if (hole.shape) {
      add(`/specimen/holes/${i}/shape/length_mm`, `length of hole ${i + 1}, mm`, hole.shape.length_mm);
      add(`/specimen/holes/${i}/shape/angle_deg`, `angle of hole ${i + 1}, degrees`, hole.shape.angle_deg ?? 0);
    }
    axes.forEach((a, c) =>
      add(`/specimen/holes/${i}/center_mm/${c}`, `centre of hole ${i + 1} along ${a}, mm`, hole.center_mm[c]),
    );
  });
  specimen.drive_mm.forEach((v, i) => add(`/specimen/drive_mm/${i}`, `drive ${i + 1}, mm`, v));
  for (const side of ["length", "thickness", "width"])
    add(`/specimen/block/${side}_mm`, `${side}, mm`, specimen.block[`${side}_mm`]);
  (material.terms ?? []).forEach((t, i) => {
    add(`/material/terms/${i}/mu_kpa`, `${symbol(`mu_${i + 1}`)}, kPa`, t.mu_kpa);
    add(`/material/terms/${i}/alpha`, symbol(`alpha_${i + 1}`), t.alpha);
  });
  for (const [name, value] of lawNumbers(material)) add(`/material/${name}`, name.replace(/_kpa$/, ", kPa"), value);
  add("/material/bulk_kpa", "κ, kPa", material.bulk_kpa);
  scan.voxel_mm.forEach((v, i) => add(`/scan/voxel_mm/${i}`, `voxel along ${"xyz"[i]}, mm`, v));
  return found;
}

/** What a pointer stands for, in words. */
export function wordsOf(pointer, request) {
  try {
    return variables(request).find((v) => v.pointer === pointer)?.words ?? pointer;
  } catch {
    return pointer;
  }
}

const spread = (low, high, count) =>
  Array.from({ length: count }, (_, i) => (count === 1 ? low : low + ((high - low) * i) / (count - 1)));

/** The form; `body(mesh)` gives the request. */
export function sweepForm(model) {
  const axes = [];
  const state = { how: "sample", count: 12, seed: 1 };
  const element = h("div", { id: "sweep-form" });
  const summary = h("p", { class: "quiet", role: "status" });

  function fresh(taken) {
    const free = variables(model).find((v) => !taken.includes(v.pointer)) ?? variables(model)[0];
    return { pointer: free.pointer, low: 0.9 * free.value, high: 1.1 * free.value };
  }
  axes.push(fresh([]));

  const total = () => (state.how === "sample" ? state.count : state.count ** axes.length);
  function tell() {
    summary.textContent = `${total().toLocaleString("en")} evaluations.`;
  }

  function render() {
    const list = variables(model);
    for (const axis of axes) if (!list.some((v) => v.pointer === axis.pointer)) Object.assign(axis, fresh([]));
    fill(
      element,
      axes.map((axis, i) =>
        h(
          "div",
          { class: "fields axis", role: "group", "aria-label": `Axis ${i + 1}` },
          h(
            "label",
            { class: "wide" },
            "Vary",
            h(
              "select",
              {
                onchange: (e) => {
                  const v = list.find((o) => o.pointer === e.target.value);
                  Object.assign(axis, { pointer: v.pointer, low: 0.9 * v.value, high: 1.1 * v.value });
                  render();
                },
              },
              list.map((v) =>
                h(
                  "option",
                  { value: v.pointer, selected: v.pointer === axis.pointer },
                  `${v.words} (${digits(v.value)})`,
                ),
              ),
            ),
          ),
          h(
            "label",
            {},
            "From",
            h("input", {
              type: "number",
              step: "any",
              value: Number(axis.low.toPrecision(6)),
              onchange: (e) => {
                axis.low = Number(e.target.value);
              },
            }),
          ),
          h(
            "label",
            {},
            "To",
            h("input", {
              type: "number",
              step: "any",
              value: Number(axis.high.toPrecision(6)),
              onchange: (e) => {
                axis.high = Number(e.target.value);
              },
            }),
          ),
          axes.length > 1 &&
            h(
              "button",
              {
                type: "button",
                onclick: () => {
                  axes.splice(i, 1);
                  render();
                },
              },
              `Remove axis ${i + 1}`,
            ),
        ),
      ),
      h(
        "div",
        { class: "fields" },
        h(
          "label",
          { class: "wide" },
          "Points",
          h(
            "select",
            {
              onchange: (e) => {
                state.how = e.target.value;
                render();
              },
            },
            [
              ["sample", "spread at random (Latin hypercube)"],
              ["grid", "all combinations"],
            ].map(([v, t]) => h("option", { value: v, selected: v === state.how }, t)),
          ),
        ),
        h(
          "label",
          {},
          state.how === "sample" ? "Evaluations" : "Values per axis",
          h("input", {
            type: "number",
            min: 1,
            step: 1,
            value: state.count,
            onchange: (e) => {
              state.count = Math.max(1, Math.round(Number(e.target.value)));
              tell();
            },
          }),
        ),
        state.how === "sample" &&
          h(
            "label",
            {},
            "Seed",
            h("input", {
              type: "number",
              min: 0,
              step: 1,
              value: state.seed,
              onchange: (e) => {
                state.seed = Math.max(0, Math.round(Number(e.target.value)));
              },
            }),
          ),
      ),
      h(
        "p",
        {},
        h(
          "button",
          {
            type: "button",
            onclick: () => {
              axes.push(fresh(axes.map((a) => a.pointer)));
              render();
            },
          },
          "Add an axis",
        ),
      ),
      summary,
    );
    tell();
  }
  render();

  const body = (mesh) => {
    const base = { ...subjectOf(model), mesh };
    const name = `sweep of ${model.specimen.name}`.slice(0, 200);
    return state.how === "sample"
      ? {
          name,
          base,
          vary: axes.map((a) => ({ pointer: a.pointer, range: [a.low, a.high] })),
          sample: { count: state.count, seed: state.seed },
        }
      : { name, base, vary: axes.map((a) => ({ pointer: a.pointer, values: spread(a.low, a.high, state.count) })) };
  };
  return { element, body, render };
}
