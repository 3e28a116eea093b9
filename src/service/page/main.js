// The page: one view per address after the hash.

import { getJson } from "./api.js";
import { compareView } from "./compare.js";
import { fill, h } from "./dom.js";
import { planView } from "./plan.js";
import { jobView } from "./job.js";
import { jobsView } from "./jobs.js";
import { recordingsView } from "./recordings.js";

const content = document.getElementById("content");
let leave = new AbortController();

/** Views that stand under another one in the navigation. */
const UNDER = { job: "jobs", compare: "jobs" };

async function show() {
  leave.abort();
  leave = new AbortController();
  const [, view = "plan", ...rest] = location.hash.split("/");
  const id = rest.join("/");
  for (const link of document.querySelectorAll("nav a")) {
    const isHere = link.hash === `#/${UNDER[view] ?? view}`;
    if (isHere) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  fill(content, h("p", { class: "quiet" }, "Loading …"));
  try {
    if (view === "job" && id) await jobView(content, id, leave.signal);
    else if (view === "compare") await compareView(content, id);
    else if (view === "recordings") await recordingsView(content, leave.signal);
    else if (view === "jobs") await jobsView(content, leave.signal);
    else await planView(content, leave.signal, id);
  } catch (error) {
    fill(content, h("h2", {}, "This did not work"), h("p", { class: "bad" }, error.message));
  }
}

addEventListener("hashchange", () => {
  show().then(() => content.focus());
});
show();
getJson("/v1/me").then(
  (me) => {
    document.getElementById("who").textContent = me.needs_token
      ? `${me.name} (${me.role}) · ${me.version}`
      : `lambdak ${me.version}`;
  },
  () => {},
);
