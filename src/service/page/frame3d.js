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

/** An arrow in the plane of x and z from `start`, along the unit vector `way`. */
function arrow([x, y, z], [dx, , dz], length) {
  const tip = 0.18 * length;
  const at = (along, across) => [x + along * dx - across * dz, y, z + along * dz + across * dx];
  const end = at(length, 0);
  return [[x, y, z], end, end, at(length - tip, tip / 2), end, at(length - tip, -tip / 2)];
}

/**
 * The axis along which a surface is held, and how its moved end went: where all of one of its ends has moved alike, by
 * the drive, and the other has not.
 */
function heldAxis(surface, half) {
  const { reference_mm: at, displacement_mm: moved, drive_mm: drive } = surface;
  const held = (k) => {
    let [kept, worst, way] = [0, 0, null];
    for (let i = 0; i < at.length; i += 3) {
      const side = at[i + k] / half[k];
      if (Math.abs(side) < 0.999) continue;
      kept += 1;
      const own = [moved[i], moved[i + 1], moved[i + 2]];
      if (side > 0) way ??= own;
      const expected = side > 0 ? way : [0, 0, 0];
      worst = Math.max(worst, ...own.map((u, c) => Math.abs(u - expected[c])));
    }
    if (way === null) return null;
    worst = Math.max(worst, Math.abs(Math.hypot(...way) - Math.abs(drive)));
    return kept > 0 && worst < 0.02 * Math.abs(drive) ? { axis: k, way } : null;
  };
  return held(1) ?? held(0);
}

/** Lines of the frame: places at rest and their displacement, mm; nothing where it is not seen how it is held. */
export function frameOf(surface) {
  const half = halves(surface.reference_mm);
  const held = heldAxis(surface, half);
  if (held === null) return null;
  const { axis, way: drive } = held;
  const others = [0, 1, 2].filter((k) => k !== axis).map((k) => 1.12 * half[k]);
  const fixed = closed(rectangle(axis, -1.01 * half[axis], others));
  const moving = closed(rectangle(axis, 1.01 * half[axis], others));
  const start = axis === 1 ? [0, 1.01 * half[1], 1.25 * half[2]] : [0.75 * half[0], 0, 1.4 * half[2]];
  const unit = drive.map((u) => u / Math.hypot(...drive));
  const lines = [
    ...fixed.map((p) => [p, [0, 0, 0]]),
    ...[...moving, ...arrow(start, unit, 0.3 * half[0])].map((p) => [p, drive]),
  ];
  return { at: new Float32Array(lines.flatMap((l) => l[0])), moved: new Float32Array(lines.flatMap((l) => l[1])) };
}
