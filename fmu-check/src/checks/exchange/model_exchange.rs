//! Model Exchange: life cycle, states and their derivatives (FMI 2.0.5, 3.2; FMI 3.0.2, 3.2).

use crate::check::{Check, Levels, Run};
use crate::checks::exchange::shared::both::both_interfaces;
use crate::checks::exchange::shared::dependencies::exchange_dependencies;
use crate::checks::exchange::shared::evaluation::{
    completed_step, independent, inputs_read_back, interleaved, mode_alone, moved, pure, same_bits, start_times,
};
use crate::checks::life::shared::calls::attempt;
use crate::checks::life::shared::kept::set_all;
use crate::checks::life::state::in_initialization;
use crate::deviation::{deviation, differ};
use crate::exchange::{Importer, UNSTABLE, UNTOUCHED};
use crate::instance::Instance;
use crate::level::Level;
use crate::lines::Line;
use crate::session::{NotDetermined, Session};
use crate::state::{Life, State};
use crate::trajectory::steps;
use fmu_import::Status;
use fmu_import::raw::{Count, Simple, Vector};
use model_description::{BaseType, Causality, ModelVariable};
use std::cell::Cell;

const TABLE: &str = "2.0.5, 3.2.3; 3.0.2, 3.2";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "E00", clause: TABLE, levels: Levels::MUST, run: Run::Exchange(minimal_run),
        requirement: "A minimal run of Model Exchange succeeds: initialization, event iteration, integrator steps, termination.",
        tried: "Initializes, iterates events, integrates with Euler's method, terminates.",
        fix: "Start with the call named in the finding; the other checks of Model Exchange depend on this run." },
    Check { id: "E01", clause: TABLE, levels: Levels::MUST, run: Run::Exchange(allowed),
        requirement: "Every call that the state of a Model Exchange instance allows succeeds.",
        tried: "Makes every allowed call in every state of Model Exchange.", fix: "Add the named call to the table of allowed states." },
    Check { id: "E01i", clause: "2.0.5, 3.2.3; 3.0.2, 2.3.3", levels: Levels::SHOULD, run: Run::Exchange(allowed_early),
        requirement: "States, derivatives, event indicators and nominals can be read in Initialization Mode.",
        tried: "Reads the vectors in Initialization Mode.", fix: "Compute them when they are read." },
    Check { id: "E02", clause: "3.0.2, 2.2.4", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Exchange(refused),
        requirement: "Every call that the state of a Model Exchange instance does not allow returns Error (Discard if it sets a variable in \
            Continuous-Time Mode), or is accepted with a message of status Warning.",
        tried: "Makes every call in every state that does not allow the call.",
        fix: "Check the state at the beginning of every function, log and return Error." },
    Check { id: "E03", clause: "2.0.5, 2.2.8; 3.0.2, 2.4.8", levels: Levels::MUST, run: Run::Exchange(counts),
        requirement: "The vectors of states, derivatives, event indicators and nominals have the lengths of the description, and nothing is written past them.",
        tried: "Reads the vectors into buffers with guard values behind them, and in FMI 3.0 their lengths.",
        fix: "Take the sizes from ModelStructure and numberOfEventIndicators." },
    Check { id: "E04a", clause: "2.0.5, 3.2.2; 3.0.2, 2.3.3", levels: Levels::MUST, run: Run::Exchange(positive_nominals),
        requirement: "The nominals of the continuous states are above 0.",
        tried: "Reads the nominals.", fix: "Return 1 if the nominal is unknown." },
    Check { id: "E04b", clause: "2.0.5, 3.2.2; 3.0.2, 2.3.3", levels: Levels::SHOULD, run: Run::Exchange(declared_nominals),
        requirement: "The nominals of the continuous states are those of the description, or 1 if it gives none.",
        tried: "Compares the nominals with the description.", fix: "Generate both from one table." },
    Check { id: "E05", clause: "2.0.5, 3.2.1; 3.0.2, 3.2.1", levels: Levels::MUST, run: Run::Exchange(round_trip),
        requirement: "Continuous states that are set can be read back, as a vector and as variables (should: inputs too, in both modes).",
        tried: "Sets states and inputs and reads them.", fix: "Store the states unchanged, and invalidate what was computed from them." },
    Check { id: "E06a", clause: "2.0.5, 3.1; 3.0.2, 3.2.1", levels: Levels::MUST, run: Run::Exchange(pure),
        requirement: "Derivatives and event indicators depend only on time, states and inputs: not on earlier evaluations, nor on the order of \
            the Set calls (should: event indicators, and a time set back to the last completed step).",
        tried: "Evaluates both in other orders, repeatedly, after other states at the same time, and in another instance, and compares.",
        fix: "Invalidate cached results in every Set function." },
    Check { id: "E06b", clause: "hardening", levels: Levels::HARD, run: Run::Exchange(same_bits),
        requirement: "Equal time, states and inputs give equal derivatives, bit for bit.",
        tried: "Compares the same evaluations bit for bit.", fix: "Start iterations from a fixed initial guess, and initialize memory." },
    Check { id: "E07", clause: "2.0.5, 3.2.2; 3.0.2, 3.2.1", levels: Levels::SHOULD, run: Run::Exchange(completed_step),
        requirement: "CompletedIntegratorStep succeeds, returns Booleans that are 0 or 1, and without an event changes no state, derivative, input, \
            parameter or time.",
        tried: "Completes steps without an event and compares.", fix: "Return false for both flags, and change nothing." },
    Check { id: "E08", clause: "2.0.5, 3.2.1; 3.0.2, 3.2.1", levels: Levels::SHOULD, run: Run::Exchange(independent),
        requirement: "The independent variable is the time that SetTime set.",
        tried: "Sets the time and reads the independent variable.", fix: "Assign the argument of SetTime to it." },
    Check { id: "E09", clause: "hardening", levels: Levels::HARD, run: Run::Exchange(wild_states),
        requirement: "States that are NaN, infinite or huge cause no crash, no hang and no Error (Discard is allowed); with valid states, the derivatives \
            are the same as before.",
        tried: "Sets states of NaN, infinity and 1e300, reads derivatives, then sets valid states.",
        fix: "Return Discard, and keep nothing from the failed evaluation." },
    Check { id: "E10", clause: "hardening", levels: Levels::HARD, run: Run::Exchange(wrong_length),
        requirement: "A vector of the wrong length is refused with Error.",
        tried: "Passes vectors that are too long by one.", fix: "Compare the length with the number of states or indicators." },
    Check { id: "E11", clause: "2.0.5, 2.2.8; 3.0.2, 2.4.8", levels: Levels::MUST, run: Run::Exchange(exchange_dependencies),
        requirement: "An output or derivative changes only with the states and inputs among its dependencies.",
        tried: "Changes states and inputs one at a time and reads outputs and derivatives that do not name them.",
        fix: "Add them to dependencies, or leave dependencies out." },
    Check { id: "E15", clause: "2.0.5, 3.2.1; 3.0.2, 3.2.1", levels: Levels::MUST, run: Run::Exchange(both_ways),
        requirement: "The vectors of states and derivatives agree with the variables that are these states and derivatives.",
        tried: "Reads both at several points and after events.", fix: "Let both functions read the same value." },
    Check { id: "E16", clause: "2.0.5, 3.2.2; 3.0.2, 2.3.5", levels: Levels::SHOULD, run: Run::Exchange(mode_alone),
        requirement: "EnterContinuousTimeMode and EnterEventMode change no state, derivative, input, parameter or time; updates of discrete states \
            change no input or parameter.",
        tried: "Reads them before and after each change of mode, and before and after the updates.",
        fix: "Reinitialize states in the update of the discrete states only." },
    Check { id: "E17", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels::MUST, run: Run::Exchange(interleaved),
        requirement: "Interleaved instances of Model Exchange give the same results as each alone.",
        tried: "Runs 3 interleaved instances and compares each with one alone; frees two, and continues the last one.",
        fix: "Keep all data in the instance; no globals and statics." },
    Check { id: "E18", clause: "2.0.5, 3.2.2; 3.0.2, 2.3.3", levels: Levels::SHOULD, run: Run::Exchange(start_times),
        requirement: "Model Exchange runs from start times of 0, -1, 1000 and 1e6, and its next time events are later than the start time.",
        tried: "Integrates 20 steps from each.", fix: "Take the start time from its argument, and count time events from it." },
    Check { id: "E19", clause: "hardening", levels: Levels::HARD, run: Run::Exchange(both_interfaces),
        requirement: "Co-simulation and Model Exchange of one FMU give approximately the same results with the same inputs.",
        tried: "Runs both with constant inputs, Model Exchange with Euler's method in two step sizes, and compares what differs at a quarter of \
            the points by a quarter of the change over the run, and by 10 times the error of the integration.",
        fix: "Let both interfaces use the same equations, start values and events." },
    Check { id: "E12", clause: "2.0.5, 2.1.6; 3.0.2, 2.3.1", levels: Levels::MUST, run: Run::Exchange(reset),
        requirement: "Reset, in any state of Model Exchange, restores a new instance: a second run equals the first.",
        tried: "Resets in every state, runs again, and compares.", fix: "Assign everything that instantiation assigns, including the event iteration." },
    Check { id: "E13", clause: "2.0.5, 2.1.8; 3.0.2, 2.2.7.4", levels: Levels::MUST, run: Run::Exchange(saved_states),
        requirement: "An FMU state saved in Event Mode or in Continuous-Time Mode restores the run from there.",
        tried: "Saves in Event Mode and Continuous-Time Mode, restores, runs, and compares.",
        fix: "Save event counters, next event times and the mode too." },
    Check { id: "E14", clause: "hardening", levels: Levels::HARD, run: Run::Exchange(foreign_states),
        requirement: "Setting a state of a Model Exchange instance in an instance for co-simulation, or the reverse, does no harm.",
        tried: "Sets a state of one kind of instance into the other.", fix: "Store the kind, and return Error." },
];

