// Numbers as they are shown: with the digits that they deserve.

/** A number with so many significant digits. */
export function digits(value, count = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const magnitude = Math.abs(value);
  if (magnitude !== 0 && (magnitude >= 1e6 || magnitude < 1e-3)) return powers(value, count);
  if (magnitude >= 10 ** count) return Number(value.toPrecision(count)).toLocaleString("en");
  return value === 0 ? "0" : value.toPrecision(count);
}

/** As someone typed it: without trailing zeros. */
export function plain(value, count = 6) {
  return Number.isFinite(value) ? String(Number(value.toPrecision(count))) : "–";
}

const SUPERSCRIPT = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

function powers(value, count) {
  const [mantissa, exponent] = value.toExponential(count - 1).split("e");
  return `${mantissa} × 10${[...String(Number(exponent))].map((c) => SUPERSCRIPT[c]).join("")}`;
}

/** So many decimals that half of the interval's width has two significant digits. */
function decimals(width) {
  return Math.max(0, Math.min(8, 1 - Math.floor(Math.log10(width / 2))));
}

const isBounded = (interval) => Array.isArray(interval) && interval.every((v) => v !== null && Number.isFinite(v));

/** A value with the digits that its interval leaves it. */
export function known(value, interval) {
  if (value === null || value === undefined) return "–";
  if (!isBounded(interval)) return digits(value, 3);
  const width = interval[1] - interval[0];
  if (!(width > 0) || width > 2 * Math.abs(value) || Math.abs(value) >= 1e6) return digits(value, 2);
  return value.toFixed(decimals(width));
}

/** An interval in words; `unit` stands once, behind it. */
export function interval(ends, unit = "") {
  if (!ends) return "not bounded by the data";
  const behind = unit ? ` ${unit}` : "";
  const [low, high] = ends;
  if (low === null && high === null) return "not bounded by the data";
  if (low === null) return `below ${digits(high, 3)}${behind}`;
  if (high === null) return `above ${digits(low, 3)}${behind}`;
  const width = high - low;
  const isWide = !(width > 0) || Math.max(Math.abs(low), Math.abs(high)) >= 1e5;
  const text = (v) =>
    isWide || width > Math.abs(low + high) || Math.abs(v) < width / 20 ? digits(v, 2) : v.toFixed(decimals(width));
  return `${text(low)} to ${text(high)}${behind}`;
}

/** Whether an interval is wider than the value itself: such a value may not be read as one that was found. */
export function isHardlyKnown(value, ends) {
  return value === null || value === undefined || !isBounded(ends) || ends[1] - ends[0] > Math.abs(value);
}

/** A part as per cent. */
export const percent = (v, count = 3) => (v === null || v === undefined ? "–" : `${digits(100 * v, count)} %`);

/** The value of largest magnitude, with its sign: drives may lead either way. */
export const farthest = (values) => values.reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a), 0);

/** A count with separators. */
export const many = (count) => count.toLocaleString("en");

/** A value with its unit. */
export const withUnit = (text, unit) => (unit ? `${text} ${unit}` : text);

/** Milliseconds as words. */
export function duration(ms) {
  const seconds = ms / 1000;
  if (seconds < 90) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  const minutes = Math.round(seconds / 60);
  return minutes < 90 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** The symbol of a parameter. */
export function symbol(name) {
  const [kind, number] = name.split("_");
  const letter = { mu: "μ", alpha: "α", kappa: "κ", c: "c", j: "J", lambda: "λ" }[kind] ?? name;
  return number ? letter + ("₀₁₂₃₄₅₆₇₈₉"[Number(number)] ?? "ₘ") : letter;
}

/** The unit of a displacement's sensitivity summed over voxels: none for a modulus, kPa for an exponent. */
export const sensitivityUnit = (name) => ({ alpha: "kPa", j: "kPa", lambda: "kPa" })[name.split("_")[0]] ?? "";

/** The unit of a material's parameter. */
export const unitOf = (name) => ({ mu: "kPa", kappa: "kPa", c: "kPa" })[name.split("_")[0]] ?? "";
