//! Scheduled Execution: the importer activates the partitions of the FMU one by one (FMI 3.0.2, 5).

use crate::check::{Check, Levels, Run};
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::ticking::{Ticking, clocks};
use fmu_import::Status;
use fmu_import::raw::{Arguments, Heard, Inside, Interface, Meanwhile, Simple};
use model_description::IntervalVariability::{Changing, Countdown, Triggered};
use model_description::ModelVariable;

const MUST: Levels = Levels(None, Some(Level::Must));
const SHOULD: Levels = Levels(None, Some(Level::Should));

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "P00", clause: "3.0.2, 5.2.1", levels: MUST, run: Run::Scheduled(activated),
        requirement: "Partitions can be activated when their clocks tick, and their results can be read.",
        tried: "Activates each partition when it is due, a triggered one at every third instant, at 12 instants; reads every variable on its clock.",
        fix: "Accept fmi3ActivateModelPartition for every clock with causality input, in Clock Activation Mode." },
    Check { id: "P01", clause: "3.0.2, 5.2.1", levels: SHOULD, run: Run::Scheduled(unknown),
        requirement: "fmi3ActivateModelPartition of a reference that is not an input clock returns Error.",
        tried: "Calls it with an output clock, a variable, and a reference that does not exist.", fix: "Return Error unless the reference belongs to an \
            input clock." },
    Check { id: "P02", clause: "3.0.2, 5.2.1", levels: SHOULD, run: Run::Scheduled(too_early),
        requirement: "Before the initialization ends, fmi3ActivateModelPartition returns Error.",
        tried: "Calls it in Instantiated and in Initialization Mode.", fix: "Check the state at the beginning of the function." },
    Check { id: "P03", clause: "3.0.2, 5.1.2", levels: MUST, run: Run::Scheduled(locked),
        requirement: "Every lockPreemption is followed by one unlockPreemption before the call returns; a partition also runs without both.",
        tried: "Counts them in every activation and getter of a run, and runs with NULL for both.", fix: "Unlock before every return of the function." },
    Check { id: "P04", clause: "3.0.2, 5.2.2", levels: MUST, run: Run::Scheduled(updated),
        requirement: "clockUpdate is called inside fmi3ActivateModelPartition only, with the environment of the instance; in it, GetClock and \
            GetIntervalDecimal succeed.",
        tried: "Asks for every output clock and countdown clock in each call of a run.", fix: "Allow both functions while clockUpdate runs." },
    Check { id: "P05", clause: "3.0.2, 5.2.2", levels: MUST, run: Run::Scheduled(active_once),
        requirement: "GetClock returns an output clock as active once for each activation.",
        tried: "Calls GetClock twice in each clockUpdate of a run.", fix: "Deactivate the clock after GetClock has returned it as active." },
];

/// Instants of a run.
const INSTANTS: usize = 12;

/// An instance for Scheduled Execution.
struct Schedule<'b> {
    instance: Instance<'b>,
    clocks: Vec<Ticking<'b>>,
    /// The actions in each `clockUpdate`.
    acts: Vec<Inside>,
}

/// One activation, with what was called meanwhile.
struct Activation<'b> {
    clock: &'b ModelVariable,
    status: Status,
    meanwhile: Meanwhile,
}

fn scheduled(session: &Session, locks: bool) -> Result<Instance<'_>, NotDetermined> {
    let interface = Interface::ScheduledExecution;
    let instance = session.made(&Arguments { interface, locks, event_mode: false, ..session.arguments("probe") })?;
    let _ = session.raw.take_heard();
    Ok(instance)
}

impl<'b> Schedule<'b> {
    /// A new instance in Clock Activation Mode. In a callback, each output clock is queried this many times.
    fn start(session: &'b Session, locks: bool, times: usize) -> Result<Self, NotDetermined> {
        let instance = scheduled(session, locks)?;
        instance.enter()?;
        let clocks_of = Ticking::all(&instance)?;
        instance.perform(Simple::ExitInitializationMode)?;
        let mut acts = Vec::new();
        for (v, _) in clocks(session, false) {
            acts.extend(std::iter::repeat_n(Inside::Clock(v.value_reference), times));
        }
        let countdown = clocks_of.iter().filter(|c| c.timing.ticks == Countdown);
        acts.extend(countdown.map(|c| Inside::Interval(c.v.value_reference)));
        Ok(Self { instance, clocks: clocks_of, acts })
    }

