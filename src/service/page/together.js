// Several diagnosed recordings: whether one material serves them all, and how well each predicts the others.

import { h, sheet } from "./dom.js";
import { digits, interval, isHardlyKnown, known, percent, symbol, unitOf, withUnit } from "./numbers.js";
import { callout, table } from "./parts.js";

/** Whether recordings agree, in words. */
function agreement({ agrees, deviance_rise: rise, parameters_saved: saved, deviance_limit: limit }) {
  const numbers =
    `The deviance rises by ${digits(rise, 3)} where ${saved} parameters are saved; ` +
    `more than ${digits(limit, 3)} would be too much.`;
  return agrees
    ? callout("good", "One material serves all recordings.", h("p", {}, numbers))
    : callout("bad", "No one material serves all recordings.", h("p", {}, numbers));
}

function materialRow(p) {
  const unit = unitOf(p.name);
  const value = isHardlyKnown(p.value, p.interval_95)
    ? "not determined"
    : withUnit(known(p.value, p.interval_95), unit);
  return [symbol(p.name), value, interval(p.interval_95, unit)];
}

const change = (pair, words) => (pair ? `${words(pair.before)} → ${words(pair.after)}` : "no equilibrium");

/** What was found of the recordings together; nothing where they could not be looked at so. */
export function together(found) {
  if (!found) return callout("warn", "The recordings could not be looked at together.");
  return sheet(
    "All recordings together",
    agreement(found.one_material),
    table(["Parameter", "One material for all", "95 % interval"], found.material_parameters.map(materialRow)),
    h(
      "p",
      { class: "quiet" },
      "Each recording predicted by the material of each other: without and with what was found.",
    ),
    table(
      ["Recording", "By the material of", "Displacement, mm rms", "Force, largest error"],
      found.predictions.map((p) => [
        p.to,
        p.from,
        change(p.displacement_rms_mm, (v) => digits(v, 2)),
        p.force_relative ? change(p.force_relative, (v) => percent(v, 2)) : "no force",
      ]),
      [1],
    ),
  );
}
