//! Runs with other communication steps reach the same results (FMI 2.0.5, 4.2.2; FMI 3.0.2, 4.2.1).

use crate::instance::Instance;
use crate::session::{NotDetermined, Session};
use model_description::{BaseType, ModelVariable};

/// Share of the largest value by which a result may differ.
const OF_VALUE: f64 = 0.1;
/// Share of the change over the run by which a result may differ.
const OF_CHANGE: f64 = 0.5;
/// A variable that changes by less than this share of its largest value is constant.
const CONSTANT: f64 = 1e-4;
/// Steps of the usual size, and how many more if no variable changes in them.
const STEPS: usize = 42;
const MORE: usize = 60;
/// Number of usual steps between two points, and of other steps.
const SIZES: [(u32, u32); 3] = [(1, 2), (2, 1), (3, 2)];

pub(crate) fn step_sizes(session: &Session) -> Result<(), NotDetermined> {
    if !session.flag("canHandleVariableCommunicationStepSize") {
        return session.not_applicable("the communication step may not change");
    }
    let fits = |v: &&ModelVariable| v.base == BaseType::Float64 && !v.is_array();
    let watched: Vec<_> = session.watched().into_iter().filter(fits).collect();
    let h = session.h();
    let begin = || {
        let instance = session.stepping()?;
        instance.change_inputs(3)?;
        let rows = vec![instance.numbers(&watched)?];
        Ok((instance, rows))
    };
    let (instance, mut usual) = begin()?;
    advance(&instance, &watched, &mut usual, (STEPS, 1, h))?;
    if (0..watched.len()).all(|i| !Extent::of(watched[i], &column(&usual, i)).moves()) {
        let end = session.description.default_experiment.stop.unwrap_or(f64::INFINITY) - 0.5 * h;
        let mut left = MORE;
        while left > 0 && instance.time.get() < end {
            advance(&instance, &watched, &mut usual, (1, 1, h))?;
            left -= 1;
        }
    }
    for (between, others) in SIZES {
        let size = h * f64::from(between) / f64::from(others);
        let (instance, mut other) = begin()?;
        let usual: Vec<_> = usual.iter().step_by(between as usize).cloned().collect();
        advance(&instance, &watched, &mut other, (usual.len() - 1, others, size))?;
        for (i, v) in watched.iter().enumerate() {
            compare(session, v, (&column(&usual, i), h), (&column(&other, i), size));
        }
    }
    Ok(())
}

/// Adds the values at the next `points`, each after `steps` steps of this size.
fn advance(
    instance: &Instance<'_>,
    watched: &[&ModelVariable],
    rows: &mut Vec<Vec<f64>>,
    (points, steps, size): (usize, u32, f64),
) -> Result<(), NotDetermined> {
    for _ in 0..points {
        instance.steps(steps as usize, size)?;
        rows.push(instance.numbers(watched)?);
    }
    Ok(())
}

fn column(rows: &[Vec<f64>], i: usize) -> Vec<f64> {
    rows.iter().map(|row| row[i]).collect()
}

/// The largest value of a run, or the nominal, and the largest change after the first step: earlier values may be start values.
struct Extent {
    value: f64,
    change: f64,
}

impl Extent {
    fn of(v: &ModelVariable, run: &[f64]) -> Self {
        let value = run.iter().map(|x| x.abs()).fold(v.nominal.unwrap_or(0.0).abs(), f64::max);
        let change = run[1..].iter().map(|x| (x - run[1]).abs()).fold(0.0, f64::max);
        Self { value, change }
    }

    fn moves(&self) -> bool {
        self.change > CONSTANT * self.value
    }
}

/// Compares two runs of a variable in steps of different sizes, at the same times.
fn compare(session: &Session, v: &ModelVariable, (usual, h): (&[f64], f64), (other, size): (&[f64], f64)) {
    let apart = usual.iter().zip(other).skip(1).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let extent = Extent::of(v, usual);
    let (value, change) = (extent.value, extent.change);
    session.require(apart <= OF_VALUE * value + 1e-9 && (!extent.moves() || apart <= OF_CHANGE * change), || {
        format!(
            "{} ({}): results with steps of {h} and {size} differ by {apart:.3e}; the largest value is {value:.3e}, the change over \
             the run {change:.3e}",
            v.name, v.variability
        )
    });
}
