//! Trajectories: the watched variables after each step, and how far two of them are apart.

use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use model_description::{BaseType, ModelVariable};

/// Steps `n` times with changing inputs and returns all watched variables after each step.
pub(super) fn trajectory(instance: &Instance<'_>, n: u32) -> Result<Vec<Vec<Vec<u64>>>, NotDetermined> {
    let watched = instance.session.watched();
    (0..n)
        .map(|k| {
            instance.change_inputs(k)?;
            instance.steps(1, instance.session.h())?;
            instance.snapshot(&watched)
        })
        .collect()
}

/// Where two trajectories differ, and by how much.
pub(super) struct Difference {
    /// First step that differs, from 0.
    pub(super) step: usize,
    /// The variable that differs first.
    pub(super) variable: usize,
    /// The largest deviation of a floating-point variable, relative to its scale; infinite for another one.
    pub(super) largest: f64,
    /// Both values where the first variable differs most.
    pub(super) values: String,
}

/// Multiple of the tolerance by which a run may differ if an integrator with variable steps restarts.
const INTEGRATOR: f64 = 5.0;

/// Minimum scale of a deviation, for a variable without a nominal: anything far below it is noise around 0.
const MIN_SCALE: f64 = 1e-9;

/// A value of a floating-point type.
fn number(base: BaseType, bits: u64) -> f64 {
    match base {
        BaseType::Float32 => f64::from(f32::from_bits(u32::try_from(bits & 0xffff_ffff).unwrap_or(0))),
        _ => f64::from_bits(bits),
    }
}

/// Where two trajectories of these variables differ.
pub(super) fn difference(variables: &[&ModelVariable], a: &[Vec<Vec<u64>>], b: &[Vec<Vec<u64>>]) -> Option<Difference> {
    if a.len() != b.len() {
        let values = format!("{} and {} steps", a.len(), b.len());
        return Some(Difference { step: a.len().min(b.len()), variable: 0, largest: f64::INFINITY, values });
    }
    let mut rows = a.iter().zip(b).enumerate();
    let (step, variable) = rows.find_map(|(step, (x, y))| Some((step, x.iter().zip(y).position(|(x, y)| x != y)?)))?;
    let of = |(i, v): (usize, &&ModelVariable)| {
        let pairs = || a.iter().zip(b).filter_map(move |(x, y)| Some((x.get(i)?, y.get(i)?)));
        if !v.base.is_float() || pairs().any(|(x, y)| x.len() != y.len()) {
            return if pairs().all(|(x, y)| x == y) { 0.0 } else { f64::INFINITY };
        }
        let values = |x: &[u64]| x.iter().map(|bits| number(v.base, *bits)).collect::<Vec<_>>();
        // The largest value, which is at least half of the range over the run, or the nominal.
        let (mut scale, mut gap) = (v.nominal.map_or(MIN_SCALE, f64::abs).max(f64::MIN_POSITIVE), 0.0_f64);
        for (x, y) in pairs().flat_map(|(x, y)| values(x).into_iter().zip(values(y))) {
            if x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan()) {
                scale = scale.max(x.abs());
            } else if (x - y).is_finite() {
                (scale, gap) = (scale.max(x.abs()).max(y.abs()), gap.max((x - y).abs()));
            } else {
                gap = f64::INFINITY;
            }
        }
        gap / scale
    };
    let largest = variables.iter().enumerate().map(of).fold(0.0, f64::max);
    Some(Difference {
        step,
        variable,
        largest,
        values: both(variables.get(variable), &a[step][variable], &b[step][variable]),
    })
}

/// Two values of a variable, and how far they are apart.
fn both(v: Option<&&ModelVariable>, a: &[u64], b: &[u64]) -> String {
    let at = a.iter().zip(b).position(|(a, b)| a != b);
    match (v, at.map(|at| (a[at], b[at]))) {
        (Some(v), Some((a, b))) if v.base.is_float() => {
            let [a, b] = [a, b].map(|bits| number(v.base, bits));
            format!("{a:?} and {b:?}, {:.1e} apart", (a - b).abs())
        }
        (_, Some((a, b))) => format!("{} and {}", a.cast_signed(), b.cast_signed()),
        (_, None) => format!("{} and {} values", a.len(), b.len()),
    }
}