    fn activate(&self, v: &'b ModelVariable) -> Result<Activation<'b>, NotDetermined> {
        let (i, t) = (&self.instance, self.instance.time.get());
        let call = format!("ActivateModelPartition({}, t={t:?})", v.name);
        let (status, meanwhile) =
            i.call_for(&call, |raw| raw.activate_partition(i.handle, v.value_reference, t, &self.acts))?;
        Ok(Activation { clock: v, status, meanwhile })
    }

    /// An activation must succeed.
    fn must(&self, Activation { clock, status, .. }: &Activation<'_>) -> Result<(), NotDetermined> {
        self.instance
            .must(&format!("ActivateModelPartition({}, t={:?})", clock.name, self.instance.time.get()), *status)
    }

    /// Activates the partitions that are due at the next instants, those with the smallest priority first.
    fn run(
        &mut self,
        look: &mut dyn FnMut(&Self, &Activation<'b>) -> Result<(), NotDetermined>,
    ) -> Result<(), NotDetermined> {
        let session = self.instance.session;
        for instant in 0..INSTANTS {
            let now = self.instance.time.get();
            let mut done = vec![false; self.clocks.len()];
            loop {
                let ticks = |c: &Ticking<'_>| {
                    if c.timing.ticks == Triggered { instant.is_multiple_of(3) } else { c.is_due(now) }
                };
                let next = (0..self.clocks.len()).filter(|&i| !done[i] && ticks(&self.clocks[i]));
                let Some(i) = next.min_by_key(|&i| self.clocks[i].timing.priority.unwrap_or(0)) else { break };
                done[i] = true;
                let activation = self.activate(self.clocks[i].v)?;
                look(self, &activation)?;
                self.must(&activation)?;
                self.clocks[i].ticked(now);
                if self.clocks[i].timing.ticks == Changing {
                    let (status, answer) = self.instance.interval(self.clocks[i].v)?;
                    self.instance.must("GetIntervalDecimal", status)?;
                    self.clocks[i].hear(answer, now);
                }
                for (act, (status, interval, qualifier)) in &activation.meanwhile.answers {
                    let asked = |c: &&mut Ticking<'_>| *act == Inside::Interval(c.v.value_reference);
                    if let Some(clock) = self.clocks.iter_mut().find(asked).filter(|_| status.is_ok()) {
                        clock.hear((*interval, *qualifier), now);
                    }
                }
            }
            if session.half_time_used() {
                break;
            }
            let known = self.clocks.iter().filter_map(|c| c.due).filter(|due| *due > now);
            self.instance.time.set(known.fold(now + session.h(), f64::min));
        }
        Ok(())
    }
}

/// The variables on a clock, whose values are numbers.
fn on<'b>(session: &'b Session, clock: &ModelVariable) -> Vec<&'b ModelVariable> {
    session.numeric().filter(|v| v.clocks.contains(&clock.value_reference)).collect()
}

fn activated(session: &Session) -> Result<(), NotDetermined> {
    let run = Schedule::start(session, true, 0).and_then(|mut schedule| {
        schedule.run(&mut |schedule, activation| {
            schedule.must(activation)?;
            for v in on(session, activation.clock) {
                let (status, _) = schedule.instance.get(v)?;
                schedule.instance.must(&format!("Get({}) after {}", v.name, activation.clock.name), status)?;
            }
            Ok(())
        })?;
        schedule.instance.perform(Simple::Terminate)
    });
    if let Err(why) = run {
        session.failed("when partitions are activated as their clocks tick", why);
    }
    Ok(())
}

fn unknown(session: &Session) -> Result<(), NotDetermined> {
    let output = clocks(session, false).first().map(|(v, _)| v.value_reference);
    let other = session.numeric().next().map(|v| v.value_reference);
    let all = session.description.variables.iter().map(|v| v.value_reference);
    let none = all.max().and_then(|last| last.checked_add(1));
    session.cases([output, other, none].into_iter().flatten(), |reference| {
        let schedule = Schedule::start(session, true, 1)?;
        let (i, t) = (&schedule.instance, session.start());
        let call = format!("ActivateModelPartition({reference}, t={t:?})");
        let (status, _) = i.call_for(&call, |raw| raw.activate_partition(i.handle, reference, t, &[]))?;
        session.require(status == Status::ERROR, || format!("{call}, which is not an input clock, returned {status}"));
        Ok(())
    })
}

