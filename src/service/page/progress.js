// How far a job is: the whole of it, what it does now, and how long it will take.

import { fill, h } from "./dom.js";
import { digits, duration } from "./numbers.js";

/** Stages of a design search in their order: words, and how much work each is by the study's budget. */
const SEARCH = {
  explore: ["sampling designs all over the space", (b) => b.explore ?? 40],
  propose: ["improving designs by what the ones before have taught", (b) => b.propose ?? 0],
  refine: ["improving the best designs by gradients", (b) => (b.refine ?? 0) * (b.iterations ?? 6)],
  confirm: ["confirming the best designs on the standard mesh", (b) => 6 * (b.confirm ?? 4)],
  repair: ["repairing designs that missed a limit", () => 4],
  verify: ["calibrating on synthetic noisy scans", (b, draws) => 10 * draws],
};

/** Stages of a diagnosis in their order: how it begins, and the part of the whole that is done by then. */
const DIAGNOSIS = [
  ["fitting the nominal model", 0.02],
  ["testing", 0.1],
  ["looking", 0.2],
  ["fitting the set-up", 0.3],
  ["fitting", 0.35],
  ["predicting on a finer mesh", 0.8],
  ["predicting voxel blocks", 0.93],
];

const WORDS = {
  solve: "solving for the equilibria",
  pictures: "drawing figures",
  "finer mesh": "fitting again on a finer mesh",
  "bound of kappa": "looking for the bound of κ",
  profiles: "following the profile likelihoods",
  contours: "drawing contours",
};

/** What a job does now, in words. */
export const stageWords = (stage) => SEARCH[stage]?.[0] ?? WORDS[stage] ?? stage;

function searchPart(progress, request) {
  const budget = request?.budget ?? {};
  const draws = request?.verification?.is_on ? (request.verification.draws ?? 0) : 0;
  const weights = Object.entries(SEARCH).map(([stage, [, weight]]) => [stage, weight(budget, draws)]);
  const whole = weights.reduce((sum, [, w]) => sum + w, 0);
  let done = 0;
  for (const [stage, weight] of weights) {
    if (stage === progress.stage)
      return (done + weight * (progress.total ? progress.done / progress.total : 0)) / whole;
    done += weight;
  }
  return null;
}

const diagnosisPart = (progress) =>
  DIAGNOSIS.reduce((part, [start, at]) => (progress.stage.startsWith(start) ? at : part), null);

const PARTS = { designs: searchPart, diagnoses: diagnosisPart };

/** The part of a job that is done, from 0 to 1; null where it cannot be told. */
export function partDone(job, request) {
  if (job.num_tasks > 1) return job.num_done / job.num_tasks;
  const p = job.progress;
  if (!p) return null;
  if (PARTS[job.kind]) return PARTS[job.kind](p, request);
  return p.total > 0 ? p.done / p.total : null;
}

/** Milliseconds that are left: by the part that is done, or by what earlier jobs of the kind took. */
function left(part, spent, usual) {
  if (usual && !(part > 0.1)) return usual - spent;
  if (part > 0.02 && spent > 2000) return (spent * (1 - part)) / part;
  return usual ? usual - spent : null;
}

function leftWords(ms) {
  if (ms === null) return "";
  return ms < 2000 ? "almost done" : `about ${duration(ms)} left`;
}

/** The live view of a job: `show(job)` for every change. */
export function progressView(request, usual) {
  const element = h("div", {});
  const past = [];
  const gains = [];
  const remember = (p, spent) => {
    const words = stageWords(p.stage);
    if (past.at(-1)?.words !== words) past.push({ words, at: spent });
    if (p.best && gains.at(-1) !== p.best) gains.push(p.best);
  };
  const now = (job) => {
    const p = job.progress;
    if (job.num_tasks > 1) return `${job.num_done} of ${job.num_tasks} tasks are done.`;
    if (!p) return job.state === "queued" ? "Waiting for a free place." : "Starting.";
    return `Now: ${stageWords(p.stage)}${p.total > 0 ? ` (${p.done} of ${p.total})` : ""}.`;
  };

  function show(job) {
    const spent = job.started_ms ? Date.now() - job.started_ms : 0;
    if (job.progress) remember(job.progress, spent);
    const part = partDone(job, request);
    fill(
      element,
      h(
        "p",
        { role: "status" },
        now(job),
        job.progress?.best ? ` Best gain so far ${digits(job.progress.best, 3)}.` : "",
      ),
      h("progress", { max: 1, value: part ?? undefined, "aria-label": "Progress of the whole job" }),
      h(
        "p",
        { class: "quiet" },
        [
          part !== null && `${Math.round(100 * part)} % of the whole`,
          job.started_ms && `${duration(spent)} so far`,
          leftWords(left(part, spent, usual)),
        ]
          .filter(Boolean)
          .join(" · "),
      ),
      gains.length > 1 &&
        h(
          "p",
          { class: "quiet" },
          `Gains found: ${gains
            .slice(-8)
            .map((v) => digits(v, 3))
            .join(" → ")}`,
        ),
      past.length > 1 &&
        h(
          "details",
          {},
          h("summary", {}, "What it has done"),
          h(
            "ol",
            { class: "quiet" },
            past.slice(-12).map((one) => h("li", {}, `after ${duration(one.at)}: ${one.words}`)),
          ),
        ),
    );
  }
  return { element, show };
}

/** What jobs of a kind usually take, milliseconds; nothing where none has ended. */
export function usualTime(jobs, kind) {
  const times = jobs
    .filter((j) => j.kind === kind && j.state === "succeeded" && j.started_ms)
    .map((j) => j.finished_ms - j.started_ms)
    .filter((ms) => ms > 1000)
    .sort((a, b) => a - b);
  return times.length ? times[Math.floor(times.length / 2)] : null;
}