/// Ten steps of the integrator; `None` if the states diverge, as they do in Euler's method if the steps are too long.
fn first_steps(session: &Session) -> Result<Option<(Instance<'_>, bool)>, NotDetermined> {
    let instance = session.exchange(State::Event)?;
    let mut importer = Importer::start(&instance)?;
    let nominals =
        session.description.states().into_iter().flat_map(|v| vec![v.nominal.unwrap_or(1.0); session.elements(v)]);
    let limits: Vec<f64> =
        instance.states()?.iter().zip(nominals).map(|(x, nominal)| 1e3 * x.abs().max(nominal.abs())).collect();
    let away = Cell::new(false);
    let result = importer.run(10, &mut |instance| {
        away.set(away.get() || instance.states()?.iter().zip(&limits).any(|(x, limit)| x.abs() > *limit));
        Ok(())
    });
    let over = importer.over;
    match result {
        // A model may refuse states that no trajectory reaches.
        Err(_) | Ok(()) if away.get() => instance.free().map(|()| None),
        Err(NotDetermined(why)) if why == UNSTABLE => instance.free().map(|()| None),
        Err(why) => Err(why),
        Ok(()) => Ok(Some((instance, over))),
    }
}

fn minimal_run(session: &Session) -> Result<(), NotDetermined> {
    let usual = session.integrator_step();
    let mut found = first_steps(session)?;
    // Stiff equations need steps of the size of their shortest time constant.
    for tenth in 1..=12 {
        if found.is_some() {
            break;
        }
        session.integrator.set(Some(usual / 10.0_f64.powi(tenth)));
        found = first_steps(session)?;
    }
    let Some((instance, over)) = found else {
        session.write(&Line::NotDetermined(UNSTABLE.into()));
        return Ok(());
    };
    if let Some(step) = session.integrator.get() {
        session.write(&Line::Integrator(step));
        session.note(format!("the equations are stiff: steps of {step:e} s instead of {usual:e} s"));
    }
    let _ = instance.snapshot(&session.watched())?;
    if !over {
        let status = instance.simple(Simple::Terminate)?;
        session.require(status.is_ok(), || format!("{} returned {status}", session.raw.name("Terminate")));
    }
    Ok(())
}

