// What holds and moves a specimen, as lines in space: plates or grips, and an arrow along the drive.

/** Corners of a rectangle: the axis that it stands on, where, and its half extents along the other two. */
function rectangle(axis, at, [a, b]) {
  const others = [0, 1, 2].filter((k) => k !== axis);
  return [
    [-a, -b],
    [a, -b],
    [a, b],
    [-a, b],
  ].map(([u, v]) => {
    const p = [0, 0, 0];
    p[axis] = at;
    p[others[0]] = u;
    p[others[1]] = v;
    return p;
  });
}

const closed = (points) => points.flatMap((p, i) => [p, points[(i + 1) % points.length]]);

/** Extents of a surface, mm: half along each axis. */
const halves = (reference) =>
  [0, 1, 2].map((k) => {
    let most = 0;
    for (let i = k; i < reference.length; i += 3) most = Math.max(most, Math.abs(reference[i]));
    return most;
  });

/** An arrow along x from `start`. */
function arrow([x, y, z], length) {
  const tip = 0.18 * length;
  const end = [x + length, y, z];
  return [[x, y, z], end, end, [end[0] - tip, y, z + tip / 2], end, [end[0] - tip, y, z - tip / 2]];
}

/** The axis along which a surface is held: where one of its ends has moved by the drive and the other has not. */
function heldAxis(surface, half) {
  const { reference_mm: at, displacement_mm: moved, drive_mm: drive } = surface;
  const isHeld = (k) => {
    let [kept, worst] = [0, 0];
    for (let i = 0; i < at.length; i += 3) {
      const side = at[i + k] / half[k];
      if (Math.abs(side) < 0.999) continue;
      kept += 1;
      worst = Math.max(worst, Math.abs(moved[i] - (side > 0 ? drive : 0)));
    }
    return kept > 0 && worst < 0.02 * Math.abs(drive);
  };
  return [1, 0].find(isHeld);
}

/** Lines of the frame: places at rest and their displacement, mm; nothing where it is not seen how it is held. */
export function frameOf(surface) {
  const half = halves(surface.reference_mm);
  const axis = heldAxis(surface, half);
  if (axis === undefined) return null;
  const others = [0, 1, 2].filter((k) => k !== axis).map((k) => 1.12 * half[k]);
  const fixed = closed(rectangle(axis, -1.01 * half[axis], others));
  const moving = closed(rectangle(axis, 1.01 * half[axis], others));
  const start = axis === 1 ? [0, 1.01 * half[1], 1.25 * half[2]] : [0.75 * half[0], 0, 1.4 * half[2]];
  const drive = [surface.drive_mm, 0, 0];
  const lines = [
    ...fixed.map((p) => [p, [0, 0, 0]]),
    ...[...moving, ...arrow(start, 0.3 * half[0])].map((p) => [p, drive]),
  ];
  return { at: new Float32Array(lines.flatMap((l) => l[0])), moved: new Float32Array(lines.flatMap((l) => l[1])) };
}
