// Tar files: a recording's folder as the service takes it.

/** A tar file of plain files. */
export async function tar(files) {
  const parts = [];
  for (const file of files) {
    const header = new Uint8Array(512);
    const put = (at, text) => header.set(new TextEncoder().encode(text), at);
    put(0, file.name);
    put(100, "0000644\0");
    put(124, file.size.toString(8).padStart(11, "0"));
    put(148, "        ");
    put(156, "0");
    put(257, "ustar\u000000");
    put(
      148,
      `${header
        .reduce((a, b) => a + b, 0)
        .toString(8)
        .padStart(6, "0")}\0 `,
    );
    parts.push(header, file, new Uint8Array((512 - (file.size % 512)) % 512));
  }
  parts.push(new Uint8Array(1024));
  return new Blob(parts, { type: "application/x-tar" });
}
