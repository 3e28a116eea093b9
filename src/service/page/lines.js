// A line plot: one quantity over another.

import { ticks } from "./axis.js";
import { h, s } from "./dom.js";

const [WIDTH, HEIGHT, LEFT, BOTTOM, GAP] = [560, 260, 60, 44, 12];
const MOST_POINTS = 2000;

const ends = (values) => {
  let [low, high] = [Infinity, -Infinity];
  for (const v of values) {
    low = Math.min(low, v);
    high = Math.max(high, v);
  }
  return low < high ? [low, high] : [low - 1, high + 1];
};

/** A plot of `points` [[x, y]]; `marks` are larger dots. */
export function linePlot(points, across, up, marks = []) {
  const step = Math.ceil(points.length / MOST_POINTS);
  const shown = points.filter((_, i) => i % step === 0);
  const [rx, ry] = [0, 1].map((k) => ends([...shown, ...marks].map((p) => p[k])));
  const x = (v) => LEFT + ((WIDTH - LEFT - GAP) * (v - rx[0])) / (rx[1] - rx[0]);
  const y = (v) => HEIGHT - BOTTOM - ((HEIGHT - BOTTOM - GAP) * (v - ry[0])) / (ry[1] - ry[0]);
  const middle = GAP + (HEIGHT - BOTTOM - GAP) / 2;
  return h(
    "figure",
    {},
    s(
      "svg",
      { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "plot", role: "img", "aria-label": `${up} over ${across}` },
      ticks(...rx).map(([v, text]) => [
        s("line", { class: "grid", x1: x(v), x2: x(v), y1: GAP, y2: HEIGHT - BOTTOM }),
        s("text", { x: x(v), y: HEIGHT - BOTTOM + 16, "text-anchor": "middle" }, text),
      ]),
      ticks(...ry).map(([v, text]) => [
        s("line", { class: "grid", x1: LEFT, x2: WIDTH - GAP, y1: y(v), y2: y(v) }),
        s("text", { x: LEFT - 6, y: y(v) + 4, "text-anchor": "end" }, text),
      ]),
      s("path", {
        class: "curve",
        d: shown.map(([a, b], i) => `${i ? "L" : "M"}${x(a).toFixed(1)} ${y(b).toFixed(1)}`).join(""),
      }),
      marks.map(([a, b]) => s("circle", { class: "point", cx: x(a), cy: y(b), r: 4.5 })),
      s("text", { x: LEFT + (WIDTH - LEFT - GAP) / 2, y: HEIGHT - 8, "text-anchor": "middle" }, across),
      s("text", { x: 14, y: middle, "text-anchor": "middle", transform: `rotate(-90 14 ${middle})` }, up),
    ),
  );
}
