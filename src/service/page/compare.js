// Results side by side: figures, promised deviations, maps and drawings of any jobs of one or of several kinds.

import { getJson } from "./api.js";
import { foundWords } from "./diagnosis.js";
import { fill, h, sheet, term } from "./dom.js";
import { figure } from "./figures.js";
import { digits, interval, known, percent, sensitivityUnit, symbol, unitOf, withUnit } from "./numbers.js";
import { numbered, shapes, table } from "./parts.js";
import { readResult } from "./result.js";
import { slicesView } from "./slices.js";
import { jobName, learnTitles } from "./titles.js";
import { COMPARED, GLOSSARY, KINDS, VERDICTS } from "./words.js";

/** A line of the comparison: key, words, number, text, whether less is better (null: neither), meaning. */
const line = (key, words, value, text, isLessBetter = null, meaning = "") => ({
  key,
  words,
  value,
  text,
  isLessBetter,
  meaning,
});

function ofEvaluation(evaluation) {
  const last = evaluation.steps.at(-1);
  return [
    line("drive", "Drive", last.drive_mm, `${digits(last.drive_mm, 3)} mm`),
    line("force", "Force", last.force_n, `${digits(last.force_n, 3)} N`),
    line(
      "stretch",
      "Median stretch",
      last.median_stretch,
      digits(last.median_stretch, 3),
      null,
      GLOSSARY["median stretch"],
    ),
    ...last.integrated_sensitivity.map((s) =>
      line(
        `s ${s.parameter}`,
        `𝒮 of ${symbol(s.parameter)}`,
        s.sum,
        withUnit(digits(s.sum, 3), sensitivityUnit(s.parameter)),
        false,
        GLOSSARY["integrated sensitivity 𝒮"],
      ),
    ),
    ...evaluation.promised_sd.map((p) =>
      line(
        `sd ${p.parameter}`,
        `Promised deviation of ${symbol(p.parameter)}`,
        p.relative_sd,
        p.identifiable ? percent(p.relative_sd, 2) : "not identifiable",
        true,
        GLOSSARY["promised deviation"],
      ),
    ),
  ];
}

const ofParameters = (list) =>
  list.map((p) =>
    line(
      `value ${p.name}`,
      symbol(p.name),
      p.value,
      `${withUnit(known(p.value, p.interval_95), unitOf(p.name))} (${interval(p.interval_95, unitOf(p.name))})`,
      null,
      GLOSSARY["κ, μ, α"],
    ),
  );

const fit = (chi2) => line("chi2", "χ² per datum", chi2, digits(chi2, 3), true, GLOSSARY["χ² per datum"]);

/** The lines of each format. */
const LINES = {
  "evaluation/1": ofEvaluation,
  "design/1": (r) => [
    line("gain", "Gain over its base", r.best.objective, digits(r.best.objective, 3), false, GLOSSARY.gain),
    line("holes", "Holes", r.best.specimen.holes.length, String(r.best.specimen.holes.length)),
    ...ofEvaluation(r.best.evaluation),
  ],
  "calibration/1": (r) => [
    fit(r.chi2_per_datum),
    line("terms", "Ogden terms", r.num_terms, String(r.num_terms)),
    ...ofParameters(r.parameters),
  ],
  "diagnosis/1": (r) => [
    fit(r.chi2_per_datum.after),
    line("verdict", "Verdict", null, VERDICTS[r.verdict]?.[0] ?? r.verdict),
    line("causes", "What was found", null, foundWords(r.causes).join("; ") || "nothing"),
    ...ofParameters(r.material_parameters),
  ],
};

/** Surfaces, and figures that stand side by side. */
const SURFACES = ["surface.json", "surface-best.json"];
const FIGURES = [
  [["histogram.svg"], "voxels in (λ, k)"],
  [["specimen.svg", "best-specimen.svg"], "drawing"],
  [["map-stretch-and-mode.svg"], "λ and k"],
  [["residual-histogram.svg"], "misfit in units of the noise"],
  [["correlation.svg"], "correlation of the estimates"],
];

/** What a result left unexplained, one map per drive: words and address. */
const RESIDUALS = {
  "calibration/1": ({ result, files }) =>
    numbered(files, /^misfit_(\d+)_(\d+)\.nii\.gz$/).map(([name], i) => ({
      href: files.get(name).href,
      drive: result.steps[i] ? `drive ${digits(result.steps[i].drive_mm, 3)} mm` : `scan ${i + 1}`,
    })),
  "diagnosis/1": ({ files }) =>
    numbered(files, /^residual_after_(\d+)\.nii\.gz$/).map(([name, n]) => ({
      href: files.get(name).href,
      drive: `scan ${n}`,
    })),
};

/** What a column is called. */
const called = ({ job }) => `${jobName(job)} (${KINDS[job.kind] ?? job.kind})`;

