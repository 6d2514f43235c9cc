//! The colors of the estimators, in every figure and on every page: the class of an estimator determines the tones, and its
//! position among the estimators of these tones determines the color. A new estimator takes the first color that is not in use.

use drive::estimator::{Class, Kind};
use fmu_plot::ink::Ink;

/// Light tones for the estimators that follow the back EMF.
const LIGHT: &[Ink] = &[
    "#dc5d63", "#d66919", "#0593e6", "#16a56e", "#c063ba", "#b08505", "#179fa5", "#847ae8", "#769c03", "#f00cf0",
    "#f03ca8", "#b286a7",
];

/// Dark tones for the others.
const DARK: &[Ink] =
    &["#0775b9", "#ae520a", "#0d8557", "#a1469c", "#8d6a06", "#695dc8", "#bb3e48", "#a40cf0", "#0c58f0", "#735e7d"];

/// Gray for the sensor, the reference for all others.
const SENSOR: &[Ink] = &["#7d8489"];

fn tones(kind: Kind) -> &'static [Ink] {
    match kind.class() {
        Class::BackEmf => LIGHT,
        Class::Sensored => SENSOR,
        Class::FluxObserver | Class::Injection | Class::Hybrid => DARK,
    }
}

/// The color of an estimator. A variant is drawn dashed in the color of its estimator.
pub fn of(kind: Kind) -> Ink {
    let tones = tones(kind);
    let before = Kind::ALL.iter().take_while(|other| **other != kind);
    tones[before.filter(|other| self::tones(**other) == tones).count() % tones.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_plot::ink::{PAPERS, contrast};

    #[test]
    fn every_estimator_has_a_color_of_its_own() {
        for (k, kind) in Kind::ALL.iter().enumerate() {
            let twin = Kind::ALL[..k].iter().find(|other| of(**other) == of(*kind));
            assert!(twin.is_none(), "{kind:?} has the color of {twin:?}: append a color to LIGHT or DARK");
        }
        assert_eq!((of(Kind::Rasmussen), of(Kind::SlidingMode)), ("#0775b9", "#769c03"));
    }

    #[test]
    fn every_color_is_seen_on_both_papers() {
        for ink in [LIGHT, DARK, SENSOR].concat() {
            for paper in PAPERS {
                assert!(contrast(ink, paper) > 3.0, "{ink} on {paper}: {:.2}", contrast(ink, paper));
            }
        }
    }
}
