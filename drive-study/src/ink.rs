//! The colors of all plots and pages, in one place.

use drive::estimator::Kind;

/// A color as `#rrggbb`.
pub type Ink = &'static str;

/// Curves that have no color of their own: distinguishable with color blindness (Okabe and Ito; the blue lighter, for dark paper).
pub const CURVES: [Ink; 7] = ["#0a80c4", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#808080"];

/// References and what frames others.
pub const REFERENCE: Ink = CURVES[6];

/// The color of an estimator, in every plot and on every page, with a contrast of at least 3 to white and to the dark paper:
/// light tones for those that follow the back EMF, dark ones for the others. A variant has the color of its estimator and a dashed line.
pub fn of(kind: Kind) -> Ink {
    match kind {
        Kind::DirectEmf => "#dc5d63",
        Kind::EmfObserver => "#d66919",
        Kind::ExtendedEmf => "#0593e6",
        Kind::VoltageModel => "#16a56e",
        Kind::CurrentModel => "#c063ba",
        Kind::VoltageFeedback => "#b08505",
        Kind::KalmanFilter => "#179fa5",
        Kind::GradientObserver => "#847ae8",
        Kind::SlidingMode => "#769c03",
        Kind::Rasmussen => "#0775b9",
        Kind::FluxObserver => "#bb3e48",
        Kind::RotatingInjection => "#ae520a",
        Kind::PulsatingInjection => "#0d8557",
        Kind::SquareWaveInjection => "#a1469c",
        Kind::NearPwmInjection => "#8d6a06",
        Kind::Hybrid => "#695dc8",
        Kind::Sensored => "#7d8489",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance and contrast of WCAG 2.2.
    fn contrast(one: &str, other: &str) -> f64 {
        let luminance = |ink: &str| {
            let part = |at: usize| {
                let x = f64::from(u8::from_str_radix(&ink[at..at + 2], 16).unwrap()) / 255.0;
                if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
            };
            0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5) + 0.05
        };
        let (a, b) = (luminance(one), luminance(other));
        a.max(b) / a.min(b)
    }

    #[test]
    fn every_estimator_has_a_color_of_its_own_that_is_seen_on_both_papers() {
        let inks: Vec<Ink> = Kind::ALL.iter().map(|kind| of(*kind)).collect();
        for (k, ink) in inks.iter().enumerate() {
            assert!(!inks[k + 1..].contains(ink), "{ink} twice");
            for paper in ["#ffffff", "#15191c"] {
                assert!(contrast(ink, paper) > 3.0, "{ink} on {paper}: {}", contrast(ink, paper));
            }
        }
    }
}
