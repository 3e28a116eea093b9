// The service: JSON calls, event streams with polling as fallback. The token stays in this tab.

import { h } from "./dom.js";

let token = sessionStorage.getItem("token") ?? "";

export class Failure extends Error {
  constructor(problem) {
    super(problem.detail || problem.title);
    this.problem = problem;
  }
}

function headers(more = {}) {
  return token ? { ...more, authorization: `Bearer ${token}` } : more;
}

async function send(path, options = {}) {
  const answer = await fetch(path, { ...options, headers: headers(options.headers) });
  if (answer.status === 401) {
    await askToken(token ? (await answer.json().catch(() => ({}))).detail : "");
    return send(path, options);
  }
  if (!answer.ok) {
    let problem;
    try {
      problem = await answer.json();
    } catch {
      problem = { title: answer.statusText, detail: `status ${answer.status}`, errors: [] };
    }
    throw new Failure(problem);
  }
  return answer;
}

let asking;
/** Asks for a token, once at a time; `wrong` says what is wrong with the one that was sent. */
function askToken(wrong) {
  asking ??= new Promise((resolve) => {
    const input = h("input", { type: "password", autocomplete: "off", required: true });
    const dialog = h(
      "dialog",
      {},
      h(
        "form",
        {
          method: "dialog",
          onsubmit: () => {
            token = input.value.trim();
            sessionStorage.setItem("token", token);
            dialog.remove();
            asking = undefined;
            resolve();
          },
        },
        h("h3", {}, "A token is needed"),
        wrong && h("p", { class: "bad", role: "alert" }, wrong),
        h("p", { class: "quiet" }, "The person who runs this service makes one with lambdak serve --add-token."),
        h("label", {}, "Token", input),
        h("p", {}, h("button", { class: "main" }, "Go on")),
      ),
    );
    dialog.addEventListener("cancel", (event) => event.preventDefault());
    document.body.append(dialog);
    dialog.showModal();
  });
  return asking;
}

export const getJson = async (path) => (await send(path)).json();
export const getBlob = async (path) => (await send(path)).blob();
export const post = async (path, body, more = {}) =>
  (
    await send(path, {
      method: "POST",
      headers: { "content-type": "application/json", ...more },
      body: JSON.stringify(body ?? {}),
    })
  ).json();

export const upload = async (path, blob) =>
  (await send(path, { method: "POST", headers: { "content-type": "application/x-tar" }, body: blob })).json();

export const remove = (path) => send(path, { method: "DELETE" });

const hasEnded = (job) => !["queued", "running"].includes(job.state);

/** Follows a job until it ends or `signal` aborts: `show(job)` for every change. */
export async function follow(id, show, signal) {
  while (!signal.aborted) {
    try {
      const answer = await send(`/v1/jobs/${id}/events`, { signal });
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (;;) {
        const { value, done } = await reader.read();
        if (done) break;
        rest += value;
        const events = rest.split("\n\n");
        rest = events.pop();
        for (const event of events) {
          const data = event
            .split("\n")
            .filter((l) => l.startsWith("data: "))
            .map((l) => l.slice(6))
            .join("");
          if (!data || !event.includes("event: job")) continue;
          const job = JSON.parse(data);
          show(job);
          if (hasEnded(job)) return;
        }
      }
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof Failure && error.problem.status === 404) throw error;
    }
    // Streams may not pass here: poll, then try again.
    for (let count = 0; count < 10 && !signal.aborted; count += 1) {
      await new Promise((resolve) => setTimeout(resolve, 1000));
      try {
        const job = await getJson(`/v1/jobs/${id}`);
        show(job);
        if (hasEnded(job)) return;
      } catch {
        /* the service may be restarting */
      }
    }
  }
}

/** Offers a blob as a file. */
export function save(blob, name) {
  const url = URL.createObjectURL(blob);
  const link = h("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 60000);
}

/** Offers a file of the service for download. */
export const download = async (path, name) => save(await getBlob(path), name);
