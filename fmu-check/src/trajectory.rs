//! Trajectories: the watched variables after each step, and how far two of them are apart.

use crate::confidence::Confidence;
use crate::encoding::show;
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use model_description::{BaseType, FmiVersion, ModelVariable};

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

/// The variable in which two trajectories differ most, and where.
pub(super) struct Difference {
    /// Index of the variable.
    pub(super) variable: usize,
    /// First step in which it differs, from 0.
    pub(super) first: usize,
    /// The step in which it differs most, from 0.
    pub(super) step: usize,
    /// The deviation there, relative to the scale of the variable; infinite if it is not a floating-point number.
    pub(super) largest: f64,
    /// Both values there; for an array, the values of an element.
    pub(super) values: [String; 2],
    /// The element of an array, from 1.
    element: Option<usize>,
    /// The largest value of the run, if the deviation there is relative to another value than these two.
    scale: Option<f64>,
    /// There is only one step.
    single: bool,
}

impl Difference {
    /// Where it differs: ` from step 1 on, most after 3 steps`.
    pub(super) fn at(&self) -> String {
        let (first, step) = (self.first + 1, self.step + 1);
        let element = self.element.map(|k| format!(" in element {k}")).unwrap_or_default();
        match (self.single, first == step) {
            (true, _) => element,
            (_, true) => format!("{element} after {}", steps(step)),
            _ => format!("{element} from step {first} on, most after {}", steps(step)),
        }
    }

    /// Where the second trajectory differs from the first, and both values: ` after 3 steps: 2.0, expected 1.0`.
    pub(super) fn text(&self) -> String {
        let [expected, found] = &self.values;
        let scale = self.scale.map(|scale| format!("; the largest value is {scale:?}")).unwrap_or_default();
        format!("{}: {found}, expected {expected}{scale}", self.at())
    }
}

/// A number of steps.
pub(super) fn steps(n: usize) -> String {
    if n == 1 { "1 step".into() } else { format!("{n} steps") }
}

/// Multiple of the tolerance by which a run may differ if an integrator with variable steps restarts.
const INTEGRATOR: f64 = 5.0;

/// Relative deviation above which a variable-step integrator cannot be the cause.
const LARGE: f64 = 1e-3;

/// Minimum scale of a deviation, for a variable without a nominal: anything far below it is noise around 0.
const MIN_SCALE: f64 = 1e-9;

/// A value of a floating-point type.
fn number(base: BaseType, bits: u64) -> f64 {
    match base {
        BaseType::Float32 => f64::from(f32::from_bits(u32::try_from(bits & 0xffff_ffff).unwrap_or(0))),
        _ => f64::from_bits(bits),
    }
}

/// The variable in which two trajectories of these variables differ most.
pub(super) fn difference(
    version: FmiVersion,
    variables: &[&ModelVariable],
    a: &[Vec<Vec<u64>>],
    b: &[Vec<Vec<u64>>],
) -> Option<Difference> {
    if a.len() != b.len() {
        let (step, values) = (a.len().min(b.len()), [a, b].map(|run| format!("a run of {}", steps(run.len()))));
        let (largest, element, scale) = (f64::INFINITY, None, None);
        return Some(Difference { variable: 0, first: step, step, largest, values, element, scale, single: false });
    }
    let each = variables.iter().enumerate().filter_map(|(i, v)| of_variable(version, (i, v), a, b));
    each.reduce(|most, other| if other.largest > most.largest { other } else { most })
}

/// Where two trajectories of one variable differ.
fn of_variable(
    version: FmiVersion,
    (i, v): (usize, &ModelVariable),
    a: &[Vec<Vec<u64>>],
    b: &[Vec<Vec<u64>>],
) -> Option<Difference> {
    let pairs = || a.iter().zip(b).map(|(x, y)| (x[i].as_slice(), y[i].as_slice())).enumerate();
    let first = pairs().find_map(|(step, (x, y))| (x != y).then_some(step))?;
    let numbers = v.base.is_float() && pairs().all(|(_, (x, y))| x.len() == y.len());
    let (mut step, mut largest, mut of) = (first, f64::INFINITY, None);
    if numbers {
        // The largest value, which is at least half of the range over the run, or the nominal.
        let (mut scale, mut gap) = (v.nominal.map_or(MIN_SCALE, f64::abs).max(f64::MIN_POSITIVE), 0.0_f64);
        for (k, (x, y)) in pairs().flat_map(|(k, (x, y))| x.iter().zip(y).map(move |pair| (k, pair))) {
            let [x, y] = [x, y].map(|bits| number(v.base, *bits));
            let difference = if x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan()) {
                scale = scale.max(x.abs());
                0.0
            } else if (x - y).is_finite() {
                scale = scale.max(x.abs()).max(y.abs());
                (x - y).abs()
            } else {
                f64::INFINITY
            };
            if difference > gap {
                (gap, step) = (difference, k);
            }
        }
        (largest, of) = (gap / scale, Some(scale));
    }
    let (element, values) = farthest(version, v, &a[step][i], &b[step][i]);
    let is_there = |scale: &f64| values.iter().filter_map(|text| text.parse().ok()).any(|x: f64| x.abs() >= *scale);
    let scale = of.filter(|scale| largest.is_finite() && !is_there(scale));
    Some(Difference { variable: i, first, step, largest, values, element, scale, single: a.len() == 1 })
}

