// Where a section is thinner than its limits: between holes, to the edges, and holes of a wrong size.

import { gapOf, reachOf } from "./hole.js";
import { outlineAt } from "./outline.js";

/** A place that breaks a limit: from, to (mm), value and limit (mm), and where there is room for words. */
const broken = (from, to, value, limit, room) => ({ from, to, value, limit, room });

function betweenHoles(holes, limit) {
  const found = [];
  holes.forEach((a, i) =>
    holes.slice(i + 1).forEach((b) => {
      const { value, n } = gapOf(a, b);
      if (value >= limit - 1e-9) return;
      const along = (hole, sign) => [0, 1].map((k) => hole.center_mm[k] + sign * n[k] * reachOf(hole, n));
      const room = [0, 1].map((k) => (a.center_mm[k] + b.center_mm[k]) / 2);
      room[1] += Math.max(reachOf(a, [0, 1]), reachOf(b, [0, 1]));
      found.push(broken(along(a, 1), along(b, -1), value, limit, room));
    }),
  );
  return found;
}

function toEdges(holes, specimen, section, limit) {
  return holes.flatMap((hole) => {
    const [x, y] = hole.center_mm;
    const [r, t] = [reachOf(hole, [1, 0]), reachOf(hole, [0, 1])];
    const half = outlineAt(specimen, section, x);
    const toSides = [
      [[x, y + t], [x, half], half - y - t],
      [[x, y - t], [x, -half], half + y - t],
      [[x + r, y], [section.length / 2, y], section.length / 2 - x - r],
      [[x - r, y], [-section.length / 2, y], section.length / 2 + x - r],
    ];
    // A notch opens to the nearest side.
    const own = hole.is_notch ? Math.min(...toSides.map(([, , value]) => value)) : null;
    return toSides
      .filter(([, , value]) => value !== own)
      .filter(([, , value]) => value < limit - 1e-9)
      .map(([from, to, value]) => broken(from, to, value, limit, [x, y + t]));
  });
}

/** All places that break a limit. Where a ligament has too few voxels, the thinnest one is the place. */
export function brokenLigaments(model, section) {
  const { holes } = model.specimen;
  const { min_ligament_hole_hole_mm: between, min_ligament_hole_edge_mm: edge } = model.limits;
  const thinnerThan = (a, b) => [...betweenHoles(holes, a), ...toEdges(holes, model.specimen, section, b)];
  const found = thinnerThan(between ?? 0, edge ?? 0);
  if (found.length > 0 || !model.brokenLimits?.includes("min_voxels_across_ligament")) return found;
  return thinnerThan(Infinity, Infinity)
    .sort((a, b) => a.value - b.value)
    .slice(0, 1)
    .map((one) => ({ ...one, limit: null }));
}

/** Holes whose diameter breaks a limit, by number. */
export function wrongDiameters(model) {
  const { min = 0, max = Infinity } = model.limits.diameter_mm ?? {};
  return new Set(
    model.specimen.holes.flatMap((o, i) => (o.diameter_mm < min - 1e-9 || o.diameter_mm > max + 1e-9 ? [i] : [])),
  );
}