fn too_early(session: &Session) -> Result<(), NotDetermined> {
    let inputs = clocks(session, true);
    let Some((v, _)) = inputs.first() else { return session.not_applicable("there is no input clock") };
    session.cases(["Instantiated", "Initialization Mode"], |state| {
        let (instance, t) = (scheduled(session, true)?, session.start());
        if state != "Instantiated" {
            instance.enter()?;
        }
        let call = format!("ActivateModelPartition({}, t={t:?})", v.name);
        let (status, _) =
            instance.call_for(&call, |raw| raw.activate_partition(instance.handle, v.value_reference, t, &[]))?;
        session.require(status == Status::ERROR, || format!("{call} in {state} returned {status}"));
        Ok(())
    })
}

/// The fault in the locks of one call.
fn unpaired(heard: &[Heard]) -> Option<&'static str> {
    let mut locked = false;
    for heard in heard {
        match (heard, locked) {
            (Heard::Lock, true) => return Some("locks twice"),
            (Heard::Unlock, false) => return Some("unlocks what is not locked"),
            (Heard::Lock, false) => locked = true,
            (Heard::Unlock, true) => locked = false,
            _ => {}
        }
    }
    locked.then_some("does not unlock")
}

fn locked(session: &Session) -> Result<(), NotDetermined> {
    session.case(|| {
        let mut found = false;
        Schedule::start(session, true, 0)?.run(&mut |schedule, Activation { clock, meanwhile, .. }| {
            let mut say = |what: String, why: Option<&str>| {
                if let Some(why) = why.filter(|_| !std::mem::replace(&mut found, true)) {
                    session.violated(format!("{what} {why}"));
                }
            };
            say(format!("ActivateModelPartition({})", clock.name), unpaired(&meanwhile.heard));
            for v in on(session, clock) {
                let _ = schedule.instance.get(v)?;
                say(format!("Get({})", v.name), unpaired(&session.raw.take_heard()));
            }
            Ok(())
        })?;
        let run = Schedule::start(session, false, 0).and_then(|mut schedule| schedule.run(&mut |_, _| Ok(())));
        if let Err(why) = run {
            session.failed("with NULL for lockPreemption and unlockPreemption", why);
        }
        Ok(())
    });
    Ok(())
}

fn updated(session: &Session) -> Result<(), NotDetermined> {
    let mut schedule = Schedule::start(session, true, 1)?;
    let own = session.environment();
    let (mut found, mut calls) = (false, 0);
    schedule.run(&mut |schedule, Activation { clock, meanwhile, .. }| {
        let mut say = |what: String| {
            if !std::mem::replace(&mut found, true) {
                session.violated(what);
            }
        };
        for heard in &meanwhile.heard {
            if let Heard::Clocks(environment) = heard {
                calls += 1;
                if *environment != own {
                    say(format!("clockUpdate got the environment {environment:#x} instead of {own:#x}"));
                }
            }
        }
        if let Some((act, (status, ..))) = meanwhile.answers.iter().find(|(_, (status, ..))| !status.is_ok()) {
            say(format!("in clockUpdate of {}, {act:?} returned {status}", clock.name));
        }
        for v in on(session, clock) {
            let _ = schedule.instance.get(v)?;
        }
        if session.raw.take_heard().iter().any(|heard| matches!(heard, Heard::Clocks(_))) {
            say("a getter called clockUpdate".into());
        }
        Ok(())
    })?;
    session.note(format!("{calls} calls of clockUpdate"));
    Ok(())
}

fn active_once(session: &Session) -> Result<(), NotDetermined> {
    if clocks(session, false).is_empty() {
        return session.not_applicable("there is no output clock");
    }
    let mut found = false;
    Schedule::start(session, true, 2)?.run(&mut |_, Activation { clock, meanwhile, .. }| {
        let answers = meanwhile.answers.iter().filter(|(act, _)| matches!(act, Inside::Clock(_)));
        let answers: Vec<_> = answers.map(|(act, (status, active, _))| (act, status.is_ok(), *active)).collect();
        for pair in answers.chunks(2) {
            if let [(act, true, _), (_, true, again)] = pair
                && *again != 0.0
                && !std::mem::replace(&mut found, true)
            {
                session.violated(format!("in clockUpdate of {}, the second {act:?} gave {again}", clock.name));
            }
        }
        Ok(())
    })
}
