// Files of other programs: what they are has to be said, and goes with them as the request of an import.

import { h, sheet } from "./dom.js";
import { choice, field, fields } from "./field.js";
import { digits } from "./numbers.js";

/** What files hold, by the ends of their names. */
const FORMS = [
  [/\.mat$/i, "matlab"],
  [/\.nii(\.gz)?$/i, "nifti"],
  [/\.(csv|txt)$/i, "points"],
];

const formOf = (file) => FORMS.find(([ends]) => ends.test(file.name))?.[1];

/** Whether these are files of another program, and not those of a recording. */
export const isForeign = (files) =>
  !files.some((f) => f.name === "recording.json") && files.length > 0 && files.every((f) => formOf(f) !== undefined);

/** Names as the service takes them: letters, digits, dots, hyphens and underscores. */
const plainNames = (files) =>
  files.map((file, i) => new File([file], `${i + 1}-${file.name.replace(/[^A-Za-z0-9._-]/g, "_")}`.slice(-100)));

/** A form that asks what `files` are; `request(content)` gives them with the answers, ready to be sent. */
export function foreignForm(files, library) {
  const named = plainNames(files);
  const form = formOf(files[0]);
  const asked = {
    name: files[0].name.replace(/\.[^.]*(\.gz)?$/i, ""),
    specimen: library.specimens[0],
    drive_mm: [],
    unit: "mm",
    axes: "",
    origin: "mask_center",
  };
  const element = sheet(
    files.length === 1 ? `What is ${files[0].name}?` : `What are these ${files.length} files?`,
    h(
      "p",
      { class: "quiet" },
      `${{ matlab: "MATLAB arrays", nifti: "NIfTI images", points: "Tables of points, one per drive" }[form]}, ` +
        `${digits(files.reduce((sum, f) => sum + f.size, 0) / 1e6, 3)} MB. They become a recording when they are ` +
        "uploaded; the service says what does not fit.",
    ),
    fields(
      field({
        label: "Name",
        kind: "text",
        value: asked.name,
        example: "my scan",
        put: (v) => {
          asked.name = v;
        },
      }),
      choice({
        label: "Specimen",
        wide: true,
        value: 0,
        options: library.specimens.map((s, i) => [i, s.name]),
        put: (i) => {
          asked.specimen = library.specimens[Number(i)];
        },
      }),
      h(
        "label",
        {},
        "Specimen's file, in its place",
        h("input", {
          type: "file",
          accept: ".json",
          onchange: async (event) => {
            const [file] = event.target.files;
            if (file) asked.specimen = JSON.parse(await file.text());
          },
        }),
      ),
      field({
        label: "Drives, mm (where the files do not say)",
        kind: "numbers",
        value: "",
        example: "2.5, 5",
        put: (v) => {
          asked.drive_mm = v;
        },
      }),
      choice({
        label: "Unit of length",
        value: asked.unit,
        options: [
          ["mm", "mm"],
          ["m", "m"],
          ["um", "µm"],
        ],
        put: (v) => {
          asked.unit = v;
        },
      }),
      form !== "points" &&
        field({
          label: "Axes along the indices (y,z,x if left out)",
          kind: "text",
          value: "",
          example: "y,z,x",
          put: (v) => {
            asked.axes = v;
          },
        }),
      form === "matlab" &&
        choice({
          label: "Place of the voxels",
          wide: true,
          value: asked.origin,
          options: [
            ["mask_center", "the mask is centred on the specimen"],
            ["positions", "as the positions X say"],
          ],
          put: (v) => {
            asked.origin = v;
          },
        }),
    ),
  );
  const request = () => ({
    files: named.map((f) => f.name),
    form,
    name: asked.name,
    specimen: asked.specimen,
    unit: asked.unit,
    ...(asked.drive_mm.length > 0 ? { drive_mm: asked.drive_mm } : {}),
    ...(asked.axes.trim() ? { axes: asked.axes.trim() } : {}),
    ...(form === "matlab" ? { origin: asked.origin } : {}),
  });
  return { element, content: () => [...named, new File([JSON.stringify(request())], "import.json")] };
}
