//! Start values of outputs and local variables that the importer sets (`initial="exact"`), and steps in which the FMU ends the
//! simulation.

use crate::encoding::{same, show};
use crate::instance::Instance;
use crate::session::{NotDetermined, Session};
use crate::settable::settable;
use fmu_import::Status;
use fmu_import::raw::{Arguments, Interface, Raw, Simple, StepStatus, number_text};
use model_description::{BaseType, Causality, ModelVariable, Variability};

/// `fmi2LastSuccessfulTime`, a status kind.
const LAST_SUCCESSFUL_TIME: i32 = 2;

/// The variables that start exactly, constants aside.
fn exact(session: &Session) -> Vec<&ModelVariable> {
    let of_model = |v: &&ModelVariable| matches!(v.causality, Causality::Output | Causality::Local);
    session.numeric().filter(of_model).filter(|v| settable(v) && session.is_steady(v)).collect()
}

/// A value set in state Instantiated persists in the initialization, and a reset restores the start value.
pub(crate) fn stand(session: &Session) -> Result<(), NotDetermined> {
    let all = exact(session);
    if all.is_empty() {
        return session.not_applicable("no output or local variable starts exactly");
    }
    let version = session.description.version;
    let simulates = session.description.co_simulation.is_some().then_some(Interface::CoSimulation);
    let exchanges = session.exchanges_here().then_some(Interface::ModelExchange);
    let each = [simulates, exchanges].into_iter().flatten().flat_map(|i| all.iter().map(move |v| (i, *v)));
    session.cases(each.collect::<Vec<_>>(), |(interface, v)| {
        let Some(values) = session.different_value(v, 1.0) else { return Ok(()) };
        let new = || session.prepare(|| session.made(&Arguments { interface, ..session.arguments("probe") }));
        let instance = new()?;
        let must = |status: Status, what: &str| session.require(status.is_ok(), || format!("{what} returned {status}"));
        let status = instance.set(v, &values)?;
        must(status, &format!("Set({}) of an instance in the state Instantiated", v.name));
        if !status.is_ok() {
            return Ok(());
        }
        let compare = |instance: &Instance<'_>, wanted: &[u64], when: &str| {
            let (status, found) = instance.get(v)?;
            let of = if interface == Interface::ModelExchange { "Model Exchange: " } else { "" };
            must(status, &format!("{of}Get({}) {when}", v.name));
            session.require(!status.is_ok() || same(v, version, wanted, &found), || {
                let [wanted, got] = [wanted, &found].map(|bits| show(v, version, bits));
                format!("{of}{} is {got} {when}, expected {wanted}", v.name)
            });
            Ok::<_, NotDetermined>(())
        };
        instance.enter()?;
        compare(&instance, &values, "in Initialization Mode, after it was set")?;
        instance.perform(Simple::ExitInitializationMode)?;
        // Events may change a discrete variable at once.
        if v.variability == Variability::Continuous {
            compare(&instance, &values, "at the end of the initialization, after it was set")?;
        }
        let fresh = new()?;
        fresh.enter()?;
        let (_, start) = fresh.get(v)?;
        instance.perform(Simple::Reset)?;
        instance.enter()?;
        compare(&instance, &start, "after Reset")
    })
}

/// Steps up to the end of the default experiment; the end of the last one, if the FMU ends the simulation in it.
fn end(session: &Session) -> Result<Option<(Instance<'_>, f64)>, NotDetermined> {
    let (instance, h) = (session.stepping()?, session.h());
    let stop = session.description.default_experiment.stop.unwrap_or(f64::INFINITY);
    session
        .record_calls(&format!("up to 10000 steps of {h}"), || {
            for k in 0..10_000 {
                if instance.time.get() + h > stop || (k % 100 == 0 && session.half_time_used()) {
                    break;
                }
                let t = instance.time.get();
                let status = instance.step(h)?;
                if instance.over.get() {
                    return Ok(Some(t));
                }
                instance.must("DoStep", status)?;
            }
            Ok(None)
        })
        .map(|ended| ended.map(|t| (instance, t)))
}

const NO_END: &str = "the FMU does not end the simulation within the default experiment";

/// The time, which is NaN if the FMU did not write it.
fn last_successful_time(instance: &Instance<'_>) -> Result<(Status, f64), NotDetermined> {
    let call = "GetRealStatus(fmi2LastSuccessfulTime)";
    let ask = |raw: &Raw| raw.step_status(StepStatus::GetRealStatus, instance.handle, LAST_SUCCESSFUL_TIME);
    let (status, bits) = instance.call_for(call, ask)?;
    Ok((status, f64::from_bits(bits)))
}

/// The time of the end is in its step, and values can be read.
pub(crate) fn ended(session: &Session) -> Result<(), NotDetermined> {
    let Some((instance, t)) = end(session)? else { return session.not_applicable(NO_END) };
    let h = session.h();
    if session.is_v2() {
        let (status, last) = last_successful_time(&instance)?;
        let rounding = 1e-9 * h + 4.0 * f64::EPSILON * t.abs();
        let inside = last >= t - rounding && last <= t + h + rounding;
        session.require(status.is_ok() && inside, || {
            let last = number_text(last);
            format!("fmi2LastSuccessfulTime after the end in the step from {t} to {} returned {status}, {last}", t + h)
        });
    }
    let outputs = session.numeric().filter(|v| v.causality == Causality::Output && v.clocks.is_empty());
    for v in outputs.filter(|v| v.base != BaseType::Binary) {
        let status = instance.get(v)?.0;
        session
            .require(status.is_ok(), || format!("Get({}) after the end of the simulation returned {status}", v.name));
    }
    let status = instance.simple(Simple::Terminate)?;
    session.require(status.is_ok(), || format!("Terminate after the end of the simulation returned {status}"));
    Ok(())
}

/// No step follows the end.
pub(crate) fn no_step_after(session: &Session) -> Result<(), NotDetermined> {
    let Some((instance, t)) = end(session)? else { return session.not_applicable(NO_END) };
    let h = session.h();
    // T12 looks at the time that the FMU returns.
    let last = if session.is_v2() { last_successful_time(&instance)?.1 } else { t + h };
    let from = if last.is_nan() { t + h } else { last };
    let status = instance.step_at(from, h)?;
    session.require(!status.is_ok(), || {
        format!("the FMU ended the simulation in the step from {t}, and DoStep(t={from}, h={h}) returned {status}")
    });
    Ok(())
}