fn allowed(session: &Session) -> Result<(), NotDetermined> {
    attempt(session, Life::ModelExchange, '+');
    Ok(())
}

fn allowed_early(session: &Session) -> Result<(), NotDetermined> {
    attempt(session, Life::ModelExchange, 's');
    Ok(())
}

fn refused(session: &Session) -> Result<(), NotDetermined> {
    attempt(session, Life::ModelExchange, '-');
    Ok(())
}

fn counts(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.exchange(State::Event)?;
    let (states, indicators) = (session.states(), session.indicators());
    if !session.is_v2() {
        let counts = [(Count::GetNumberOfContinuousStates, states), (Count::GetNumberOfEventIndicators, indicators)];
        for (name, expected) in counts {
            let (status, found) = instance.call_for(name.as_str(), |raw| raw.count(name, instance.handle, false))?;
            session.require(status.is_ok() && found == expected, || {
                format!("fmi3{} returned {status}, {found}; the description has {expected}", name.as_str())
            });
        }
    }
    for (name, n) in [
        (Vector::GetContinuousStates, states),
        (instance.derivatives_name(), states),
        (Vector::GetNominalsOfContinuousStates, states),
        (Vector::GetEventIndicators, indicators),
    ] {
        if n == 0 {
            continue;
        }
        let (status, values, intact) = instance.vector(name, n)?;
        session.require(intact, || format!("{} wrote past the {n} values", name.as_str()));
        session.require(!status.is_ok() || values.iter().all(|v| v.to_bits() != UNTOUCHED.to_bits()), || {
            format!("{} did not write all of the {n} values", name.as_str())
        });
    }
    session.note(format!("{states} states, {indicators} event indicators"));
    Ok(())
}

