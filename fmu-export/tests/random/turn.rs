//! One call of one instance with arguments that are right or wrong, and the status that the standard requires.

use super::twin::{Snapshot, Twin};
use super::{DISCARD, ERROR, OK};
use crate::oracle::{State, Statuses, Turn, verdict};
use State::{Continuous, Event, Initialization, Instantiated, Terminated};
use fmu_core::Elapsed;

/// The turn of an instance, and its expected state.
pub struct Attempt<'a, 'b, M: Twin> {
    pub now: &'a mut Snapshot<M>,
    pub turn: &'a mut Turn<'b, Snapshot<M>>,
}

impl<M: Twin> Attempt<'_, '_, M> {
    /// Whether the state is one of these.
    pub fn is(&self, states: &[State]) -> bool {
        self.now.is(states)
    }

    /// Whether it is Model Exchange in one of these states: `two` for FMI 2.0, `three` for FMI 3.0.
    pub fn in_exchange(&self, two: &[State], three: &[State]) -> bool {
        self.now.kind.exchanges() && self.is(if self.now.kind.version() == 2 { two } else { three })
    }

    pub fn enter(&mut self) -> Statuses {
        let start = self.turn.mostly(&[0.0, 1e4], &[f64::NAN]);
        let fits = self.is(&[Instantiated]) && start.is_finite();
        let wanted = verdict(fits);
        if fits {
            (self.now.start, self.now.end, self.now.settled, self.now.state) =
                (Some(start), start, start, Initialization);
        }
        [self.turn.importer.enter(start, None), wanted]
    }

    pub fn exit(&mut self) -> Statuses {
        let wanted = verdict(self.is(&[Initialization]) && self.now.block.model.fits() && self.now.is_storable());
        if wanted == OK {
            if self.now.fresh || !self.now.stated {
                self.now.initialize();
            }
            (self.now.running, self.now.old) = (true, false);
            self.now.state = if self.now.kind.handles_events() { Event } else { State::Step };
            if self.now.kind.handles_events() {
                self.now.begin();
            }
        }
        [self.turn.importer.exit(), wanted]
    }

    pub fn terminate(&mut self) -> Statuses {
        let wanted = verdict(self.is(&[Event, Continuous, State::Step]));
        self.now.state = Terminated;
        [self.turn.importer.terminate(), wanted]
    }

    pub fn reset(&mut self) -> Statuses {
        *self.now = Snapshot::new(self.now.kind);
        [self.turn.importer.reset(), OK]
    }

    pub fn event(&mut self) -> Statuses {
        let may = if self.now.kind.exchanges() {
            self.is(&[Event, Continuous])
        } else {
            self.now.kind.handles_events() && self.is(&[State::Step])
        };
        let wanted = verdict(may);
        // FMI 3.0 does not allow it in Event Mode; if no time has passed, it has no effect.
        let (again, later) = (self.is(&[Event]) && self.now.kind.version() == 3, self.now.end > self.now.settled);
        if may && (!again || later) {
            self.now.begin();
            self.now.state = Event;
        }
        [self.turn.importer.event(), wanted]
    }

    pub fn update(&mut self) -> Statuses {
        let expected = if self.is(&[Event]) { self.now.update() } else { Err(ERROR) };
        let (status, update) = self.turn.importer.try_update();
        let wanted = expected.map_or_else(|status| status, |_| OK);
        if let Ok(expected) = expected {
            assert_eq!(update, expected, "{}", self.turn.trace);
        }
        [status, wanted]
    }

    pub fn leave(&mut self) -> Statuses {
        let mut done = if self.is(&[Event]) { Ok(()) } else { Err(ERROR) };
        if done.is_ok() && self.now.kind.exchanges() {
            while done.is_ok() && (self.now.pending || self.now.fresh) {
                done = self.now.update().map(|_| ());
            }
        }
        let wanted = done.map_or_else(|status| status, |()| OK);
        (self.now.state, self.now.pending) = (if self.now.kind.exchanges() { Continuous } else { State::Step }, false);
        [self.turn.importer.leave(), wanted]
    }

    pub fn set_time(&mut self) -> Statuses {
        let wrong = self.turn.rarely();
        let t = self.now.end
            + self.turn.draw.of(if wrong {
                &[-1.0, f64::NAN, f64::INFINITY]
            } else {
                &[0.0, 0.005, 0.01, 0.02, 0.003, -0.004, -0.02]
            });
        let fits = t.is_finite() && t >= self.now.settled - 4.0 * f64::EPSILON * self.now.settled.abs();
        let wanted = verdict(self.in_exchange(&[Event, Continuous], &[Event, Continuous]) && fits);
        if wanted == OK {
            let start = self.now.start.unwrap();
            self.now.end = t.max(start);
            self.now.elapsed = Elapsed::between(start, self.now.end);
        }
        [self.turn.importer.set_time(t), wanted]
    }

