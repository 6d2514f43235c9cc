//! Intermediate updates: callbacks of an FMU inside a step (FMI 3.0.2, 4.2.2).

use crate::check::{Check, Levels, Run};
use crate::deviation::deviation;
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::trajectory::steps;
use fmu_import::Status;
use fmu_import::raw::{Arguments, Heard, Inside, Meanwhile, Simple, StepResults, number_text};
use model_description::{BaseType, Causality, ModelVariable};

const CLAUSE: &str = "3.0.2, 4.2.2";
const MUST: Levels = Levels(None, Some(Level::Must));
const SHOULD: Levels = Levels(None, Some(Level::Should));
const HARD: Levels = Levels(None, Some(Level::Hard));

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "U00", clause: CLAUSE, levels: MUST, run: Run::Probe(in_order),
        requirement: "intermediateUpdate is called inside DoStep only, with the environment of the instance, flags of 0 or 1, and times \
            between the last finished internal step and the end of the step.",
        tried: "Looks at the calls during 20 steps, and between them.", fix: "Call it after an internal step, with the time that was reached." },
    Check { id: "U01", clause: CLAUSE, levels: MUST, run: Run::Probe(outputs),
        requirement: "If intermediateVariableGetAllowed is true, the intermediate outputs that the importer requested can be read.",
        tried: "Gets each intermediate output in the callbacks of 5 steps.", fix: "Allow getters while the callback runs." },
    Check { id: "U02", clause: CLAUSE, levels: MUST, run: Run::Probe(returned),
        requirement: "If canReturnEarly is true and the importer requests an early return, the step ends between the time of the callback and the \
            requested time.",
        tried: "Requests a return at the time of the callback, halfway to the end of the step, and at the end of the step.",
        fix: "Check earlyReturnRequested after each callback, and write earlyReturn and lastSuccessfulTime." },
    Check { id: "U03", clause: CLAUSE, levels: MUST, run: Run::Probe(allowed),
        requirement: "canReturnEarly is true only if the instantiation allowed early returns; otherwise a request has no effect.",
        tried: "Requests a return with earlyReturnAllowed = false.", fix: "Set canReturnEarly from earlyReturnAllowed." },
    Check { id: "U04", clause: CLAUSE, levels: SHOULD, run: Run::Probe(announced),
        requirement: "An FMU calls intermediateUpdate only if providesIntermediateUpdate is true.",
        tried: "Gives the callback to an FMU without the flag, and makes 5 steps.", fix: "Set the flag." },
    Check { id: "U05", clause: "hardening", levels: HARD, run: Run::Probe(refused),
        requirement: "In the callback, Terminate, EnterEventMode and EnterStepMode return Error.",
        tried: "Calls each in the first callback.", fix: "Give the instance a separate state while the callback runs." },
    Check { id: "U06", clause: "hardening", levels: HARD, run: Run::Probe(silent),
        requirement: "An empty callback does not change results.",
        tried: "Makes 20 steps with and without it, and compares the outputs.", fix: "Use the same internal steps in both." },
];

/// Ends a probe of an FMU without intermediate updates.
macro_rules! needs_updates {
    ($session:ident) => {
        if !$session.flag("providesIntermediateUpdate") {
            return $session.not_applicable("providesIntermediateUpdate is false");
        }
    };
}

/// The intermediate outputs of the type Float64.
fn intermediate(session: &Session) -> Vec<&ModelVariable> {
    let fits = |v: &&ModelVariable| {
        v.causality == Causality::Output && v.base == BaseType::Float64 && v.intermediate && !v.is_array()
    };
    session.description.variables.iter().filter(fits).collect()
}

/// A new instance whose importer is called inside steps.
fn updated(session: &Session, early_return: bool) -> Result<Instance<'_>, NotDetermined> {
    session.prepare(|| {
        let list = intermediate(session).iter().map(|v| v.value_reference).collect();
        let arguments = Arguments { intermediate: Some(list), early_return, ..session.arguments("probe") };
        let instance = session.made(&arguments)?;
        instance.initialize()?;
        let _ = session.raw.take_heard();
        Ok(instance)
    })
}

