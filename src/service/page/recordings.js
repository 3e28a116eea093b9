// Recordings: upload a folder, look at what it holds, calibrate on it, diagnose it.

import { Failure, getJson, post, remove, upload } from "./api.js";
import { fill, h, say } from "./dom.js";
import { digits } from "./numbers.js";

/** A tar file of plain files. */
async function tar(files) {
  const parts = [];
  for (const file of files) {
    const header = new Uint8Array(512);
    const put = (at, text) => header.set(new TextEncoder().encode(text), at);
    put(0, file.name);
    put(100, "0000644\0");
    put(124, file.size.toString(8).padStart(11, "0"));
    put(148, "        ");
    put(156, "0");
    put(257, "ustar\u000000");
    put(148, `${header.reduce((a, b) => a + b, 0).toString(8).padStart(6, "0")}\0 `);
    parts.push(header, file, new Uint8Array((512 - (file.size % 512)) % 512));
  }
  parts.push(new Uint8Array(1024));
  return new Blob(parts, { type: "application/x-tar" });
}

export async function recordingsView(content, signal) {
  const library = await getJson("/v1/library");
  const list = h("div", {});
  const problem = h("div", { role: "alert" });
  const input = h("input", { type: "file", webkitdirectory: true, multiple: true, id: "recording" });
  const show = async () => {
    const { recordings } = await getJson("/v1/recordings");
    if (signal.aborted) return;
    fill(list, recordings.length === 0 ? h("p", { class: "quiet" }, "No recordings yet.") : recordings.map(entry));
  };
  const fail = (error) => fill(problem, h("p", { class: "bad" }, error instanceof Failure ? `${error.problem.title}. ${error.message}` : error.message));
  const send = async (event) => {
    fill(problem);
    const files = [...input.files].filter((f) => !f.name.startsWith("."));
    if (files.length === 0) { say("Choose the recording's folder first."); return; }
    event.target.disabled = true;
    try { await upload("/v1/recordings", await tar(files)); say("Kept."); await show(); } catch (error) { fail(error); }
    event.target.disabled = false;
  };

  function entry(recording) {
    const { summary } = recording;
    const material = h("select", { "aria-label": "Material as believed" }, h("option", { value: "" }, "material unknown"), library.materials.map((m, i) => h("option", { value: i }, m.name)));
    const mesh = h("select", { "aria-label": "Mesh" }, [["", "default mesh"], ["2", "coarse mesh"], ["1", "standard mesh"]].map(([v, t]) => h("option", { value: v }, t)));
    const terms = h("select", { "aria-label": "Number of terms" }, [["", "number of terms: chosen"], ["1", "one term"], ["2", "two terms"], ["3", "three terms"]].map(([v, t]) => h("option", { value: v }, t)));
    const start = (kind, body) => async (event) => {
      event.target.disabled = true;
      try { location.hash = `#/job/${(await post(`/v1/${kind}`, body())).id}`; } catch (error) { fail(error); event.target.disabled = false; }
    };
    const factor = () => (mesh.value === "" ? {} : { mesh_factor: Number(mesh.value) });
    const calibrate = start("calibrations", () => ({ recordings: [recording.id], ...(terms.value === "" ? {} : { num_terms: Number(terms.value) }), ...factor() }));
    const diagnose = start("diagnoses", () => ({ recording: recording.id, ...(material.value === "" ? {} : { material: library.materials[Number(material.value)].material }), ...factor() }));
    return h("section", { class: "sheet" },
      h("h3", {}, recording.title || recording.id.slice(0, 12)),
      h("p", { class: "quiet" }, `${summary.specimen.name} · ${summary.shape.join(" × ")} voxels of ${summary.voxel_mm.map((v) => digits(v)).join(" × ")} mm, ${summary.num_voxels.toLocaleString("en")} of them material · ${(recording.num_bytes / 1e6).toFixed(1)} MB`),
      h("div", { class: "scroll" }, h("table", {}, h("thead", {}, h("tr", {}, ["Drive, mm", "Force, N"].map((t) => h("th", {}, t)))),
        h("tbody", {}, summary.steps.map((s) => h("tr", {}, h("td", {}, digits(s.drive_mm)), h("td", {}, digits(s.force_n))))))),
      h("div", { class: "row" }, h("div", {}, mesh)),
      h("div", { class: "row" }, h("button", { class: "main calibrate", onclick: calibrate }, "Calibrate"), h("div", {}, terms)),
      h("div", { class: "row" }, h("button", { onclick: async () => {
        if (!confirm("Delete this recording? Results of jobs that read it stay.")) return;
        try { await remove(`/v1/recordings/${recording.id}`); say("Deleted."); await show(); } catch (error) { fail(error); }
      } }, "Delete")),
      h("div", { class: "row" }, h("button", { class: "main diagnose", onclick: diagnose }, "Diagnose"), h("div", {}, material)));
  }

  fill(content, h("h2", {}, "Recordings"),
    h("section", { class: "sheet" }, h("h3", {}, "Upload a recording"),
      h("p", { class: "quiet" }, "A folder with recording.json and its images. It is read and checked before it is kept."),
      h("div", { class: "row" }, h("label", { for: "recording" }, "Folder", input), h("button", { onclick: send }, "Upload")), problem),
    list);
  await show();
}
