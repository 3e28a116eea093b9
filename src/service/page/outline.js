// Outlines of specimens in their section.

/** Extents of the section: x along the length; the other axis is z for holes through the thickness, y for the width. */
export function sectionOf(specimen) {
  const axis = specimen.holes[0]?.axis ?? "thickness";
  const { length_mm: length, thickness_mm: thickness, width_mm: width, wedge_mm: wedge = 0 } = specimen.block;
  const isFront = axis !== "width";
  return {
    axis,
    length,
    height: isFront ? width : thickness,
    depth: isFront ? thickness : width,
    // Of a wedge, at its thick end.
    deepest: isFront ? thickness + Math.abs(wedge) / 2 : width,
    up: isFront ? "z" : "y",
    through: isFront ? "y" : "z",
  };
}

/** Half of the extent across the section at x: of a wedge, whose holes run along its thickness, it goes along x. */
export function halfDepth(specimen, section, x) {
  const { thickness_mm: thickness, wedge_mm: wedge = 0 } = specimen.block;
  return (section.depth / 2) * (section.up === "z" ? 1 + (wedge / thickness) * (x / section.length) : 1);
}

/** What an outline may be, and what it is called. */
export const KINDS_OF_OUTLINES = [
  ["block", "block"],
  ["iso37_type4", "dumb-bell, ISO 37 type 4"],
  ["dumbbell", "dumb-bell"],
];

/** The gauge and the block of ISO 37 type 4, mm. */
const ISO37_TYPE4 = { gauge_width_mm: 2, gauge_length_mm: 12, fillet_radius_mm: 3 };
const ISO37_BLOCK = { length_mm: 35, thickness_mm: 2, width_mm: 6 };

export const kindOfOutline = ({ outline }) => (typeof outline === "object" ? "dumbbell" : (outline ?? "block"));

/** Gives a specimen another outline; a new gauge is half as wide as the block. */
export function giveOutline(specimen, kind) {
  if (kind === "block") delete specimen.outline;
  else if (kind === "iso37_type4") {
    specimen.outline = kind;
    specimen.block = { ...ISO37_BLOCK };
  } else {
    const { length_mm: length, width_mm: width } = specimen.block;
    specimen.outline = {
      dumbbell: { gauge_width_mm: width / 2, gauge_length_mm: length / 5, fillet_radius_mm: width / 2 },
    };
  }
}

/** The gauge of a dumb-bell that the section shows; none of a block. */
function gaugeOf(specimen, section) {
  const kind = kindOfOutline(specimen);
  if (kind === "block" || section.up !== "z") return null;
  return kind === "dumbbell" ? specimen.outline.dumbbell : ISO37_TYPE4;
}

/** Half of a dumb-bell's width at x: the gauge's, two arcs of one radius, the end's. */
function dumbbell(gauge, end, x) {
  const [narrow, radius] = [gauge.gauge_width_mm / 2, gauge.fillet_radius_mm];
  const arc = Math.sqrt(Math.max(0, radius ** 2 - (radius - (end - narrow) / 2) ** 2));
  const on = Math.abs(x) - gauge.gauge_length_mm / 2;
  if (on <= 0) return narrow;
  if (on <= arc) return narrow + radius - Math.sqrt(radius ** 2 - on ** 2);
  if (on < 2 * arc) return end - radius + Math.sqrt(radius ** 2 - (2 * arc - on) ** 2);
  return end;
}

/** Half of the section's height at x, mm. */
export function outlineAt(specimen, section, x) {
  const gauge = gaugeOf(specimen, section);
  return gauge ? dumbbell(gauge, section.height / 2, x) : section.height / 2;
}

/** The outline as a path, y down. */
export function outlinePath(specimen, section) {
  const half = section.length / 2;
  const count = gaugeOf(specimen, section) ? 140 : 1;
  const upper = Array.from({ length: count + 1 }, (_, i) => {
    const x = -half + (section.length * i) / count;
    return [x, outlineAt(specimen, section, x)];
  });
  const points = [...upper, ...[...upper].reverse().map(([x, y]) => [x, -y])];
  return `M${points.map(([x, y]) => `${x.toFixed(3)} ${(-y).toFixed(3)}`).join("L")}Z`;
}
