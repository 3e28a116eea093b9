// Jobs: the list, and one job followed live.

import { download, follow, getJson, post, remove } from "./api.js";
import { digits, duration, fill, h, say } from "./dom.js";
import { resultView } from "./result.js";

const when = (ms) => new Date(ms).toLocaleString("en-GB", { dateStyle: "short", timeStyle: "medium" });
const badge = (state) => h("span", { class: `state ${state}` }, state);
const isOpen = (job) => ["queued", "running"].includes(job.state);

export async function jobsView(content, signal) {
  let before = null;
  const body = h("tbody", {});
  const more = h("button", { onclick: () => load() }, "Older jobs");
  const line = (job) => h("tr", {},
    h("td", {}, h("a", { href: `#/job/${job.id}` }, job.title || job.id.slice(0, 8))),
    h("td", {}, job.kind), h("td", {}, badge(job.state)), h("td", { class: "number" }, `${job.num_done} / ${job.num_tasks}`),
    h("td", {}, job.owner), h("td", {}, when(job.created_ms)),
    h("td", {}, isOpen(job) ? h("button", { onclick: () => act(job, "cancel") }, "Cancel")
      : ["failed", "cancelled"].includes(job.state) ? h("button", { onclick: () => act(job, "resume") }, "Resume") : null));
  const act = async (job, verb) => {
    try { await post(`/v1/jobs/${job.id}/${verb}`); say(verb === "cancel" ? "Cancelled." : "Back in the queue."); } catch (error) { say(error.message); }
    refresh();
  };
  async function load() {
    const page = await getJson(`/v1/jobs?limit=50${before ? `&before=${before}` : ""}`);
    body.append(...page.jobs.map(line));
    before = page.next;
    more.hidden = !before;
    if (body.childElementCount === 0) fill(body, h("tr", {}, h("td", { colspan: 7, class: "quiet" }, "No jobs yet.")));
  }
  async function refresh() {
    if (before === null || body.childElementCount <= 50) {
      const page = await getJson("/v1/jobs?limit=50");
      if (!signal.aborted && page.jobs.length) fill(body, page.jobs.map(line));
    }
  }
  fill(content, h("h2", {}, "Jobs"),
    h("section", { class: "sheet scroll" }, h("table", {}, h("thead", {}, h("tr", {}, ["Job", "Kind", "State", "Tasks", "By", "Submitted", ""].map((t) => h("th", {}, t)))), body), h("p", {}, more)));
  await load();
  const timer = setInterval(() => { if (!body.contains(document.activeElement)) refresh().catch(() => {}); }, 3000);
  signal.addEventListener("abort", () => clearInterval(timer));
}

export async function jobView(content, id, signal) {
  const first = await getJson(`/v1/jobs/${id}`);
  const head = h("section", { class: "sheet" });
  const result = h("div", {});
  const history = [];
  fill(content, h("h2", {}, first.title || "Job"), head, result);
  let shown = "";

  const act = (verb, word) => async () => {
    try { await post(`/v1/jobs/${id}/${verb}`); say(word); if (verb === "resume") jobView(content, id, signal); } catch (error) { say(error.message); }
  };
  const show = (job) => {
    const p = job.progress;
    if (p?.best && history.at(-1) !== p.best) history.push(p.best);
    const share = job.num_tasks > 1 ? [job.num_done, job.num_tasks] : p && p.total > 0 ? [p.done, p.total] : null;
    const end = job.finished_ms ?? Date.now();
    fill(head,
      h("div", { class: "row end" },
        h("div", { class: "row" }, badge(job.state), h("span", { class: "quiet" }, job.kind), job.started_ms && h("span", { class: "quiet" }, duration(Math.max(0, end - job.started_ms)))),
        h("div", { class: "row" },
          isOpen(job) && h("button", { onclick: act("cancel", "Cancelled; what was found is kept.") }, "Cancel"),
          ["failed", "cancelled"].includes(job.state) && h("button", { onclick: act("resume", "Back in the queue.") }, "Resume"),
          !isOpen(job) && h("button", { id: "delete", onclick: async () => {
            if (!confirm("Delete this job with its results and files?")) return;
            try { await remove(`/v1/jobs/${id}`); say("Deleted."); location.hash = "#/jobs"; } catch (error) { say(error.message); }
          } }, "Delete"),
          h("button", { onclick: async () => { try { await navigator.clipboard.writeText(location.href); say("The link is copied."); } catch { say(location.href); } } }, "Copy link"),
          ["evaluations", "designs"].includes(job.kind) && h("a", { class: "button", href: `#/plan/${id}` }, "Plan from here"))),
      isOpen(job) && share && h("div", {},
        h("p", { role: "status" }, job.num_tasks > 1 ? `${share[0]} of ${share[1]} tasks` : `${p.stage}: ${share[0]} of ${share[1]}`, p?.best ? `, best gain so far ${digits(p.best)}` : ""),
        h("progress", { max: share[1], value: share[0], "aria-label": "Progress" })),
      isOpen(job) && !share && p && h("p", { role: "status" }, p.stage),
      isOpen(job) && !share && !p && h("p", { class: "quiet", role: "status" }, job.state === "queued" ? "Waiting for a free place." : "Starting."),
      history.length > 1 && isOpen(job) && h("p", { class: "quiet" }, `Best gain: ${history.map((v) => digits(v)).join(" → ")}`),
      job.problem && h("div", { role: "alert" }, h("p", { class: "bad" }, `${job.problem.title}. ${job.problem.detail}`)));
    if (job.state === "succeeded" && shown !== job.state) {
      shown = job.state;
      resultView(result, job, download).catch((error) => fill(result, h("p", { class: "bad" }, error.message)));
    }
  };
  show(first);
  if (isOpen(first)) follow(id, show, signal).catch((error) => say(error.message));
}