/// Ends a probe of an FMU without continuous states.
macro_rules! needs_states {
    ($session:ident) => {
        if $session.states() == 0 {
            return $session.not_applicable("there are no continuous states");
        }
    };
}

fn nominals(session: &Session) -> Result<Vec<f64>, NotDetermined> {
    let instance = session.exchange(State::Continuous)?;
    instance.nominals()
}

fn positive_nominals(session: &Session) -> Result<(), NotDetermined> {
    needs_states!(session);
    let found = nominals(session)?;
    for (name, nominal) in session.element_names(session.description.states()).iter().zip(&found) {
        session.require(nominal.is_finite() && *nominal > 0.0, || format!("the nominal of {name} is {nominal:?}"));
    }
    Ok(())
}

fn declared_nominals(session: &Session) -> Result<(), NotDetermined> {
    needs_states!(session);
    let states = session.description.states();
    let declared = states.iter().flat_map(|v| vec![(v, v.nominal.unwrap_or(1.0)); session.elements(v)]);
    for ((v, declared), found) in declared.zip(nominals(session)?) {
        session.require((found - declared).abs() <= 1e-12 * declared.abs(), || {
            format!("line {}: {} has the nominal {declared}, but the binary returned {found}", v.line, v.name)
        });
    }
    Ok(())
}

fn round_trip(session: &Session) -> Result<(), NotDetermined> {
    inputs_read_back(session)?;
    needs_states!(session);
    let instance = session.exchange(State::Continuous)?;
    let x = moved(session, &instance.states()?, usize::MAX);
    let status = instance.set_states(&x)?;
    if !status.is_ok() {
        return Err(NotDetermined(format!("SetContinuousStates({x:?}) returned {status}")));
    }
    let found = instance.states()?;
    let names = session.element_names(session.description.states());
    for ((name, set), got) in names.iter().zip(&x).zip(&found) {
        session.require((set - got).abs() <= 0.0, || {
            format!("{name}: set to {set:?} in the vector of states, read as {got:?}")
        });
    }
    let mut rest = &x[..];
    for v in session.description.states() {
        let (one, more) = rest.split_at(session.elements(v).min(rest.len()));
        rest = more;
        let (status, found) = instance.get(v)?;
        let found: Vec<f64> = found.into_iter().map(f64::from_bits).collect();
        session.require(status.is_ok() && found == one, || {
            let found = if found.is_empty() { String::new() } else { format!(", {found:?}") };
            format!("the state {} was set to {one:?}, and Get returned {status}{found}", v.name)
        });
    }
    Ok(())
}

