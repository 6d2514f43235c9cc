//! Steps and time (FMI 2.0.5, 4.2.2; FMI 3.0.2, 4.2.1).

use crate::check::{Check, Levels, Run};
use crate::checks::life::shared::kept::derivatives_are_slopes;
use crate::checks::life::shared::starts::{ended, no_step_after};
use crate::checks::steps::shared::derivatives::{input_derivatives, output_derivatives, slopes};
use crate::checks::steps::shared::plain_runs::determinism;
use crate::checks::steps::shared::step_sizes::step_sizes;
use crate::encoding::show;
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{ENDED, NotDetermined, Session};
use crate::trajectory::{difference, trajectory};
use fmu_import::Status;
use fmu_import::raw::{StepStatus, number_text};
use model_description::{BaseType, Causality, CoSimulation, ModelVariable};
use std::time::{Duration, Instant};

const STEP: &str = "2.0.5, 4.2.2; 3.0.2, 4.2.1";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "T01a", clause: STEP, levels: Levels::SHOULD, run: Run::Probe(start_times),
        requirement: "Steps succeed from start times of 0, -1, 1000 and 1e6, and the independent variable has the time of the step.",
        tried: "Runs 20 steps from each start time.", fix: "Use startTime instead of 0." },
    Check { id: "T01b", clause: STEP, levels: Levels::HARD, run: Run::Probe(gap),
        requirement: "A step that does not start at the end of the last step gives Error.",
        tried: "Makes a step that does not begin where the last ended.",
        fix: "Compare currentCommunicationPoint with the time of the FMU, with a tolerance for rounding." },
    Check { id: "T01c", clause: STEP, levels: Levels::MUST, run: Run::Probe(accumulated),
        requirement: "A time that the importer accumulates, t = t + h, is accepted for many steps, and so is t = t_0 + k h.",
        tried: "Makes up to 100000 steps within the default experiment, with t = t + h.",
        fix: "Compare times with a tolerance relative to the step, and count steps in integers." },
    Check { id: "T02a", clause: STEP, levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Probe(non_positive_step),
        requirement: "A step size of 0 or less gives Error.",
        tried: "Makes steps of 0 and of -h.", fix: "Return Error unless the step is above 0." },
    Check { id: "T02b", clause: "hardening", levels: Levels::HARD, run: Run::Probe(non_finite_step),
        requirement: "A step size or time that is NaN or infinite gives Error and returns promptly.",
        tried: "Makes steps of NaN, infinity and 1e300, and from times of NaN and infinity.",
        fix: "Write the condition so that NaN fails it: !(h > 0 && h < limit)." },
    Check { id: "T03", clause: STEP, levels: Levels::HARD, run: Run::Probe(step_sizes),
        requirement: "Communication steps of 1/2, 3/2 and 2 times the usual size give approximately the same results with constant inputs.",
        tried: "Runs with both sizes to the same times, and compares: to 10 % of the largest value, and to half of the change over the run.",
        fix: "Divide each communication step into internal steps, the last one shorter, and lose no remainder." },
    Check { id: "T04", clause: "2.0.5, 4.3.1; 3.0.2, 4.4", levels: Levels::SHOULD, run: Run::Probe(variable),
        requirement: "With canHandleVariableCommunicationStepSize, steps of 0.05 to 3 times the usual size succeed.",
        tried: "Makes 200 steps of random sizes.", fix: "Divide the step into internal ones, the last of them shorter." },
    Check { id: "T05", clause: "2.0.5, 4.2.2; 3.0.2, 4.2.1", levels: Levels::MUST, run: Run::Probe(no_set_state_before),
        requirement: "With noSetFMUStatePriorToCurrentPoint, steps succeed, and the state at the current point can still be saved and set (should: no \
            result changes).",
        tried: "Runs with and without the flag, saves and restores, and compares.", fix: "Use the flag only as a hint for result buffers." },
    Check { id: "T06a", clause: "3.0.2, 4.2.1", levels: Levels(None, Some(Level::Must)), run: Run::Probe(step_results),
        requirement: "After OK, all results are written, Booleans are 0 or 1, and the step has neither returned early \
        nor asked for events without permission (should: \
            lastSuccessfulTime is less than a step from t + h).",
        tried: "Makes 20 steps and checks the four results.", fix: "Write all four results before returning OK." },
    Check { id: "T06b", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.4", levels: Levels::SHOULD, run: Run::Probe(independent),
        requirement: "The independent variable equals the time of the last communication point.",
        tried: "Reads the independent variable after steps.", fix: "Assign t + h to it at the end of a step." },
    Check { id: "T06c", clause: "3.0.2, 2.2.1", levels: Levels(None, Some(Level::Hard)), run: Run::Probe(null_results),
        requirement: "NULL pointers for results do no harm.",
        tried: "Passes NULL for each result.", fix: "Check the pointers before writing." },
    Check { id: "T07", clause: "2.0.5, 4.2.3", levels: Levels(Some(Level::Should), None), run: Run::Probe(statuses),
        requirement: "fmi2GetRealStatus and the related functions return Discard for unavailable information and do no harm.",
        tried: "Asks each function for each kind of status.", fix: "Return Discard for unavailable information." },
    Check { id: "T09", clause: "2.0.5, 4.2.1; 3.0.2, 4.1.2", levels: Levels::MUST, run: Run::Probe(output_derivatives),
        requirement: "With maxOutputDerivativeOrder above 0, first derivatives of continuous outputs can be read.",
        tried: "Reads first derivatives of all continuous outputs.", fix: "Implement the function, or set maxOutputDerivativeOrder to 0." },
    Check { id: "T09s", clause: "2.0.5, 4.2.1; 3.0.2, 4.1.2", levels: Levels::SHOULD, run: Run::Probe(slopes),
        requirement: "First derivatives of outputs match the slopes, to 10 %; orders above the maximum give Error.",
        tried: "Compares derivatives with slopes over short steps, and requests other orders.",
        fix: "Return the derivative at the end of the step, and Error for orders beyond the maximum." },
    Check { id: "T13", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.5", levels: Levels::SHOULD, run: Run::Probe(derivatives_are_slopes),
        requirement: "A variable that is the derivative of another has the value of its slope, to 30 %.",
        tried: "Compares with slopes over steps in which the derivative changes by less than a fifth.", fix: "Update the derivative at the end of a step." },
    Check { id: "T11", clause: "2.0.5, 4.2.1", levels: Levels(Some(Level::Must), None), run: Run::Probe(input_derivatives),
        requirement: "With canInterpolateInputs, first derivatives of continuous inputs can be set.",
        tried: "Sets a derivative of an input of order 1.", fix: "Implement the function, or set canInterpolateInputs to false." },
    Check { id: "T12", clause: "2.0.5, 4.2.3; 3.0.2, 4.2.1", levels: Levels::MUST, run: Run::Probe(ended),
        requirement: "After a step in which the FMU ends the simulation, outputs can be read, fmi2LastSuccessfulTime lies in the step, and Terminate \
            succeeds.",
        tried: "Steps through the default experiment; if the FMU ends the simulation, reads time and outputs, and terminates.",
        fix: "Keep the state of the end, and return its time." },
    Check { id: "T12s", clause: "hardening", levels: Levels::HARD, run: Run::Probe(no_step_after),
        requirement: "No step succeeds after the FMU has ended the simulation.",
        tried: "Steps on after the end.", fix: "Return Error until the FMU is reset." },
    Check { id: "T14", clause: "hardening", levels: Levels::HARD, run: Run::Probe(unread),
        requirement: "Reading variables does not change the run.",
        tried: "Runs 20 steps in two instances, reads one after each step and the other at the end, and compares.",
        fix: "Compute in DoStep; let getters only return values." },
    Check { id: "T10", clause: "hardening", levels: Levels::HARD, run: Run::Any(determinism),
        requirement: "Two instances with the same inputs give the same results bit for bit.",
        tried: "Runs two instances one after the other, in each interface, and compares all variables; no other check compares a variable in which \
            they differ.",
        fix: "Initialize all memory, share no data between instances, and give random numbers a seed; a measured time always differs." },
    Check { id: "T10p", clause: "hardening", levels: Levels::HARD, run: Run::Twice(two_processes),
        requirement: "Two processes with different addresses give the same results bit for bit.",
        tried: "Runs in two processes and compares hashes.", fix: "Avoid any dependence on addresses, time or the process." },
];

