// What is done with a plan as a whole: undo and redo, files in and out, a link.

import { save } from "./api.js";
import { h, say } from "./dom.js";
import { linkOf, planOfFile } from "./draft.js";

const nameOf = (model) => (model.specimen.name || "specimen").replace(/[^\w.-]+/g, "-");
const asFile = (content, name) =>
  save(new Blob([`${JSON.stringify(content, null, 2)}\n`], { type: "application/json" }), name);

/** What can be saved: words, file name, content. */
const FILES = [
  ["Specimen", (m) => `${nameOf(m)}.json`, (m) => ({ schema: "specimen/1", ...m.specimen })],
  ["Material", () => "material.json", (m) => ({ schema: "ogden/1", ...m.material })],
  ["Study", (m) => `${nameOf(m)}-study.json`, (m, study) => study(m)],
];

/** The bar; `replace(parts)` puts parts of a plan in place, `fresh()` begins anew. */
export function planBar(model, past, study, { replace, restored, fresh }) {
  const input = h("input", {
    type: "file",
    accept: ".json,application/json",
    id: "plan-file",
    hidden: true,
    onchange: async () => {
      try {
        replace(planOfFile(await input.files[0].text()));
        say(`${input.files[0].name} is opened.`);
      } catch (error) {
        say(error.message);
      }
      input.value = "";
    },
  });
  const step = (by, label, id) =>
    h(
      "button",
      {
        type: "button",
        id,
        onclick: () => {
          past.go(by);
          restored();
        },
      },
      label,
    );
  const undo = step(-1, "Undo", "undo");
  const redo = step(1, "Redo", "redo");
  const copyLink = async () => {
    const link = await linkOf(model);
    try {
      await navigator.clipboard.writeText(link);
      say("The link holds the whole plan; it is copied.");
    } catch {
      location.hash = new URL(link).hash;
    }
  };
  const saved = h(
    "select",
    {
      "aria-label": "Save as a file",
      onchange: (event) => {
        const [, name, content] = FILES[Number(event.target.value)];
        asFile(content(model, study), name(model));
        event.target.value = "";
      },
    },
    h("option", { value: "" }, "Save as a file …"),
    FILES.map(([label], i) => h("option", { value: i }, label)),
  );
  const element = h(
    "div",
    { class: "row bar-of-plan" },
    undo,
    redo,
    h("button", { type: "button", onclick: () => input.click() }, "Open a file"),
    input,
    h("div", {}, saved),
    h("button", { type: "button", id: "plan-link", onclick: copyLink }, "Copy link"),
    h(
      "button",
      {
        type: "button",
        onclick: () => {
          if (confirm("Begin anew? What is planned now can be undone.")) fresh();
        },
      },
      "Begin anew",
    ),
  );
  const update = () => {
    undo.disabled = !past.can(-1);
    redo.disabled = !past.can(1);
  };
  update();
  return { element, update };
}

/** Undo and redo by keyboard, outside of fields. */
export function undoKeys(past, restored, signal) {
  addEventListener(
    "keydown",
    (event) => {
      if (!(event.ctrlKey || event.metaKey) || event.target.closest?.("input, select, textarea")) return;
      const by =
        event.key === "y" || (event.key.toLowerCase() === "z" && event.shiftKey) ? 1 : event.key === "z" ? -1 : 0;
      if (by === 0) return;
      event.preventDefault();
      past.go(by);
      restored();
    },
    { signal },
  );
}
