// Fields of forms: what is wrong with one is said below it, in words.

import { fill, h, term } from "./dom.js";
import { inWords } from "./words.js";

/** A number; an error in words where it is none. */
const number = (example) => (text) => {
  const value = Number(String(text).trim().replace(",", "."));
  if (String(text).trim() === "" || !Number.isFinite(value)) throw new Error(`give a number such as ${example}`);
  return value;
};

/** Numbers in one line. */
const numbers = (example, count) => (text) => {
  const values = text
    .split(/[\s,;]+/)
    .filter(Boolean)
    .map(Number);
  if (values.length === 0 || values.some((v) => !Number.isFinite(v)) || (count && values.length !== count)) {
    throw new Error(`give ${count ? `${count} ` : ""}numbers such as ${example}`);
  }
  return values;
};

/** A whole number. */
const whole = (example) => (text) => {
  const value = number(example)(text);
  if (!Number.isInteger(value)) throw new Error(`give a whole number such as ${example}`);
  return value;
};

/** The same where nothing need be given. */
const optional = (read) => (text) => (text.trim() === "" ? undefined : read(text));

/** How the text of a field is read, by its kind; `example` stands in the words of its error. */
const READERS = {
  text: () => (text) => text,
  number,
  whole,
  numbers: (example) => numbers(example),
  triple: (example) => numbers(example, 3),
  optional: (example) => optional(number(example)),
  optionalWhole: (example) => optional(whole(example)),
  optionalNumbers: (example) => optional(numbers(example)),
  optionalTriple: (example) => optional(numbers(example, 3)),
};

let made = 0;

/**
 * A field: `kind` of READERS; `pointer` of what it holds, by which errors of the service find it; `put` takes the value
 * that was read. A value that cannot be read changes nothing.
 */
export function field({ label, kind = "number", value, put, example = "5", pointer, meaning, wide, changed, ...more }) {
  const id = `field-${(made += 1)}`;
  const wrong = h("span", { class: "wrong-field", id: `${id}-wrong`, role: "alert" });
  const name = label.split(",")[0];
  const input = h("input", {
    id,
    value: value ?? "",
    "data-pointer": pointer,
    "aria-describedby": `${id}-wrong`,
    inputmode: kind === "text" ? null : "decimal",
    ...more,
    onchange: () => {
      let read;
      try {
        read = READERS[kind](example)(input.value);
      } catch (error) {
        input.dataset.unread = "";
        mark(input, `${name}: ${error.message}`);
        return;
      }
      delete input.dataset.unread;
      mark(input, "");
      put(read);
      changed?.();
    },
  });
  return h(
    "div",
    { class: wide ? "field wide" : "field" },
    h("div", { class: "row tight" }, h("label", { for: id }, label), meaning && term("?", meaning)),
    input,
    wrong,
  );
}

/** Says what is wrong with a field; nothing takes it back. */
function mark(input, words) {
  if (words) input.setAttribute("aria-invalid", "true");
  else input.removeAttribute("aria-invalid");
  fill(document.getElementById(`${input.id}-wrong`) ?? input.nextElementSibling, words);
}

/** A field whose text could not be read: what would be sent is not what is seen. */
export const unreadField = (root) => root.querySelector("[data-unread]");

/** Shows errors of the service at their fields; the ones that have no field are given back. */
export function markErrors(root, errors) {
  const inputs = [...root.querySelectorAll("[data-pointer]")];
  const isMarked = (input) => input.hasAttribute("aria-invalid") && input.dataset.unread === undefined;
  for (const input of inputs) if (isMarked(input)) mark(input, "");
  return errors.filter((error) => {
    const pointer = (error.pointer ?? "").replace(/^\/base(?=\/|$)/, "/specimen").replace(/^\/materials\/0/, "");
    const input = inputs.find(
      (one) => pointer === one.dataset.pointer || pointer.startsWith(`${one.dataset.pointer}/`),
    );
    if (input) mark(input, inWords(error, "It"));
    return !input;
  });
}

/** A choice among [[value, words]]. */
export function choice({ label, options, value, put, meaning, wide, changed, ...more }) {
  const id = `field-${(made += 1)}`;
  return h(
    "div",
    { class: wide ? "field wide" : "field" },
    h("div", { class: "row tight" }, h("label", { for: id }, label), meaning && term("?", meaning)),
    h(
      "select",
      {
        id,
        ...more,
        onchange: (event) => {
          put(event.target.value);
          changed?.();
        },
      },
      options.map(([key, text]) => h("option", { value: key, selected: String(key) === String(value) }, text)),
    ),
  );
}

/** Fields side by side. */
export const fields = (...children) => h("div", { class: "fields" }, children);
