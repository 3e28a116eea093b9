// Small helpers: elements without innerHTML, so that no text from outside becomes markup.

/** An element: tag, attributes (on… are listeners), children (elements, text, lists, null). */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  set(element, attributes);
  append(element, children);
  return element;
}

/** An SVG element. */
export function s(tag, attributes = {}, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  set(element, attributes);
  append(element, children);
  return element;
}

function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "value" && "value" in element) element.value = value;
    else if (name === "width_percent") element.style.width = `${value}%`;
    else element.setAttribute(name, value === true ? "" : value);
  }
}

function append(element, children) {
  for (const child of children.flat(Infinity)) {
    if (child !== null && child !== undefined && child !== false) element.append(child);
  }
}

/** Replaces the content. */
export function fill(element, ...children) {
  element.replaceChildren();
  append(element, children);
}

let timer;
/** A short message at the foot of the page. */
export function say(text) {
  const line = document.getElementById("message");
  line.textContent = text;
  clearTimeout(timer);
  timer = setTimeout(() => {
    line.textContent = "";
  }, 6000);
}

let count = 0;
/** A term with its meaning: shown on hover and focus, read by screen readers. */
export function term(text, meaning) {
  if (!meaning) return text;
  const id = `term-${(count += 1)}`;
  const tip = h("span", { class: "tip", role: "tooltip", id }, meaning);
  const button = h("button", { type: "button", "aria-describedby": id }, text);
  // Placed on the screen, so that no scrolling part of the page cuts it off.
  const place = () => {
    const box = button.getBoundingClientRect();
    tip.style.left = `${Math.max(8, Math.min(box.left, innerWidth - Math.min(336, 0.9 * innerWidth)))}px`;
    tip.style.top = `${box.bottom + 4}px`;
  };
  button.addEventListener("pointerenter", place);
  button.addEventListener("focus", place);
  button.addEventListener("keydown", (event) => {
    if (event.key === "Escape") button.blur();
  });
  return h("span", { class: "term" }, button, tip);
}

/** A sheet with a heading. */
export const sheet = (title, ...children) => h("section", { class: "sheet" }, title && h("h3", {}, title), children);

/** A part that is closed until someone wants it. */
export const more = (summary, ...children) => h("details", {}, h("summary", {}, summary), children);
