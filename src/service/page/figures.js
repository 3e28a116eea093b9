// Figures of results. In the dark their paper and inks change, and their data keep their colours.

import { getBlob } from "./api.js";
import { h } from "./dom.js";

/** Inks of the figures on white paper, and what stands for them on dark paper. */
const DARK_INKS = {
  "#ffffff": "#1c2027",
  "#fff": "#1c2027",
  "#222222": "#e6e9ee",
  "#111": "#e6e9ee",
  "#335": "#a9b7e8",
  "#666666": "#a3adbd",
  "#777": "#a3adbd",
  "#8c8c8c": "#7d8899",
  "#e8e8e8": "#333a45",
  "#f3f3f1": "#2a303a",
  "#c6c6c4": "#566073",
  "#76848f": "#a9b6c2",
  "#20639b": "#6cb2ff",
  "#b3261e": "#ff8a80",
  "#c8511b": "#ff9255",
};
const dark = matchMedia("(prefers-color-scheme: dark)");

const attribute = (tag, name) => tag.match(new RegExp(`\\s${name}="([^"]*)"`))?.[1];
const place = (tag, names) => names.map((name) => Number(attribute(tag, name) ?? 0));

/** A coloured field that is large enough for letters: its box. */
function fieldOf(tag) {
  const [x, y, width, height] = place(tag, ["x", "y", "width", "height"]);
  return !DARK_INKS[attribute(tag, "fill")] && width > 8 && height > 8 ? { x, y, width, height } : null;
}

/** The figure in dark inks. Letters on coloured fields keep their ink, as the fields keep their colour. */
function darkened(text) {
  let fields = [];
  const isOnField = (tag) => {
    const [x, y] = place(tag, ["x", "y"]);
    return fields.some((f) => x >= f.x && x <= f.x + f.width && y >= f.y && y <= f.y + f.height);
  };
  const sheets = text.replace(/<style>[^<]*<\/style>/g, (sheet) =>
    sheet.replace(/#[0-9a-f]+/g, (ink) => DARK_INKS[ink] ?? ink),
  );
  return sheets.replace(/<\/?([a-z]+)[^>]*>/g, (tag, name) => {
    if (name === "g") fields = [];
    const field = name === "rect" && fieldOf(tag);
    if (field) fields.push(field);
    if (name === "text" && isOnField(tag)) return tag;
    return tag.replace(/(\s(?:fill|stroke))="(#[0-9a-f]+)"/g, (whole, key, ink) => `${key}="${DARK_INKS[ink] ?? ink}"`);
  });
}

/** A figure from SVG text. */
function figureOf(text, caption) {
  const image = h("img", { alt: caption });
  const show = () => {
    URL.revokeObjectURL(image.src);
    image.src = URL.createObjectURL(new Blob([dark.matches ? darkened(text) : text], { type: "image/svg+xml" }));
  };
  const follow = () => {
    if (image.isConnected) show();
    else dark.removeEventListener("change", follow);
  };
  show();
  dark.addEventListener("change", follow);
  return h("figure", {}, image, h("figcaption", {}, caption));
}

/** The figure in a job's file; nothing where it left none. */
export async function figure(files, name, caption) {
  if (!name || !files.has(name)) return null;
  return figureOf(await (await getBlob(files.get(name).href)).text(), caption);
}

/** A sheet of figures: [[file, caption]]. */
export async function figureSheet(files, wanted) {
  const figures = (await Promise.all(wanted.map(([name, caption]) => figure(files, name, caption)))).filter(Boolean);
  return (
    figures.length > 0 &&
    h("section", { class: "sheet" }, h("div", { class: figures.length > 1 ? "halves" : null }, figures))
  );
}
