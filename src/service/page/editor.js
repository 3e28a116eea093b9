// The section of a specimen to edit: holes are dragged, or moved by the arrow keys (Shift: ten times as far).

import { h, s } from "./dom.js";
import { KINDS_OF_HOLES, holeShape, kindOf, reshape, sizeOf, widen } from "./hole.js";
import { wrongDiameters } from "./ligaments.js";
import { plain } from "./numbers.js";
import { sectionOf } from "./outline.js";
import { drawSection } from "./section_drawing.js";

/** What ties holes by symmetry: the signs of the mirrors between them. */
const MIRRORS = {
  mirror_x: [[-1, 1]],
  mirror_z: [[1, -1]],
  mirror_x_and_z: [
    [-1, 1],
    [1, -1],
    [-1, -1],
  ],
  point: [[-1, -1]],
};
const HELP =
  "Drag a hole, or choose it with Tab and move it with the arrow keys; + and − change its size, Delete removes it. " +
  "Where the limits ask for symmetry, mirrored holes move together.";
const round = (value) => Math.round(value * 20) / 20;

/** The holes that symmetry ties to the one of this number, with the signs of the mirrors. */
function images(model, index) {
  const holes = model.specimen.holes;
  const {
    center_mm: [x, y],
    diameter_mm,
  } = holes[index];
  const isAt = (hole, m) =>
    Math.abs(hole.center_mm[0] - m[0] * x) < 1e-6 && Math.abs(hole.center_mm[1] - m[1] * y) < 1e-6;
  return holes.flatMap((hole, other) => {
    const signs =
      other === index || Math.abs(hole.diameter_mm - diameter_mm) > 1e-6
        ? undefined
        : (MIRRORS[model.limits.symmetry] ?? []).find((m) => isAt(hole, m));
    return signs ? [{ hole, signs }] : [];
  });
}

