//! State that an evaluation, the end of a step and a change of the mode must leave unchanged (FMI 2.0.5, 3.2; FMI 3.0.2, 3.2).

use crate::checks::life::shared::values::is_rounded;
use crate::checks::process::instances::only_once;
use crate::deviation::deviation;
use crate::encoding::{same, show};
use crate::exchange::Importer;
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::state::State;
use crate::trajectory::steps;
use fmu_import::raw::{Arguments, Interface, Simple, flag_text};
use model_description::{BaseType, Causality, ModelVariable, Variability};

/// States near those given: one of them, or all, moved slightly.
pub(crate) fn moved(session: &Session, x: &[f64], k: usize) -> Vec<f64> {
    let nominal = session.description.states();
    let size = |i: usize| nominal.get(i).and_then(|v| v.nominal).unwrap_or(1.0).abs().max(x[i].abs());
    x.iter().enumerate().map(|(i, x)| if i == k || k >= nominal.len() { x + 1e-3 * size(i) } else { *x }).collect()
}

/// Values at one point, each evaluated after a different action: the action, the derivatives, and the event indicators.
type Evaluations = Vec<(&'static str, Vec<f64>, Vec<f64>)>;

/// Values at a point, or the reason why time cannot be set back to it.
fn evaluations(session: &Session) -> Result<Result<Evaluations, String>, NotDetermined> {
    let begin = || -> Result<_, NotDetermined> {
        let instance = session.excited()?;
        let mut importer = Importer::start(&instance)?;
        importer.run(50, &mut |_| Ok(()))?;
        let over = importer.over;
        Ok((instance, over))
    };
    let (instance, over) = begin()?;
    if over {
        return Err(NotDetermined("the FMU ends the simulation at once".into()));
    }
    let (t, dt, x) = (instance.time.get(), session.integrator_step(), instance.states()?);
    let inputs: Vec<(&ModelVariable, Vec<u64>)> = session
        .number_inputs()
        .filter(|v| v.variability == Variability::Continuous)
        .filter_map(|v| Some((v, session.different_value(v, 3.0)?)))
        .collect();
    let point = |instance: &Instance<'_>, order: [usize; 3]| -> Result<(), NotDetermined> {
        for what in order {
            match what {
                0 => instance.must("SetTime", instance.set_time(t)?)?,
                1 => instance.must("SetContinuousStates", instance.set_states(&x)?)?,
                _ => {
                    for (v, values) in &inputs {
                        instance.must("Set", instance.set(v, values)?)?;
                    }
                }
            }
        }
        Ok(())
    };
    let of = session.derivative_variables();
    let read = |instance: &Instance<'_>| {
        Ok::<_, NotDetermined>((session.steady(&of, instance.derivatives()?), instance.indicators()?))
    };
    let away = |k: usize| -> Result<(), NotDetermined> {
        instance.must("SetContinuousStates", instance.set_states(&moved(session, &x, k))?)?;
        let _ = read(&instance)?;
        instance.must("SetTime", instance.set_time(t + dt)?)?;
        let _ = read(&instance)?;
        Ok(())
    };
    // Like an integrator that retries with a shorter step.
    away(usize::MAX)?;
    let back = instance.set_time(t)?;
    if !back.is_ok() {
        return Ok(Err(format!("SetTime({t:?}) after SetTime({:?}) returned {back}", t + dt)));
    }
    point(&instance, [0, 1, 2])?;
    let mut found = Vec::new();
    let mut add = |what, (derivatives, indicators)| found.push((what, derivatives, indicators));
    add("first", read(&instance)?);
    add("read twice", read(&instance)?);
    let _ = instance.snapshot(&session.watched())?;
    add("after outputs", read(&instance)?);
    for (k, what) in [(0, "after another state"), (usize::MAX, "after other states")] {
        away(k)?;
        point(&instance, [1, 2, 0])?;
        add(what, read(&instance)?);
    }
    // Other states at the same time, as an integrator of several stages sets them.
    away(usize::MAX)?;
    point(&instance, [0, 1, 2])?;
    instance.must("SetContinuousStates", instance.set_states(&moved(session, &x, usize::MAX))?)?;
    let _ = read(&instance)?;
    instance.must("SetContinuousStates", instance.set_states(&x)?)?;
    add("after other states at the same time", read(&instance)?);
    let (other, _) = begin()?;
    point(&other, [2, 1, 0])?;
    add("in another instance, set in another order", read(&other)?);
    Ok(Ok(found))
}

pub(crate) fn pure(session: &Session) -> Result<(), NotDetermined> {
    if session.states() == 0 {
        return session.not_applicable("there are no continuous states");
    }
    let found = match evaluations(session)? {
        Ok(found) => found,
        Err(why) => {
            session.lesser(Level::Should, why);
            return Ok(());
        }
    };
    let Some((_, derivatives, indicators)) = found.first() else { return Ok(()) };
    let names = session.names_of(&session.derivative_variables());
    for (what, values, z) in &found[1..] {
        if let Some(found) = deviation(std::slice::from_ref(derivatives), std::slice::from_ref(values)) {
            session.deviates(found.largest, &format!("{what}: {}", found.text(&names)));
        }
        if let Some(found) = deviation(std::slice::from_ref(indicators), std::slice::from_ref(z)) {
            let text = format!("{what}: {}", found.text(&session.names_of_indicators()));
            session.deviates_at(Some(Level::Should), found.largest, &text);
        }
    }
    Ok(())
}

