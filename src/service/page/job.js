// One job: followed live while it runs, then its result.

import { download, follow, getJson, post, remove } from "./api.js";
import { fill, h, say } from "./dom.js";
import { badge, isOpen } from "./jobs.js";
import { duration } from "./numbers.js";
import { progressView, usualTime } from "./progress.js";
import { resultView } from "./result.js";
import { startButton } from "./start.js";
import { askName, jobName, learnTitles } from "./titles.js";
import { COMPARED, KINDS } from "./words.js";

const PLANNED = ["evaluations", "designs", "solves", "scans"];

async function copyLink() {
  try {
    await navigator.clipboard.writeText(location.href);
    say("The link is copied.");
  } catch {
    say(location.href);
  }
}

/** The buttons of a job. */
function actions(job, request, reload) {
  const act = (verb, word) => async () => {
    try {
      await post(`/v1/jobs/${job.id}/${verb}`);
      say(word);
      if (verb === "resume") reload();
    } catch (error) {
      say(error.message);
    }
  };
  const erase = async () => {
    if (!confirm("Delete this job with its results and files?")) return;
    try {
      await remove(`/v1/jobs/${job.id}`);
      say("Deleted.");
      location.hash = "#/jobs";
    } catch (error) {
      say(error.message);
    }
  };
  return [
    isOpen(job) &&
      h("button", { type: "button", onclick: act("cancel", "Cancelled; what was found is kept.") }, "Cancel"),
    ["failed", "cancelled"].includes(job.state) &&
      h("button", { type: "button", onclick: act("resume", "Back in the queue.") }, "Resume"),
    PLANNED.includes(job.kind) && h("a", { class: "button", href: `#/plan/${job.id}` }, "Plan from here"),
    job.state === "succeeded" &&
      COMPARED.has(job.kind) &&
      h("a", { class: "button", href: `#/compare/${job.id}` }, "Compare with …"),
    !isOpen(job) &&
      startButton("Run again", job.kind, () => request, {
        title: "The same request, with this version of the program",
      }),
    h(
      "button",
      {
        type: "button",
        onclick: () => {
          if (askName(job.id, jobName(job))) reload();
        },
      },
      "Rename",
    ),
    h("button", { type: "button", onclick: copyLink }, "Copy link"),
    !isOpen(job) && h("button", { type: "button", id: "delete", onclick: erase }, "Delete"),
  ];
}

/** Why a job failed, field by field. */
const problemView = (problem) =>
  h(
    "div",
    { class: "callout bad", role: "alert" },
    h("strong", {}, problem.title),
    h("p", {}, problem.detail),
    (problem.errors ?? []).map((e) => h("p", {}, `${e.pointer || "The whole"}: ${e.detail}`)),
  );

export async function jobView(content, id, signal) {
  const [first, request] = await Promise.all([
    getJson(`/v1/jobs/${id}`),
    getJson(`/v1/jobs/${id}/request`),
    learnTitles().catch(() => {}),
  ]);
  const others = isOpen(first) ? (await getJson("/v1/jobs?limit=50").catch(() => ({ jobs: [] }))).jobs : [];
  const live = progressView(request, usualTime(others, first.kind, request.recordings?.length ?? 1));
  const head = h("section", { class: "sheet" });
  const result = h("div", {});
  const title = `${KINDS[first.kind] ?? first.kind}`;
  const reload = () => jobView(content, id, signal);
  let shown = "";

  const show = (job) => {
    const end = job.finished_ms ?? Date.now();
    if (isOpen(job)) live.show(job);
    fill(
      head,
      h(
        "div",
        { class: "row end" },
        h(
          "div",
          { class: "row" },
          badge(job.state),
          h("span", { class: "quiet" }, title),
          job.started_ms && h("span", { class: "quiet" }, duration(Math.max(0, end - job.started_ms))),
          h("span", { class: "quiet" }, `version ${job.version}`),
        ),
        h("div", { class: "row" }, actions(job, request, reload)),
      ),
      isOpen(job) && live.element,
      job.problem && problemView(job.problem),
    );
    if (job.state === "succeeded" && shown !== job.state) {
      shown = job.state;
      fill(result, h("p", { class: "quiet" }, "Reading the result …"));
      resultView(result, job, download).catch((error) =>
        fill(result, h("p", { class: "bad", role: "alert" }, error.message)),
      );
    }
  };
  fill(content, h("h2", {}, jobName(first)), head, result);
  show(first);
  if (!isOpen(first)) return;
  let last = first;
  const timer = setInterval(() => {
    if (isOpen(last)) live.show(last);
  }, 1000);
  signal.addEventListener("abort", () => clearInterval(timer));
  follow(
    id,
    (job) => {
      last = job;
      show(job);
    },
    signal,
  )
    .catch((error) => say(error.message))
    .finally(() => clearInterval(timer));
}