fn unread(session: &Session) -> Result<(), NotDetermined> {
    let read = trajectory(&session.stepping()?, 20)?;
    let instance = session.stepping()?;
    for k in 0..20 {
        instance.change_inputs(k)?;
        instance.steps(1, session.h())?;
    }
    let last = instance.snapshot(&session.watched())?;
    session.compare("read after the last of 20 steps only", &read[read.len() - 1..], &[last]);
    Ok(())
}

fn start_times(session: &Session) -> Result<(), NotDetermined> {
    session.cases([0.0, -1.0, 1000.0, 1e6], |start| {
        let instance = session.fresh()?;
        instance.experiment(start, None);
        let life = instance.initialize().and_then(|()| instance.steps(20, session.h()));
        if let Err(why) = life {
            session.failed(&format!("startTime={start}"), why);
        } else if let Some(time) = independent_variable(session)
            && let (status, bits) = instance.get(time)?
            && status.is_ok()
        {
            let found = bits.first().map_or(f64::NAN, |b| f64::from_bits(*b));
            session.require((found - instance.time.get()).abs() < session.h(), || {
                format!("startTime={start}: after the step to {}, {} is {found}", instance.time.get(), time.name)
            });
        }
        Ok(())
    })
}

fn gap(session: &Session) -> Result<(), NotDetermined> {
    session.cases([0.5, -0.5, 2.0], |shift| {
        let (instance, h) = (session.stepping()?, session.h());
        instance.steps(3, h)?;
        let t = instance.time.get();
        let status = instance.step_at(t + shift * h, h)?;
        session.require(!status.is_ok(), || {
            format!("the last step ended at {t}, and DoStep(t={}, h={h}) returned {status}", t + shift * h)
        });
        Ok(())
    })
}

