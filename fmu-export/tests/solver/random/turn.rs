//! One call of one instance with arguments that are right or wrong, and the status that the standard requires.

use super::super::*;
use super::draw::{Choices as _, Draw};
use super::twin::{Snapshot, Twin};
use fmu_core::Elapsed;
use std::fmt::Write;

/// Status of a call, and the one it should have.
pub type Call = (c_int, c_int);

/// The instance of this turn, its random choices and its results.
pub struct Turn<'a, M: Twin> {
    pub fmu: &'a Fmu,
    pub now: &'a mut Snapshot<M>,
    pub draw: &'a mut Draw,
    pub trace: &'a mut String,
}

impl<M: Twin> Turn<'_, M> {
    /// Whether the state is one of these.
    pub fn is(&self, states: &str) -> bool {
        states.contains(self.now.state)
    }

    /// Whether it is Model Exchange in one of these states: `two` for FMI 2.0, `three` for FMI 3.0.
    pub fn in_exchange(&self, two: &str, three: &str) -> bool {
        self.now.kind.exchanges() && self.is(if self.now.kind.version() == 2 { two } else { three })
    }

    /// A number of values, rarely a wrong one.
    pub fn n(&mut self, right: usize) -> usize {
        if self.draw.rarely() { right + 1 } else { right }
    }

    pub fn enter(&mut self) -> Call {
        let start = if self.draw.rarely() { f64::NAN } else { self.draw.of(&[0.0, 1e4]) };
        let fits = self.is("i") && start.is_finite();
        let wanted = if fits { OK } else { ERROR };
        if fits {
            (self.now.start, self.now.end, self.now.settled, self.now.state) = (Some(start), start, start, 'n');
        }
        (self.fmu.enter(start, None), wanted)
    }

    pub fn exit(&mut self) -> Call {
        let wanted = if self.is("n") && self.now.block.model.fits() && self.now.is_storable() { OK } else { ERROR };
        if wanted == OK {
            if self.now.fresh || !self.now.stated {
                self.now.initialize();
            }
            (self.now.running, self.now.old) = (true, false);
            self.now.state = if self.now.kind.handles_events() { 'v' } else { 's' };
            if self.now.kind.handles_events() {
                self.now.begin();
            }
        }
        (self.fmu.exit(), wanted)
    }

    pub fn terminate(&mut self) -> Call {
        let wanted = if self.is("vcs") { OK } else { ERROR };
        self.now.state = 't';
        (self.fmu.terminate(), wanted)
    }

    pub fn reset(&mut self) -> Call {
        *self.now = Snapshot::new(self.now.kind);
        (self.fmu.reset(), OK)
    }

    pub fn event(&mut self) -> Call {
        let may =
            if self.now.kind.exchanges() { self.is("vc") } else { self.now.kind.handles_events() && self.is("s") };
        let wanted = if may { OK } else { ERROR };
        // FMI 3.0 does not allow it in Event Mode; where no time has passed, it does nothing.
        let (again, later) = (self.is("v") && self.now.kind.version() == 3, self.now.end > self.now.settled);
        if may && (!again || later) {
            self.now.begin();
            self.now.state = 'v';
        }
        (self.fmu.event(), wanted)
    }

    pub fn update(&mut self) -> Call {
        let expected = if self.is("v") { self.now.update() } else { Err(ERROR) };
        let (status, update) = self.fmu.try_update();
        let wanted = expected.map_or_else(|status| status, |_| OK);
        if let Ok(expected) = expected {
            assert_eq!(update, expected, "{}", self.trace);
        }
        (status, wanted)
    }

    pub fn leave(&mut self) -> Call {
        let mut done = if self.is("v") { Ok(()) } else { Err(ERROR) };
        if done.is_ok() && self.now.kind.exchanges() {
            while done.is_ok() && (self.now.pending || self.now.fresh) {
                done = self.now.update().map(|_| ());
            }
        }
        let wanted = done.map_or_else(|status| status, |()| OK);
        (self.now.state, self.now.pending) = (if self.now.kind.exchanges() { 'c' } else { 's' }, false);
        (self.fmu.leave(), wanted)
    }

    pub fn set_time(&mut self) -> Call {
        let wrong = self.draw.rarely();
        let t = self.now.end
            + self.draw.of(if wrong {
                &[-1.0, f64::NAN, f64::INFINITY]
            } else {
                &[0.0, 0.005, 0.01, 0.02, 0.003, -0.004, -0.02]
            });
        let fits = t.is_finite() && t >= self.now.settled - 4.0 * f64::EPSILON * self.now.settled.abs();
        let wanted = if self.in_exchange("vc", "vc") && fits { OK } else { ERROR };
        if wanted == OK {
            let start = self.now.start.unwrap();
            self.now.end = t.max(start);
            self.now.elapsed = Elapsed::between(start, self.now.end);
        }
        (self.fmu.set_time(t), wanted)
    }

    pub fn completed(&mut self) -> Call {
        let wanted = if self.in_exchange("c", "c") { OK } else { ERROR };
        (self.fmu.completed(), wanted)
    }

    pub fn step(&mut self) -> Call {
        let wrong = self.draw.rarely();
        let h = self.draw.of(if wrong { &[0.0, -0.01, f64::NAN] } else { &[0.01, 0.003, 0.007, 0.025, 0.073] });
        let t = self.now.end + if self.draw.rarely() { self.draw.of(&[h, 0.005 * h, -h, f64::NAN]) } else { 0.0 };
        let expected = if self.is("s") { self.now.step(t, h) } else { Err(ERROR) };
        let (status, stepped) = self.fmu.step(t, h);
        let wanted = expected.map_or_else(|status| status, |_| OK);
        if let Ok(expected) = expected {
            assert_eq!(stepped, expected, "{}", self.trace);
        }
        (status, wanted)
    }

    pub fn set_states(&mut self) -> Call {
        let nx = M::CAN.states().len();
        let x: Vec<f64> = (0..self.n(nx))
            .map(|_| {
                if self.draw.rarely() {
                    self.draw.of(&[2e6, 1e5, 2e9, f64::NAN])
                } else {
                    self.draw.of(&[0.0, 0.5, -1.0, 1.0, 3.0, -1e-3])
                }
            })
            .collect();
        let rows = M::CAN.rows().unwrap();
        let ranges = rows.iter().map(|&row| M::TABLE.locate(row).unwrap().1.range);
        let wanted = match () {
            () if !self.in_exchange("nvc", "vc") || x.len() != nx => ERROR,
            () if ranges.zip(&x).any(|(range, x)| !range.contains(*x)) => DISCARD,
            () => OK,
        };
        if wanted == OK {
            self.now.show();
        }
        // Outside of Continuous-Time Mode, equal values change nothing.
        if wanted == OK && (self.is("c") || self.now.states() != x) {
            for (state, x) in M::CAN.states().iter().zip(&x) {
                *state.at(&mut self.now.block.model) = *x;
            }
            if self.is("n") {
                (self.now.old, self.now.stated) = (true, true);
            }
        }
        (self.fmu.set_states(&x), wanted)
    }

    pub fn set(&mut self) -> Call {
        let version = self.now.kind.version();
        let references: Vec<u32> = (0..self.draw.below(4))
            .map(
                |_| if self.draw.rarely() { u32::try_from(self.draw.below(30)).unwrap() } else { self.draw.of(M::SET) },
            )
            .filter(|&r| version == 2 || !is_element::<M>(r))
            .collect();
        let sizes = references.iter().map(|&r| extent::<M>(r, version));
        let values: Vec<f64> = (0..sizes.sum())
            .map(|_| {
                if self.draw.rarely() {
                    self.draw.of(&[-1.0, f64::NAN, 1e12, f64::INFINITY])
                } else {
                    self.draw.of(M::VALUES)
                }
            })
            .collect();
        let _ = write!(self.trace, " {references:?} {values:?}");
        let wanted = match () {
            () if !(self.is("invs") || self.now.kind.exchanges() && self.is("c")) => ERROR,
            () if references.is_empty() => OK,
            () => self.now.set(&references, &values),
        };
        (self.fmu.set(&references, &values), wanted)
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
