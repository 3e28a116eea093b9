// Results: each format by its own view; then the files, one by one or all in one.

import { getBlob, getJson, save } from "./api.js";
import { calibration } from "./calibration.js";
import { design } from "./design.js";
import { diagnoses, diagnosis } from "./diagnosis.js";
import { fill, h, more, sheet } from "./dom.js";
import { evaluation } from "./evaluation.js";
import { figureSheet } from "./figures.js";
import { evaluationList } from "./evaluation_list.js";
import { next } from "./next.js";
import { numbered } from "./parts.js";
import { onward, scan } from "./scan.js";
import { slicesView } from "./slices.js";
import { zip } from "./zip.js";

const VIEWS = {
  "evaluation/1": evaluation,
  "design/1": design,
  "evaluation-list/1": evaluationList,
  "scan/1": scan,
  "calibration/1": calibration,
  "diagnosis/1": diagnosis,
  "diagnoses/1": diagnoses,
  "next/1": next,
};

/** What has no view of its own is shown as it is: its figures, its maps, its content. */
function plainView(result, files) {
  const pictures = [...files.keys()].filter((f) => f.endsWith(".svg"));
  const maps = numbered(files, /^u_(\d+)\.nii\.gz$/).map(([name, n]) => ({
    label: `drive ${n}`,
    panels: [{ label: "Displacement", href: files.get(name).href }],
  }));
  const text = JSON.stringify(result, null, 2).slice(0, 20000);
  return [
    result.recording && sheet("The recording that was made", onward(result.recording)),
    slicesView("Displacements", maps),
    figureSheet(
      files,
      pictures.map((f) => [f, f.slice(0, -4).replaceAll("-", " ")]),
    ),
    sheet("Result", h("pre", { tabindex: 0 }, text)),
  ];
}

/** Result, request and files of a job that has succeeded. */
export async function readResult(id) {
  const [result, { artefacts }, request] = await Promise.all([
    getJson(`/v1/jobs/${id}/result`),
    getJson(`/v1/jobs/${id}/artefacts`),
    getJson(`/v1/jobs/${id}/request`),
  ]);
  return { result, artefacts, request, files: new Map(artefacts.map((a) => [a.name, a])) };
}

export async function resultView(element, job, download) {
  const { result, artefacts, request, files } = await readResult(job.id);
  const parts = (VIEWS[result.schema] ?? plainView)(result, files, request);
  fill(
    element,
    await Promise.all(parts.flat(Infinity)),
    downloads(job, artefacts, download),
    inputs(request, result, job),
  );
}

/** Everything that a job left, in one file. */
async function all(job, artefacts) {
  const paths = [
    ["result.json", `/v1/jobs/${job.id}/result`],
    ["request.json", `/v1/jobs/${job.id}/request`],
    ...artefacts.map((a) => [a.name, a.href]),
  ];
  const files = await Promise.all(paths.map(async ([name, path]) => ({ name, blob: await getBlob(path) })));
  save(await zip(files), `${(job.title || job.kind).replace(/[^\w.-]+/g, "-").slice(0, 60)}.zip`);
}

function downloads(job, artefacts, download) {
  const entry = (name, path) =>
    h(
      "li",
      {},
      h(
        "a",
        {
          href: path,
          download: name,
          onclick: (event) => {
            event.preventDefault();
            download(path, name);
          },
        },
        name,
      ),
    );
  return sheet(
    "Files",
    h(
      "p",
      {},
      h(
        "button",
        {
          type: "button",
          id: "download-all",
          onclick: async (event) => {
            const button = event.currentTarget;
            button.disabled = true;
            try {
              await all(job, artefacts);
            } finally {
              button.disabled = false;
            }
          },
        },
        "Download all as one file",
      ),
    ),
    h(
      "ul",
      { class: "files" },
      entry("result.json", `/v1/jobs/${job.id}/result`),
      entry("request.json", `/v1/jobs/${job.id}/request`),
      artefacts.map((a) => entry(a.name, a.href)),
    ),
  );
}

const inputs = (request, result, job) =>
  h(
    "section",
    { class: "sheet" },
    h(
      "p",
      { class: "quiet" },
      `Computed by lambdak ${result.version ?? job.version}` +
        `${result.input_hash ? `, inputs ${result.input_hash.slice(0, 12)}` : ""}.`,
    ),
    more(
      "What it was computed from",
      h("pre", { class: "scroll", tabindex: 0 }, JSON.stringify(request, null, 2).slice(0, 20000)),
    ),
  );
