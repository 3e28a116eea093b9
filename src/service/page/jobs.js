// The list of jobs: found by name, kind and state; named, compared and deleted.

import { getJson, post, remove } from "./api.js";
import { fill, h, say } from "./dom.js";
import { partDone } from "./progress.js";
import { askName, jobName, learnTitles } from "./titles.js";
import { KINDS } from "./words.js";

const when = (ms) => new Date(ms).toLocaleString("en-GB", { dateStyle: "short", timeStyle: "medium" });
export const badge = (state) => h("span", { class: `state ${state}` }, state);
export const isOpen = (job) => ["queued", "running"].includes(job.state);
const STATES = ["queued", "running", "succeeded", "failed", "cancelled"];

function howFar(job) {
  const part = isOpen(job) ? partDone(job) : null;
  if (job.num_tasks > 1) return `${job.num_done} / ${job.num_tasks} tasks`;
  return part === null ? "" : `${Math.round(100 * part)} %`;
}

export async function jobsView(content, signal) {
  await learnTitles().catch(() => {});
  const state = { jobs: [], next: null, text: "", kind: "", state: "", chosen: new Set() };
  const body = h("tbody", {});
  const older = h("button", { type: "button", onclick: () => load(state.next) }, "Older jobs");
  const compare = h(
    "button",
    {
      type: "button",
      id: "compare",
      onclick: () => {
        location.hash = `#/compare/${[...state.chosen].join(",")}`;
      },
    },
    "Compare",
  );

  const act = async (work, word) => {
    try {
      await work();
      say(word);
    } catch (error) {
      say(error.message);
    }
    refresh().catch(() => {});
  };
  const deleted = (job) =>
    confirm(`Delete ${jobName(job)} with its results and files?`) &&
    act(() => remove(`/v1/jobs/${job.id}`), "Deleted.");
  const button = (label, job, onclick) =>
    h("button", { type: "button", onclick, "aria-label": `${label} ${jobName(job)}` }, label);

  const line = (job) =>
    h(
      "tr",
      {},
      h(
        "td",
        {},
        job.state === "succeeded" &&
          h("input", {
            type: "checkbox",
            checked: state.chosen.has(job.id),
            "aria-label": `Choose ${jobName(job)} to compare`,
            onchange: (e) => {
              if (e.target.checked) state.chosen.add(job.id);
              else state.chosen.delete(job.id);
              tell();
            },
          }),
      ),
      h("td", {}, h("a", { href: `#/job/${job.id}` }, jobName(job))),
      h("td", {}, KINDS[job.kind] ?? job.kind),
      h("td", {}, badge(job.state)),
      h("td", {}, howFar(job)),
      h("td", {}, job.owner),
      h("td", {}, when(job.created_ms)),
      h("td", {}, job.version),
      h(
        "td",
        {},
        h(
          "div",
          { class: "row tight" },
          isOpen(job) && button("Cancel", job, () => act(() => post(`/v1/jobs/${job.id}/cancel`), "Cancelled.")),
          ["failed", "cancelled"].includes(job.state) &&
            button("Resume", job, () => act(() => post(`/v1/jobs/${job.id}/resume`), "Back in the queue.")),
          button("Rename", job, () => {
            if (askName(job.id, jobName(job))) draw();
          }),
          !isOpen(job) && button("Delete", job, () => deleted(job)),
        ),
      ),
    );

  const fits = (job) =>
    (!state.kind || job.kind === state.kind) &&
    (!state.state || job.state === state.state) &&
    jobName(job).toLowerCase().includes(state.text.toLowerCase());
  function tell() {
    compare.disabled = state.chosen.size < 2;
    compare.textContent =
      state.chosen.size < 2 ? "Compare (choose two or more)" : `Compare ${state.chosen.size} results`;
  }
  function draw() {
    const shown = state.jobs.filter(fits);
    const none = state.jobs.length === 0 ? "No jobs yet." : "No job fits the filter.";
    fill(body, shown.length > 0 ? shown.map(line) : h("tr", {}, h("td", { colspan: 9, class: "quiet" }, none)));
    older.hidden = !state.next;
    tell();
  }
  async function load(before) {
    const page = await getJson(`/v1/jobs?limit=50${before ? `&before=${before}` : ""}`);
    state.jobs.push(...page.jobs);
    state.next = page.next;
    draw();
  }
  async function refresh() {
    const page = await getJson("/v1/jobs?limit=50");
    if (signal.aborted) return;
    const last = page.jobs.at(-1)?.created_ms ?? Infinity;
    state.jobs = [
      ...page.jobs,
      ...state.jobs.filter((j) => j.created_ms < last && !page.jobs.some((p) => p.id === j.id)),
    ];
    draw();
  }

  const pick = (label, options, key) =>
    h(
      "label",
      {},
      label,
      h(
        "select",
        {
          onchange: (e) => {
            state[key] = e.target.value;
            draw();
          },
        },
        options.map(([value, text]) => h("option", { value }, text)),
      ),
    );
  fill(
    content,
    h("h2", {}, "Jobs"),
    h(
      "section",
      { class: "sheet" },
      h(
        "div",
        { class: "fields" },
        h(
          "label",
          {},
          "Name contains",
          h("input", {
            type: "search",
            oninput: (e) => {
              state.text = e.target.value;
              draw();
            },
          }),
        ),
        pick("Kind", [["", "every kind"], ...Object.entries(KINDS)], "kind"),
        pick("State", [["", "every state"], ...STATES.map((s) => [s, s])], "state"),
      ),
      h("p", {}, compare),
      h(
        "div",
        { class: "scroll", tabindex: 0, role: "region", "aria-label": "Jobs" },
        h(
          "table",
          {},
          h(
            "thead",
            {},
            h(
              "tr",
              {},
              [
                h("span", { class: "hidden" }, "Compare"),
                "Job",
                "Kind",
                "State",
                "Done",
                "By",
                "Submitted",
                "Version",
                h("span", { class: "hidden" }, "Actions"),
              ].map((t) => h("th", { scope: "col" }, t)),
            ),
          ),
          body,
        ),
      ),
      h("p", {}, older),
    ),
  );
  await load();
  const timer = setInterval(() => {
    if (!body.contains(document.activeElement)) refresh().catch(() => {});
  }, 3000);
  signal.addEventListener("abort", () => clearInterval(timer));
}