fn both_ways(session: &Session) -> Result<(), NotDetermined> {
    needs_states!(session);
    let d = &session.description;
    let derivatives: Vec<&ModelVariable> = d.derivatives.iter().filter_map(|u| d.referenced(u.reference)).collect();
    let instance = session.excited()?;
    let mut importer = Importer::start(&instance)?;
    // At the start, after some steps, and after events.
    let mut looked = 0;
    for k in 0..400 {
        let event = importer.step(session.integrator_step(), &mut |_, _| ())?;
        if importer.over || looked == 8 {
            break;
        }
        if !event && k % 50 != 0 {
            continue;
        }
        looked += 1;
        let mut vector = instance.states()?;
        vector.extend(instance.derivatives()?);
        let mut rest = &vector[..];
        for v in d.states().iter().chain(&derivatives) {
            let (of_vector, more) = rest.split_at(session.elements(v).min(rest.len()));
            rest = more;
            let (status, found) = instance.get(v)?;
            let found: Vec<f64> = found.into_iter().map(f64::from_bits).collect();
            if !status.is_ok() || v.base != BaseType::Float64 {
                continue;
            }
            if let Some(deviation) = deviation(&[of_vector.to_vec()], std::slice::from_ref(&found)) {
                let (text, t) = (deviation.text(&session.names_of(&[v])), instance.time.get());
                let text = format!("line {}: t = {t:?}: {text} as in the vector", v.line);
                session.deviates(deviation.largest, &text);
                return Ok(());
            }
        }
    }
    Ok(())
}

fn wild_states(session: &Session) -> Result<(), NotDetermined> {
    needs_states!(session);
    session.cases([f64::NAN, f64::INFINITY, 1e300], |wild| {
        let instance = session.exchange(State::Continuous)?;
        let (x, f) = (instance.states()?, instance.derivatives()?);
        let set = instance.set_states(&vec![wild; x.len()])?;
        let mut answers = vec![("SetContinuousStates", set)];
        if set.is_ok() {
            answers
                .push((instance.derivatives_name().as_str(), instance.vector(instance.derivatives_name(), x.len())?.0));
            if session.indicators() > 0 {
                let (status, ..) = instance.vector(Vector::GetEventIndicators, session.indicators())?;
                answers.push(("GetEventIndicators", status));
            }
        }
        for (name, status) in answers {
            session.require(status.is_ok() || status == Status::DISCARD, || {
                format!("{name} with states of {wild:e} returned {status}, which ends the simulation")
            });
            if !status.is_ok() && status != Status::DISCARD {
                return Ok(());
            }
        }
        let status = instance.set_states(&x)?;
        let again = if status.is_ok() { instance.derivatives()? } else { Vec::new() };
        session.require(!differ(&again, &f), || {
            format!(
                "the derivatives were {f:?}; after states of {wild:e} and the old ones ({status}) they are {again:?}"
            )
        });
        Ok(())
    })
}

fn wrong_length(session: &Session) -> Result<(), NotDetermined> {
    needs_states!(session);
    for (name, n) in [
        (Vector::GetContinuousStates, session.states() + 1),
        (Vector::SetContinuousStates, session.states() + 1),
        (Vector::GetNominalsOfContinuousStates, session.states() + 1),
        (Vector::GetEventIndicators, session.indicators() + 1),
    ] {
        session.case(|| {
            let instance = session.exchange(State::Continuous)?;
            let mut room = vec![0.0; n + 8];
            let call = format!("{}(n={n})", name.as_str());
            let status = instance.call(&call, |raw| raw.vector(name, instance.handle, Some(&mut room), n))?;
            session.require(status == Status::ERROR, || format!("{call} returned {status}"));
            Ok(())
        });
    }
    Ok(())
}

fn reset(session: &Session) -> Result<(), NotDetermined> {
    let run = |instance: &Instance<'_>| Importer::start(instance)?.trajectory(100);
    let first = run(&session.exchange(State::Event)?)?;
    session.cases(Life::ModelExchange.states(), |&state| {
        let running = state == State::Continuous;
        let instance = session.exchange(if running { State::Initialization } else { state })?;
        if running {
            // Refusals are not the subject of this check.
            if let Err(NotDetermined(why)) = set_all(&instance, 1.0) {
                session.note(why);
            }
            let _ = instance
                .perform(Simple::ExitInitializationMode)
                .and_then(|()| Importer::start(&instance)?.run(20, &mut |_| Ok(())));
        }
        let status = instance.simple(Simple::Reset)?;
        if !status.is_ok() {
            session.violated(format!("Reset in {state:?} returned {status}"));
            return Ok(());
        }
        instance.experiment(session.start(), None);
        if let Err(why) = instance.bring_to(State::Event) {
            session.failed(&format!("after Reset in {state:?}"), why);
            return Ok(());
        }
        if let Some(found) = deviation(&first, &run(&instance)?) {
            let (step, text) = (steps(found.step), found.text(&session.names_of_rows()));
            let text = format!("after Reset in {state:?}, compared with a new instance: after {step} {text}");
            session.deviates(found.largest, &text);
        }
        Ok(())
    })
}