impl Instance<'_> {
    /// A communication step with these actions of the importer in its callbacks; returns the calls made meanwhile, and the ends
    /// of the step.
    fn step_updated(&self, acts: &[Inside]) -> Result<(Status, StepResults, Meanwhile, [f64; 2]), NotDetermined> {
        let (t, h) = (self.time.get(), self.session.h());
        let call = format!("DoStep(t={t:?}, h={h:?}), with {acts:?} in intermediateUpdate");
        let (status, (stepped, meanwhile)) =
            self.call_for(&call, |raw| raw.do_step_updated(self.handle, (t, h), acts))?;
        if status.is_ok() {
            self.time.set(if stepped.early == 1 { stepped.last } else { t + h });
            self.over.set(stepped.terminate == 1);
        }
        Ok((status, stepped, meanwhile, [t, t + h]))
    }
}

fn in_order(session: &Session) -> Result<(), NotDetermined> {
    needs_updates!(session);
    let instance = updated(session, false)?;
    let own = session.environment();
    let mut calls = 0;
    for _ in 0..20 {
        if instance.over.get() || session.half_time_used() {
            break;
        }
        let (status, _, meanwhile, [t, end]) = instance.step_updated(&[])?;
        instance.must("DoStep", status)?;
        let (near, mut earliest) = (1e-9 * (end - t), t);
        for heard in &meanwhile.heard {
            let Heard::Intermediate { environment, time, set_requested, get_allowed, finished, can_return } = *heard
            else {
                continue;
            };
            calls += 1;
            let flags = [set_requested, get_allowed, finished, can_return];
            let outside = !(time >= earliest - near && time <= end + near);
            if outside || flags.iter().any(|flag| *flag > 1) || environment != own {
                session.violated(format!(
                    "in the step from {t:?} to {end:?}, after an internal step to {earliest:?}: {heard}"
                ));
                return Ok(());
            }
            if finished == 1 {
                earliest = time;
            }
        }
        let _ = instance.snapshot(&session.watched())?;
        let late = session.raw.take_heard();
        if let Some(heard) = late.first() {
            session.violated(format!("in a getter after the step to {end:?}: {heard}"));
            return Ok(());
        }
    }
    session.note(format!("{calls} calls in 20 steps"));
    Ok(())
}

fn outputs(session: &Session) -> Result<(), NotDetermined> {
    needs_updates!(session);
    let list = intermediate(session);
    if list.is_empty() {
        return session.not_applicable("there is no intermediate output of the type Float64");
    }
    let instance = updated(session, false)?;
    let acts: Vec<Inside> = list.iter().map(|v| Inside::Get(v.value_reference)).collect();
    for _ in 0..5 {
        let (status, _, meanwhile, _) = instance.step_updated(&acts)?;
        let open = |heard: &&Heard| matches!(heard, Heard::Intermediate { get_allowed: 1, .. });
        let all = meanwhile.heard.iter().filter(open).count() == meanwhile.heard.len();
        let refused = meanwhile.answers.iter().find(|(_, (status, value, _))| !status.is_ok() || value.is_nan());
        if let Some((act, (answer, value, _))) = refused.filter(|_| all) {
            session.violated(format!("in a callback, {act:?} returned {answer} and gave {}", number_text(*value)));
            return Ok(());
        }
        instance.must("DoStep", status)?;
    }
    Ok(())
}

/// The time of the first callback of a step in which the importer may request its end.
fn first_chance(meanwhile: &Meanwhile) -> Option<f64> {
    meanwhile.heard.iter().find_map(|heard| match heard {
        Heard::Intermediate { time, can_return: 1, .. } => Some(*time),
        _ => None,
    })
}

