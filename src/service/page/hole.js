// Outlines of holes in the section: circles, ellipses and slots, and round notches that a side cuts open.

import { s } from "./dom.js";
import { plain } from "./numbers.js";

/** What a hole may look like, and what it is called. */
export const KINDS_OF_HOLES = [
  ["circle", "circle"],
  ["ellipse", "ellipse"],
  ["slot", "slot"],
  ["notch", "notch"],
];

/** What a hole is, by the list above. */
export const kindOf = (hole) => (hole.is_notch ? "notch" : (hole.shape?.kind ?? "circle"));

const unit = (degrees) => [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];

/** Half of the extents along and across a hole, and the unit vector along it. */
function axesOf({ diameter_mm, shape }) {
  const b = diameter_mm / 2;
  return { a: shape ? shape.length_mm / 2 : b, b, along: unit(shape?.angle_deg ?? 0), kind: shape?.kind ?? "circle" };
}

/** How far a hole reaches from its centre in a direction, mm. */
export function reachOf(hole, [dx, dy]) {
  const { a, b, along, kind } = axesOf(hole);
  const u = dx * along[0] + dy * along[1];
  const v = dy * along[0] - dx * along[1];
  if (kind === "slot") return (a - b) * Math.abs(u) + b;
  return Math.hypot(a * u, b * v);
}

/** Material between two holes, mm, less than none where they overlap, and the direction in which it is thinnest. */
export function gapOf(one, other) {
  const [dx, dy] = [0, 1].map((k) => other.center_mm[k] - one.center_mm[k]);
  const of = (angle) => {
    const n = [Math.cos(angle), Math.sin(angle)];
    return { n, value: dx * n[0] + dy * n[1] - reachOf(one, n) - reachOf(other, n) };
  };
  const straight = Math.atan2(dy, dx);
  let best = { ...of(straight), angle: straight };
  if (!one.shape && !other.shape) return best;
  // The widest gap between parallel lines that part them: sought all around, then ever more closely.
  for (let step = Math.PI / 24, count = 24; step > 1e-7; step /= 8, count = 8) {
    const middle = best.angle;
    for (let i = -count; i <= count; i += 1) {
      const found = of(middle + i * step);
      if (found.value > best.value) best = { ...found, angle: middle + i * step };
    }
  }
  return best;
}

/** Room for a line beside what is drawn, as a part of a section's length. */
const LINE = 0.01;

/** Draws of a notch what lies in the block: the circle as far as its sides. */
function cutOpen(circle, hole, section) {
  const beyond = (center, half) => center + hole.diameter_mm / 2 - half;
  const [x, y] = hole.center_mm;
  const line = LINE * section.length;
  const sides = [
    beyond(y, section.height / 2),
    beyond(x, section.length / 2),
    beyond(-y, section.height / 2),
    beyond(-x, section.length / 2),
  ];
  // A line's width beyond the side, so that the side's own line is gone, and beyond the circle's own line elsewhere.
  const insets = sides.map((over) => `${(Math.max(over, 0) - line).toFixed(3)}px`);
  circle.style.setProperty("clip-path", `inset(${insets.join(" ")}) fill-box`);
  return circle;
}

/** A hole of a section as an element, y down. */
export function holeShape(hole, section, more = {}) {
  const [x, y] = hole.center_mm;
  const { a, b, kind } = axesOf(hole);
  if (kind === "circle") {
    const circle = s("circle", { cx: x, cy: -y, r: b, ...more });
    return hole.is_notch ? cutOpen(circle, hole, section) : circle;
  }
  const transform = `translate(${x} ${-y}) rotate(${-hole.shape.angle_deg})`;
  if (kind === "ellipse") return s("ellipse", { rx: a, ry: b, transform, ...more });
  return s("rect", { x: -a, y: -b, width: 2 * a, height: 2 * b, rx: b, transform, ...more });
}

/** The size of a hole in words. */
export function sizeOf({ diameter_mm, shape, is_notch }) {
  const width = plain(diameter_mm, 4);
  if (is_notch) return `R ${plain(diameter_mm / 2, 4)}`;
  return shape ? `${plain(shape.length_mm, 4)} × ${width}, ${plain(shape.angle_deg, 4)}°` : `⌀ ${width}`;
}

/** Gives a hole another outline; a new one is half as long again as wide. */
export function reshape(hole, kind) {
  if (kind === "notch") hole.is_notch = true;
  else delete hole.is_notch;
  if (kind === "circle" || kind === "notch") delete hole.shape;
  else hole.shape = { length_mm: 1.5 * hole.diameter_mm, angle_deg: 0, ...hole.shape, kind };
}

/** Gives a hole another width; an outline keeps how much longer it is. */
export function widen(hole, diameter_mm) {
  if (hole.shape) hole.shape.length_mm += diameter_mm - hole.diameter_mm;
  hole.diameter_mm = diameter_mm;
}
