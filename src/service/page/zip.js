// Zip files: everything in one file to take home, and recordings that come as one.

const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k += 1) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c >>> 0;
});

function checksum(bytes) {
  let c = 0xffffffff;
  for (const b of bytes) c = CRC[(c ^ b) & 0xff] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}

/** Numbers of so many bytes, the lowest byte first. */
function record(fields) {
  const bytes = [];
  for (const [size, value] of fields) for (let i = 0; i < size; i += 1) bytes.push(Math.floor(value / 256 ** i) & 0xff);
  return Uint8Array.from(bytes);
}

/** A zip file of { name, blob }, stored as they are: most of them are compressed already. */
export async function zip(files) {
  const [parts, index] = [[], []];
  let offset = 0;
  let indexSize = 0;
  for (const { name, blob } of files) {
    const bytes = new Uint8Array(await blob.arrayBuffer());
    const title = new TextEncoder().encode(name);
    // Version 2.0, names in UTF-8, stored, 1 January 1980.
    const common = [
      [2, 20],
      [2, 0x800],
      [2, 0],
      [2, 0],
      [2, 0x21],
      [4, checksum(bytes)],
      [4, bytes.length],
      [4, bytes.length],
      [2, title.length],
      [2, 0],
    ];
    const head = record([[4, 0x04034b50], ...common]);
    const entry = record([[4, 0x02014b50], [2, 20], ...common, [2, 0], [2, 0], [2, 0], [4, 0], [4, offset]]);
    parts.push(head, title, bytes);
    index.push(entry, title);
    offset += head.length + title.length + bytes.length;
    indexSize += entry.length + title.length;
  }
  const end = record([
    [4, 0x06054b50],
    [2, 0],
    [2, 0],
    [2, files.length],
    [2, files.length],
    [4, indexSize],
    [4, offset],
    [2, 0],
  ]);
  return new Blob([...parts, ...index, end], { type: "application/zip" });
}

const inflate = (bytes) =>
  new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"))).blob();

/** The files of a zip file, folders left out: [File]. */
export async function unzip(file) {
  const bytes = new Uint8Array(await file.arrayBuffer());
  const view = new DataView(bytes.buffer);
  let at = bytes.length - 22;
  while (at >= 0 && view.getUint32(at, true) !== 0x06054b50) at -= 1;
  if (at < 0) throw new Error(`${file.name} is not a zip file.`);
  const found = [];
  let entry = view.getUint32(at + 16, true);
  for (let count = view.getUint16(at + 10, true); count > 0; count -= 1) {
    const u16 = (o) => view.getUint16(entry + o, true);
    const [method, size, title] = [u16(10), view.getUint32(entry + 20, true), u16(28)];
    const name = new TextDecoder().decode(bytes.subarray(entry + 46, entry + 46 + title));
    const start = view.getUint32(entry + 42, true);
    const data = start + 30 + view.getUint16(start + 26, true) + view.getUint16(start + 28, true);
    entry += 46 + title + u16(30) + u16(32);
    if (name.endsWith("/") || name.startsWith("__MACOSX")) continue;
    const body = bytes.subarray(data, data + size);
    if (method !== 0 && method !== 8)
      throw new Error(`${name} in ${file.name} is packed in a way that this page does not read.`);
    found.push(new File([method === 8 ? await inflate(body) : body], name.split("/").at(-1)));
  }
  return found;
}