fn saved_states(session: &Session) -> Result<(), NotDetermined> {
    if !session.exchange_saves() {
        return session.not_applicable("canGetAndSetFMUState is false for Model Exchange");
    }
    let comparable = |v: &&ModelVariable| v.clocks.is_empty() && v.causality != Causality::Independent;
    let all: Vec<&ModelVariable> = session.numeric().filter(comparable).collect();
    session.case(|| in_initialization(session, &|| session.exchange(State::Initialization), &all));
    let compare = |mode: &str, first: &[Vec<f64>], second: &[Vec<f64>]| {
        if let Some(found) = deviation(first, second) {
            let (step, text) = (steps(found.step), found.text(&session.names_of_rows()));
            session.deviates(found.largest, &format!("restored in {mode}: {step} later {text}"));
        }
    };
    session.case(|| {
        let instance = session.excited()?;
        let (saved, t) = (instance.save()?, instance.time.get());
        let first = Importer::start(&instance)?.trajectory(100)?;
        instance.restore(saved, t)?;
        compare("Event Mode", &first, &Importer::start(&instance)?.trajectory(100)?);
        Ok(())
    });
    session.case(|| {
        let instance = session.excited()?;
        let mut importer = Importer::start(&instance)?;
        importer.run(50, &mut |_| Ok(()))?;
        let (saved, t, next) = (instance.save()?, instance.time.get(), importer.next);
        let before = instance.snapshot(&all)?;
        let mut first = importer.trajectory(100)?;
        for _ in 0..2 {
            instance.restore(saved, t)?;
            for (v, (old, new)) in all.iter().zip(before.iter().zip(instance.snapshot(&all)?)) {
                session.compare_variables(
                    &[*v],
                    "restored in Continuous-Time Mode",
                    &[vec![old.clone()]],
                    &[vec![new]],
                );
            }
            let second = Importer::resume(&instance, next)?.trajectory(100)?;
            compare("Continuous-Time Mode", &first, &second);
            first = second;
        }
        Ok(())
    });
    // In the middle of an event: the update that follows must be the same.
    session.case(|| {
        let instance = session.excited()?;
        let mut importer = Importer::start(&instance)?;
        importer.run(50, &mut |_| Ok(()))?;
        if importer.over {
            return Ok(());
        }
        instance.perform(Simple::EnterEventMode)?;
        let (saved, t) = (instance.save()?, instance.time.get());
        let first = Importer::start(&instance)?.trajectory(100)?;
        instance.restore(saved, t)?;
        compare("Event Mode", &first, &Importer::start(&instance)?.trajectory(100)?);
        Ok(())
    });
    Ok(())
}

fn foreign_states(session: &Session) -> Result<(), NotDetermined> {
    let d = &session.description;
    let both = d.model_exchange.as_ref().zip(d.co_simulation.as_ref());
    let Some((exchange, simulation)) = both else { return session.not_applicable("the FMU has one interface only") };
    if exchange.model_identifier != simulation.model_identifier {
        return session.not_applicable("the interfaces have binaries of their own");
    }
    if !exchange.can_get_and_set_state() || !simulation.can_get_and_set_state() {
        return session.not_applicable("canGetAndSetFMUState is false");
    }
    session.cases([true, false], |to_simulation| {
        let (exchange, simulation) = (session.exchange(State::Continuous)?, session.stepping()?);
        let (from, to) = if to_simulation { (&exchange, &simulation) } else { (&simulation, &exchange) };
        let saved = from.save()?;
        let status = to.call("SetFMUState of the other interface", |raw| raw.set_state(to.handle, saved))?;
        session.note(format!("SetFMUState returned {status}"));
        if status == Status::FATAL {
            return Ok(());
        }
        // Regardless of the status, the next calls and a reset must not crash.
        if to_simulation {
            let _ = to.step(session.h())?;
        } else {
            let _ = to.set_time(to.time.get() + session.integrator_step())?;
            let _ = to.vector(to.derivatives_name(), session.states())?;
        }
        let status = to.simple(Simple::Reset)?;
        session.require(status.is_ok(), || format!("Reset after a state of the other interface returned {status}"));
        Ok(())
    })
}