fn accumulated(session: &Session) -> Result<(), NotDetermined> {
    many_steps(session)?;
    // Rounding must not matter either: another importer multiplies.
    let (instance, h, start) = (session.stepping()?, session.h(), session.start());
    let stop = session.description.default_experiment.stop.unwrap_or(f64::INFINITY);
    for k in 0..200 {
        let t = start + f64::from(k) * h;
        if t + h > stop || instance.over.get() {
            break;
        }
        let status = instance.step_at(t, h)?;
        if !status.is_ok() && status != Status::DISCARD && !instance.over.get() {
            session.violated(format!("step {k}, DoStep(t={t:?}, h={h:?}), t = {start} + {k} h, returned {status}"));
            break;
        }
    }
    Ok(())
}

fn many_steps(session: &Session) -> Result<(), NotDetermined> {
    let (instance, h) = (session.stepping()?, session.h());
    // Outside its default experiment, an FMU may lack data, so a failure there is inconclusive.
    let stop = session.description.default_experiment.stop.unwrap_or(f64::INFINITY);
    let began = Instant::now();
    session.record_calls(&format!("up to 100000 steps of {h}, t = t + h"), || {
        for k in 0..100_000 {
            if instance.time.get() + h > stop {
                session.note(format!("{k} steps, to the end of the default experiment"));
                return Ok(());
            }
            let status = instance.step(h)?;
            if instance.over.get() {
                session.note(format!("the FMU ended the simulation after {k} steps"));
                return Ok(());
            }
            // The model may be able to complete only a part of a step (Discard).
            if !status.is_ok() && status != Status::DISCARD {
                session.violated(format!("step {k}, DoStep(t={:?}, h={h:?}), returned {status}", instance.time.get()));
                return Ok(());
            }
            let enough = k >= 1000 && began.elapsed() > Duration::from_millis(500);
            if !status.is_ok() || (k % 100 == 0 && (enough || session.half_time_used())) {
                session.note(format!("{k} steps"));
                return Ok(());
            }
        }
        session.note("100000 steps");
        Ok(())
    })
}

fn non_positive_step(session: &Session) -> Result<(), NotDetermined> {
    session.cases([0.0, -session.h()], |h| {
        let instance = session.stepping()?;
        instance.steps(2, session.h())?;
        let status = instance.step_at(instance.time.get(), h)?;
        session
            .require(status == Status::ERROR, || format!("DoStep(t={}, h={h}) returned {status}", instance.time.get()));
        Ok(())
    })
}

fn non_finite_step(session: &Session) -> Result<(), NotDetermined> {
    let h = session.h();
    let wild = [(None, f64::NAN), (None, f64::INFINITY), (Some(f64::NAN), h), (Some(f64::INFINITY), h), (None, 1e300)];
    session.cases(wild, |(t, h)| {
        let instance = session.stepping()?;
        instance.steps(2, session.h())?;
        let t = t.unwrap_or(instance.time.get());
        let status = instance.step_at(t, h)?;
        // A step of 1e300 is finite and may succeed; only a hang is a violation.
        session.require(!status.is_ok() || (1e300..f64::INFINITY).contains(&h), || {
            format!("DoStep(t={t}, h={h}) returned {status}")
        });
        Ok(())
    })
}

