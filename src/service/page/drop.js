// Files that are dropped or chosen: folders and zip files become the files in them.

import { unzip } from "./zip.js";

const fileOf = (entry) =>
  new Promise((resolve, reject) => {
    entry.file(resolve, reject);
  });
const part = (reader) =>
  new Promise((resolve, reject) => {
    reader.readEntries(resolve, reject);
  });

/** All files below an entry of a drop. */
async function below(entry) {
  if (entry.isFile) return [await fileOf(entry)];
  const reader = entry.createReader();
  const found = [];
  // A reader gives a part at a time and ends with an empty one.
  for (let some = await part(reader); some.length > 0; some = await part(reader)) {
    for (const one of some) found.push(...(await below(one)));
  }
  return found;
}

/** Zip files are opened; files that systems leave behind are left out. */
export async function unpacked(files) {
  const found = [];
  for (const file of files) found.push(...(/\.zip$/i.test(file.name) ? await unzip(file) : [file]));
  return found.filter((f) => !f.name.startsWith("."));
}

/** Makes an element a place to drop files on; `take(files)` is given them. */
export function dropPlace(element, take) {
  const over = (is) => (event) => {
    event.preventDefault();
    element.classList.toggle("over", is);
  };
  element.addEventListener("dragover", over(true));
  element.addEventListener("dragleave", over(false));
  element.addEventListener("drop", async (event) => {
    over(false)(event);
    // Entries must be asked for before anything is waited for.
    const entries = [...event.dataTransfer.items].map((i) => i.webkitGetAsEntry?.()).filter(Boolean);
    const loose = [...event.dataTransfer.files];
    const files = entries.length > 0 ? (await Promise.all(entries.map(below))).flat() : loose;
    take(files);
  });
}
