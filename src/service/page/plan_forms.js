// The forms of a plan: specimen and material.

import { h } from "./dom.js";
import { choice, field, fields } from "./field.js";
import { lawNumbers } from "./law.js";
import { giveOutline, KINDS_OF_OUTLINES, kindOfOutline, sectionOf } from "./outline.js";
import { GLOSSARY } from "./words.js";

const copy = (value) => structuredClone(value);

/** A dumb-bell's outline: which, and of its own gauge the dimensions. */
function outlineFields(sp, changed) {
  const kind = kindOfOutline(sp);
  const dimension = (name, label, meaning) =>
    field({
      label,
      value: sp.outline.dumbbell[name],
      put: (v) => {
        sp.outline.dumbbell[name] = v;
      },
      pointer: `/specimen/outline/dumbbell/${name}`,
      meaning,
      changed,
    });
  return [
    choice({ label: "Outline", value: kind, options: KINDS_OF_OUTLINES, put: (v) => giveOutline(sp, v), changed }),
    ...(kind === "dumbbell"
      ? [
          dimension("gauge_width_mm", "Width of the gauge, mm"),
          dimension("gauge_length_mm", "Length of the gauge, mm", "The straight narrow part, between the arcs."),
          dimension("fillet_radius_mm", "Radius of the arcs, mm", "Of both arcs between gauge and end."),
        ]
      : []),
  ];
}

/** The specimen's own fields. */
export function specimenForm(model, library, edited) {
  const sp = model.specimen;
  const side = (name) =>
    field({
      label: `${name.charAt(0).toUpperCase()}${name.slice(1)}, mm`,
      value: sp.block[`${name}_mm`],
      put: (v) => {
        sp.block[`${name}_mm`] = v;
      },
      pointer: `/specimen/block/${name}_mm`,
      example: "19.1",
      changed: edited,
    });
  return fields(
    choice({
      label: "Start from",
      wide: true,
      value: "",
      options: [["", "this specimen"], ...library.specimens.map((v, i) => [i, v.name])],
      put: (i) => {
        if (i !== "") model.specimen = copy(library.specimens[Number(i)]);
      },
      changed: edited,
    }),
    field({
      label: "Name",
      kind: "text",
      wide: true,
      maxlength: 200,
      value: sp.name,
      put: (v) => {
        sp.name = v;
      },
      pointer: "/specimen/name",
      changed: edited,
    }),
    choice({
      label: "Test",
      value: sp.test,
      options: [
        ["double_lap_shear", "double-lap shear"],
        ["uniaxial", "uniaxial"],
      ],
      put: (v) => {
        sp.test = v;
        if (v === "uniaxial") {
          delete sp.drive_angle_deg;
          delete sp.precompression_mm;
          delete sp.block.wedge_mm;
        } else delete sp.outline;
      },
      changed: edited,
    }),
    ...(sp.test === "uniaxial"
      ? outlineFields(sp, edited)
      : [
          field({
            label: "Angle of the drive, °",
            kind: "number",
            value: sp.drive_angle_deg ?? 0,
            example: "0",
            pointer: "/specimen/drive_angle_deg",
            put: (v) => {
              sp.drive_angle_deg = v;
            },
            meaning: "From x towards z, in the plane of the plates. Forces are along the drive.",
            changed: edited,
          }),
          field({
            label: "Plates pressed together, mm",
            kind: "number",
            value: sp.precompression_mm ?? 0,
            example: "0",
            pointer: "/specimen/precompression_mm",
            put: (v) => {
              sp.precompression_mm = v;
            },
            meaning: "Before they are driven, and kept so. A negative number pulls them apart.",
            changed: edited,
          }),
          field({
            label: "Wedge, mm",
            kind: "number",
            value: sp.block.wedge_mm ?? 0,
            example: "0",
            pointer: "/specimen/block/wedge_mm",
            put: (v) => {
              sp.block.wedge_mm = v;
            },
            meaning: "By how much the block is thicker at x = +length/2 than at −length/2; thickness is that in the middle.",
            changed: edited,
          }),
        ]),
    choice({
      label: "Holes run along",
      value: sectionOf(sp).axis,
      options: [
        ["thickness", "thickness (y)"],
        ["width", "width (z)"],
      ],
      put: (v) => {
        sp.holes.forEach((o) => {
          o.axis = v;
        });
      },
      changed: edited,
    }),
    side("length"),
    side("thickness"),
    side("width"),
    field({
      label: "Samples in parallel",
      kind: "whole",
      value: sp.samples_in_parallel ?? 1,
      example: "2",
      pointer: "/specimen/samples_in_parallel",
      put: (v) => {
        sp.samples_in_parallel = v;
      },
      meaning: "How many samples alike share the load cell; the force is that of all together.",
      changed: edited,
    }),
    field({
      label: "Drives, mm",
      kind: "numbers",
      value: sp.drive_mm.join(", "),
      example: "5, 9",
      pointer: "/specimen/drive_mm",
      put: (v) => {
        sp.drive_mm = v;
      },
      meaning:
        "How far the plate or grip is moved when a scan is taken, from the least to the most. Negative numbers, all of them, shear the other way or push the grips together.",
      changed: edited,
    }),
  );
}

/** The material's fields. */
export function materialForm(model, library, edited) {
  const terms = model.material.terms ?? [];
  const numbers = lawNumbers(model.material);
  const term = (index) => [
    field({
      label: `μ of term ${index + 1}, kPa`,
      value: terms[index].mu_kpa,
      pointer: `/material/terms/${index}/mu_kpa`,
      example: "17",
      put: (v) => {
        terms[index].mu_kpa = v;
      },
      changed: edited,
    }),
    field({
      label: `α of term ${index + 1}`,
      value: terms[index].alpha,
      pointer: `/material/terms/${index}/alpha`,
      example: "1.9",
      put: (v) => {
        terms[index].alpha = v;
      },
      changed: edited,
    }),
  ];
  return h(
    "div",
    {},
    fields(
      choice({
        label: "Start from",
        wide: true,
        value: "",
        options: [["", "this material"], ...library.materials.map((m, i) => [i, m.name])],
        put: (i) => {
          if (i !== "") model.material = copy(library.materials[Number(i)].material);
        },
        changed: edited,
      }),
      field({
        label: "κ, kPa",
        value: model.material.bulk_kpa,
        pointer: "/material/bulk_kpa",
        example: "2200",
        meaning: GLOSSARY["κ, μ, α"],
        put: (v) => {
          model.material.bulk_kpa = v;
        },
        changed: edited,
      }),
      terms.map((_, index) => term(index)),
      numbers.map(([name, value]) =>
        field({
          label: name.endsWith("_kpa") ? `${name.slice(0, -4).replace("_", "")}, kPa` : name.replace("_", ""),
          value,
          pointer: `/material/${name}`,
          example: String(value),
          put: (v) => {
            model.material[name] = v;
          },
          changed: edited,
        }),
      ),
    ),
    numbers.length === 0 &&
      h(
      "div",
      { class: "row" },
      h(
        "button",
        {
          type: "button",
          onclick: () => {
            terms.push({ mu_kpa: 1, alpha: 4 });
            edited();
          },
        },
        "Add a term",
      ),
      terms.length > 1 &&
        h(
          "button",
          {
            type: "button",
            onclick: () => {
              terms.pop();
              edited();
            },
          },
          "Remove the last",
        ),
    ),
  );
}