/// Two values of a variable: for an array, the pair that is farthest apart, and its number from 1.
fn farthest(version: FmiVersion, v: &ModelVariable, a: &[u64], b: &[u64]) -> (Option<usize>, [String; 2]) {
    if a.len() != b.len() {
        let one = |x: &[u64]| if x.is_empty() { "no value".into() } else { format!("{} values", x.len()) };
        return (None, [one(a), one(b)]);
    }
    let distance = |k: &usize| (number(v.base, a[*k]) - number(v.base, b[*k])).abs();
    let mut unequal = (0..a.len()).filter(|k| a[*k] != b[*k]);
    let k = if v.base.is_float() { unequal.max_by(|x, y| distance(x).total_cmp(&distance(y))) } else { unequal.next() };
    let k = k.unwrap_or(0);
    ((a.len() > 1).then_some(k + 1), [a, b].map(|all| show(v, version, &all[k..=k])))
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
        if let [v] = variables
            && !self.is_steady(v)
        {
            return;
        }
        let Some(found) = difference(self.description.version, variables, a, b) else { return };
        let name = variables.get(found.variable).map_or("an output", |v| v.name.as_str());
        let text = format!("{what}: {name} differs{}", found.text());
        self.deviates(found.largest, &text);
    }

    /// Reports a value that differs from the expected one.
    pub(super) fn value_deviates(&self, v: &ModelVariable, expected: &[u64], found: Vec<u64>, text: &str) {
        self.value_deviates_at(None, v, expected, found, text);
    }

    /// Reports a value that differs from the expected one, at this level or the check's.
    pub(super) fn value_deviates_at(
        &self,
        lower: Option<Level>,
        v: &ModelVariable,
        expected: &[u64],
        found: Vec<u64>,
        text: &str,
    ) {
        if !self.is_steady(v) {
            return;
        }
        if let Some(found) = difference(self.description.version, &[v], &[vec![expected.to_vec()]], &[vec![found]]) {
            self.deviates_at(lower, found.largest, text);
        }
    }

    /// Reports a deviation, relative to the largest value.
    pub(super) fn deviates(&self, largest: f64, text: &str) {
        self.deviates_at(None, largest, text);
    }

    /// Reports a deviation at this level or the check's.
    pub(super) fn deviates_at(&self, lower: Option<Level>, largest: f64, text: &str) {
        let tolerance = self.tolerance();
        let (level, range) = if largest <= tolerance {
            (Some(Level::Hard), format!("within the tolerance {tolerance:e}"))
        } else if largest <= INTEGRATOR * tolerance {
            // The deviation of an integrator with variable steps that restarts.
            (Some(Level::Should), format!("within {INTEGRATOR} times the tolerance {tolerance:e}"))
        } else {
            (lower, format!("above the tolerance {tolerance:e}"))
        };
        let confidence = if largest < LARGE { Confidence::Likely } else { Confidence::Certain };
        let size =
            if largest.is_finite() { format!("; relative deviation {largest:.1e}, {range}") } else { String::new() };
        self.report(level, confidence, format!("{text}{size}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_description::FmiVersion::V3;

    #[test]
    fn a_difference_is_relative_to_the_largest_value_of_its_variable() {
        let xml = br#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t"><ModelVariables>
            <Float64 name="x" valueReference="1" causality="output"/><Int32 name="n" valueReference="2" causality="output"/>
            </ModelVariables><ModelStructure/></fmiModelDescription>"#;
        let description = model_description::read(xml).unwrap();
        let variables: Vec<_> = description.variables.iter().collect();
        let row = |x: f64, n: u64| vec![vec![x.to_bits()], vec![n]];
        let first = [row(1.0, 3), row(-4.0, 3), row(2.0, 3)];
        assert!(difference(V3, &variables, &first, &first).is_none());
        let found = difference(V3, &variables, &first, &[row(1.0, 3), row(-4.0, 3), row(2.5, 3)]).unwrap();
        assert_eq!((found.step, found.variable, found.largest.to_bits()), (2, 0, 0.125_f64.to_bits()));
        // The values are taken at the point with the largest deviation.
        let found = difference(V3, &variables, &first, &[row(1.1, 3), row(-4.0, 3), row(2.5, 3)]).unwrap();
        assert_eq!((found.first, found.step), (0, 2));
        assert_eq!(found.text(), " from step 1 on, most after 3 steps: 2.5, expected 2.0; the largest value is 4.0");
        let found = difference(V3, &variables, &first, &[row(1.0, 3), row(-4.0, 4), row(2.0, 3)]).unwrap();
        assert!((found.step, found.variable) == (1, 1) && found.largest.is_infinite());
        // Integers have their sign.
        let found = difference(V3, &variables, &[row(1.0, 3)], &[row(1.0, 0xffff_ffff)]).unwrap();
        assert_eq!(found.text(), ": -1, expected 3");
        let found = difference(V3, &variables, &first, &first[..2]).unwrap();
        assert!(found.step == 2 && found.largest.is_infinite());
        let noise = |x: f64| [row(x, 3)];
        let found = difference(V3, &variables, &noise(0.0), &noise(-8.7e-18)).unwrap();
        assert!(found.largest < 1e-8 && found.values == ["0.0", "-8.7e-18"], "{:?}", found.values);
        let nan = [row(f64::NAN, 3)];
        assert!(difference(V3, &variables, &nan, &nan).is_none());
        assert!(difference(V3, &variables, &nan, &[row(0.0, 3)]).unwrap().largest.is_infinite());
    }
}
