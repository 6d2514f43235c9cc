//! Event mode and early return of co-simulation (FMI 3.0.2, 4.2.1).

use crate::check::{Check, Levels, Run};
use crate::checks::life::shared::calls::attempt;
use crate::deviation::deviation;
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::state::Life;
use crate::trajectory::steps;
use fmu_import::Status;
use fmu_import::raw::{Arguments, Simple, StepResults};
use model_description::BaseType;

const STEP: &str = "3.0.2, 4.2.1";
const MUST: Levels = Levels(None, Some(Level::Must));
const SHOULD: Levels = Levels(None, Some(Level::Should));

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "N01", clause: STEP, levels: MUST, run: Run::Probe(combinations),
        requirement: "Steps succeed with every combination of eventModeUsed and earlyReturnAllowed; after an early return, the next step \
            starts at lastSuccessfulTime.",
        tried: "Runs with each combination of the two flags, with steps of 1 and 5 communication steps.",
        fix: "Start a step at the time that the importer passes: lastSuccessfulTime after an early return, otherwise the end of the last step." },
    Check { id: "N02", clause: STEP, levels: MUST, run: Run::Probe(permitted),
        requirement: "A step returns early only if early return is allowed, and requests event handling only if event mode is used; Booleans are 0 or 1.",
        tried: "Checks the results of the same runs.", fix: "Return early and request events only if the instantiation allowed it." },
    Check { id: "N03", clause: STEP, levels: MUST, run: Run::Probe(reached),
        requirement: "After an early return lastSuccessfulTime lies between the communication point and the end of the step (should: time advances).",
        tried: "Checks the times of the same runs.", fix: "Write the time that was reached, between t and t + h." },
    Check { id: "N03e", clause: STEP, levels: SHOULD, run: Run::Probe(truly_early),
        requirement: "earlyReturn is true only if the step ended before its end.",
        tried: "Checks earlyReturn of the same runs.", fix: "Set earlyReturn only if lastSuccessfulTime is before t + h." },
    Check { id: "N04", clause: "3.0.2, 2.2.4", levels: SHOULD, run: Run::Probe(without_event_mode),
        requirement: "Without eventModeUsed, EnterEventMode returns Error.",
        tried: "Calls EnterEventMode of an instance without event mode.", fix: "Return Error." },
    Check { id: "N05", clause: "3.0.2, 2.2.4", levels: SHOULD, run: Run::Probe(wrong_mode),
        requirement: "DoStep in Event Mode, and UpdateDiscreteStates and EnterStepMode in Step Mode, return Error.",
        tried: "Makes calls of the other mode.", fix: "Check the mode at the beginning of every function." },
    Check { id: "N06", clause: "3.0.2, 2.3.5", levels: SHOULD, run: Run::Probe(next_event_time),
        requirement: "The next event time of an update is after now, if it is defined.",
        tried: "Checks nextEventTime of the updates.", fix: "Return an absolute time after now." },
    Check { id: "N07", clause: "hardening", levels: Levels(None, Some(Level::Hard)), run: Run::Probe(round_trip),
        requirement: "Entering and leaving Event Mode without an event changes no result.",
        tried: "Enters and leaves Event Mode between steps and compares.", fix: "Leave the state unchanged if there is no event." },
];

/// Ends a probe of an FMU without event mode.
macro_rules! needs_event_mode {
    ($session:ident) => {
        if !$session.flag("hasEventMode") {
            return $session.not_applicable("hasEventMode is false");
        }
        if $session.description.variables.iter().any(|v| v.base == BaseType::Clock) {
            return $session.not_applicable("the FMU has clocks, which the importer would have to serve");
        }
    };
}

const COMBINATIONS: [(bool, bool); 4] = [(false, false), (false, true), (true, false), (true, true)];

/// Steps an instance that uses event mode and early return as its instantiation said.
struct Stepper<'b> {
    instance: Instance<'b>,
    event_mode: bool,
    early: bool,
    /// The next event that an update defined.
    next: Option<f64>,
    over: bool,
}

impl<'b> Stepper<'b> {
    /// An instance in Step Mode.
    fn start(session: &'b Session, (event_mode, early): (bool, bool)) -> Result<Self, NotDetermined> {
        session.prepare(|| {
            let arguments = Arguments { event_mode, early_return: early, ..session.arguments("probe") };
            let instance = session.made(&arguments)?;
            instance.enter()?;
            instance.perform(Simple::ExitInitializationMode)?;
            let mut stepper = Self { instance, event_mode, early, next: None, over: false };
            if event_mode {
                stepper.leave_event_mode()?;
            }
            Ok(stepper)
        })
    }

