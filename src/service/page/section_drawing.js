// The drawing of a specimen: its section with holes, plates or grips, the drive, dimensions, and a view from the side.

import { s } from "./dom.js";
import { holeShape, reachOf } from "./hole.js";
import { brokenLigaments } from "./ligaments.js";
import { digits, farthest, plain } from "./numbers.js";
import { halfDepth, outlinePath, sectionOf } from "./outline.js";

/** Sizes of a drawing, mm of the specimen: `text` is the height of letters, `margin` the room for dimensions. */
function layout(section, isSheared) {
  const text = Math.max(section.length / 34, section.height / 22);
  const margin = 3.4 * text;
  const gap = 5.4 * text;
  // Plates seen from their edge stand above and below the section; they and their words need room there.
  const isEdge = isSheared && section.up === "y";
  const below = isEdge ? 3.2 * text : 1.7 * text;
  const side = section.height / 2 + gap + (isEdge ? 1.6 * text : 0) + section.deepest / 2;
  return { text, margin, top: isEdge ? 3.4 * text : 2 * text, below, side };
}

const line = (cls, [x1, y1], [x2, y2]) => s("line", { class: cls, x1, y1, x2, y2 });
const words = (size, x, y, text, more = {}) =>
  s("text", { x, y, "font-size": size, "text-anchor": "middle", ...more }, text);

/** A dimension: a line with two ends and its words. */
function dimension(size, from, to, text) {
  const isLevel = from[1] === to[1];
  const [x, y] = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
  const end = 0.35 * size;
  const mark = ([a, b]) => line("dimension", [a - end, b + end], [a + end, b - end]);
  return [
    line("dimension", from, to),
    mark(from),
    mark(to),
    words(
      size,
      x,
      isLevel ? y - 0.4 * size : y,
      text,
      isLevel ? {} : { transform: `rotate(-90 ${x - 0.4 * size} ${y})`, x: x - 0.4 * size },
    ),
  ];
}

/** An arrow along x from its middle line's start, or towards that start where it points back, with words above it. */
function arrow(size, [x, y], length, text, isWrong, isBack) {
  const cls = isWrong ? "drive wrong" : "drive";
  const tip = (isBack ? -0.6 : 0.6) * size;
  const end = isBack ? x : x + length;
  return [
    line(cls, [x, y], [x + length, y]),
    s("path", {
      class: cls,
      d: `M${end - tip} ${y - tip / 2}L${end} ${y}L${end - tip} ${y + tip / 2}`,
    }),
    words(size, x + length / 2, y - 0.5 * size, text, { class: isWrong ? "wrong" : "strong" }),
  ];
}

const plate = (x, y, width, height) => s("rect", { class: "held", x, y, width, height });

/** Grips at both ends of a pulled specimen, in one view. */
const grips = (section, center, height, thick) =>
  [-1, 1].map((side) =>
    plate(side < 0 ? -section.length / 2 - thick : section.length / 2, center - height / 2, thick, height),
  );

/** Plates above and below a sheared specimen, in the view in which they are seen from their edge; `half` is half of
 * the gap between them at both ends. */
const plates = (section, center, half, thick) =>
  [-1, 1].map((side) => {
    const face = [-1, 1].map((end, i) => [(end * section.length) / 2, center + side * half[i]]);
    const back = face.map(([x, y]) => [x, y + side * thick]).reverse();
    return s("polygon", { class: "held", points: [...face, ...back].join(" ") });
  });

/** Half of the extent across the section at both ends. */
const ends = (specimen, section) => [-1, 1].map((end) => halfDepth(specimen, section, (end * section.length) / 2));

/** What holds and moves the specimen. */
function held(model, section, at) {
  const { text, side } = at;
  const thick = 0.7 * text;
  const farthestDrive = farthest(model.specimen.drive_mm);
  const angle = model.specimen.drive_angle_deg ? ` at ${plain(model.specimen.drive_angle_deg)}° from x to z` : "";
  const nearer = model.specimen.precompression_mm ?? 0;
  const pressed = nearer ? `, ${nearer > 0 ? "pressed together" : "pulled apart"} by ${plain(Math.abs(nearer))} mm` : "";
  const drive = `drive ${plain(farthestDrive)} mm${angle}${pressed}`;
  const ofResponse = ["max_drive_mm", "max_force_n", "max_normal_force_n", "max_local_stretch"];
  const isWrong = (model.brokenLimits ?? []).some((name) => ofResponse.includes(name));
  if (model.specimen.test === "uniaxial") {
    return [
      grips(section, 0, section.height, thick),
      grips(section, side, section.depth, thick),
      arrow(text, [section.length / 2 + 1.4 * thick, -0.9 * text], 2.6 * text, "", isWrong, farthestDrive < 0),
      words(text, section.length / 2, -section.height / 2 - 0.6 * text, drive, {
        "text-anchor": "end",
        class: isWrong ? "wrong" : "strong",
      }),
    ];
  }
  // Plates lie along y: they are seen from their edge where y is drawn, else they cover the section.
  const isEdge = section.up === "y";
  const center = isEdge ? 0 : side;
  const height = isEdge ? section.height : section.deepest;
  const reach = Math.min(section.length * 0.3, 5 * text);
  return [
    plates(section, center, isEdge ? [height / 2, height / 2] : ends(model.specimen, section), thick),
    arrow(
      text,
      [section.length / 2 - reach, center - height / 2 - thick - 0.6 * text],
      reach,
      `moved plate, ${drive}`,
      isWrong,
      farthestDrive < 0,
    ),
    words(text, -section.length / 2, center + height / 2 + thick + 1.1 * text, "fixed plate", {
      "text-anchor": "start",
    }),
    words(
      text,
      -section.length / 2,
      (isEdge ? side - section.deepest / 2 : -section.height / 2) - 0.6 * text,
      "between the plates",
      { "text-anchor": "start" },
    ),
  ];
}