fn variable(session: &Session) -> Result<(), NotDetermined> {
    if !session.flag("canHandleVariableCommunicationStepSize") {
        return session.not_applicable("canHandleVariableCommunicationStepSize is false");
    }
    let (instance, h) = (session.stepping()?, session.h());
    let mut random = 0x2545_f491_u32;
    for _ in 0..200 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let part = h * (0.05 + 3.0 * f64::from(random >> 8) / f64::from(1 << 24));
        let t = instance.time.get();
        let status = instance.step(part)?;
        if instance.over.get() {
            session.note("the FMU ended the simulation");
            break;
        }
        if !status.is_ok() {
            if status != Status::DISCARD {
                session.violated(format!("DoStep(t={t:?}, h={part:?}) returned {status}"));
            }
            break;
        }
    }
    Ok(())
}

fn step_results(session: &Session) -> Result<(), NotDetermined> {
    let (instance, h) = (session.stepping()?, session.h());
    if session.flag("hasEventMode") && session.description.variables.iter().any(|v| v.base == BaseType::Clock) {
        return session.not_applicable("the FMU has clocks and needs event mode");
    }
    for _ in 0..20 {
        let t = instance.time.get();
        let (status, step_results) = instance
            .call_for(&format!("DoStep(t={t}, h={h})"), |raw| raw.do_step(instance.handle, t, h, false, [true; 4]))?;
        instance.must("DoStep", status)?;
        session
            .require([step_results.event, step_results.terminate, step_results.early].iter().all(|b| *b <= 1), || {
                format!("DoStep(t={t}, h={h}) gave {step_results}: a Boolean is not 0 or 1, or was not written")
            });
        session.require(step_results.event != 1, || {
            format!("DoStep(t={t}, h={h}) asked for event handling, and the instance has no event mode")
        });
        session.require(step_results.early != 1, || {
            format!("DoStep(t={t}, h={h}) returned early although that was not allowed")
        });
        // A step may end a little elsewhere: a fixed-step integrator cannot reach every time.
        let last = step_results.last;
        let text = format!("DoStep(t={t}, h={h}) gave lastSuccessfulTime={}", number_text(last));
        if !last.is_finite() {
            session.violated(text);
        } else if step_results.early == 0 && step_results.terminate == 0 && (last - (t + h)).abs() >= h {
            session.lesser(Level::Should, text);
        }
        // One finding is enough.
        if step_results.terminate == 1
            || step_results.early != 0
            || step_results.event != 0
            || step_results.terminate > 1
        {
            break;
        }
        instance.time.set(t + h);
    }
    Ok(())
}

fn independent_variable(session: &Session) -> Option<&ModelVariable> {
    let fits = |v: &&ModelVariable| v.causality == Causality::Independent && v.base == BaseType::Float64;
    session.description.variables.iter().find(fits)
}

fn independent(session: &Session) -> Result<(), NotDetermined> {
    let Some(time) = independent_variable(session) else {
        return session.not_applicable("there is no independent variable of type Float64");
    };
    let (instance, h) = (session.stepping()?, session.h());
    let varies = session.flag("canHandleVariableCommunicationStepSize");
    for part in [0.0, 1.0, 1.0, 2.0, 1.0, 3.0] {
        if part > 0.0 {
            instance.steps(1, if varies { part * h } else { h })?;
        }
        let (status, bits) = instance.get(time)?;
        let (t, found) = (instance.time.get(), bits.first().map_or(f64::NAN, |b| f64::from_bits(*b)));
        let is_close = status.is_ok() && (found - t).abs() <= 1e-6 * h + 4.0 * f64::EPSILON * t.abs();
        session.require(is_close, || {
            let found = show(time, session.description.version, &bits);
            format!("at the communication point {t}, Get({}) returned {status}, {found}", time.name)
        });
    }
    Ok(())
}

fn null_results(session: &Session) -> Result<(), NotDetermined> {
    session.cases(0..4, |missing| {
        let instance = session.stepping()?;
        let mut given = [true; 4];
        given[missing] = false;
        let name = ["eventHandlingNeeded", "terminateSimulation", "earlyReturn", "lastSuccessfulTime"][missing];
        let status = instance.call(&format!("DoStep({name}=NULL)"), |raw| {
            raw.do_step(instance.handle, instance.time.get(), session.h(), false, given).map(|(s, _)| s)
        })?;
        session.note(format!("{name}=NULL: {status}"));
        Ok(())
    })
}