    fn leave_event_mode(&mut self) -> Result<(), NotDetermined> {
        for _ in 0..100 {
            let (status, updated) = self.instance.update()?;
            self.instance.must("UpdateDiscreteStates", status)?;
            self.over |= updated.terminate == 1;
            self.next = (updated.next_event_time_defined == 1).then_some(updated.next_event_time);
            if updated.again == 0 || self.over {
                break;
            }
        }
        if self.over {
            return Ok(());
        }
        self.instance.perform(Simple::EnterStepMode)
    }

    fn event(&mut self) -> Result<(), NotDetermined> {
        self.instance.perform(Simple::EnterEventMode)?;
        self.leave_event_mode()
    }

    /// A step of `h`, at most to the next event, and the event at its end: its result, and the request.
    fn step(&mut self, whole: f64) -> Result<(Status, StepResults, f64), NotDetermined> {
        let t = self.instance.time.get();
        let variable = self.instance.session.flag("canHandleVariableCommunicationStepSize");
        // A step that ends at the event, which the importer must not pass. Closer than this it is reached.
        let near = 1e-9 * whole + 4.0 * f64::EPSILON * t.abs();
        let inside = |next: &f64| variable && *next > t + near && *next < t + whole;
        let h = self.next.filter(inside).map_or(whole, |next| next - t);
        let call = format!("DoStep(t={t:?}, h={h:?})");
        let (status, stepped) =
            self.instance.call_for(&call, |raw| raw.do_step(self.instance.handle, t, h, false, [true; 4]))?;
        if !status.is_ok() {
            return Ok((status, stepped, t + h));
        }
        self.over |= stepped.terminate == 1;
        // Without an early return, the next communication point is the importer's (FMI 3.0.2, 4.2.1).
        self.instance.time.set(if stepped.early == 1 { stepped.last } else { t + h });
        let reached = self.next.is_some_and(|next| stepped.last >= next - near);
        if self.event_mode && !self.over && (stepped.event == 1 || reached) {
            self.event()?;
        }
        Ok((status, stepped, t + h))
    }
}

