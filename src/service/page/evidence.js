// What a diagnosis suspected: every suspect in full, with how much it would explain.

import { fill, h, term } from "./dom.js";
import { digits } from "./numbers.js";
import { GLOSSARY } from "./words.js";

const LEAST = 10; // Below this a fall of the deviance says nothing; bars begin here.
const FIRST = 6;

/** Bars of one round, the strongest first. */
function bars(entries) {
  const strength = (e) => e.fitted ?? e.score;
  const reach = Math.log(Math.max(2 * LEAST, ...entries.map(strength)) / LEAST);
  const width = (v) => Math.max(1, (100 * Math.log(Math.max(v, LEAST) / LEAST)) / reach);
  const line = (e) =>
    h(
      "li",
      { class: "suspect" },
      h("span", { class: "what" }, e.description),
      h("span", { class: "bar" }, h("i", { width_percent: width(strength(e)) })),
      h("span", { class: "number" }, e.fitted === null ? `${digits(e.score, 3)}, not fitted` : digits(e.fitted, 3)),
    );
  const sorted = [...entries].sort((a, b) => strength(b) - strength(a));
  return [
    h("ol", { class: "suspects" }, sorted.slice(0, FIRST).map(line)),
    sorted.length > FIRST &&
      h(
        "details",
        {},
        h("summary", {}, `${sorted.length - FIRST} weaker suspects`),
        h("ol", { class: "suspects" }, sorted.slice(FIRST).map(line)),
      ),
  ];
}

/** All rounds of a diagnosis. */
export function evidence(ranked) {
  if (ranked.length === 0) return h("p", { class: "quiet" }, "Nothing had to be suspected.");
  const rounds = [...new Set(ranked.map((r) => r.round))];
  const list = h("div", {});
  const show = (round) => fill(list, bars(ranked.filter((r) => r.round === round)));
  show(rounds[0]);
  return h(
    "div",
    {},
    h(
      "p",
      { class: "quiet" },
      "Bars are on a logarithmic scale from ten; numbers are the ",
      term("evidence", GLOSSARY.evidence),
      " of a full fit, or to first order where a suspect was not fitted.",
    ),
    rounds.length > 1 &&
      h(
        "label",
        {},
        "Round of the search",
        h(
          "select",
          { onchange: (e) => show(Number(e.target.value)) },
          rounds.map((r) =>
            h("option", { value: r }, r === rounds[0] ? `${r}: nothing named yet` : `${r}: with what was named before`),
          ),
        ),
      ),
    list,
  );
}
