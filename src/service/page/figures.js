// Figures of results. In the dark their paper and inks change, and their data keep their colours.

import { getBlob } from "./api.js";
import { h } from "./dom.js";

/** Inks of the figures on white paper, and what stands for them on dark paper. */
const DARK_INKS = {
  "#ffffff": "#1c2027", "#fff": "#1c2027", "#222222": "#e6e9ee", "#111": "#e6e9ee", "#335": "#a9b7e8", "#666666": "#a3adbd",
  "#777": "#a3adbd", "#8c8c8c": "#7d8899", "#e8e8e8": "#333a45", "#f3f3f1": "#2a303a", "#c6c6c4": "#566073",
  "#76848f": "#a9b6c2", "#20639b": "#6cb2ff", "#b3261e": "#ff8a80", "#c8511b": "#ff9255",
};
const dark = matchMedia("(prefers-color-scheme: dark)");

/** Whether a text stands on a coloured field, which keeps its colour. */
function isOnField(text) {
  const [x, y] = ["x", "y"].map((a) => Number(text.getAttribute(a)));
  return [...text.parentNode.children].some((r) => {
    if (r.tagName !== "rect" || DARK_INKS[r.getAttribute("fill")]) return false;
    const [left, top, width, height] = ["x", "y", "width", "height"].map((a) => Number(r.getAttribute(a) ?? 0));
    return x >= left && x <= left + width && y >= top && y <= top + height && width > 8 && height > 8;
  });
}

function darkened(text) {
  const picture = new DOMParser().parseFromString(text, "image/svg+xml");
  if (picture.querySelector("parsererror")) return text;
  for (const element of picture.querySelectorAll("[fill], [stroke]")) {
    if (element.tagName === "text" && isOnField(element)) continue;
    for (const name of ["fill", "stroke"]) {
      const ink = DARK_INKS[element.getAttribute(name)];
      if (ink) element.setAttribute(name, ink);
    }
  }
  return new XMLSerializer().serializeToString(picture);
}

/** A figure from SVG text. */
export function figureOf(text, caption) {
  const image = h("img", { alt: caption });
  const show = () => {
    URL.revokeObjectURL(image.src);
    image.src = URL.createObjectURL(new Blob([dark.matches ? darkened(text) : text], { type: "image/svg+xml" }));
  };
  const follow = () => { if (image.isConnected) show(); else dark.removeEventListener("change", follow); };
  show();
  dark.addEventListener("change", follow);
  return h("figure", {}, image, h("figcaption", {}, caption));
}

/** The figure in a job's file; nothing where it left none. */
export async function figure(files, name, caption) {
  if (!files.has(name)) return null;
  return figureOf(await (await getBlob(files.get(name).href)).text(), caption);
}

/** A sheet of figures: [[file, caption]]. */
export async function figureSheet(files, wanted) {
  const figures = (await Promise.all(wanted.map(([name, caption]) => figure(files, name, caption)))).filter(Boolean);
  return figures.length > 0 && h("section", { class: "sheet" }, h("div", { class: figures.length > 1 ? "halves" : null }, figures));
}
