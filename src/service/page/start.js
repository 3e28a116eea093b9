// Starts jobs: a button that posts a request and goes to the job.

import { post } from "./api.js";
import { h, say } from "./dom.js";

/** Posts a request; the page goes to its job. */
export async function startJob(kind, body) {
  const key = crypto.randomUUID?.() ?? String(Math.random()).slice(2);
  const job = await post(`/v1/${kind}`, body, { "idempotency-key": key });
  location.hash = `#/job/${job.id}`;
}

/** A button that starts a job; `body` makes its request. */
export function startButton(label, kind, body, attributes = { class: "main" }) {
  return h(
    "button",
    {
      type: "button",
      ...attributes,
      onclick: async (event) => {
        const button = event.currentTarget;
        button.disabled = true;
        try {
          await startJob(kind, body());
        } catch (error) {
          say(error.message);
          button.disabled = false;
        }
      },
    },
    label,
  );
}
