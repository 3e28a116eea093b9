// Points of a table over one of its columns: what a sweep found.

import { ticks } from "./axis.js";
import { fill, h, s } from "./dom.js";
import { digits } from "./numbers.js";

/** A plot of `rows` with selectable columns `across` and `up`: [[key, label]]; a click on a point opens its row. */
export function scatter(rows, across, up, open) {
  const picture = h("div", {});
  const state = { across: across[0][0], up: up[0][0] };
  const pick = (label, options, key) =>
    h(
      "label",
      { class: "wide" },
      label,
      h(
        "select",
        {
          onchange: (e) => {
            state[key] = e.target.value;
            draw();
          },
        },
        options.map(([value, text]) => h("option", { value, selected: value === state[key] }, text)),
      ),
    );

  function draw() {
    const points = rows
      .map((r) => [r[state.across], r[state.up], r])
      .filter((p) => p.slice(0, 2).every(Number.isFinite));
    if (points.length === 0) {
      fill(picture, h("p", { class: "quiet" }, "There is nothing to draw."));
      return;
    }
    const [W, H, L, B, T, R] = [640, 320, 70, 44, 12, 12];
    const range = (i) => {
      const all = points.map((p) => p[i]);
      const [low, high] = [Math.min(...all), Math.max(...all)];
      const pad = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
      return [low - pad, high + pad];
    };
    const [rx, ry] = [range(0), range(1)];
    const x = (v) => L + ((W - L - R) * (v - rx[0])) / (rx[1] - rx[0]);
    const y = (v) => H - B - ((H - B - T) * (v - ry[0])) / (ry[1] - ry[0]);
    const name = (list, key) => list.find((o) => o[0] === key)[1];
    fill(
      picture,
      s(
        "svg",
        {
          viewBox: `0 0 ${W} ${H}`,
          class: "plot",
          role: "img",
          "aria-label": `${name(up, state.up)} over ${name(across, state.across)}, ${points.length} points`,
        },
        ticks(...rx).map(([v, text]) => [
          s("line", { x1: x(v), x2: x(v), y1: T, y2: H - B, class: "grid" }),
          s("text", { x: x(v), y: H - B + 16, "text-anchor": "middle" }, text),
        ]),
        ticks(...ry).map(([v, text]) => [
          s("line", { x1: L, x2: W - R, y1: y(v), y2: y(v), class: "grid" }),
          s("text", { x: L - 6, y: y(v) + 4, "text-anchor": "end" }, text),
        ]),
        points.map(([a, b, row]) =>
          s(
            "circle",
            { cx: x(a), cy: y(b), r: 4.5, class: "point", onclick: () => open?.(row) },
            s("title", {}, `${digits(a)}, ${digits(b)}${open ? ": click to plan from it" : ""}`),
          ),
        ),
        s("text", { x: L + (W - L - R) / 2, y: H - 8, "text-anchor": "middle" }, name(across, state.across)),
        s(
          "text",
          {
            x: 14,
            y: T + (H - B - T) / 2,
            "text-anchor": "middle",
            transform: `rotate(-90 14 ${T + (H - B - T) / 2})`,
          },
          name(up, state.up),
        ),
      ),
    );
  }
  draw();
  return h("div", {}, h("div", { class: "fields" }, pick("Across", across, "across"), pick("Up", up, "up")), picture);
}
