// Results: an evaluation, a design, a sweep.

import { getBlob, getJson } from "./api.js";
import { digits, fill, h, symbol } from "./dom.js";
import { view3d } from "./view3d.js";

export async function resultView(element, job, download) {
  const [result, { artefacts }] = await Promise.all([getJson(`/v1/jobs/${job.id}/result`), getJson(`/v1/jobs/${job.id}/artefacts`)]);
  const files = new Map(artefacts.map((a) => [a.name, a]));
  const parts = { "evaluation/1": evaluation, "design/1": design, "evaluation-list/1": list, "diagnosis/1": diagnosis }[result.schema]?.(result, files) ?? [h("section", { class: "sheet" }, h("pre", {}, JSON.stringify(result, null, 2).slice(0, 20000)))];
  fill(element, await Promise.all(parts), downloads(job, artefacts, download));
}

function downloads(job, artefacts, download) {
  const entry = (name, path) => h("li", {}, h("a", { href: path, download: name, onclick: (event) => { event.preventDefault(); download(path, name); } }, name));
  return h("section", { class: "sheet" }, h("h3", {}, "Files"),
    h("ul", { class: "files" }, entry("result.json", `/v1/jobs/${job.id}/result`), artefacts.map((a) => entry(a.name, a.href))));
}

async function picture(files, name, caption) {
  if (!files.has(name)) return null;
  const url = URL.createObjectURL(await getBlob(files.get(name).href));
  return h("figure", {}, h("img", { src: url, alt: caption }), h("figcaption", {}, caption));
}

const bigNumbers = (pairs) => h("div", { class: "figure" }, pairs.map(([value, label]) => h("div", {}, h("b", {}, value), h("span", {}, label))));
const table = (heads, rows) => h("div", { class: "scroll" }, h("table", {}, h("thead", {}, h("tr", {}, heads.map((t, i) => h("th", { class: i ? "number" : null }, t)))),
  h("tbody", {}, rows.map((r) => h("tr", {}, r.map((v, i) => h("td", { class: i ? "number" : null }, v)))))));
const percent = (v) => (v === null || v === undefined ? "–" : `${digits(100 * v, 3)} %`);

function promised(list) {
  return table(["Parameter", "Promised deviation", "Relative", ""], list.map((p) => [symbol(p.parameter), digits(p.value), percent(p.relative_sd), p.identifiable ? "" : "not identifiable"]));
}

function sensitivities(step) {
  return table(["Parameter", "Sum", "Mean per voxel", "Volume integral, mm³"], step.integrated_sensitivity.map((v) => [symbol(v.parameter), digits(v.sum), digits(v.mean_per_voxel), digits(v.volume_integral)]));
}

function evaluation(result, files) {
  const last = result.steps.at(-1);
  return [
    h("section", { class: "sheet" },
      bigNumbers([[`${digits(last.force_n, 3)} N`, `force at ${digits(last.drive_mm)} mm`], [last.num_voxels.toLocaleString("en"), "voxels"], [digits(last.median_stretch), "median stretch"], [digits(result.largest_principal_stretch, 3), "largest stretch"]]),
      table(["Drive, mm", "Force, N", "Voxels", "Median stretch"], result.steps.map((s) => [digits(s.drive_mm), digits(s.force_n), s.num_voxels.toLocaleString("en"), digits(s.median_stretch)]))),
    h("div", { class: "halves" },
      h("section", { class: "sheet" }, h("h3", {}, "What the scan promises"), promised(result.promised_sd)),
      h("section", { class: "sheet" }, h("h3", {}, `Integrated sensitivity at ${digits(last.drive_mm)} mm`), sensitivities(last))),
    shapes(files, [["surface.json", "Deformed specimen"]]),
    pictureSheet(files, [["histogram.svg", "Where the voxels lie in (λ, k)"], ["integrated-sensitivity.svg", "Integrated sensitivities, sums over voxels"]]),
    pictureSheet(files, [["map-stretch-and-mode.svg", "λ and k through the specimen"]]),
    pictureSheet(files, [...files.keys()].filter((n) => /^map-sensitivity/.test(n)).map((n) => [n, `Sensitivity to ${symbol(n.slice(16, -4))}`])),
  ];
}

