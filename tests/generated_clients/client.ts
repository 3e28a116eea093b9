// A program's way through the service with the types that openapi-typescript writes of its document: upload a
// recording, calibrate on it, diagnose it, download every file.
//
//     node client.js http://127.0.0.1:8080 RECORDING.tar
//
// Needs openapi-fetch and the generated file schema.d.ts.

import { createHash } from "node:crypto";
import { readFile } from "node:fs/promises";
import createClient from "openapi-fetch";
import type { components, paths } from "./schema.js";

type Job = components["schemas"]["JobView"];

const LONG_MS = 600_000;
const [address, tar] = process.argv.slice(2);
if (!address || !tar) throw new Error("give an address and a tar file");
const client = createClient<paths>({ baseUrl: address });

/** What a call gave; its problem is an error. */
function given<T>({ data, error }: { data?: T; error?: components["schemas"]["Problem"] }): T {
  if (error) throw new Error(`${error.title}: ${error.detail}`);
  if (data === undefined) throw new Error("no content");
  return data;
}

/** The job, once it has succeeded. */
async function finished(started: Job): Promise<Job> {
  const end = Date.now() + LONG_MS;
  let job = started;
  while (job.state === "queued" || job.state === "running") {
    if (Date.now() > end) throw new Error(`${job.id} still runs`);
    await new Promise((resolve) => setTimeout(resolve, 200));
    job = given(await client.GET("/v1/jobs/{id}", { params: { path: { id: job.id } } }));
  }
  if (job.state !== "succeeded") throw new Error(job.problem?.detail ?? job.state);
  return job;
}

/** Every file of the job, each as long and with the content that the list promises; how many there are. */
async function downloaded(job: Job): Promise<number> {
  const { artefacts } = given(await client.GET("/v1/jobs/{id}/artefacts", { params: { path: { id: job.id } } }));
  for (const file of artefacts) {
    const path = { id: job.id, name: file.name };
    const got = await client.GET("/v1/jobs/{id}/artefacts/{name}", { params: { path }, parseAs: "arrayBuffer" });
    const content = new Uint8Array(given(got) as unknown as ArrayBuffer);
    const sha256 = createHash("sha256").update(content).digest("hex");
    if (content.length !== file.num_bytes || sha256 !== file.sha256) throw new Error(`${file.name} is another file`);
  }
  return artefacts.length;
}

const bytes = await readFile(tar);
const kept = given(
  await client.POST("/v1/recordings", {
    // The document calls the body binary, which TypeScript has no type for.
    body: bytes as unknown as string,
    bodySerializer: (body) => body as unknown as Uint8Array<ArrayBuffer>,
    headers: { "content-type": "application/octet-stream" },
  }),
);

const calibration = await finished(
  accepted(
    await client.POST("/v1/calibrations", {
      body: { recordings: [kept.id], num_terms: 1, mesh_factor: 4, has_mesh_allowance: false, num_starts: 1 },
    }),
  ),
);
const found = given(await client.GET("/v1/jobs/{id}/result", { params: { path: { id: calibration.id } } }));
if (found.schema !== "calibration/1") throw new Error(`a calibration gave ${found.schema}`);
const modulus = found.initial_shear_modulus_kpa?.value ?? 0;
if (!(modulus > 0)) throw new Error(`the modulus is ${modulus}`);

const diagnosis = await finished(
  accepted(await client.POST("/v1/diagnoses", { body: { recording: kept.id, mesh_factor: 4, max_causes: 1 } })),
);
const what = given(await client.GET("/v1/jobs/{id}/result", { params: { path: { id: diagnosis.id } } }));
if (what.schema !== "diagnosis/1") throw new Error(`a diagnosis gave ${what.schema}`);

const count = (await downloaded(calibration)) + (await downloaded(diagnosis));
if (count <= 10) throw new Error(`only ${count} files`);
console.log(
  `openapi-typescript: uploaded, calibrated (${modulus.toFixed(2)} kPa), diagnosed (${what.verdict}), ` +
    `downloaded ${count} files`,
);

/** The job that a request started; the other answer of these addresses is that of a dry run. */
function accepted(got: {
  data?: Job | components["schemas"]["Estimate"];
  error?: components["schemas"]["Problem"];
}): Job {
  const data = given(got);
  if (!("id" in data)) throw new Error("nothing was started");
  return data;
}