    pub fn completed(&mut self) -> Statuses {
        let wanted = verdict(self.in_exchange(&[Continuous], &[Continuous]));
        [self.turn.importer.completed(), wanted]
    }

    pub fn step(&mut self) -> Statuses {
        let wrong = self.turn.rarely();
        let h = self.turn.draw.of(if wrong { &[0.0, -0.01, f64::NAN] } else { &[0.01, 0.003, 0.007, 0.025, 0.073] });
        let t = self.now.end + if self.turn.rarely() { self.turn.draw.of(&[h, 0.005 * h, -h, f64::NAN]) } else { 0.0 };
        let expected = if self.is(&[State::Step]) { self.now.step(t, h) } else { Err(ERROR) };
        let (status, stepped) = self.turn.importer.step(t, h);
        let wanted = expected.map_or_else(|status| status, |_| OK);
        if let Ok(expected) = expected {
            assert_eq!(stepped, expected, "{}", self.turn.trace);
        }
        [status, wanted]
    }

    pub fn set_states(&mut self) -> Statuses {
        let nx = M::CAN.states().len();
        let x: Vec<f64> = (0..self.turn.count(nx))
            .map(|_| {
                if self.turn.rarely() {
                    self.turn.draw.of(&[2e6, 1e5, 2e9, f64::NAN])
                } else {
                    self.turn.draw.of(&[0.0, 0.5, -1.0, 1.0, 3.0, -1e-3])
                }
            })
            .collect();
        let rows = M::CAN.rows().unwrap();
        let ranges = rows.iter().map(|&row| M::TABLE.locate(row).unwrap().1.range);
        let wanted = match () {
            () if !self.in_exchange(&[Initialization, Event, Continuous], &[Event, Continuous]) || x.len() != nx => {
                ERROR
            }
            () if ranges.zip(&x).any(|(range, x)| !range.contains(*x)) => DISCARD,
            () => OK,
        };
        if wanted == OK {
            self.now.show();
        }
        // Outside Continuous-Time Mode, equal values have no effect.
        if wanted == OK && (self.is(&[Continuous]) || self.now.states() != x) {
            for (state, x) in M::CAN.states().iter().zip(&x) {
                *state.at(&mut self.now.block.model) = *x;
            }
            if self.is(&[Initialization]) {
                (self.now.old, self.now.stated) = (true, true);
            }
        }
        [self.turn.importer.set_states(&x), wanted]
    }

    pub fn set(&mut self) -> Statuses {
        let version = self.now.kind.version();
        let references: Vec<u32> = (0..self.turn.draw.below(4))
            .map(|_| {
                if self.turn.rarely() {
                    u32::try_from(self.turn.draw.below(30)).unwrap()
                } else {
                    self.turn.draw.of(M::SET)
                }
            })
            .filter(|&r| version == 2 || !is_element::<M>(r))
            .collect();
        let sizes = references.iter().map(|&r| extent::<M>(r, version));
        let values: Vec<f64> = (0..sizes.sum())
            .map(|_| {
                if self.turn.rarely() {
                    self.turn.draw.of(&[-1.0, f64::NAN, 1e12, f64::INFINITY])
                } else {
                    self.turn.draw.of(M::VALUES)
                }
            })
            .collect();
        self.turn.note((&references, &values));
        let wanted = match () {
            () if !(self.is(&[Instantiated, Initialization, Event, State::Step])
                || self.now.kind.exchanges() && self.is(&[Continuous])) =>
            {
                ERROR
            }
            () if references.is_empty() => OK,
            () => self.now.set(&references, &values),
        };
        [self.turn.importer.set(&references, &values), wanted]
    }
}

/// Whether `reference` is that of an array element other than the first; FMI 3.0 has no such references.
pub fn is_element<M: Twin>(reference: u32) -> bool {
    let index = usize::try_from(reference).unwrap().checked_sub(1);
    index.and_then(|i| M::TABLE.element(i)).is_some_and(|element| element > 0)
}

/// Number of values that a `reference` has.
pub fn extent<M: Twin>(reference: u32, version: u8) -> usize {
    let index = usize::try_from(reference).unwrap().checked_sub(1);
    let of = index.and_then(|i| M::TABLE.locate(i)).and_then(|(_, meta, _)| meta.dimension);
    of.filter(|_| version == 3).unwrap_or(1)
}