/** The view from the side, holes as hidden lines. */
function sideView(model, section, { text, side }) {
  const { length, depth } = section;
  const half = (x) => halfDepth(model.specimen, section, x);
  const [left, right] = ends(model.specimen, section);
  const corners = [
    [-length / 2, side - left],
    [length / 2, side - right],
    [length / 2, side + right],
    [-length / 2, side + left],
  ];
  const told = left === right ? plain(depth) : `${plain(2 * left)} to ${plain(2 * right)}`;
  return [
    s("polygon", { class: "outline", points: corners.join(" ") }),
    model.specimen.holes.flatMap((hole) =>
      [-1, 1]
        .map((e) => hole.center_mm[0] + e * reachOf(hole, [1, 0]))
        // A notch in an end ends there.
        .filter((x) => Math.abs(x) < length / 2)
        .map((x) => line("concealed", [x, side - half(x)], [x, side + half(x)])),
    ),
    dimension(
      text,
      [-length / 2 - 1.3 * text, side + left],
      [-length / 2 - 1.3 * text, side - left],
      `${section.through} ${told}`,
    ),
  ];
}

/** Where limits are broken, with what is there and what is asked for. */
function marks(model, section, { text }) {
  const told = (value, limit) => {
    if (limit === null) return "too few voxels";
    return value < 0 ? `${digits(-value, 2)} mm too far` : `${digits(value, 2)} < ${plain(limit)} mm`;
  };
  const inside = (x) => Math.max(-section.length / 2 + 4 * text, Math.min(section.length / 2 - 4 * text, x));
  return brokenLigaments(model, section).map(({ from, to, value, limit, room }) => [
    line("broken", [from[0], -from[1]], [to[0], -to[1]]),
    words(text, inside(room[0]), -room[1] - 0.5 * text, told(value, limit), { class: "wrong" }),
  ]);
}

/** Lengths to a hundredth of a millimetre: a picture that is not edited needs no more. */
const rounded = (specimen) =>
  JSON.parse(JSON.stringify(specimen, (_, v) => (typeof v === "number" ? Math.round(100 * v) / 100 : v)));

/** A picture of a specimen that is not edited. */
export function sectionPicture(exact, label) {
  const specimen = rounded(exact);
  const svg = s("svg", { class: "section still", role: "img", "aria-label": label });
  const { under, over } = drawSection(svg, { specimen, limits: {} });
  const section = sectionOf(specimen);
  const holes = specimen.holes.map((hole) => holeShape(hole, section, { class: "hole" }));
  svg.append(...[under, holes, over].flat(Infinity));
  return svg;
}

/** Everything but the holes; `svg` takes its frame. */
export function drawSection(svg, model) {
  const section = sectionOf(model.specimen);
  const at = layout(section, model.specimen.test !== "uniaxial");
  const { text, margin, top, below, side } = at;
  const { length, height, deepest } = section;
  svg.setAttribute(
    "viewBox",
    [
      -length / 2 - margin,
      -height / 2 - top,
      length + margin + 4.5 * text,
      height / 2 + top + side + deepest / 2 + 2.4 * text,
    ]
      .map((v) => v.toFixed(3))
      .join(" "),
  );
  svg.style.setProperty("--stroke", `${0.006 * length}px`);
  const under = [
    sideView(model, section, at),
    s("path", { class: "outline", d: outlinePath(model.specimen, section) }),
    held(model, section, at),
    dimension(text, [-length / 2, height / 2 + below], [length / 2, height / 2 + below], `x ${plain(length)} mm`),
    dimension(
      text,
      [-length / 2 - 1.3 * text, height / 2],
      [-length / 2 - 1.3 * text, -height / 2],
      `${section.up} ${plain(height)} mm`,
    ),
  ];
  return { under, over: marks(model, section, at), text };
}
