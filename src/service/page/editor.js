// Draws the section of a specimen; holes are dragged, or moved by the arrow keys (Shift: ten times as far).

import { h, s } from "./dom.js";
import { digits } from "./numbers.js";

/** Extents of the section: x along the length; the other axis is z for holes through the thickness, y for the width. */
export function section(specimen) {
  const axis = specimen.holes[0]?.axis ?? "thickness";
  const { length_mm, thickness_mm, width_mm } = specimen.block;
  return { axis, length: length_mm, height: axis === "width" ? thickness_mm : width_mm };
}

/** An editor: `element`, `draw()`; `change()` is called after every edit. */
export function editor(model, change) {
  const svg = s("svg", { class: "section", role: "group", "aria-label": "Section of the specimen with its holes" });
  const list = h("div", { class: "scroll" });
  const element = h("div", {}, svg, h("p", { class: "quiet" }, "Drag a hole, or choose it with Tab and move it with the arrow keys; + and − change its size, Delete removes it. Where the limits ask for symmetry, mirrored holes move together."), list);
  let dragging = null;

  const toMm = (event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [point.x, -point.y];
  };
  const round = (value) => Math.round(value * 20) / 20;
  const move = (index, x, y) => {
    const { length, height } = section(model.specimen);
    const clamp = (value, half) => Math.max(-half, Math.min(half, value));
    const images = mirrored(index);
    const to = [round(clamp(x, length / 2)), round(clamp(y, height / 2))];
    model.specimen.holes[index].center_mm = to;
    for (const { hole, signs } of images) hole.center_mm = [signs[0] * to[0], signs[1] * to[1]];
    edited();
  };
  // The holes that the symmetry among the limits ties to this one, with the signs of the mirrors between them.
  const mirrored = (index) => {
    const holes = model.specimen.holes;
    const { center_mm: [x, y], diameter_mm } = holes[index];
    const signs = { mirror_x: [[-1, 1]], mirror_z: [[1, -1]], mirror_x_and_z: [[-1, 1], [1, -1], [-1, -1]], point: [[-1, -1]] }[model.limits.symmetry] ?? [];
    return holes.flatMap((hole, other) => {
      const found = other === index ? undefined : signs.find((m) =>
        Math.abs(hole.center_mm[0] - m[0] * x) < 1e-6 && Math.abs(hole.center_mm[1] - m[1] * y) < 1e-6 && Math.abs(hole.diameter_mm - diameter_mm) < 1e-6);
      return found ? [{ hole, signs: found }] : [];
    });
  };
  const resize = (index, by) => {
    const hole = model.specimen.holes[index];
    const images = mirrored(index);
    hole.diameter_mm = Math.max(0.5, Math.round((hole.diameter_mm + by) * 20) / 20);
    for (const image of images) image.hole.diameter_mm = hole.diameter_mm;
    edited();
  };
  const remove = (index) => {
    model.specimen.holes.splice(index, 1);
    model.chosen = -1;
    edited();
  };
  const edited = () => { draw(); change(); };

  const onKey = (index) => (event) => {
    const [x, y] = model.specimen.holes[index].center_mm;
    const step = event.shiftKey ? 1 : 0.1;
    const to = { ArrowLeft: [x - step, y], ArrowRight: [x + step, y], ArrowUp: [x, y + step], ArrowDown: [x, y - step] }[event.key];
    if (to) move(index, ...to);
    else if (event.key === "+" || event.key === "=") resize(index, 0.1);
    else if (event.key === "-") resize(index, -0.1);
    else if (event.key === "Delete" || event.key === "Backspace") remove(index);
    else return;
    event.preventDefault();
    svg.querySelectorAll(".hole")[Math.min(index, model.specimen.holes.length - 1)]?.focus();
  };

  svg.addEventListener("pointermove", (event) => {
    if (dragging === null) return;
    const [x, y] = toMm(event);
    move(dragging.index, x - dragging.dx, y - dragging.dy);
  });
  svg.addEventListener("pointerup", () => { dragging = null; });
  svg.addEventListener("pointercancel", () => { dragging = null; });

  function draw() {
    const { axis, length, height } = section(model.specimen);
    const margin = 0.12 * Math.max(length, height);
    const stroke = 0.006 * length;
    svg.setAttribute("viewBox", `${-length / 2 - margin} ${-height / 2 - margin} ${length + 2 * margin} ${height + 2 * margin}`);
    const parts = [];
    const isShear = model.specimen.test === "double_lap_shear";
    if (!isShear) {
      for (const side of [-1, 1]) {
        parts.push(s("rect", { class: "held", x: side < 0 ? -length / 2 - margin * .3 : length / 2, y: -height / 2, width: margin * .3, height }));
      }
    } else if (axis === "width") {
      for (const side of [-1, 1]) {
        parts.push(s("rect", { class: "held", x: -length / 2, y: side < 0 ? -height / 2 - margin * .25 : height / 2, width: length, height: margin * .25 }));
      }
    }
    parts.push(s("rect", { class: "outline", x: -length / 2, y: -height / 2, width: length, height, "stroke-width": stroke }));
    model.specimen.holes.forEach((hole, index) => {
      const classes = ["hole", index === model.chosen ? "chosen" : "", model.wrong?.has(index) ? "wrong" : ""].join(" ");
      parts.push(s("circle", {
        class: classes, cx: hole.center_mm[0], cy: -hole.center_mm[1], r: hole.diameter_mm / 2, "stroke-width": stroke, tabindex: 0, role: "button",
        "aria-label": `Hole ${index + 1}, ${digits(hole.diameter_mm)} mm at ${digits(hole.center_mm[0])}, ${digits(hole.center_mm[1])} mm`,
        onpointerdown: (event) => {
          const [x, y] = toMm(event);
          dragging = { index, dx: x - hole.center_mm[0], dy: y - hole.center_mm[1] };
          model.chosen = index;
          svg.setPointerCapture(event.pointerId);
        },
        onfocus: () => { model.chosen = index; },
        onkeydown: onKey(index),
      }));
    });
    const size = length / 34;
    const text = s("text", { x: -length / 2, y: height / 2 + margin * .8 }, `${digits(length)} × ${digits(height)} mm, x to the right, ${axis === "width" ? "y" : "z"} up`);
    text.style.fontSize = `${size}px`;
    parts.push(text);
    svg.replaceChildren(...parts);
    table();
  }

  function table() {
    const holes = model.specimen.holes;
    const number = (hole, name, get, put) => h("input", {
      type: "number", step: "any", value: get(hole), "aria-label": name,
      onchange: (event) => { const v = Number(event.target.value); if (Number.isFinite(v)) { put(hole, v); edited(); } },
    });
    const other = section(model.specimen).axis === "width" ? "y" : "z";
    list.replaceChildren(holes.length === 0 ? h("p", { class: "quiet" }, "No holes.") : h("table", {},
      h("thead", {}, h("tr", {}, ["Hole", "x mm", `${other} mm`, "Diameter mm", ""].map((t) => h("th", {}, t)))),
      h("tbody", {}, holes.map((hole, index) => h("tr", {},
        h("td", {}, String(index + 1)),
        h("td", {}, number(hole, `x of hole ${index + 1}`, (o) => o.center_mm[0], (o, v) => { o.center_mm[0] = v; })),
        h("td", {}, number(hole, `${other} of hole ${index + 1}`, (o) => o.center_mm[1], (o, v) => { o.center_mm[1] = v; })),
        h("td", {}, number(hole, `diameter of hole ${index + 1}`, (o) => o.diameter_mm, (o, v) => { o.diameter_mm = v; })),
        h("td", {}, h("button", { type: "button", onclick: () => remove(index), "aria-label": `Remove hole ${index + 1}` }, "Remove")))))));
  }

  return { element, draw, add: () => {
    const { axis } = section(model.specimen);
    model.specimen.holes.push({ axis, center_mm: [0, 0], diameter_mm: Math.max(1, 0.25 * section(model.specimen).height) });
    model.chosen = model.specimen.holes.length - 1;
    edited();
  } };
}