function design(result, files) {
  const { base, best } = result;
  const row = (label, e) => [label, e.specimen.holes.length, digits(e.specimen.drive_mm.at(-1)), digits(e.force_n ?? e.evaluation.steps.at(-1).force_n, 3), digits(e.evaluation.steps.at(-1).median_stretch), digits(e.objective), e.closest_limit.split(":")[0].replaceAll("_", " ")];
  return [
    h("section", { class: "sheet" },
      bigNumbers([[`× ${digits(best.objective, 3)}`, "gain over the base specimen"], [String(best.specimen.holes.length), "holes"], [`${digits(best.specimen.drive_mm.at(-1), 3)} mm`, "drive"], [`${digits(best.evaluation.steps.at(-1).force_n, 3)} N`, "force"]]),
      h("ul", { class: "findings" }, result.findings.map((f) => h("li", {}, f))),
      table(["Design", "Holes", "Drive, mm", "Force, N", "Median stretch", "Gain", "Closest limit"], [row("base", base), row("chosen", best), ...result.ranked.slice(1, 5).map((e, i) => row(`${i + 2}.`, e))])),
    shapes(files, [["surface-base.json", "Base"], ["surface-best.json", "Chosen"]]),
    h("div", { class: "halves" },
      h("section", { class: "sheet" }, h("h3", {}, "Base: promised deviations"), promised(base.evaluation.promised_sd)),
      h("section", { class: "sheet" }, h("h3", {}, "Chosen: promised deviations"), promised(best.evaluation.promised_sd))),
    result.verification.best.length > 0 && h("section", { class: "sheet" }, h("h3", {}, "Verification on synthetic noisy scans, chosen design"),
      table(["Parameter", "Truth", "Mean", "Found deviation", "Promised", "Draws"], result.verification.best.map((p) => [symbol(p.parameter), digits(p.truth), digits(p.mean), digits(p.found_sd), digits(p.promised_sd), p.draws]))),
    pictureSheet(files, [["histogram.svg", "Voxels in (λ, k): base against chosen"], ["best-specimen.svg", "Drawing of the chosen specimen"]]),
  ];
}

function list(result) {
  return [h("section", { class: "sheet" }, h("h3", {}, `${result.evaluations.length} evaluations`),
    table(["Specimen", "Drive, mm", "Force, N", "Median stretch", "Promised"], result.evaluations.slice(0, 500).map((e) => {
      const last = e.evaluation?.steps.at(-1);
      const holes = e.request.specimen.holes.map((o) => digits(o.diameter_mm, 3)).join(", ");
      const name = `${e.request.specimen.name}${holes ? ` (⌀ ${holes} mm)` : ""}`;
      return last ? [name, digits(last.drive_mm), digits(last.force_n), digits(last.median_stretch), e.evaluation.promised_sd.filter((p) => p.parameter !== "kappa").map((p) => `${symbol(p.parameter)} ${percent(p.relative_sd)}`).join(", ")]
        : [name, e.problem?.detail ?? "", "", "", ""];
    })))];
}

const VERDICTS = {
  no_mismatch: "No mismatch beyond noise and meshes.", explained: "The mismatch is explained.",
  explained_ambiguously: "Explained, but not by one cause alone: the data cannot tell these apart.", unexplained: "Something is left that no known cause explains.",
};

function diagnosis(result) {
  const change = (pair, unit = "") => (pair ? `${digits(pair.before, 3)} → ${digits(pair.after, 3)}${unit}` : "–");
  return [h("section", { class: "sheet" },
    bigNumbers([[change(result.chi2_per_datum), "χ² per datum, before and after"], [change(result.kept_back_rms_mm, " mm"), "misfit of data kept back, rms"]]),
    h("p", {}, VERDICTS[result.verdict] ?? result.verdict)),
  ...result.causes.map((cause) => h("section", { class: "sheet" },
    h("h3", {}, `${cause.name} (${cause.category})`), cause.description && h("p", {}, cause.description),
    table(["Parameter", "Value", "95 % interval"], cause.parameters.map((p) => [p.name, digits(p.value), p.interval_95 ? p.interval_95.map((v) => digits(v)).join(" to ") : "not bounded"])),
    cause.location && h("p", { class: "quiet" }, `At the ${cause.location.region}: centre ${cause.location.center_mm.map((v) => digits(v, 3)).join(", ")} mm, extent ${cause.location.extent_mm.map((v) => digits(v, 3)).join(", ")} mm.`)))];
}

async function pictureSheet(files, wanted) {
  const figures = (await Promise.all(wanted.map(([name, caption]) => picture(files, name, caption)))).filter(Boolean);
  return figures.length ? h("section", { class: "sheet" }, h("div", { class: figures.length > 1 ? "halves" : null }, figures)) : null;
}

async function shapes(files, wanted) {
  const found = await Promise.all(wanted.filter(([name]) => files.has(name)).map(async ([name, label]) => [JSON.parse(await (await getBlob(files.get(name).href)).text()), label]));
  return found.length ? view3d(found) : null;
}