/** An editor: `element`, `draw()`, `add()`; `change()` is called after every edit. */
export function editor(model, change) {
  const svg = s("svg", { class: "section", role: "group", "aria-label": "Section of the specimen with its holes" });
  const list = h("div", { class: "scroll" });
  const element = h("div", {}, svg, h("p", { class: "quiet" }, HELP), list);
  let dragging = null;

  const toMm = (event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [point.x, -point.y];
  };
  const edited = () => {
    draw();
    change();
  };
  const move = (index, x, y) => {
    const { length, height } = sectionOf(model.specimen);
    const clamp = (value, half) => round(Math.max(-half, Math.min(half, value)));
    const tied = images(model, index);
    const to = [clamp(x, length / 2), clamp(y, height / 2)];
    model.specimen.holes[index].center_mm = to;
    for (const { hole, signs } of tied) hole.center_mm = [signs[0] * to[0], signs[1] * to[1]];
    edited();
  };
  const resize = (index, by) => {
    const hole = model.specimen.holes[index];
    const tied = images(model, index);
    const width = Math.max(0.5, round(hole.diameter_mm + by));
    for (const one of [hole, ...tied.map((image) => image.hole)]) widen(one, width);
    edited();
  };
  const remove = (index) => {
    model.specimen.holes.splice(index, 1);
    model.chosen = -1;
    edited();
  };

  const onKey = (index) => (event) => {
    const [x, y] = model.specimen.holes[index].center_mm;
    const step = event.shiftKey ? 1 : 0.1;
    const to = {
      ArrowLeft: [x - step, y],
      ArrowRight: [x + step, y],
      ArrowUp: [x, y + step],
      ArrowDown: [x, y - step],
    }[event.key];
    const by = { "+": 0.1, "=": 0.1, "-": -0.1 }[event.key];
    if (to) move(index, ...to);
    else if (by) resize(index, by);
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
  for (const end of ["pointerup", "pointercancel"])
    svg.addEventListener(end, () => {
      dragging = null;
    });

  function outline(hole, index, wrong) {
    const classes = ["hole", index === model.chosen ? "chosen" : "", wrong ? "wrong" : ""].join(" ");
    const [x, y] = hole.center_mm;
    return holeShape(hole, sectionOf(model.specimen), {
      class: classes,
      tabindex: 0,
      role: "button",
      "aria-label":
        `Hole ${index + 1}, ${kindOf(hole) !== "circle" ? `${kindOf(hole)} ${sizeOf(hole)}, in` : plain(hole.diameter_mm)} mm at ${plain(x)}, ${plain(y)} mm` +
        `${wrong ? ", breaks a limit" : ""}`,
      onpointerdown: (event) => {
        const at = toMm(event);
        dragging = { index, dx: at[0] - x, dy: at[1] - y };
        model.chosen = index;
        svg.setPointerCapture(event.pointerId);
      },
      onfocus: () => {
        model.chosen = index;
      },
      onkeydown: onKey(index),
    });
  }

  function draw() {
    const { under, over, text } = drawSection(svg, model);
    const sizes = wrongDiameters(model);
    const holes = model.specimen.holes.map((hole, i) => outline(hole, i, sizes.has(i) || model.wrong?.has(i)));
    const labels = model.specimen.holes.map((hole, i) => {
      const [x, y] = labelled(hole, text);
      return s(
        "text",
        {
          class: "in-hole",
          x,
          y: -y + text / 3,
          "font-size": hole.is_notch ? text : Math.min(text, hole.diameter_mm / 3.2),
          "text-anchor": "middle",
        },
        `${i + 1}: ${sizeOf(hole)}`,
      );
    });
    svg.replaceChildren(...[under, holes, labels, over].flat(Infinity));
    table();
  }

  /** Where a hole is named: at its centre, a notch beside its wall, in the material. */
  function labelled(hole, text) {
    const section = sectionOf(model.specimen);
    if (!hole.is_notch) return hole.center_mm;
    const halves = [section.length / 2, section.height / 2];
    const inset = hole.center_mm.map((x, k) => halves[k] - Math.abs(x));
    const across = inset[0] <= inset[1] ? 0 : 1;
    const beside = hole.diameter_mm / 2 + (across === 0 ? 2.4 : 0.9) * text;
    return hole.center_mm.map((x, k) => (k === across ? x - Math.sign(x) * beside : x));
  }

  function table() {
    const holes = model.specimen.holes;
    const number = (hole, name, get, put) =>
      h("input", {
        type: "number",
        step: "any",
        value: get(hole),
        "aria-label": name,
        onchange: (event) => {
          const v = Number(event.target.value);
          if (event.target.value !== "" && Number.isFinite(v)) {
            put(hole, v);
            edited();
          }
        },
      });
    const other = sectionOf(model.specimen).up;
    const outlineCells = (hole, index) => [
      h(
        "td",
        {},
        h(
          "select",
          {
            "aria-label": `outline of hole ${index + 1}`,
            onchange: (event) => {
              reshape(hole, event.target.value);
              edited();
            },
          },
          KINDS_OF_HOLES.map(([kind, words]) =>
            h("option", { value: kind, selected: kind === kindOf(hole) }, words),
          ),
        ),
      ),
      ...[
        ["length_mm", `length of hole ${index + 1}, mm`],
        ["angle_deg", `angle of hole ${index + 1}, degrees`],
      ].map(([key, name]) =>
        h(
          "td",
          {},
          hole.shape &&
            number(
              hole,
              name,
              (o) => o.shape[key] ?? 0,
              (o, v) => {
                o.shape[key] = v;
              },
            ),
        ),
      ),
    ];
    list.replaceChildren(
      holes.length === 0
        ? h("p", { class: "quiet" }, "No holes.")
        : h(
            "table",
            {},
            h(
              "thead",
              {},
              h(
                "tr",
                {},
                ["Hole", "x, mm", `${other}, mm`, "Diameter, mm", "Outline", "Length, mm", "Angle, °", h("span", { class: "hidden" }, "Remove")].map((t) =>
                  h("th", { scope: "col" }, t),
                ),
              ),
            ),
            h(
              "tbody",
              {},
              holes.map((hole, index) =>
                h(
                  "tr",
                  {},
                  h("td", {}, String(index + 1)),
                  h(
                    "td",
                    {},
                    number(
                      hole,
                      `x of hole ${index + 1}, mm`,
                      (o) => o.center_mm[0],
                      (o, v) => {
                        o.center_mm[0] = v;
                      },
                    ),
                  ),
                  h(
                    "td",
                    {},
                    number(
                      hole,
                      `${other} of hole ${index + 1}, mm`,
                      (o) => o.center_mm[1],
                      (o, v) => {
                        o.center_mm[1] = v;
                      },
                    ),
                  ),
                  h(
                    "td",
                    {},
                    number(
                      hole,
                      `diameter of hole ${index + 1}, mm`,
                      (o) => o.diameter_mm,
                      (o, v) => {
                        o.diameter_mm = v;
                      },
                    ),
                  ),
                  outlineCells(hole, index),
                  h(
                    "td",
                    {},
                    h(
                      "button",
                      { type: "button", onclick: () => remove(index), "aria-label": `Remove hole ${index + 1}` },
                      "Remove",
                    ),
                  ),
                ),
              ),
            ),
          ),
    );
  }

  return {
    element,
    draw,
    add: () => {
      const { axis, height } = sectionOf(model.specimen);
      model.specimen.holes.push({ axis, center_mm: [0, 0], diameter_mm: Math.max(1, round(0.25 * height)) });
      model.chosen = model.specimen.holes.length - 1;
      edited();
    },
  };
}
