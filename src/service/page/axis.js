// Round numbers along an axis.

/** Round steps over [low, high], about `count` of them: values and words. */
export function ticks(low, high, count = 4) {
  const raw = (high - low) / count || Math.abs(high) || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((f) => f * power >= raw * 0.999);
  const decimals = Math.min(12, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  const found = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) {
    found.push([v, (Math.abs(v) < 1e-9 * step ? 0 : v).toFixed(decimals)]);
  }
  return found;
}
