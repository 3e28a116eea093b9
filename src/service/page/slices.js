// Slices through images (NIfTI): a component of a vector field before and after, on one colour scale.

import { getBlob } from "./api.js";
import { digits, fill, h } from "./dom.js";

/** A compressed NIfTI-1 image of floats: shape, components, voxel sizes, values (x fastest, components last). */
async function readImage(href) {
  const blob = await getBlob(href);
  const bytes = await new Response(blob.stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
  const view = new DataView(bytes);
  if (view.getInt32(0, true) !== 348 || view.getInt16(70, true) !== 16) throw new Error("The image is not NIfTI-1 with single-precision values.");
  const dim = (n) => (view.getInt16(40, true) >= n ? Math.max(1, view.getInt16(40 + 2 * n, true)) : 1);
  const shape = [dim(1), dim(2), dim(3)];
  const offset = view.getFloat32(108, true);
  const values = new Float32Array(bytes, offset, shape[0] * shape[1] * shape[2] * dim(5));
  return {
    shape, components: dim(5), bounds: bounds(values, shape), voxel: [1, 2, 3].map((n) => view.getFloat32(76 + 4 * n, true)),
    origin: [0, 1, 2].map((n) => view.getFloat32(292 + 16 * n, true)),
    values,
  };
}

/** First and last place along each axis where there is a value: maps leave out the empty margin. */
function bounds(values, [nx, ny, nz]) {
  const found = [[nx, -1], [ny, -1], [nz, -1]];
  for (let z = 0, i = 0; z < nz; z += 1) {
    for (let y = 0; y < ny; y += 1) {
      for (let x = 0; x < nx; x += 1, i += 1) {
        if (!Number.isFinite(values[i])) continue;
        [x, y, z].forEach((p, a) => { found[a] = [Math.min(found[a][0], p), Math.max(found[a][1], p)]; });
      }
    }
  }
  return found.map(([low, high], a) => (high < low ? [0, [nx, ny, nz][a] - 1] : [low, high]));
}

const AXES = ["x", "y", "z"];
const PLANES = [[0, 1, 2], [0, 2, 1], [2, 1, 0]]; // across, up, through

/** Blue over white to red; t from -1 to 1. */
function color(t) {
  const s = Math.max(-1, Math.min(1, t));
  const end = s < 0 ? [33, 82, 168] : [178, 32, 38];
  const w = Math.abs(s) ** 0.8;
  return end.map((c) => Math.round(255 + (c - 255) * w));
}

/** The slice's values of one component, row by row from the top, and its width and height. */
function slice(image, component, [across, up, through], index) {
  const { shape, bounds } = image;
  const [nx, ny] = shape;
  const size = nx * ny * shape[2];
  const [width, height] = [across, up].map((a) => bounds[a][1] - bounds[a][0] + 1);
  const values = new Float32Array(width * height);
  const place = [0, 0, 0];
  place[through] = index;
  for (let row = 0; row < height; row += 1) {
    place[up] = bounds[up][1] - row;
    for (let column = 0; column < width; column += 1) {
      place[across] = bounds[across][0] + column;
      values[row * width + column] = image.values[component * size + place[0] + nx * (place[1] + ny * place[2])];
    }
  }
  return { width, height, values };
}

function draw(canvas, image, cut, axes, limit) {
  canvas.width = cut.width;
  canvas.height = cut.height;
  // Voxels are not cubes: the picture has the sample's proportions.
  const ratio = (cut.width * image.voxel[axes[0]]) / (cut.height * image.voxel[axes[1]]);
  canvas.style.aspectRatio = String(ratio);
  const pixels = new ImageData(cut.width, cut.height);
  cut.values.forEach((v, i) => {
    if (!Number.isFinite(v)) return;
    const [r, g, b] = color(v / limit);
    pixels.data.set([r, g, b, 255], 4 * i);
  });
  canvas.getContext("2d").putImageData(pixels, 0, 0);
}

const rms = (values) => {
  let sum = 0;
  let count = 0;
  for (const v of values) if (Number.isFinite(v)) { sum += v * v; count += 1; }
  return count ? Math.sqrt(sum / count) : NaN;
};

/** The 99th percentile of |value| of a component. */
function reach(image, component) {
  const size = image.values.length / image.components;
  const all = image.values.subarray(component * size, (component + 1) * size).filter(Number.isFinite).map(Math.abs).sort();
  return all.length ? all[Math.floor(0.99 * (all.length - 1))] : 0;
}

/** Maps of `sets`: [{ label, panels: [{ label, href }] }]; all panels of a set share the colour scale. */
export function slicesView(title, sets, note) {
  if (sets.length === 0) return null;
  const state = { set: sets.length - 1, component: 0, plane: 0, index: null, scale: 0 };
  const images = new Map();
  const load = (href) => { if (!images.has(href)) images.set(href, readImage(href)); return images.get(href); };
  const panels = h("div", { class: "maps" });
  const problem = h("div", { role: "alert" });
  const legend = h("div", { class: "scale" });
  const where = h("output", {});
  const range = h("input", { type: "range", min: 0, step: 1, "aria-label": "Slice", oninput: (e) => { state.index = Number(e.target.value); show(); } });
  const pick = (label, options, key) => h("label", {}, label, h("select", { onchange: (e) => { state[key] = Number(e.target.value); if (key === "plane") state.index = null; show(); } },
    options.map((text, i) => h("option", { value: i, selected: i === state[key] }, text))));
  let turn = 0;

  async function show() {
    const mine = turn += 1;
    const set = sets[state.set];
    try {
      const loaded = await Promise.all(set.panels.map((p) => load(p.href)));
      if (mine !== turn) return;
      const axes = PLANES[state.plane];
      const first = loaded[0];
      const [low, high] = first.bounds[axes[2]];
      state.index = Math.max(low, Math.min(state.index ?? Math.floor((low + high) / 2), high));
      range.min = low;
      range.max = high;
      range.value = state.index;
      const at = Math.round(1e4 * (first.origin[axes[2]] + state.index * first.voxel[axes[2]])) / 1e4;
      where.textContent = `${AXES[axes[2]]} = ${digits(at, 3)} mm (${state.index - low + 1} of ${high - low + 1})`;
      const limit = reach(loaded[Math.min(state.scale, loaded.length - 1)], state.component) || 1;
      fill(panels, loaded.map((image, i) => {
        const cut = slice(image, state.component, axes, state.index);
        const canvas = h("canvas", { class: "slice", role: "img", "aria-label": `${set.panels[i].label}, u ${AXES[state.component]}, ${where.textContent}` });
        draw(canvas, image, cut, axes, limit);
        return h("figure", {}, canvas, h("figcaption", {}, `${set.panels[i].label}: rms in this slice ${digits(rms(cut.values), 3)} mm`));
      }));
      const ramp = h("canvas", { class: "ramp", width: 101, height: 1, "aria-hidden": "true" });
      const bar = new ImageData(101, 1);
      for (let i = 0; i < 101; i += 1) bar.data.set([...color(i / 50 - 1), 255], 4 * i);
      ramp.getContext("2d").putImageData(bar, 0, 0);
      fill(legend, h("span", {}, `${digits(-limit, 3)} mm`), ramp, h("span", {}, `${digits(limit, 3)} mm`));
      fill(problem);
    } catch (error) {
      if (mine === turn) fill(problem, h("p", { class: "bad" }, error.message));
    }
  }

  const widest = Math.max(...sets.map((s) => s.panels.length));
  const sheet = h("section", { class: "sheet slices" }, h("h3", {}, title), note && h("p", { class: "quiet" }, note),
    h("div", { class: "fields" },
      pick("Map", sets.map((s) => s.label), "set"),
      pick("Component", AXES.map((a) => `u along ${a}`), "component"),
      pick("Plane", PLANES.map(([a, b]) => `${AXES[a]} and ${AXES[b]}`), "plane"),
      widest > 1 && pick("Colours reach to", ["the left map's values", "the right map's values"], "scale"),
      h("label", { class: "wide" }, "Slice ", where, range)),
    panels, legend, problem);
  show();
  return sheet;
}
