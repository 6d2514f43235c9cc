//! Co-simulation and Model Exchange of one FMU, side by side: the same equations give about the same results.
//!
//! The importer's own integration is also inexact. It is estimated from a run in half the steps, and only what differs by far
//! more, at many points, is a finding.

use crate::exchange::Importer;
use crate::instance::Instance;
use crate::session::{NotDetermined, Session};
use crate::state::State;
use fmu_import::raw::Simple;
use model_description::{BaseType, ModelVariable};

/// Maximum number of communication points.
const POINTS: u32 = 100;
/// Integrator steps in a communication step: in the run, and in the finer run that shows its error.
const PARTS: [u32; 2] = [40, 20];
/// Share of the change over the run by which results may differ, and share of the largest value.
const OF_CHANGE: f64 = 0.25;
const OF_VALUE: f64 = 1e-3;
/// Multiple of the estimated error of the integration by which results may differ.
const OF_ERROR: f64 = 10.0;

pub(crate) fn both_interfaces(session: &Session) -> Result<(), NotDetermined> {
    let d = &session.description;
    let identifiers = d.model_exchange.as_ref().zip(d.co_simulation.as_ref());
    if identifiers.is_none_or(|(exchange, simulation)| exchange.model_identifier != simulation.model_identifier) {
        return session.not_applicable("the FMU does not have both interfaces in one binary");
    }
    if d.variables.iter().any(|v| v.base == BaseType::Clock) {
        return session.not_applicable("the FMU has clocks");
    }
    if session.integrator.get().is_some() {
        return session.not_applicable("the equations are stiff: Euler's method is too coarse for a comparison");
    }
    let scalar = |v: &&ModelVariable| {
        !v.is_array()
            && matches!(v.base, BaseType::Float64 | BaseType::Int32 | BaseType::Boolean | BaseType::Enumeration)
    };
    let watched: Vec<_> = session.watched().into_iter().filter(scalar).take(200).collect();
    let simulated = simulated(session, &watched)?;
    let fine = integrated(session, &watched, simulated.len(), PARTS[0])?;
    let coarse = integrated(session, &watched, fine.len(), PARTS[1])?;
    let points = simulated.len().min(fine.len()).min(coarse.len());
    if points < 4 {
        return Err(NotDetermined("the simulation ends after a few steps".into()));
    }
    for (i, v) in watched.iter().enumerate() {
        let [a, b, c] =
            [&simulated, &fine, &coarse].map(|rows| rows[..points].iter().map(|r| r[i]).collect::<Vec<_>>());
        if let Some(text) = apart(&a, &b, &c) {
            session.violated(format!("{}: {text}", v.name));
        }
    }
    session.note(format!("compared {} variables at {points} points", watched.len()));
    Ok(())
}

/// Where the results are farthest apart, if they are apart at a quarter of the points.
fn apart(simulated: &[f64], integrated: &[f64], coarse: &[f64]) -> Option<String> {
    let change = |run: &[f64]| run.iter().map(|x| (x - run[0]).abs()).fold(0.0, f64::max);
    let value = simulated.iter().chain(integrated).map(|x| x.abs()).fold(1e-9, f64::max);
    let allowed = (OF_CHANGE * change(simulated).max(change(integrated))).max(OF_VALUE * value);
    let all = simulated.iter().zip(integrated).zip(coarse).enumerate();
    let far: Vec<_> = all
        .map(|(k, ((a, b), c))| (k + 1, *a, *b, (a - b).abs(), (b - c).abs()))
        .filter(|(.., distance, error)| *distance > allowed + OF_ERROR * error)
        .collect();
    let (k, a, b, ..) = far.iter().max_by(|x, y| x.3.total_cmp(&y.3)).filter(|_| 4 * far.len() >= simulated.len())?;
    Some(format!(
        "after {k} communication steps it is {a:?} in co-simulation and {b:?} in Model Exchange; they differ at {} of {} points",
        far.len(),
        simulated.len()
    ))
}

/// Sets the inputs in Initialization Mode, where both interfaces allow it.
fn begin(instance: &Instance<'_>) -> Result<(), NotDetermined> {
    instance.change_inputs(4)?;
    instance.perform(Simple::ExitInitializationMode)
}

fn values(instance: &Instance<'_>, watched: &[&ModelVariable]) -> Result<Vec<f64>, NotDetermined> {
    let number = |(v, bits): (&&ModelVariable, Vec<u64>)| match (v.base, bits.first()) {
        (BaseType::Float64, Some(bits)) => f64::from_bits(*bits),
        (_, Some(bits)) => i32::try_from(bits.cast_signed()).map_or(f64::NAN, f64::from),
        _ => f64::NAN,
    };
    Ok(watched.iter().zip(instance.snapshot(watched)?).map(number).collect())
}

/// The values after each communication step.
fn simulated(session: &Session, watched: &[&ModelVariable]) -> Result<Vec<Vec<f64>>, NotDetermined> {
    let (instance, h) = (session.initializing()?, session.h());
    begin(&instance)?;
    let stop = session.description.default_experiment.stop.unwrap_or(f64::INFINITY) + 1e-6 * h;
    session.record_calls(&format!("up to {POINTS} steps of {h}, each followed by getting all outputs"), || {
        let mut rows = Vec::new();
        for _ in 0..POINTS {
            if instance.time.get() + h > stop || session.half_time_used() {
                break;
            }
            let status = instance.step(h)?;
            if instance.over.get() {
                break;
            }
            instance.must("DoStep", status)?;
            rows.push(values(&instance, watched)?);
        }
        Ok(rows)
    })
}

/// The values at the same times in Model Exchange.
fn integrated(
    session: &Session,
    watched: &[&ModelVariable],
    points: usize,
    parts: u32,
) -> Result<Vec<Vec<f64>>, NotDetermined> {
    let instance = session.exchange(State::Initialization)?;
    begin(&instance)?;
    let mut importer = Importer::start(&instance)?;
    let (start, h) = (session.start(), session.h());
    session.record_calls(&format!("{points} times {parts} integrator steps to the same times"), || {
        let mut rows = Vec::new();
        for k in 1..=u32::try_from(points).unwrap_or(POINTS) {
            importer.reach(start + f64::from(k) * h, h / f64::from(parts))?;
            if importer.over || session.half_time_used() {
                break;
            }
            rows.push(values(&instance, watched)?);
        }
        Ok(rows)
    })
}
