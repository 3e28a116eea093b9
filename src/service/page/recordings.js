// Recordings: dropped or chosen, looked at, kept; then one or several are calibrated on or diagnosed.

import { Failure, getJson, remove, upload } from "./api.js";
import { fill, h, say, sheet } from "./dom.js";
import { dropPlace, unpacked } from "./drop.js";
import { foreignForm, isForeign } from "./foreign.js";
import { keptFiles, look } from "./look.js";
import { digits, many, plain } from "./numbers.js";
import { table } from "./parts.js";
import { starters } from "./recording_starters.js";
import { tar } from "./tar.js";
import { askName, recordingName } from "./titles.js";

export async function recordingsView(content, signal) {
  const library = await getJson("/v1/library");
  const state = { recordings: [], text: "", chosen: new Set(), content: () => [] };
  const list = h("div", {});
  const together = h("div", {});
  const view = h("div", {});
  const problem = h("div", { role: "alert" });
  const fail = (error) =>
    fill(
      problem,
      h("p", { class: "bad" }, error instanceof Failure ? `${error.problem.title}. ${error.message}` : error.message),
      (error.problem?.errors ?? []).map((e) => h("p", { class: "bad" }, `${e.pointer}: ${e.detail}`)),
    );

  const fits = (r) => recordingName(r).toLowerCase().includes(state.text.toLowerCase());
  function draw() {
    const shown = state.recordings.filter(fits);
    fill(
      list,
      shown.length > 0
        ? shown.map(entry)
        : h(
            "p",
            { class: "quiet" },
            state.recordings.length === 0 ? "No recordings yet." : "No recording fits the filter.",
          ),
    );
  }
  function drawTogether() {
    const ids = [...state.chosen];
    fill(
      together,
      ids.length > 1 &&
        sheet(
          `${ids.length} recordings together: one material`,
          starters(library, () => ids, fail),
        ),
    );
  }
  const load = async () => {
    const { recordings } = await getJson("/v1/recordings");
    if (signal.aborted) return;
    state.recordings = recordings;
    draw();
  };

  /** Shows a recording; `read` gives its files. */
  async function show(read) {
    fill(problem);
    try {
      fill(view, await look(await read()));
    } catch (error) {
      fill(view);
      fail(error);
    }
  }
  async function take(files) {
    fill(problem);
    try {
      const found = await unpacked(files);
      keepButton.disabled = found.length === 0;
      state.content = () => found;
      if (isForeign(found)) {
        const form = foreignForm(found, library);
        state.content = form.content;
        fill(view, form.element);
      } else if (found.length > 0) await show(() => found);
    } catch (error) {
      fail(error);
    }
  }
  const input = h("input", {
    type: "file",
    webkitdirectory: true,
    multiple: true,
    id: "recording",
    onchange: () => take([...input.files]),
  });
  const zipInput = h("input", {
    type: "file",
    accept: ".zip",
    id: "recording-zip",
    onchange: () => take([...zipInput.files]),
  });
  const filesInput = h("input", {
    type: "file",
    accept: ".mat,.nii,.gz,.csv,.txt",
    multiple: true,
    id: "recording-files",
    onchange: () => take([...filesInput.files]),
  });
  const keepButton = h(
    "button",
    {
      type: "button",
      class: "main",
      disabled: true,
      onclick: async () => {
        fill(problem);
        keepButton.disabled = true;
        try {
          await upload("/v1/recordings", await tar(state.content()));
          say("Kept.");
          fill(view);
          await load();
        } catch (error) {
          fail(error);
          keepButton.disabled = false;
        }
      },
    },
    "Upload",
  );
  const place = h(
    "div",
    { class: "drop" },
    h("p", {}, "Drop a recording's folder or zip file here, or files of another program, or choose them."),
    h(
      "div",
      { class: "row" },
      h("label", { for: "recording" }, "Folder", input),
      h("label", { for: "recording-zip" }, "Zip file", zipInput),
      h("label", { for: "recording-files" }, "MATLAB, NIfTI or tables", filesInput),
      keepButton,
    ),
  );
  dropPlace(place, take);

  function entry(recording) {
    const { summary } = recording;
    const name = recordingName(recording);
    const erase = async () => {
      if (!confirm(`Delete ${name}? Results of jobs that read it stay.`)) return;
      try {
        await remove(`/v1/recordings/${recording.id}`);
        say("Deleted.");
        state.chosen.delete(recording.id);
        await load();
      } catch (error) {
        fail(error);
      }
    };
    const choose = (event) => {
      if (event.target.checked) state.chosen.add(recording.id);
      else state.chosen.delete(recording.id);
      drawTogether();
    };
    return h(
      "section",
      { class: "sheet" },
      h(
        "div",
        { class: "row end" },
        h("h3", {}, name),
        h(
          "div",
          { class: "row tight" },
          !summary.is_raw &&
            h(
              "label",
              { class: "tick" },
              h("input", { type: "checkbox", checked: state.chosen.has(recording.id), onchange: choose }),
              "with others",
            ),
          h(
            "button",
            {
              type: "button",
              class: "look",
              onclick: async () => {
                await show(() => keptFiles(recording.id));
                view.scrollIntoView({ block: "start" });
              },
            },
            "Look",
          ),
          h(
            "button",
            {
              type: "button",
              onclick: () => {
                if (askName(recording.id, name)) draw();
              },
            },
            "Rename",
          ),
          h("button", { type: "button", onclick: erase }, "Delete"),
        ),
      ),
      h(
        "p",
        { class: "quiet" },
        `${summary.specimen.name} · ${summary.shape.join(" × ")} voxels of ` +
          `${summary.voxel_mm.map((v) => plain(v, 3)).join(" × ")} mm, ` +
          `${many(summary.num_voxels)} of them material · ${digits(recording.num_bytes / 1e6, 2)} MB` +
          `${summary.is_raw ? " · raw phases" : ""}`,
      ),
      table(
        ["Drive, mm", "Force, N"],
        summary.steps.map((s) => [plain(s.drive_mm, 4), digits(s.force_n)]),
      ),
      starters(library, () => [recording.id], fail, summary.is_raw),
    );
  }

  fill(
    content,
    h("h2", {}, "Recordings"),
    sheet(
      "Upload a recording",
      h(
        "p",
        { class: "quiet" },
        "A folder, or a zip file of one, with recording.json and its images: displacements, or raw phases. It is " +
          "shown first; the service reads and checks it before it keeps it. MATLAB files, images of other programs and " +
          "tables of points become such a recording here, too; the files of scanners by lambdak import.",
      ),
      place,
      problem,
    ),
    view,
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
    ),
    together,
    list,
  );
  await load();
}