impl Session {
    /// Reports a difference between two runs that ought to be the same; below the tolerance, at a lower level.
    pub(super) fn compare(&self, what: &str, a: &[Vec<Vec<u64>>], b: &[Vec<Vec<u64>>]) {
        let watched = self.watched();
        self.compare_variables(&watched, what, a, b);
    }

    /// Compares two runs in these variables.
    pub(super) fn compare_variables(
        &self,
        variables: &[&ModelVariable],
        what: &str,
        a: &[Vec<Vec<u64>>],
        b: &[Vec<Vec<u64>>],
    ) {
        let Some(found) = difference(variables, a, b) else { return };
        let name = variables.get(found.variable).map_or("an output", |v| v.name.as_str());
        let after = if a.len() > 1 { format!(" after {} steps", found.step + 1) } else { String::new() };
        let text = format!("{what}: {name} differs{after}: {}", found.values);
        self.deviates(found.largest, &text);
    }

    /// Reports a value that is not the expected one.
    pub(super) fn value_deviates(&self, v: &ModelVariable, expected: &[u64], found: Vec<u64>, text: &str) {
        self.value_deviates_at(None, v, expected, found, text);
    }

    /// Reports a value that is not the expected one, at this level or at that of the check.
    pub(super) fn value_deviates_at(
        &self,
        lower: Option<Level>,
        v: &ModelVariable,
        expected: &[u64],
        found: Vec<u64>,
        text: &str,
    ) {
        if let Some(found) = difference(&[v], &[vec![expected.to_vec()]], &[vec![found]]) {
            self.deviates_at(lower, found.largest, text);
        }
    }

    /// Reports a deviation, relative to the largest value.
    pub(super) fn deviates(&self, largest: f64, text: &str) {
        self.deviates_at(None, largest, text);
    }

    /// Reports a deviation at this level, or at that of the check.
    pub(super) fn deviates_at(&self, lower: Option<Level>, largest: f64, text: &str) {
        let tolerance = self.tolerance();
        let (level, text) = if largest <= tolerance {
            (Some(Level::Hard), format!("{text}; relative deviation {largest:.1e}, within {tolerance:e}"))
        } else if largest <= INTEGRATOR * tolerance {
            // The deviation of an integrator with variable steps that restarts.
            (
                Some(Level::Should),
                format!("{text}; relative deviation {largest:.1e}, within {INTEGRATOR} times {tolerance:e}"),
            )
        } else if largest.is_finite() {
            (lower, format!("{text}; relative deviation {largest:.1e}, above {tolerance:e}"))
        } else {
            (lower, text.into())
        };
        match level {
            Some(level) => self.lesser(level, text),
            None => self.violated(text),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_is_relative_to_the_largest_value_of_its_variable() {
        let xml = br#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t"><ModelVariables>
            <Float64 name="x" valueReference="1" causality="output"/><Int32 name="n" valueReference="2" causality="output"/>
            </ModelVariables><ModelStructure/></fmiModelDescription>"#;
        let description = model_description::read(xml).unwrap();
        let variables: Vec<_> = description.variables.iter().collect();
        let row = |x: f64, n: u64| vec![vec![x.to_bits()], vec![n]];
        let first = [row(1.0, 3), row(-4.0, 3), row(2.0, 3)];
        assert!(difference(&variables, &first, &first).is_none());
        let found = difference(&variables, &first, &[row(1.0, 3), row(-4.0, 3), row(2.5, 3)]).unwrap();
        assert_eq!((found.step, found.variable, found.largest.to_bits()), (2, 0, 0.125_f64.to_bits()));
        let found = difference(&variables, &first, &[row(1.0, 3), row(-4.0, 4), row(2.0, 3)]).unwrap();
        assert!((found.step, found.variable) == (1, 1) && found.largest.is_infinite());
        let found = difference(&variables, &first, &first[..2]).unwrap();
        assert!(found.step == 2 && found.largest.is_infinite());
        let noise = |x: f64| [row(x, 3)];
        let found = difference(&variables, &noise(0.0), &noise(-8.7e-18)).unwrap();
        assert!(found.largest < 1e-8 && found.values == "0.0 and -8.7e-18, 8.7e-18 apart", "{}", found.values);
        let nan = [row(f64::NAN, 3)];
        assert!(difference(&variables, &nan, &nan).is_none());
        assert!(difference(&variables, &nan, &[row(0.0, 3)]).unwrap().largest.is_infinite());
    }
}
