// The check of a specimen: limits with their margins, what was not checked, cost.

import { fill, h } from "./dom.js";
import { digits, duration, many, plain } from "./numbers.js";
import { LIMITS, inWords, limitWords } from "./words.js";

/** The verdict: class and words. */
function verdict(found) {
  if (found.errors.length > 0) return ["bad", "This specimen cannot be evaluated."];
  if (!found.is_valid) return ["bad", "A limit is broken."];
  return ["good", found.unchecked.length > 0 ? "Every limit that was checked is kept." : "Every limit is kept."];
}

function meter(m) {
  const unit = LIMITS[m.name]?.[1] ?? "";
  const text =
    m.name === "symmetry"
      ? m.is_satisfied
        ? "kept"
        : "broken"
      : `${plain(m.value, 3)} / ${plain(m.limit, 3)}${unit ? ` ${unit}` : ""}`;
  const [words, , side] = LIMITS[m.name] ?? [m.name.replaceAll("_", " "), "", ""];
  return h(
    "div",
    { class: `meter${m.is_satisfied ? "" : " broken"}` },
    h("span", {}, `${words}${side ? ` (${side})` : ""}${m.is_satisfied ? "" : ": broken"}`),
    h("span", {}, text),
    h("div", { class: "bar" }, h("i", { width_percent: Math.max(2, Math.min(100, 50 * (1 + m.margin_relative))) })),
  );
}

const cost = (c, volume) =>
  h(
    "p",
    { class: "quiet" },
    `${many(c.num_voxels)} voxels, ${many(c.num_elements)} elements; an evaluation takes about ` +
      `${duration(1000 * c.seconds)} (a job of this service at most ${duration(1000 * c.most_seconds)}). ` +
      `${digits(volume, 4)} mm³ of material.`,
  );

/** Shows what was found; `others` are the errors that have no field. */
export function showCheck(element, found, others) {
  const [kind, words] = verdict(found);
  fill(
    element,
    h("p", { class: kind, role: "status" }, words),
    others.map((e) => h("p", { class: "bad" }, inWords(e, e.pointer))),
    others.length < found.errors.length && h("p", { class: "bad" }, "What is wrong is said at the field."),
    found.margins.map(meter),
    found.unchecked.map((u) =>
      h("p", { class: "quiet" }, `${limitWords(u.name)} (limit ${digits(u.limit, 3)}) was not checked: ${u.detail}`),
    ),
    found.cost && cost(found.cost, found.volume_mm3),
  );
}