function difference(one, first) {
  if (!first || one === first || !Number.isFinite(one.value) || !Number.isFinite(first.value) || first.value === 0)
    return null;
  const part = one.value / first.value - 1;
  if (Math.abs(part) < 0.0005) return null;
  const kind = one.isLessBetter === null ? "quiet" : part < 0 === one.isLessBetter ? "good" : "bad";
  return h(
    "div",
    { class: kind },
    `${part > 0 ? "+" : "−"}${digits(Math.abs(100 * part), 2)} %${{ good: ", better", bad: ", worse" }[kind] ?? ""}`,
  );
}

function figuresTable(columns) {
  const keys = [...new Map(columns.flatMap((c) => c.lines.map((l) => [l.key, l])))];
  return table(
    ["", ...columns.map((c) => h("a", { href: `#/job/${c.job.id}` }, jobName(c.job)))],
    [
      ["Kind", ...columns.map((c) => KINDS[c.job.kind] ?? c.job.kind)],
      ...keys.map(([key, any]) => [
        term(any.words, any.meaning),
        ...columns.map((c) => {
          const one = c.lines.find((l) => l.key === key);
          return one
            ? [
                one.text,
                difference(
                  one,
                  columns[0].lines.find((l) => l.key === key),
                ),
              ]
            : "–";
        }),
      ]),
      ["Version", ...columns.map((c) => c.result.version ?? c.job.version)],
    ],
  );
}

async function pictures(columns) {
  const rows = await Promise.all(
    FIGURES.map(async ([names, caption]) => {
      const of = (c) =>
        figure(
          c.files,
          names.find((name) => c.files.has(name)),
          `${called(c)}: ${caption}`,
        );
      const found = (await Promise.all(columns.map(of))).filter(Boolean);
      // One alone has nothing to stand beside.
      return found.length > 1 && h("section", { class: "sheet" }, h("div", { class: "halves" }, found));
    }),
  );
  return rows;
}

async function surfaces(columns) {
  const wanted = columns.flatMap((c) =>
    SURFACES.filter((n) => c.files.has(n))
      .slice(0, 1)
      .map((n) => [c, n]),
  );
  return shapes(
    new Map(wanted.map(([c, n]) => [c.job.id, c.files.get(n)])),
    wanted.map(([c]) => [c.job.id, called(c)]),
  );
}

/** Maps of what each result leaves, side by side: one set per drive that at least two of them have. */
function residuals(columns) {
  const found = columns
    .map((c) => ({ name: called(c), maps: RESIDUALS[c.result.schema]?.(c) ?? [] }))
    .filter(({ maps }) => maps.length > 0);
  const sets = [];
  for (let i = 0; found.filter(({ maps }) => i < maps.length).length > 1; i += 1) {
    const there = found.filter(({ maps }) => i < maps.length);
    const drives = [...new Set(there.map(({ maps }) => maps[i].drive))];
    sets.push({
      label: drives.find((words) => words.startsWith("drive")) ?? drives[0],
      panels: there.map(({ name, maps }) => ({ label: name, href: maps[i].href })),
    });
  }
  return slicesView("What each leaves: measured less predicted", sets, {
    note: "All are cut at the same place and share one scale of colours.",
  });
}

/** A chooser of a further job to stand beside. */
function adder(ids, jobs) {
  const free = jobs.filter((j) => j.state === "succeeded" && COMPARED.has(j.kind) && !ids.includes(j.id));
  return h(
    "label",
    {},
    "Add a result",
    h(
      "select",
      {
        id: "add-result",
        onchange: (e) => {
          location.hash = `#/compare/${[...ids, e.target.value].join(",")}`;
        },
      },
      h("option", { value: "" }, free.length > 0 ? "choose …" : "there is no other"),
      free.map((j) => h("option", { value: j.id }, `${jobName(j)} (${KINDS[j.kind] ?? j.kind})`)),
    ),
  );
}

export async function compareView(content, text) {
  const ids = text.split(",").filter(Boolean);
  const [{ jobs }] = await Promise.all([getJson("/v1/jobs?limit=100"), learnTitles().catch(() => {})]);
  const columns = await Promise.all(
    ids.map(async (id) => {
      const [job, read] = await Promise.all([getJson(`/v1/jobs/${id}`), readResult(id)]);
      return { job, ...read, lines: LINES[read.result.schema]?.(read.result) ?? [] };
    }),
  );
  fill(
    content,
    h("h2", {}, "Compare"),
    h(
      "section",
      { class: "sheet" },
      h("p", { class: "quiet" }, "Differences are from the first result."),
      columns.length > 0 && figuresTable(columns),
      adder(ids, jobs),
    ),
    await surfaces(columns),
    residuals(columns),
    await pictures(columns),
  );
}
