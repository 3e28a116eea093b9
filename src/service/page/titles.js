// What jobs and recordings are called: by their specimen or recording, or as somebody named them in this browser.

import { getJson } from "./api.js";

const KEY = "lambdak names";

function named() {
  try {
    return JSON.parse(localStorage.getItem(KEY)) ?? {};
  } catch {
    return {};
  }
}

/** Names something in this browser; an empty name takes the name back. */
function rename(id, name) {
  const all = named();
  if (name) all[id] = name;
  else delete all[id];
  try {
    localStorage.setItem(KEY, JSON.stringify(all));
  } catch {
    /* a browser may keep nothing */
  }
}

let recordings = new Map();

/** Learns the titles of the recordings, which jobs name by their identifiers. */
export async function learnTitles() {
  const list = (await getJson("/v1/recordings")).recordings;
  recordings = new Map(list.map((r) => [r.id, r.title || r.id.slice(0, 12)]));
}

/** A recording's name. */
export const recordingName = (recording) => named()[recording.id] ?? (recording.title || recording.id.slice(0, 12));

/** A job's name: recordings stand in it by their titles. */
export function jobName(job) {
  if (named()[job.id]) return named()[job.id];
  const title = job.title || job.id.slice(0, 8);
  return title.replace(/[0-9a-f]{64}/g, (id) => named()[id] ?? recordings.get(id) ?? id.slice(0, 12));
}

/** Asks for a new name; whether there is one now. */
export function askName(id, now) {
  const name = prompt("Name in this browser (empty: the name it came with)", now);
  if (name === null) return false;
  rename(id, name.trim());
  return true;
}
