// Outlines of specimens in their section.

/** Extents of the section: x along the length; the other axis is z for holes through the thickness, y for the width. */
export function sectionOf(specimen) {
  const axis = specimen.holes[0]?.axis ?? "thickness";
  const { length_mm: length, thickness_mm: thickness, width_mm: width } = specimen.block;
  const isFront = axis !== "width";
  return {
    axis,
    length,
    height: isFront ? width : thickness,
    depth: isFront ? thickness : width,
    up: isFront ? "z" : "y",
    through: isFront ? "y" : "z",
  };
}

const isDumbbell = (specimen, section) => specimen.outline === "iso37_type4" && section.up === "z";

/** ISO 37 type 4, mm: half of the narrow length, half-widths, radius of both arcs of a transition, and their length. */
const NARROW = 6;
const [HALF_NARROW, HALF_END, RADIUS] = [1, 3, 3];
const ARC = Math.sqrt(RADIUS ** 2 - (RADIUS - (HALF_END - HALF_NARROW) / 2) ** 2);

function dumbbell(x) {
  const on = Math.abs(x) - NARROW;
  if (on <= 0) return HALF_NARROW;
  if (on <= ARC) return HALF_NARROW + RADIUS - Math.sqrt(RADIUS ** 2 - on ** 2);
  if (on < 2 * ARC) return HALF_END - RADIUS + Math.sqrt(RADIUS ** 2 - (2 * ARC - on) ** 2);
  return HALF_END;
}

/** Half of the section's height at x, mm. */
export const outlineAt = (specimen, section, x) => (isDumbbell(specimen, section) ? dumbbell(x) : section.height / 2);

/** The outline as a path, y down. */
export function outlinePath(specimen, section) {
  const half = section.length / 2;
  const count = isDumbbell(specimen, section) ? 140 : 1;
  const upper = Array.from({ length: count + 1 }, (_, i) => {
    const x = -half + (section.length * i) / count;
    return [x, outlineAt(specimen, section, x)];
  });
  const points = [...upper, ...[...upper].reverse().map(([x, y]) => [x, -y])];
  return `M${points.map(([x, y]) => `${x.toFixed(3)} ${(-y).toFixed(3)}`).join("L")}Z`;
}
