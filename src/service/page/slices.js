// Slices through images: a component of a vector field before and after, on one colour scale, with ticks in mm.

import { getBlob } from "./api.js";
import { ticks } from "./axis.js";
import { diverging } from "./colors.js";
import { fill, h, s } from "./dom.js";
import { masked, mostToSee, reach, readImage, rms, slice } from "./nifti.js";
import { digits } from "./numbers.js";

const AXES = ["x", "y", "z"];
const DISPLACEMENT = AXES.map((a) => `u along ${a}`);
const PLANES = [
  [0, 1, 2],
  [0, 2, 1],
  [2, 1, 0],
]; // across, up, through

/** The slice as a picture of one pixel per voxel. */
function painted(cut, limit) {
  const canvas = h("canvas", { width: cut.width, height: cut.height });
  const pixels = new ImageData(cut.width, cut.height);
  cut.values.forEach((v, i) => {
    if (Number.isFinite(v)) pixels.data.set([...diverging(v / limit), 255], 4 * i);
  });
  canvas.getContext("2d").putImageData(pixels, 0, 0);
  return canvas.toDataURL();
}

/** Ends of the picture along an axis, mm: the outer edges of its first and last voxel. */
function ends(image, axis) {
  const at = (i) => image.origin[axis] + i * image.voxel[axis];
  const [first, last] = image.bounds[axis];
  return [at(first - 0.5), at(last + 0.5)];
}

/** A map with its axes; `tell` is given the value under the pointer. */
function map(image, cut, axes, limit, label, tell) {
  const [x, y] = [ends(image, axes[0]), ends(image, axes[1])];
  const [left, bottom, gap, wide] = [38, 34, 8, 420];
  const scale = Math.min(wide / (x[1] - x[0]), 340 / (y[1] - y[0]));
  const [width, height] = [scale * (x[1] - x[0]), scale * (y[1] - y[0])];
  const across = (v) => left + scale * (v - x[0]);
  const up = (v) => gap + height - scale * (v - y[0]);
  const picture = s("image", {
    x: left,
    y: gap,
    width,
    height,
    href: painted(cut, limit),
    preserveAspectRatio: "none",
  });
  picture.addEventListener("pointermove", (event) => {
    const box = picture.getBoundingClientRect();
    const at = [
      ((event.clientX - box.left) / box.width) * cut.width,
      ((event.clientY - box.top) / box.height) * cut.height,
    ].map(Math.floor);
    tell(cut.values[at[1] * cut.width + at[0]]);
  });
  return s(
    "svg",
    { class: "map", viewBox: `0 0 ${left + wide + gap} ${gap + height + bottom}`, role: "img", "aria-label": label },
    s("rect", { class: "paper", x: left, y: gap, width, height }),
    picture,
    s("rect", { class: "frame", x: left, y: gap, width, height }),
    ticks(...x, 5).map(([v, text]) => [
      s("line", { class: "tick", x1: across(v), x2: across(v), y1: gap + height, y2: gap + height + 4 }),
      s("text", { x: across(v), y: gap + height + 15, "text-anchor": "middle" }, text),
    ]),
    ticks(...y, Math.max(3, Math.min(5, height / 40))).map(([v, text]) => [
      s("line", { class: "tick", x1: left - 4, x2: left, y1: up(v), y2: up(v) }),
      s("text", { x: left - 6, y: up(v) + 4, "text-anchor": "end" }, text),
    ]),
    s("text", { x: left + width / 2, y: gap + height + 30, "text-anchor": "middle" }, `${AXES[axes[0]]}, mm`),
    s(
      "text",
      { x: 10, y: gap + height / 2, "text-anchor": "middle", transform: `rotate(-90 10 ${gap + height / 2})` },
      `${AXES[axes[1]]}, mm`,
    ),
  );
}

/** The colour scale. */
function scaleOf(limit, unit) {
  const ramp = h("canvas", { class: "ramp", width: 101, height: 1, "aria-hidden": "true" });
  const bar = new ImageData(101, 1);
  for (let i = 0; i < 101; i += 1) bar.data.set([...diverging(i / 50 - 1), 255], 4 * i);
  ramp.getContext("2d").putImageData(bar, 0, 0);
  return [
    ramp,
    h(
      "div",
      { class: "ends" },
      [-1, -0.5, 0, 0.5, 1].map((t) => h("span", {}, `${t === 0 ? 0 : digits(t * limit, 2)} ${unit}`)),
    ),
  ];
}

/** The image of a panel, within its mask where it has one. */
async function imageOf({ mask, ...panel }) {
  const read = async ({ href, blob }) => readImage(blob ?? (await getBlob(href)));
  const image = await read(panel);
  return mask ? masked(image, await read(mask)) : image;
}

/** The part of a map that lies beyond its scale, in words. */
function beyond(cut, limit) {
  const there = cut.values.filter(Number.isFinite);
  const part = there.filter((v) => Math.abs(v) > limit).length / (there.length || 1);
  return part > 0.02 ? `; ${Math.round(100 * part)} % of it lies beyond the colours` : "";
}

