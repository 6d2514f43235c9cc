//! Runs with other communication steps reach the same results (FMI 2.0.5, 4.2.2; FMI 3.0.2, 4.2.1).

use crate::session::{NotDetermined, Session};
use model_description::{BaseType, ModelVariable};

/// Share of the largest value by which a result may differ.
const OF_VALUE: f64 = 0.1;
/// Share of the change over the run by which a result may differ.
const OF_CHANGE: f64 = 0.5;
/// A variable that changes by less than this share of its largest value is constant.
const CONSTANT: f64 = 1e-4;

pub(crate) fn step_sizes(session: &Session) -> Result<(), NotDetermined> {
    if !session.flag("canHandleVariableCommunicationStepSize") {
        return session.not_applicable("the communication step may not change");
    }
    let h = session.h();
    // Number of points, and between two of them the number of usual steps and of others.
    for (points, usual, others) in [(40, 1, 2), (20, 2, 1), (14, 3, 2)] {
        compare(session, points, (usual, h), (others, h * f64::from(usual) / f64::from(others)))?;
    }
    Ok(())
}

/// Compares a run with one in steps of another size, at the same times.
fn compare(session: &Session, points: u32, usual: (u32, f64), other: (u32, f64)) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| v.base == BaseType::Float64 && !v.is_array();
    let watched: Vec<_> = session.watched().into_iter().filter(fits).collect();
    let run = |(steps, h): (u32, f64)| {
        let instance = session.stepping()?;
        instance.change_inputs(3)?;
        let mut rows = vec![instance.numbers(&watched)?];
        for _ in 0..points {
            for _ in 0..steps {
                instance.steps(1, h)?;
            }
            rows.push(instance.numbers(&watched)?);
        }
        Ok(rows)
    };
    let (one, two) = (run(usual)?, run(other)?);
    for (i, v) in watched.iter().enumerate() {
        let of = |rows: &[Vec<f64>]| rows.iter().map(|row| row[i]).collect::<Vec<_>>();
        let (a, b) = (of(&one), of(&two));
        // The values before the first step may be those of the start.
        let apart = a.iter().zip(&b).skip(1).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let value = a.iter().map(|x| x.abs()).fold(v.nominal.unwrap_or(0.0).abs(), f64::max);
        let change = a[1..].iter().map(|x| (x - a[1]).abs()).fold(0.0, f64::max);
        let moves = change > CONSTANT * value;
        session.require(apart <= OF_VALUE * value + 1e-9 && (!moves || apart <= OF_CHANGE * change), || {
            format!(
                "{} ({}): results with steps of {} and {} differ by {apart:.3e}; the largest value is {value:.3e}, the change over \
                 the run {change:.3e}",
                v.name, v.variability, usual.1, other.1
            )
        });
    }
    Ok(())
}
