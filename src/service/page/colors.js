// The colours of signed quantities.

/** Blue over white to red; t from -1 to 1. */
export function diverging(t) {
  const s = Math.max(-1, Math.min(1, t));
  const end = s < 0 ? [33, 82, 168] : [178, 32, 38];
  const w = Math.abs(s) ** 0.8;
  return end.map((c) => Math.round(255 + (c - 255) * w));
}
