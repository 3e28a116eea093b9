// How far a job is: the whole of it, what it does now, and how long it will take.

import { fill, h } from "./dom.js";
import { digits, duration, farthest, plain } from "./numbers.js";
import { sectionPicture } from "./section_drawing.js";

/** Stages of a design search in their order: words, and how much work each is by the study's budget. */
const SEARCH = {
  explore: ["sampling designs all over the space", (b) => b.explore ?? 40],
  propose: ["improving designs by what the ones before have taught", (b) => b.propose ?? 0],
  refine: ["improving the best designs by gradients", (b) => (b.refine ?? 0) * (b.iterations ?? 6)],
  confirm: ["confirming the best designs on the standard mesh", (b) => 6 * (b.confirm ?? 4)],
  repair: ["repairing designs that missed a limit", () => 4],
  verify: ["calibrating on synthetic noisy scans", (b, draws) => 10 * draws],
};

/** Stages of a diagnosis: a pattern, and the part of the whole that is done by then; `n` is the round of the search. */
const byRound = (n) => 0.15 + 0.6 * (1 - 0.6 ** (n - 1));
const DIAGNOSIS = [
  [/^fitting the nominal model/, () => 0.02],
  [/^reading the load curve/, () => 0.04],
  [/^predicting on a finer mesh/, () => 0.06],
  [/^interior test/, () => 0.1],
  [/^round (\d+): testing/, byRound],
  [/^round (\d+): fitting/, (n) => byRound(n) + 0.1],
  [/^fitting the set-up as a whole/, () => 0.5],
  [/^testing whether the material is compressible/, () => 0.75],
  [/^correcting by a finer mesh/, () => 0.78],
  [/^predicting voxel blocks/, () => 0.92],
];

const WORDS = {
  solve: "solving for the equilibria",
  pictures: "drawing figures",
  "finer mesh": "fitting again on a finer mesh",
  "bound of kappa": "looking for the bound of κ",
  profiles: "following the profile likelihoods",
  contours: "drawing contours",
};

/** A stage of a calibration: the number of terms that is tried, or a fit with so many that has ended. */
function termWords(stage) {
  const [, n, has] = stage.match(/^(\d+) terms?( from)?/) ?? [];
  if (!n) return null;
  const terms = n === "1" ? "one term" : `${n} terms`;
  return has ? `fitting ${terms}: one of the starts has settled` : `fitting ${terms}`;
}

/** What a job does now, in words. */
const stageWords = (stage) => SEARCH[stage]?.[0] ?? WORDS[stage] ?? termWords(stage) ?? stage;

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

/** Several recordings are diagnosed one after the other, and it is not told which one it is. */
function diagnosisPart(progress, request) {
  if (request?.recordings?.length > 1) return null;
  for (const [pattern, part] of DIAGNOSIS) {
    const found = progress.stage.match(pattern);
    if (found) return part(Number(found[1] ?? 1));
  }
  return null;
}


/**
 * A calibration tries one number of terms after the other, each from some starts; then come a finer mesh, profiles and
 * contours where they are asked for. How much work each is: a fit with one term counts one.
 */
function calibrationPart(progress, request) {
  const most = request?.num_terms ?? 3;
  const later = 0.4 * (request?.num_starts ?? 3);
  const ofTerms = (n) => (n <= 0 ? 0 : 1 + later * (n - 1));
  const stages = [
    ["finer mesh", request?.has_mesh_allowance === false ? 0 : 1],
    ["bound of kappa", 0.2],
    ["profiles", request?.has_profiles ? 0.5 * (1 + 2 * most) : 0],
    ["contours", request?.has_contours ? 8 : 0],
  ];
  const whole = stages.reduce((sum, [, weight]) => sum + weight, ofTerms(most));
  const begun = progress.stage.match(/^(\d+) terms?( from)?/);
  if (begun) {
    const n = Math.min(Number(begun[1]), most);
    const within = begun[2] ? 0.5 * (ofTerms(n) - ofTerms(n - 1)) : 0;
    return (ofTerms(n - 1) + within) / whole;
  }
  let done = ofTerms(most);
  for (const [stage, weight] of stages) {
    if (stage === progress.stage) return done / whole;
    done += weight;
  }
  return null;
}

const PARTS = { designs: searchPart, diagnoses: diagnosisPart, calibrations: calibrationPart };

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
  if (ms < -2000) return "longer than earlier ones took";
  return ms < 2000 ? "almost done" : `about ${duration(ms)} left`;
}

/** The live view of a job: `show(job)` for every change. */
export function progressView(request, usual) {
  const element = h("div", {});
  const steps = h("ol", { class: "quiet" });
  const done = h("details", {}, h("summary", {}, "What it has done"), steps);
  const picture = h("div", {});
  const past = [];
  const gains = [];
  let drawn = "";
  let most = null; // What is done is not undone: a search that goes back a stage does not go back in the whole.
  const remember = (p, spent) => {
    const words = stageWords(p.stage);
    if (past.at(-1)?.words !== words) past.push({ words, at: spent });
    const gain = p.best ? digits(p.best, 3) : null;
    if (gain && gains.at(-1) !== gain) gains.push(gain);
    const best = JSON.stringify(p.best_specimen ?? null);
    if (p.best_specimen && best !== drawn) {
      drawn = best;
      const specimen = p.best_specimen;
      const drive = plain(farthest(specimen.drive_mm), 3);
      const holes = `${specimen.holes.length} ${specimen.holes.length === 1 ? "hole" : "holes"}`;
      const words = `The best design so far: ${holes}, drive ${drive} mm`;
      fill(picture, h("figure", { class: "best" }, sectionPicture(specimen, words), h("figcaption", {}, words)));
    }
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
    const reached = partDone(job, request);
    if (reached !== null) most = Math.max(most ?? 0, reached);
    const part = most;
    fill(
      steps,
      past.slice(-12).map((one) => h("li", {}, `after ${duration(one.at)}: ${one.words}`)),
    );
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
      gains.length > 1 && h("p", { class: "quiet" }, `Gains found: ${gains.slice(-8).join(" → ")}`),
      picture,
      past.length > 1 && done,
    );
  }
  return { element, show };
}

/** What `count` jobs of a kind usually take, milliseconds; nothing where none has ended. */
export function usualTime(jobs, kind, count) {
  const times = jobs
    .filter((j) => j.kind === kind && j.state === "succeeded" && j.started_ms)
    .map((j) => j.finished_ms - j.started_ms)
    .filter((ms) => ms > 1000)
    .sort((a, b) => a - b);
  return times.length ? count * times[Math.floor(times.length / 2)] : null;
}