/// The fault of a step, from its status, its results, and its requested start and end.
type Rule<'a> = &'a dyn Fn(&Stepper<'_>, Status, StepResults, [f64; 2]) -> Option<String>;

/// Steps of one and of five communication steps, within the default experiment, for each combination of the two flags.
fn each_step(session: &Session, rule: Rule<'_>) -> Result<(), NotDetermined> {
    each_step_of(session, false, rule)
}

/// Like [`each_step`]; with `must_start`, an instantiation that returns NULL is a violation.
fn each_step_of(session: &Session, must_start: bool, rule: Rule<'_>) -> Result<(), NotDetermined> {
    needs_event_mode!(session);
    let stop = session.description.default_experiment.stop.unwrap_or(f64::INFINITY);
    // An FMU with a fixed step may require the step of its default experiment.
    let variable = session.flag("canHandleVariableCommunicationStepSize");
    for flags in COMBINATIONS {
        for multiple in if variable { &[1.0, 5.0][..] } else { &[1.0] } {
            session.case(|| {
                let h = multiple * session.h();
                let mut stepper = match Stepper::start(session, flags) {
                    Err(NotDetermined(why)) if why.ends_with(" returned NULL") => {
                        if must_start {
                            session
                                .violated(format!("eventModeUsed={}, earlyReturnAllowed={}: {why}", flags.0, flags.1));
                        }
                        return Ok(());
                    }
                    stepper => stepper?,
                };
                for _ in 0..200 {
                    let t = stepper.instance.time.get();
                    if stepper.over || t + h > stop * (1.0 + 1e-9) || session.half_time_used() {
                        break;
                    }
                    let (status, stepped, end) = stepper.step(h)?;
                    if let Some(text) = rule(&stepper, status, stepped, [t, end]) {
                        session.violated(format!(
                            "eventModeUsed={}, earlyReturnAllowed={}: DoStep(t={t:?}, h={:?}) {text}",
                            flags.0,
                            flags.1,
                            end - t
                        ));
                        break;
                    }
                    if !status.is_ok() {
                        break;
                    }
                }
                Ok(())
            });
        }
    }
    Ok(())
}

fn combinations(session: &Session) -> Result<(), NotDetermined> {
    each_step_of(session, true, &|_, status, _, _| (!status.is_ok()).then(|| format!("returned {status}")))
}

fn permitted(session: &Session) -> Result<(), NotDetermined> {
    each_step(session, &|stepper, status, stepped, _| {
        let flags = [stepped.event, stepped.terminate, stepped.early];
        if !status.is_ok() {
            None
        } else if flags.iter().any(|f| *f > 1) {
            Some(format!("gave {stepped}: a Boolean is not 0 or 1, or was not written"))
        } else if stepped.early == 1 && !stepper.early {
            Some("returned early, which was not allowed".into())
        } else if stepped.event == 1 && !stepper.event_mode {
            Some("asked for event handling, but event mode is not used".into())
        } else {
            None
        }
    })
}

fn reached(session: &Session) -> Result<(), NotDetermined> {
    let standing = std::cell::Cell::new(0);
    each_step(session, &|_, status, stepped, [t, end]| {
        if !status.is_ok() {
            return None;
        }
        // Without an early return, an internal solver may end a little elsewhere.
        let early = stepped.early == 1;
        standing.set(if stepped.last <= t { standing.get() + 1 } else { 0 });
        let good = stepped.last.is_finite() && stepped.last >= t && (!early || stepped.last <= end + 1e-9 * (end - t));
        let text = format!("gave {stepped}");
        // An early return may leave the time unchanged, but not repeatedly.
        if good && standing.get() == 20 {
            session.lesser(Level::Should, format!("DoStep(t={t:?}), the 20th in succession, {text}"));
        }
        (!good).then_some(text)
    })
}

fn truly_early(session: &Session) -> Result<(), NotDetermined> {
    each_step(session, &|_, status, stepped, [_, end]| {
        let whole = status.is_ok() && stepped.early == 1 && stepped.last >= end;
        whole.then(|| format!("gave earlyReturn=1, lastSuccessfulTime={:?}, the end of the step", stepped.last))
    })
}

fn without_event_mode(session: &Session) -> Result<(), NotDetermined> {
    needs_event_mode!(session);
    let stepper = Stepper::start(session, (false, false))?;
    let status = stepper.instance.simple(Simple::EnterEventMode)?;
    session.require(status == Status::ERROR, || format!("EnterEventMode returned {status}"));
    Ok(())
}

fn wrong_mode(session: &Session) -> Result<(), NotDetermined> {
    needs_event_mode!(session);
    attempt(session, Life::EventMode, '-');
    Ok(())
}

fn next_event_time(session: &Session) -> Result<(), NotDetermined> {
    each_step(session, &|stepper, _, _, _| {
        let t = stepper.instance.time.get();
        let bad = stepper.next.filter(|next| stepper.event_mode && !stepper.over && *next <= t - 1e-9 * t.abs());
        bad.map(|next| format!("reached {t:?}, and the next event time is {next:?}"))
    })
}

fn round_trip(session: &Session) -> Result<(), NotDetermined> {
    needs_event_mode!(session);
    let outputs: Vec<_> = session.watched().into_iter().filter(|v| v.base == BaseType::Float64).collect();
    let run = |visits: bool| -> Result<Vec<Vec<f64>>, NotDetermined> {
        let mut stepper = Stepper::start(session, (true, false))?;
        let mut rows = Vec::new();
        for _ in 0..30 {
            if stepper.over {
                break;
            }
            let (status, stepped, _) = stepper.step(session.h())?;
            stepper.instance.must("DoStep", status)?;
            let due = stepper.next.is_some_and(|next| next <= stepped.last + 1e-6 * session.h());
            if visits && stepped.event == 0 && !due && !stepper.over {
                stepper.event()?;
            }
            let values = stepper.instance.snapshot(&outputs)?;
            rows.push(values.into_iter().flatten().map(f64::from_bits).collect());
        }
        Ok(rows)
    };
    if let Some(found) = deviation(&run(false)?, &run(true)?) {
        let text = found.text(&session.names_of(&outputs));
        session.violated(format!("with visits of Event Mode, after {} {text}", steps(found.step)));
    }
    Ok(())
}