/** The number of the slice of an image that is nearest to `at`, mm along an axis. */
const indexAt = (image, axis, at) => Math.round((at - image.origin[axis]) / image.voxel[axis]);

/**
 * Maps of `sets`: [{ label, panels: [{ label, href or blob, mask: { href or blob } }] }]. A set's panels are cut at the
 * same place and share the scale of panel `scale`; the slice shown first is the one with the most to see in panel
 * `aimed`. `components` names what an image holds.
 */
export function slicesView(title, sets, { note, scale = 0, aimed = 0, unit = "mm", components = DISPLACEMENT } = {}) {
  if (sets.length === 0) return null;
  const state = { set: sets.length - 1, component: null, plane: null, index: null, scale };
  const images = new Map();
  const load = (panel) => {
    const key = panel.href ?? panel.blob;
    if (!images.has(key)) images.set(key, imageOf(panel));
    return images.get(key);
  };
  const panels = h("div", { class: "maps" });
  const problem = h("div", { role: "alert" });
  const legend = h("div", { class: "scale" });
  const where = h("output", {});
  const under = h("p", { class: "quiet reading" });
  const range = h("input", {
    type: "range",
    min: 0,
    step: 1,
    "aria-label": "Slice",
    oninput: (e) => {
      state.index = Number(e.target.value);
      show();
    },
  });
  const choosers = {};
  const pick = (label, options, key) => {
    choosers[key] = h(
      "select",
      {
        onchange: (e) => {
          state[key] = Number(e.target.value);
          if (key === "plane") state.index = null;
          show();
        },
      },
      options.map((text, i) => h("option", { value: i, selected: i === state[key] }, text)),
    );
    return h("label", {}, label, choosers[key]);
  };
  let turn = 0;

  function aim(image) {
    if (state.component !== null) return;
    Object.assign(state, mostToSee(image, PLANES));
    if (choosers.component) choosers.component.value = state.component;
    choosers.plane.value = state.plane;
  }

  async function show() {
    const mine = (turn += 1);
    const set = sets[state.set];
    try {
      const loaded = await Promise.all(set.panels.map(load));
      if (mine !== turn) return;
      aim(loaded[Math.min(aimed, loaded.length - 1)]);
      draw(set, loaded);
      fill(problem);
    } catch (error) {
      if (mine === turn) fill(problem, h("p", { class: "bad" }, error.message));
    }
  }

  function draw(set, loaded) {
    const axes = PLANES[state.plane];
    const first = loaded[0];
    const [low, high] = first.bounds[axes[2]];
    state.index = Math.max(low, Math.min(state.index ?? Math.floor((low + high) / 2), high));
    Object.assign(range, { min: low, max: high, value: state.index });
    const at = Math.round(1e4 * (first.origin[axes[2]] + state.index * first.voxel[axes[2]])) / 1e4;
    where.textContent = `${AXES[axes[2]]} = ${digits(at, 3)} mm (${state.index - low + 1} of ${high - low + 1})`;
    const limit = reach(loaded[Math.min(state.scale, loaded.length - 1)], state.component) || 1;
    const tell = (v) => {
      under.textContent = Number.isFinite(v) ? `Under the pointer: ${digits(v, 3)} ${unit}` : "";
    };
    fill(
      panels,
      loaded.map((image, i) => {
        const cut = slice(image, state.component, axes, indexAt(image, axes[2], at));
        const label = set.panels[i].label;
        return h(
          "figure",
          {},
          map(image, cut, axes, limit, `${label}, ${components[state.component]}, ${where.textContent}`, tell),
          h("figcaption", {}, `${label}: rms in this slice ${digits(rms(cut.values), 3)} ${unit}${beyond(cut, limit)}`),
        );
      }),
    );
    fill(legend, scaleOf(limit, unit));
  }

  /** Goes through the maps one after the other, as a film. */
  async function play(event) {
    const button = event.currentTarget;
    button.disabled = true;
    for (let i = 0; i < sets.length && button.isConnected; i += 1) {
      state.set = i;
      choosers.set.value = i;
      await show();
      await new Promise((resolve) => setTimeout(resolve, 700));
    }
    button.disabled = false;
  }

  const names = sets[0].panels.map((p) => p.label);
  const scales = names.length === 2 ? ["on the left", "on the right"] : names.map((name) => `of ${name}`);
  const element = h(
    "section",
    { class: "sheet slices" },
    h("h3", {}, title),
    note && h("p", { class: "quiet" }, note),
    h(
      "div",
      { class: "fields" },
      pick(
        "Map",
        sets.map((one) => one.label),
        "set",
      ),
      components.length > 1 && pick("Component", components, "component"),
      pick(
        "Plane",
        PLANES.map(([a, b]) => `${AXES[a]} and ${AXES[b]}`),
        "plane",
      ),
      names.length > 1 && pick("Colours reach to the values", scales, "scale"),
      h("label", { class: "wide" }, "Slice ", where, range),
    ),
    panels,
    legend,
    under,
    sets.length > 1 && h("p", {}, h("button", { type: "button", onclick: play }, "Play the maps")),
    problem,
  );
  show();
  return element;
}
