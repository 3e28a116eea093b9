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
    else if (name === "width_percent") element.style.width = value + "%";
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
  timer = setTimeout(() => { line.textContent = ""; }, 6000);
}

/** A number with so many significant digits. */
export function digits(value, count = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const magnitude = Math.abs(value);
  if (magnitude !== 0 && (magnitude >= 1e6 || magnitude < 1e-3)) return value.toExponential(count - 1);
  return String(Number(value.toPrecision(count)));
}

/** The symbol of a parameter. */
export function symbol(name) {
  const [kind, number] = name.split("_");
  const letter = { mu: "μ", alpha: "α", kappa: "κ" }[kind] ?? name;
  return number ? letter + "₀₁₂₃₄₅₆₇₈₉"[Number(number)] : letter;
}

/** Milliseconds as words. */
export function duration(ms) {
  const seconds = ms / 1000;
  if (seconds < 90) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}
