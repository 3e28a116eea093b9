//! Colours: perceptually uniform maps and the few inks of the house.

/// Main text and lines.
pub(super) const INK: &str = "#222222";
/// Secondary text.
pub(super) const MUTED: &str = "#666666";
/// Axis lines and ticks.
pub(super) const AXIS: &str = "#8c8c8c";
/// Grid lines.
pub(super) const GRID: &str = "#e8e8e8";
/// What is outside or missing.
pub(super) const EMPTY: &str = "#f3f3f1";
/// The base specimen.
pub(super) const BASE: &str = "#76848f";
/// The best specimen.
pub(super) const BEST: &str = "#c8511b";
/// Neutral emphasis.
pub(super) const ACCENT: &str = "#20639b";
/// Infeasible or unimportant marks.
pub(super) const FAINT: &str = "#c6c6c4";
/// A violated limit.
pub(super) const BAD: &str = "#b3261e";
/// Colours of series beyond base and best.
pub(super) const SERIES: [&str; 6] = [BASE, BEST, ACCENT, "#3b8465", "#8a5a9e", "#a8882b"];

/// The colour of a series: base and best have theirs in every picture, whatever their places.
pub(super) fn of_series(name: &str, place: usize) -> &'static str {
    match name {
        "base" => BASE,
        "best" => BEST,
        _ => SERIES[place % SERIES.len()],
    }
}

/// A colour map from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorMap {
    /// Viridis (van der Walt and Smith, CC0): for quantities without a special value.
    #[default]
    Viridis,
    /// Magma (van der Walt and Smith, CC0): dark where there is little.
    Magma,
    /// Blue – white – red, white in the middle: for signed quantities. The range is made symmetric about zero.
    Diverging,
}

/// Every sixteenth entry of the 256-entry tables; between them linear interpolation errs by less than 2/255.
const VIRIDIS: [u32; 17] = [
    0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c, 0x1f9f88, 0x27ad81,
    0x3dbc74, 0x5cc863, 0x81d34d, 0xaadc32, 0xd5e21a, 0xfde725,
];
const MAGMA: [u32; 17] = [
    0x000004, 0x0a0822, 0x1d1147, 0x36106b, 0x51127c, 0x6a1c81, 0x832681, 0x9c2e7f, 0xb73779, 0xcf4070, 0xe55064,
    0xf4695c, 0xfb8761, 0xfea571, 0xfec287, 0xfde0a1, 0xfcfdbf,
];
const DIVERGING: [u32; 17] = [
    0x053061, 0x175290, 0x2a71b2, 0x3f8ec0, 0x6bacd1, 0x9bc9e0, 0xc2ddec, 0xe0ecf3, 0xf7f6f6, 0xfbe6da, 0xfbceb7,
    0xf5ac8b, 0xe58368, 0xd25849, 0xbb2a34, 0x960f27, 0x67001f,
];

impl ColorMap {
    /// Red, green, blue in 0..=255 at `fraction`, which is clamped to [0, 1]; NaN counts as 0.
    pub(super) fn rgb(self, fraction: f64) -> [f64; 3] {
        let table = match self {
            ColorMap::Viridis => &VIRIDIS,
            ColorMap::Magma => &MAGMA,
            ColorMap::Diverging => &DIVERGING,
        };
        let x = if fraction.is_nan() { 0.0 } else { 16.0 * fraction.clamp(0.0, 1.0) };
        let cell = (x as usize).min(15);
        let t = x - cell as f64;
        let channel = |color: u32, shift: u32| f64::from(color >> shift & 0xff);
        [16, 8, 0].map(|s| (1.0 - t) * channel(table[cell], s) + t * channel(table[cell + 1], s))
    }

    /// `#rrggbb` at `fraction`.
    pub(super) fn hex(self, fraction: f64) -> String {
        hex(self.rgb(fraction))
    }

    /// The range of a colour scale for values from `low` to `high`: symmetric about zero for [`ColorMap::Diverging`],
    /// never empty.
    pub(super) fn range(self, [low, high]: [f64; 2]) -> [f64; 2] {
        if self == ColorMap::Diverging {
            let end = low.abs().max(high.abs()).max(f64::MIN_POSITIVE);
            return [-end, end];
        }
        let scale = low.abs().max(high.abs());
        if high - low > 1e-9 * scale {
            return [low, high];
        }
        let half = if scale > 0.0 { 0.05 * scale } else { 0.5 };
        [low - half, high + half]
    }
}

/// `#rrggbb`; channels are clamped to 0..=255.
pub(super) fn hex(rgb: [f64; 3]) -> String {
    let [r, g, b] = rgb.map(|c| c.round().clamp(0.0, 255.0) as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Ink that is readable on a colour: white on dark, dark on light.
pub(super) fn ink_on([r, g, b]: [f64; 3]) -> &'static str {
    if 0.299 * r + 0.587 * g + 0.114 * b < 140.0 { "#ffffff" } else { INK }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_hit_their_ends() {
        assert_eq!(ColorMap::Viridis.hex(0.0), "#440154");
        assert_eq!(ColorMap::Viridis.hex(1.0), "#fde725");
        assert_eq!(ColorMap::Magma.hex(2.0), "#fcfdbf");
        assert_eq!(ColorMap::Magma.hex(f64::NAN), "#000004");
        assert_eq!(ColorMap::Diverging.hex(0.5), "#f7f6f6");
    }

    #[test]
    fn a_specimen_has_one_colour_at_every_place() {
        assert_eq!([of_series("base", 0), of_series("base", 1)], [BASE; 2]);
        assert_eq!([of_series("best", 0), of_series("best", 1)], [BEST; 2]);
        assert_ne!(of_series("other", 2), of_series("another", 3));
    }

    #[test]
    fn ranges_are_never_empty() {
        assert_eq!(ColorMap::Diverging.range([-1.0, 3.0]), [-3.0, 3.0]);
        for map in [ColorMap::Viridis, ColorMap::Diverging] {
            for value in [0.0, 5.0, -2.0] {
                let [low, high] = map.range([value, value]);
                assert!(low < high);
            }
        }
    }

    /// Lightness grows along the sequential maps: they stay ordered in grey print.
    #[test]
    fn sequential_maps_grow_lighter() {
        for map in [ColorMap::Viridis, ColorMap::Magma] {
            let luma = |t: f64| {
                let [r, g, b] = map.rgb(t);
                0.299 * r + 0.587 * g + 0.114 * b
            };
            for i in 0..64 {
                assert!(luma(f64::from(i + 1) / 64.0) > luma(f64::from(i) / 64.0));
            }
        }
    }
}
