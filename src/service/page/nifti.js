// Images (NIfTI-1, compressed): a scalar or a vector per voxel.

/** Uncompresses a blob. */
const unzipped = async (blob) => new Response(blob.stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();

const READERS = {
  2: ["getUint8", 1],
  4: ["getInt16", 2],
  8: ["getInt32", 4],
  16: ["getFloat32", 4],
  64: ["getFloat64", 8],
  512: ["getUint16", 2],
};

/** The values of an image; single precision is taken as it lies. */
function valuesOf(bytes, view, offset, count) {
  const kind = view.getInt16(70, true);
  if (kind === 16 && offset % 4 === 0) return new Float32Array(bytes, offset, count);
  const reader = READERS[kind];
  if (!reader) throw new Error(`The image holds values of the NIfTI type ${kind}, which this page does not read.`);
  const [read, size] = reader;
  return Float32Array.from({ length: count }, (_, i) => view[read](offset + size * i, true));
}

/** An image: shape, components, voxel sizes, origin, values (x fastest, components last). */
export async function readImage(blob) {
  const bytes = await unzipped(blob);
  const view = new DataView(bytes);
  if (bytes.byteLength < 352 || view.getInt32(0, true) !== 348) throw new Error("The image is not NIfTI-1.");
  const dim = (n) => (view.getInt16(40, true) >= n ? Math.max(1, view.getInt16(40 + 2 * n, true)) : 1);
  const shape = [dim(1), dim(2), dim(3)];
  const components = dim(5);
  const values = valuesOf(bytes, view, view.getFloat32(108, true), shape[0] * shape[1] * shape[2] * components);
  return {
    shape,
    components,
    values,
    bounds: bounds(values, shape),
    voxel: [1, 2, 3].map((n) => view.getFloat32(76 + 4 * n, true)),
    origin: [0, 1, 2].map((n) => view.getFloat32(292 + 16 * n, true)),
  };
}

/** The image where a mask is not zero; outside there is nothing to see. */
export function masked(image, mask) {
  const count = mask.values.length;
  const values = image.values.map((v, i) => (mask.values[i % count] > 0 ? v : NaN));
  return { ...image, values, bounds: bounds(values, image.shape) };
}

/** First and last place along each axis where there is a value: maps leave out the empty margin. */
function bounds(values, [nx, ny, nz]) {
  const found = [
    [nx, -1],
    [ny, -1],
    [nz, -1],
  ];
  for (let z = 0, i = 0; z < nz; z += 1) {
    for (let y = 0; y < ny; y += 1) {
      for (let x = 0; x < nx; x += 1, i += 1) {
        if (!Number.isFinite(values[i])) continue;
        [x, y, z].forEach((p, a) => {
          found[a] = [Math.min(found[a][0], p), Math.max(found[a][1], p)];
        });
      }
    }
  }
  return found.map(([low, high], a) => (high < low ? [0, [nx, ny, nz][a] - 1] : [low, high]));
}

/**
 * The slice's values of one component, row by row from the top, and its width and height; no values where the image has
 * no such slice.
 */
export function slice(image, component, [across, up, through], index) {
  const { shape, bounds: ends } = image;
  const [nx, ny] = shape;
  const size = nx * ny * shape[2];
  const [width, height] = [across, up].map((a) => ends[a][1] - ends[a][0] + 1);
  const values = new Float32Array(width * height);
  const place = [0, 0, 0];
  place[through] = index;
  if (index < 0 || index >= shape[through]) return { width, height, values: values.fill(NaN) };
  for (let row = 0; row < height; row += 1) {
    place[up] = ends[up][1] - row;
    for (let column = 0; column < width; column += 1) {
      place[across] = ends[across][0] + column;
      values[row * width + column] = image.values[component * size + place[0] + nx * (place[1] + ny * place[2])];
    }
  }
  return { width, height, values };
}

/** Root mean square of the values that there are. */
export function rms(values) {
  let [sum, count] = [0, 0];
  for (const v of values)
    if (Number.isFinite(v)) {
      sum += v * v;
      count += 1;
    }
  return count ? Math.sqrt(sum / count) : NaN;
}

/** The 99th percentile of |value| of a component. */
export function reach(image, component) {
  const size = image.values.length / image.components;
  const all = image.values
    .subarray(component * size, (component + 1) * size)
    .filter(Number.isFinite)
    .map(Math.abs)
    .sort();
  return all.length ? all[Math.floor(0.99 * (all.length - 1))] : 0;
}

/** The sum of squared differences from the mean: how much of a pattern a slice shows. */
function pattern(values) {
  let [sum, squares, count] = [0, 0, 0];
  for (const v of values)
    if (Number.isFinite(v)) {
      sum += v;
      squares += v * v;
      count += 1;
    }
  return count ? squares - (sum * sum) / count : 0;
}

/** Component, plane and slice in which there is the most to see. */
export function mostToSee(image, planes) {
  const best = { component: 0, plane: 0, index: null, seen: -1 };
  for (let component = 0; component < image.components; component += 1) {
    planes.forEach((axes, plane) => {
      const [low, high] = image.bounds[axes[2]];
      for (let index = low; index <= high; index += 1) {
        const seen = pattern(slice(image, component, axes, index).values);
        if (seen > best.seen) Object.assign(best, { component, plane, index, seen });
      }
    });
  }
  return best;
}
