//! Default colors of curves.

/// A color as `#rrggbb`.
pub type Ink = &'static str;

/// Colors for curves, distinguishable with color blindness (Okabe and Ito; the blue is lighter, for dark paper).
pub const CURVES: [Ink; 7] = ["#0a80c4", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#808080"];

/// The color of references, and of marks.
pub const REFERENCE: Ink = CURVES[6];

/// Light and dark background, as in the style of a page.
pub const PAPERS: [Ink; 2] = ["#ffffff", "#15191c"];

/// Contrast of two colors by WCAG 2.2, from 1 to 21: at least 3 for a curve on each of the [`PAPERS`].
pub fn contrast(one: &str, other: &str) -> f64 {
    let luminance = |ink: &str| {
        let part = |at: usize| {
            let byte = ink.get(at..at + 2).and_then(|text| u8::from_str_radix(text, 16).ok());
            let x = f64::from(byte.unwrap_or_default()) / 255.0;
            if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5) + 0.05
    };
    let (a, b) = (luminance(one), luminance(other));
    a.max(b) / a.min(b)
}