fn statuses(session: &Session) -> Result<(), NotDetermined> {
    use StepStatus::{GetBooleanStatus, GetIntegerStatus, GetRealStatus, GetStatus, GetStringStatus};
    for name in [GetStatus, GetRealStatus, GetIntegerStatus, GetBooleanStatus, GetStringStatus] {
        for kind in [0, 1, 2, 3, 99] {
            session.case(|| {
                let instance = session.stepping()?;
                instance.steps(1, session.h())?;
                let status = instance.call(&format!("{name:?}(kind={kind})"), |raw| {
                    raw.step_status(name, instance.handle, kind).map(|(s, _)| s)
                })?;
                let known = [Status::OK, Status::WARNING, Status::DISCARD].contains(&status) || kind == 99;
                // A kind of status that this function never returns may be an Error.
                let fits = matches!(
                    (name, kind),
                    (GetStatus, 0) | (GetRealStatus, 2) | (GetBooleanStatus, 3) | (GetStringStatus, 1)
                );
                session.require(known || !fits, || format!("fmi2{name:?}({kind}) returned {status}"));
                Ok(())
            });
        }
    }
    Ok(())
}

/// Notes a hash of all outputs, which the parent process compares.
fn two_processes(session: &Session) -> Result<(), NotDetermined> {
    let values = trajectory(&session.stepping()?, 30)?.into_iter().flatten().flatten();
    let hash = values
        .flat_map(u64::to_le_bytes)
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    session.note(format!("30 steps, all outputs hashed: {hash:016x}"));
    Ok(())
}

fn no_set_state_before(session: &Session) -> Result<(), NotDetermined> {
    let saves = session.description.co_simulation.as_ref().is_some_and(CoSimulation::can_get_and_set_state);
    let run = |instance: &Instance<'_>, from: u32, no_prior: bool| {
        let mut rows = Vec::new();
        for k in from..from + 10 {
            instance.change_inputs(k)?;
            let (t, h) = (instance.time.get(), session.h());
            let status = instance.step_with(t, h, no_prior)?;
            if instance.over.get() {
                return Err(NotDetermined(format!("{ENDED} at {t}")));
            }
            session.require(status.is_ok(), || {
                format!("with noSetFMUStatePriorToCurrentPoint={no_prior} DoStep(t={t}) returned {status}")
            });
            instance.time.set(t + h);
            rows.push(instance.snapshot(&session.watched())?);
        }
        Ok::<_, NotDetermined>(rows)
    };
    if session.description.variables.iter().any(|v| v.base == BaseType::Clock) {
        return session.not_applicable("the FMU has clocks and needs event mode");
    }
    let (unrestricted, restricted) = (session.stepping()?, session.stepping()?);
    let (a, b) = (run(&unrestricted, 0, false)?, run(&restricted, 0, true)?);
    // For the text the flag is a hint: that it changes no result is not said.
    if let Some(found) = difference(session.description.version, &session.watched(), &a, &b) {
        let name = session.watched().get(found.variable).map_or_else(String::new, |v| v.name.clone());
        let text = format!("with noSetFMUStatePriorToCurrentPoint {name} differs{}", found.text());
        session.deviates_at(Some(Level::Should), found.largest, &text);
    }
    if !saves {
        session.note("the FMU does not save states");
        return Ok(());
    }
    // A state that does not lead back even without the flag is unrelated to the flag; F02a checks it.
    let (here, time) = (unrestricted.save()?, unrestricted.time.get());
    let first = unrestricted.run(10, session.h())?;
    unrestricted.restore(here, time)?;
    let leads_back = unrestricted.run(10, session.h()).is_ok_and(|again| {
        difference(session.description.version, &session.watched(), &first, &again)
            .is_none_or(|d| d.largest <= session.tolerance())
    });
    if !leads_back {
        return Err(NotDetermined("without the flag, a state that was set does not lead back either (F02a)".into()));
    }
    let (here, time) = (restricted.save()?, restricted.time.get());
    let first = run(&restricted, 10, false)?;
    if let Err(NotDetermined(why)) = restricted.restore(here, time) {
        session
            .violated(format!("restoring the current point after a step with noSetFMUStatePriorToCurrentPoint: {why}"));
        return Ok(());
    }
    session.compare("after a state was restored", &first, &run(&restricted, 10, false)?);
    Ok(())
}
