// Results: an evaluation, a design, a sweep, a scan, a calibration, a diagnosis.

import { getBlob, getJson } from "./api.js";
import { digits, fill, h, symbol } from "./dom.js";
import { scatter } from "./plot.js";
import { slicesView } from "./slices.js";
import { wordsOf } from "./sweep.js";
import { view3d } from "./view3d.js";

export async function resultView(element, job, download) {
  const [result, { artefacts }] = await Promise.all([getJson(`/v1/jobs/${job.id}/result`), getJson(`/v1/jobs/${job.id}/artefacts`)]);
  const files = new Map(artefacts.map((a) => [a.name, a]));
  const parts = { "evaluation/1": evaluation, "design/1": design, "evaluation-list/1": list, "scan/1": scan, "calibration/1": calibration, "diagnosis/1": diagnosis }[result.schema]?.(result, files) ?? [h("section", { class: "sheet" }, h("pre", {}, JSON.stringify(result, null, 2).slice(0, 20000)))];
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
  const varied = result.varied ?? [];
  const at = (value, pointer) => pointer.slice(1).split("/").reduce((v, key) => v?.[key.replaceAll("~1", "/").replaceAll("~0", "~")], value);
  const rows = result.evaluations.filter((e) => e.evaluation).map((e) => {
    const last = e.evaluation.steps.at(-1);
    const row = { force: last.force_n, stretch: last.median_stretch, drive: last.drive_mm };
    varied.forEach((p) => { row[p] = at(e.request, p); });
    e.evaluation.promised_sd.forEach((p) => { row[p.parameter] = p.relative_sd === null ? NaN : 100 * p.relative_sd; });
    return row;
  });
  const first = result.evaluations[0]?.request;
  const named = varied.map((p) => [p, wordsOf(p, first)]);
  const parameters = (result.evaluations.find((e) => e.evaluation)?.evaluation.promised_sd ?? []).map((p) => [p.parameter, `promised deviation of ${symbol(p.parameter)}, %`]);
  const failed = result.evaluations.length - rows.length;
  const heads = [...named.map((n) => n[1]), "Force, N", "Median stretch", ...parameters.map((p) => p[1])];
  if (varied.length > 0) {
    return [h("section", { class: "sheet" }, h("h3", {}, `${rows.length} evaluations${failed ? `, ${failed} without a solution` : ""}`),
      scatter(rows, named, [["force", "force, N"], ["stretch", "median stretch"], ...parameters])),
    h("section", { class: "sheet" }, h("h3", {}, "Table"),
      table(heads, rows.slice(0, 500).map((r) => [...varied.map((p) => digits(r[p])), digits(r.force), digits(r.stretch), ...parameters.map((p) => digits(r[p[0]], 3))])),
      rows.length > 500 && h("p", { class: "quiet" }, "The first 500; all are in table.csv and table.parquet."))];
  }
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

function diagnosis(result, files) {
  const change = (pair, unit = "") => (pair ? `${digits(pair.before, 3)} → ${digits(pair.after, 3)}${unit}` : "–");
  return [h("section", { class: "sheet" },
    bigNumbers([[change(result.chi2_per_datum), "χ² per datum, before and after"], [change(result.kept_back_rms_mm, " mm"), "misfit of data kept back, rms"]]),
    h("p", {}, VERDICTS[result.verdict] ?? result.verdict)),
  ...result.causes.map((cause) => h("section", { class: "sheet" },
    h("h3", {}, `${cause.name} (${cause.category})`), cause.description && h("p", {}, cause.description),
    table(["Parameter", "Value", "95 % interval"], cause.parameters.map((p) => [p.name, digits(p.value), p.interval_95 ? p.interval_95.map((v) => digits(v)).join(" to ") : "not bounded"])),
    cause.location && h("p", { class: "quiet" }, `At the ${cause.location.region}: centre ${cause.location.center_mm.map((v) => digits(v, 3)).join(", ")} mm, extent ${cause.location.extent_mm.map((v) => digits(v, 3)).join(", ")} mm.`))),
  slicesView("What the model leaves: measured less predicted",
    numbered(files, /^residual_before_(\d+)\.nii\.gz$/).map(([name, n]) => ({
      label: `drive ${n}`, panels: [["Before: material alone", name], ["After: with the causes", `residual_after_${n}.nii.gz`]].map(([label, file]) => ({ label, href: files.get(file).href })),
    }))),
  pictureSheet(files, [["evidence.svg", "Causes by what they would explain"], ["load-curve.svg", "The load curve"]])];
}

/** Files whose name fits, with what the brackets caught. */
const numbered = (files, pattern) => [...files.keys()].map((name) => name.match(pattern)).filter(Boolean).sort((a, b) => a[0].localeCompare(b[0], "en", { numeric: true }));

function scan(result, files) {
  return [h("section", { class: "sheet" },
    bigNumbers([[result.num_voxels.toLocaleString("en"), "voxels"], [String(result.steps.length), "drives"], [result.noise_sd_mm ? `${result.noise_sd_mm.map((v) => digits(v, 2)).join(", ")} mm` : "–", "noise found along x, y, z"]]),
    table(["Drive, mm", "Force, N", "True force, N", "Error rms x, y, z, mm"], result.steps.map((s) => [digits(s.drive_mm), digits(s.force_n), digits(s.true_force_n), s.error ? s.error.map((e) => digits(e.rms_mm, 2)).join(", ") : "raw phases"])),
    result.recording && h("p", {}, "The scan is kept as a recording: ", h("a", { href: "#/recordings" }, "calibrate on it or diagnose it"), ".")),
  slicesView("Displacements as scanned", numbered(files, /^u_(\d+)\.nii\.gz$/).map(([name, n]) => ({ label: `drive ${digits(result.steps[n - 1].drive_mm)} mm`, panels: [{ label: "Displacement", href: files.get(name).href }] })))];
}

function calibration(result, files) {
  const shear = result.initial_shear_modulus_kpa;
  const ends = ([low, high]) => `${low === null ? "open" : digits(low)} to ${high === null ? "open" : digits(high)}`;
  const panel = (label, name) => ({ label, href: files.get(name).href });
  const steps = numbered(files, /^measured_(\d+)_(\d+)\.nii\.gz$/).map(([, r, n], i) => {
    const s = result.steps[i];
    return { r, n, label: `${s ? `${result.recordings.length > 1 ? `${s.recording}, ` : ""}${digits(s.drive_mm)} mm` : `${r}.${n}`}` };
  });
  return [h("section", { class: "sheet" },
    bigNumbers([...(shear ? [[`${digits(shear.value)} kPa`, "initial shear modulus"]] : []), [String(result.num_terms), result.num_terms === 1 ? "term" : "terms"], [digits(result.chi2_per_datum, 3), "χ² per datum"]]),
    table(["Parameter", "Value", "Deviation", "95 % interval", ""], result.parameters.map((p) => [symbol(p.name), p.value === null ? "–" : digits(p.value), p.sd === null ? "–" : digits(p.sd, 3), ends(p.interval_95), p.identifiable ? "" : "not identifiable"])),
    result.notes.map((n) => h("p", { class: "quiet" }, n))),
  h("section", { class: "sheet" }, h("h3", {}, "Fit per drive"),
    table(["Drive, mm", "Voxels", "Misfit rms x, y, z, mm", "Force, N", "Model's force, N"], result.steps.map((s) => [digits(s.drive_mm), s.num_voxels.toLocaleString("en"), s.rms_mm.map((v) => digits(v, 3)).join(", "), digits(s.force_n), digits(s.model_force_n)]))),
  slicesView("Before and after the material is taken into account", steps.flatMap(({ r, n, label }) => [
    { label: `${label}: measured and model`, panels: [panel("Measured", `measured_${r}_${n}.nii.gz`), panel("Model", `model_${r}_${n}.nii.gz`)] },
    { label: `${label}: measured and what is left`, panels: [panel("Before: measured", `measured_${r}_${n}.nii.gz`), panel("After: measured less model", `misfit_${r}_${n}.nii.gz`)] },
  ])),
  pictureSheet(files, [...files.keys()].filter((f) => f.endsWith(".svg")).map((f) => [f, f.slice(0, -4).replaceAll("-", " ")]))];
}

async function pictureSheet(files, wanted) {
  const figures = (await Promise.all(wanted.map(([name, caption]) => picture(files, name, caption)))).filter(Boolean);
  return figures.length ? h("section", { class: "sheet" }, h("div", { class: figures.length > 1 ? "halves" : null }, figures)) : null;
}

async function shapes(files, wanted) {
  const found = await Promise.all(wanted.filter(([name]) => files.has(name)).map(async ([name, label]) => [JSON.parse(await (await getBlob(files.get(name).href)).text()), label]));
  return found.length ? view3d(found) : null;
}