pub(crate) fn same_bits(session: &Session) -> Result<(), NotDetermined> {
    if session.states() == 0 {
        return session.not_applicable("there are no continuous states");
    }
    let found = evaluations(session)?.map_err(NotDetermined)?;
    let Some((_, first, _)) = found.first() else { return Ok(()) };
    for (what, values, _) in &found[1..] {
        let names = session.names_of(&session.derivative_variables());
        for ((name, a), b) in names.iter().zip(first).zip(values) {
            let apart = || format!("{what}: {name} is {b:?}, expected {a:?} ({:.1e} apart)", (a - b).abs());
            session.require(a.to_bits() == b.to_bits(), apart);
        }
    }
    Ok(())
}

/// The states and the derivatives that can be compared.
fn vectors(instance: &Instance<'_>) -> Result<[Vec<f64>; 2], NotDetermined> {
    let session = instance.session;
    let states = session.steady(&session.description.states(), instance.states()?);
    Ok([states, session.steady(&session.derivative_variables(), instance.derivatives()?)])
}

/// Inputs, parameters and the time, with their values.
struct Snapshot<'a, 'b> {
    instance: &'a Instance<'b>,
    variables: Vec<&'b ModelVariable>,
    values: Vec<Vec<u64>>,
    /// States and derivatives.
    vectors: [Vec<f64>; 2],
}

impl<'a, 'b> Snapshot<'a, 'b> {
    fn read(instance: &'a Instance<'b>) -> Result<Self, NotDetermined> {
        let fits = |v: &&ModelVariable| {
            v.clocks.is_empty()
                && matches!(v.causality, Causality::Input | Causality::Parameter | Causality::Independent)
        };
        let variables: Vec<_> = instance.session.numeric().filter(fits).take(200).collect();
        let values = instance.snapshot(&variables)?;
        Ok(Self { instance, variables, values, vectors: vectors(instance)? })
    }

    /// Requires that a call has left them unchanged.
    fn require(&self, call: &str) -> Result<(), NotDetermined> {
        let session = self.instance.session;
        let now = vectors(self.instance)?;
        let names =
            [session.names_of(&session.description.states()), session.names_of(&session.derivative_variables())];
        for (names, (before, after)) in names.iter().zip(self.vectors.iter().zip(&now)) {
            let found = deviation(std::slice::from_ref(before), std::slice::from_ref(after));
            if let Some(found) = found {
                let t = self.instance.time.get();
                session.violated(format!("after {call} at t = {t:?}: {}", found.text(names)));
            }
        }
        self.require_but_states(call)
    }

    fn require_but_states(&self, call: &str) -> Result<(), NotDetermined> {
        let session = self.instance.session;
        for (v, (old, new)) in
            self.variables.iter().zip(self.values.iter().zip(self.instance.snapshot(&self.variables)?))
        {
            if !old.is_empty() && !new.is_empty() {
                session.compare_variables(&[*v], &format!("after {call}"), &[vec![old.clone()]], &[vec![new]]);
            }
        }
        Ok(())
    }
}

pub(crate) fn completed_step(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.excited()?;
    if Importer::start(&instance)?.over {
        return Err(NotDetermined("the FMU ends the simulation at once".into()));
    }
    for _ in 0..5 {
        instance.must("SetTime", instance.set_time(instance.time.get() + 1e-3 * session.integrator_step())?)?;
        let before = Snapshot::read(&instance)?;
        let (status, flags) = instance.completed()?;
        session.require(status.is_ok() && flags.iter().all(|f| matches!(f, 0 | 1)), || {
            let [enter, end] = flags.map(flag_text);
            format!("CompletedIntegratorStep returned {status}, enterEventMode={enter}, terminateSimulation={end}")
        });
        if !status.is_ok() || flags != [0, 0] {
            return Ok(());
        }
        before.require("CompletedIntegratorStep")?;
    }
    Ok(())
}

pub(crate) fn independent(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| v.causality == Causality::Independent && v.base == BaseType::Float64;
    let Some(time) = session.description.variables.iter().find(fits) else {
        return session.not_applicable("there is no independent variable of type Float64");
    };
    let instance = session.exchange(State::Continuous)?;
    for _ in 0..3 {
        // Forward and back, like an integrator that retries with a shorter step.
        let t = instance.time.get() + 0.1 * session.integrator_step();
        instance.must("SetTime", instance.set_time(t + session.integrator_step())?)?;
        instance.must("SetTime", instance.set_time(t)?)?;
        let (status, bits) = instance.get(time)?;
        let found = bits.first().map_or(f64::NAN, |b| f64::from_bits(*b));
        session.require(status.is_ok() && (found - t).abs() <= 1e-9 * t.abs(), || {
            let found = show(time, session.description.version, &bits);
            format!("after SetTime({t:?}), Get({}) returned {status}, {found}", time.name)
        });
    }
    Ok(())
}

