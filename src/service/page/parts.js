// Parts that results share: figures in large type, tables, words that stand out.

import { getBlob } from "./api.js";
import { h, term } from "./dom.js";
import { lawNumbers } from "./law.js";
import { digits, known, percent, sensitivityUnit, symbol, unitOf, withUnit } from "./numbers.js";
import { GLOSSARY } from "./words.js";
import { view3d } from "./view3d.js";

/** Figures in large type: [[value, label, meaning]]. */
export const bigNumbers = (pairs) =>
  h(
    "div",
    { class: "figure" },
    pairs.map(([value, label, meaning]) => h("div", {}, h("b", {}, value), h("span", {}, term(label, meaning)))),
  );

/** A table; all columns but the first hold numbers, unless `words` lists them. */
export const table = (heads, rows, words = []) => {
  const kind = (i) => (i > 0 && !words.includes(i) ? "number" : null);
  return h(
    "div",
    { class: "scroll", tabindex: 0, role: "region", "aria-label": "Table" },
    h(
      "table",
      {},
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          heads.map((t, i) => h("th", { class: kind(i), scope: "col" }, t)),
        ),
      ),
      h(
        "tbody",
        {},
        rows.map((r) =>
          h(
            "tr",
            {},
            r.map((v, i) => h("td", { class: kind(i) }, v)),
          ),
        ),
      ),
    ),
  );
};

/** Words that are said first: `kind` is good, warn or bad. */
export const callout = (kind, title, ...children) =>
  h("div", { class: `callout ${kind}`, role: kind === "bad" ? "alert" : "note" }, h("strong", {}, title), children);

/** Files whose name fits, with what the brackets caught. */
export const numbered = (files, pattern) =>
  [...files.keys()]
    .map((name) => name.match(pattern))
    .filter(Boolean)
    .sort((a, b) => a[0].localeCompare(b[0], "en", { numeric: true }));

/** A column of what the mesh may put the rows' numbers wrong by, where it is known. */
function meshColumn(rows) {
  const isKnown = rows.some((row) => Number.isFinite(row.discretisation_relative));
  return isKnown
    ? { heads: [term("Mesh", GLOSSARY["mesh error"])], cells: (row) => [`± ${percent(row.discretisation_relative, 2)}`] }
    : { heads: [], cells: () => [] };
}

/** Promised standard deviations. */
export function promised(list) {
  const meaning = GLOSSARY["promised deviation"];
  const mesh = meshColumn(list);
  return table(
    ["Parameter", term("Promised deviation", meaning), "Relative", ...mesh.heads, ""],
    list.map((p) => [
      symbol(p.parameter),
      withUnit(digits(p.value, 2), unitOf(p.parameter)),
      percent(p.relative_sd, 2),
      ...mesh.cells(p),
      p.identifiable ? "" : h("span", { class: "bad" }, "not identifiable"),
    ]),
    [3 + mesh.heads.length],
  );
}

/** Integrated sensitivities of a drive. */
export function sensitivities(step) {
  const mesh = meshColumn(step.integrated_sensitivity);
  return table(
    [
      "Parameter",
      term("𝒮, sum", GLOSSARY["integrated sensitivity 𝒮"]),
      "Mean per voxel",
      "Volume integral",
      ...mesh.heads,
    ],
    step.integrated_sensitivity.map((v) => [
      symbol(v.parameter),
      withUnit(digits(v.sum, 3), sensitivityUnit(v.parameter)),
      withUnit(digits(v.mean_per_voxel, 3), sensitivityUnit(v.parameter)),
      withUnit(
        digits(v.surface_integral ?? v.volume_integral, 3),
        [sensitivityUnit(v.parameter), v.surface_integral === undefined ? "mm³" : "mm²"].filter(Boolean).join(" "),
      ),
      ...mesh.cells(v),
    ]),
  );
}

/** A material: value with its unit and digits. */
export const materialRow = (name, value, ends) => withUnit(known(value, ends), unitOf(name));

/** The parameters of a material by name. */
export function parametersOf(material) {
  const found = { kappa: material.bulk_kpa };
  (material.terms ?? []).forEach((t, i) => {
    found[`mu_${i + 1}`] = t.mu_kpa;
    found[`alpha_${i + 1}`] = t.alpha;
  });
  // A law in the first invariant has numbers of its own.
  for (const [name, value] of lawNumbers(material)) found[name.replace(/_kpa$/, "")] = value;
  return found;
}

/** ½ Σ μα, kPa. */
export const shearModulus = (material) =>
  (material.terms ?? []).reduce((sum, t) => sum + 0.5 * t.mu_kpa * t.alpha, 0);

/** Deformed surfaces side by side: [[file, label]]. */
export async function shapes(files, wanted) {
  const read = async ([name, label]) => [JSON.parse(await (await getBlob(files.get(name).href)).text()), label];
  const found = await Promise.all(wanted.filter(([name]) => files.has(name)).map(read));
  return found.length > 0 && view3d(found);
}