fn returned(session: &Session) -> Result<(), NotDetermined> {
    needs_updates!(session);
    let first = updated(session, true)?.step_updated(&[])?;
    let Some(chance) = first_chance(&first.2) else {
        return session.not_applicable("canReturnEarly is never true");
    };
    let [start, end] = first.3;
    if !(start..=end).contains(&chance) {
        // U00 looks at the time.
        return Err(NotDetermined(format!("intermediateUpdate is called for {chance:?} in a step to {end:?}")));
    }
    session.cases([chance, 0.5 * (chance + end), end], |wanted| {
        let instance = updated(session, true)?;
        let (status, stepped, meanwhile, _) = instance.step_updated(&[Inside::Return(wanted)])?;
        let near = 1e-9 * (end - start);
        let reached = stepped.last >= chance - near && stepped.last <= wanted + near;
        let early = stepped.early == u8::from(stepped.last < end - near);
        session.require(status.is_ok() && reached && (early || wanted >= end - near), || {
            format!(
                "asked at {chance:?} to return at {wanted:?} of a step to {end:?}, DoStep returned {status}, {stepped}, after {} callbacks",
                meanwhile.heard.len()
            )
        });
        if status.is_ok() && reached {
            let (next, ..) = instance.step_updated(&[])?;
            session.require(next.is_ok(), || format!("the step from {:?} returned {next}", stepped.last));
        }
        Ok(())
    })
}

fn allowed(session: &Session) -> Result<(), NotDetermined> {
    needs_updates!(session);
    let instance = updated(session, false)?;
    for _ in 0..5 {
        let t = instance.time.get();
        let (status, stepped, meanwhile, [_, end]) = instance.step_updated(&[Inside::Return(t)])?;
        if first_chance(&meanwhile).is_some() || stepped.early == 1 {
            session.violated(format!(
                "with earlyReturnAllowed = false, the step to {end:?} returned {status}, {stepped}; {}",
                meanwhile.heard.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
            ));
            return Ok(());
        }
        instance.must("DoStep", status)?;
    }
    Ok(())
}

fn announced(session: &Session) -> Result<(), NotDetermined> {
    if session.flag("providesIntermediateUpdate") {
        return session.not_applicable("providesIntermediateUpdate is true");
    }
    let arguments = Arguments { intermediate: Some(Vec::new()), ..session.arguments("probe") };
    // An FMU may refuse it.
    let Some(instance) = session.instantiate(&arguments)? else { return Ok(()) };
    instance.initialize()?;
    for _ in 0..5 {
        let (status, _, meanwhile, _) = instance.step_updated(&[])?;
        let calls = meanwhile.heard.len();
        session.require(calls == 0, || {
            format!("a step made {calls} calls of intermediateUpdate, and providesIntermediateUpdate is false")
        });
        if calls > 0 || !status.is_ok() {
            break;
        }
    }
    Ok(())
}

fn refused(session: &Session) -> Result<(), NotDetermined> {
    needs_updates!(session);
    let calls = [Simple::Terminate, Simple::EnterEventMode, Simple::EnterStepMode];
    session.cases(calls, |call| {
        let (_, _, meanwhile, _) = updated(session, false)?.step_updated(&[Inside::Call(call)])?;
        if let Some((_, (status, ..))) = meanwhile.answers.first() {
            session.require(*status == Status::ERROR, || {
                format!("{} in intermediateUpdate returned {status}", session.raw.name(call.as_str()))
            });
        }
        Ok(())
    })
}

fn silent(session: &Session) -> Result<(), NotDetermined> {
    needs_updates!(session);
    let outputs: Vec<_> = session.watched().into_iter().filter(|v| v.base == BaseType::Float64).collect();
    let run = |called: bool| -> Result<Vec<Vec<f64>>, NotDetermined> {
        let instance = if called { updated(session, false)? } else { session.stepping()? };
        let mut rows = Vec::new();
        for _ in 0..20 {
            if instance.over.get() {
                break;
            }
            if called {
                let (status, ..) = instance.step_updated(&[])?;
                instance.must("DoStep", status)?;
            } else {
                instance.steps(1, session.h())?;
            }
            rows.push(instance.snapshot(&outputs)?.into_iter().flatten().map(f64::from_bits).collect());
        }
        Ok(rows)
    };
    if let Some(found) = deviation(&run(false)?, &run(true)?) {
        let text = found.text(&session.names_of(&outputs));
        session.violated(format!("with an empty callback, after {} {text}", steps(found.step)));
    }
    Ok(())
}
