// A look at a recording before anything is fitted: its maps, drive by drive, and its load curve.

import { getBlob, getJson } from "./api.js";
import { h, sheet } from "./dom.js";
import { linePlot } from "./lines.js";
import { digits, plain } from "./numbers.js";
import { table } from "./parts.js";
import { slicesView } from "./slices.js";

/** Columns of a CSV file by their names. */
function columns(text) {
  const [head, ...rows] = text
    .trim()
    .split(/\r?\n/)
    .map((l) => l.split(","));
  return Object.fromEntries(head.map((name, i) => [name.trim(), rows.map((r) => Number(r[i]))]));
}

async function loadCurve(file, steps) {
  const { time_s: time, drive_mm: drive, force_n: force } = columns(await file.text());
  if (!time || !force) return null;
  const held = steps.filter((s) => Number.isFinite(s.force_n));
  const over = (list, marks, words) =>
    linePlot(
      list.map((v, i) => [v, force[i]]).filter((p) => p.every(Number.isFinite)),
      words,
      "force, N",
      marks,
    );
  return sheet(
    "The load cell",
    h(
      "div",
      { class: "halves" },
      over(
        time,
        held.filter((s) => s.window_s).map((s) => [(s.window_s[0] + s.window_s[1]) / 2, s.force_n]),
        "time, s",
      ),
      drive &&
        over(
          drive,
          held.map((s) => [s.drive_mm, s.force_n]),
          "drive, mm",
        ),
    ),
    h("p", { class: "quiet" }, "Dots are the forces that the recording gives for its drives."),
  );
}

/** A file of this computer as it is, one of the service by its address. */
const sourceOf = (file) => (file.href ? { href: file.href } : { blob: file });

/** The files of a recording that the service keeps: each is read when it is shown. */
export async function keptFiles(id) {
  const { artefacts } = await getJson(`/v1/recordings/${id}/files`);
  return artefacts.map(({ name, href, num_bytes: size }) => ({
    name,
    size,
    href,
    text: async () => (await getBlob(href)).text(),
  }));
}

/** Maps of what the recording holds: displacements, or the phases that become displacements by an import. */
function maps(steps, byName, mask) {
  const there = (names) => [names].flat().filter((n) => typeof n === "string" && byName.has(n));
  const drive = (s) => `drive ${plain(s.drive_mm, 4)} mm`;
  const displacements = steps.flatMap((s) =>
    there(s.displacement).map((name) => ({
      label: drive(s),
      panels: [{ label: "Displacement as recorded", ...sourceOf(byName.get(name)) }],
    })),
  );
  const phases = steps.flatMap((s) =>
    there(s.raw?.phase).map((name, i) => ({
      label: `${drive(s)}, phase along ${"xyz"[i]}`,
      panels: [
        {
          label: "Phase as recorded",
          ...sourceOf(byName.get(name)),
          mask: byName.has(mask) && sourceOf(byName.get(mask)),
        },
      ],
    })),
  );
  return [
    slicesView("The displacement, drive by drive", displacements),
    slicesView("The phases, drive by drive", phases, {
      unit: "rad",
      components: ["phase"],
      note: "They become displacements by an import, which can be started once the recording is kept.",
    }),
  ];
}

/** What the files of a recording hold. */
export async function look(files) {
  const byName = new Map(files.map((f) => [f.name, f]));
  if (!byName.has("recording.json")) throw new Error("There is no recording.json among these files.");
  const recording = JSON.parse(await byName.get("recording.json").text());
  const steps = recording.steps ?? [];
  return [
    sheet(
      recording.id ?? "Recording",
      h(
        "p",
        { class: "quiet" },
        `${recording.specimen?.name ?? "a specimen"}, ${files.length} files, ` +
          `${digits(files.reduce((sum, f) => sum + f.size, 0) / 1e6, 3)} MB`,
      ),
      table(
        ["Drive, mm", "Force, N", "± N"],
        steps.map((s) => [plain(s.drive_mm, 4), digits(s.force_n), digits(s.force_sd_n, 2)]),
      ),
    ),
    maps(steps, byName, recording.mask),
    byName.has("load.csv") && (await loadCurve(byName.get("load.csv"), steps)),
  ];
}