pub(crate) fn mode_alone(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.excited()?;
    for _ in 0..3 {
        let before = Snapshot::read(&instance)?;
        let event = instance.iterate()?;
        before.require_but_states("the updates of an event")?;
        if event.terminates() || !event.ended() {
            return Ok(());
        }
        let before = Snapshot::read(&instance)?;
        instance.perform(Simple::EnterContinuousTimeMode)?;
        before.require("EnterContinuousTimeMode")?;
        let t = instance.time.get() + session.integrator_step();
        let next = event.next().unwrap_or(f64::INFINITY);
        instance.must("SetTime", instance.set_time(t.min(next))?)?;
        let before = Snapshot::read(&instance)?;
        instance.perform(Simple::EnterEventMode)?;
        before.require("EnterEventMode")?;
    }
    Ok(())
}

pub(crate) fn interleaved(session: &Session) -> Result<(), NotDetermined> {
    if only_once(session) {
        return session.not_applicable("canBeInstantiatedOnlyOncePerProcess is true");
    }
    let alone = session.exchange(State::Event)?;
    let expected = Importer::start(&alone)?.trajectory(80)?;
    let mut instances = Vec::new();
    for k in 0..3 {
        let interface = Interface::ModelExchange;
        let Some(instance) = session.instantiate(&Arguments { interface, ..session.arguments("probe") })? else {
            session.violated(format!("instance {} could not be created while {} others existed", k + 2, k + 1));
            return Ok(());
        };
        instance.bring_to(State::Event)?;
        instances.push(instance);
    }
    let Some(last) = instances.pop() else { return Ok(()) };
    let (mut of_last, mut rows_of_last) = (Importer::start(&last)?, Vec::new());
    let mut others = instances.iter().map(|i| Ok((Importer::start(i)?, Vec::new()))).collect::<Result<Vec<_>, _>>()?;
    for _ in 0..60 {
        for (importer, rows) in &mut others {
            rows.extend(importer.trajectory(1)?);
        }
        rows_of_last.extend(of_last.trajectory(1)?);
    }
    let compare = |k: usize, rows: &[Vec<f64>], when: &str| {
        if let Some(found) = deviation(&expected[..expected.len().min(rows.len().max(60))], rows) {
            let (step, text) = (steps(found.step), found.text(&session.names_of_rows()));
            let text = format!("instance {}, compared with one alone: after {step} {text}{when}", k + 2);
            session.deviates(found.largest, &text);
            return false;
        }
        true
    };
    let rows = others.into_iter().map(|(_, rows)| rows).chain([rows_of_last.clone()]);
    if !rows.enumerate().fold(true, |same, (k, rows)| compare(k, &rows, "") && same) {
        return Ok(());
    }
    instances.into_iter().chain([alone]).try_for_each(Instance::free)?;
    rows_of_last.extend(of_last.trajectory(20)?);
    compare(2, &rows_of_last, "; the others were freed after 60");
    Ok(())
}

pub(crate) fn start_times(session: &Session) -> Result<(), NotDetermined> {
    session.cases([0.0, -1.0, 1000.0, 1e6], |start| {
        let interface = Interface::ModelExchange;
        let instance = session.made(&Arguments { interface, ..session.arguments("probe") })?;
        instance.experiment(start, None);
        let run = || {
            instance.bring_to(State::Event)?;
            let mut importer = Importer::start(&instance)?;
            let next = importer.next;
            importer.run(20, &mut |_| Ok(()))?;
            Ok(next)
        };
        match run() {
            Err(why) => session.failed(&format!("startTime={start}"), why),
            Ok(next) => {
                if let Some(next) = next.filter(|next| *next <= start) {
                    session.violated(format!("startTime={start}: nextEventTime of the first event is {next:?}"));
                }
            }
        }
        Ok(())
    })
}

/// Inputs that are set in Event Mode and in Continuous-Time Mode.
pub(crate) fn inputs_read_back(session: &Session) -> Result<(), NotDetermined> {
    let version = session.description.version;
    for state in [State::Event, State::Continuous] {
        let allowed = |v: &&ModelVariable| state == State::Event || v.variability == Variability::Continuous;
        let instance = session.exchange(state)?;
        for v in session.number_inputs().filter(allowed).take(40) {
            let Some(values) = session.different_value(v, 1.0) else { continue };
            // A model may refuse a value.
            if !instance.set(v, &values)?.is_ok() {
                break;
            }
            let (status, back) = instance.get(v)?;
            let kept = same(v, version, &values, &back) || is_rounded(v, version, &values, &back);
            if !status.is_ok() || !kept {
                let [set, got] = [&values, &back].map(|bits| show(v, version, bits));
                let text =
                    format!("{} was set to {set} in {state:?}, and Get({}) returned {status}, {got}", v.name, v.name);
                session.lesser(Level::Should, text);
            }
        }
    }
    Ok(())
}
