//! Calls that read, and change nothing.

use super::turn::{Attempt, extent, is_element};
use super::twin::Twin;
use super::{ERROR, OK};
use crate::oracle::{Call, State, Statuses, bits};
use State::{Continuous, Event, Initialization, Instantiated, Terminated};

impl<M: Twin> Attempt<'_, '_, M> {
    pub fn get(&mut self) -> Statuses {
        let references: Vec<u32> = (0..self.turn.draw.below(4))
            .map(|_| {
                if self.turn.rarely() {
                    u32::try_from(self.turn.draw.below(30)).unwrap()
                } else {
                    self.turn.draw.of(M::REALS)
                }
            })
            .collect();
        self.turn.note(&references);
        let version = self.now.kind.version();
        let may = version == 3 || self.is(&[Initialization, Event, Continuous, State::Step, Terminated, State::Error]);
        let mut expected = Vec::new();
        let mut verdict = if may { OK } else { ERROR };
        if may {
            // The number of values is checked first, then the values.
            if version == 3 && references.iter().any(|&r| is_element::<M>(r)) {
                verdict = ERROR;
            } else {
                self.now.show();
            }
        }
        for &reference in &references {
            match if verdict == OK { self.now.reals(reference) } else { break } {
                Ok(values) => expected.extend(values),
                Err(status) => verdict = status,
            }
        }
        let mut values = vec![f64::NAN; references.iter().map(|&r| extent::<M>(r, version)).sum()];
        let status = self.turn.importer.try_get(&references, &mut values);
        if verdict == OK && status == OK {
            assert_eq!(bits(&values), bits(&expected), "{}", self.turn.trace);
        }
        [status, verdict]
    }

    /// States, derivatives, indicators or nominal values.
    pub fn values(&mut self, call: Call) -> Statuses {
        let right = if call == Call::Indicators { M::CAN.indicators().len() } else { M::CAN.states().len() };
        let n = self.turn.count(right);
        let mut values = vec![f64::NAN; n];
        let may = if call == Call::Nominals {
            self.in_exchange(
                &[Instantiated, Initialization, Event, Continuous, Terminated, State::Error],
                &[Initialization, Event, Continuous, Terminated],
            )
        } else {
            self.in_exchange(
                &[Initialization, Event, Continuous, Terminated, State::Error],
                &[Initialization, Event, Continuous, Terminated],
            )
        };
        let mut expected = Err(ERROR);
        if may && n == right {
            if self.is(&[Initialization]) && call != Call::Nominals {
                self.now.show();
            }
            expected = match call {
                Call::GetStates => Ok(self.now.states()),
                Call::Derivatives => self.now.derivatives(),
                Call::Indicators => Ok(self.now.indicators()),
                _ => Ok(M::CAN
                    .rows()
                    .unwrap()
                    .iter()
                    .map(|&r| M::TABLE.locate(r).unwrap().1.nominal.unwrap_or(1.0))
                    .collect()),
            };
        }
        let status = match call {
            Call::GetStates => self.turn.importer.try_states(&mut values),
            Call::Derivatives => self.turn.importer.try_derivatives(&mut values),
            Call::Indicators => self.turn.importer.try_indicators(&mut values),
            _ => self.turn.importer.try_nominals(&mut values),
        };
        let wanted = match &expected {
            Ok(_) => OK,
            Err(status) => *status,
        };
        if let Ok(expected) = expected {
            assert_eq!(bits(&values), bits(&expected), "{}", self.turn.trace);
        }
        [status, wanted]
    }

    pub fn directional(&mut self) -> Statuses {
        let nx = M::CAN.states().len();
        let last = u32::try_from(M::TABLE.len() + nx).unwrap();
        let (unknown, known) = (if nx > 0 { last } else { 1 }, M::SET[0]);
        let seed = [self.turn.draw.of(&[1.0, -2.0, 0.0, f64::NAN])];
        let named = self.turn.draw.of(&[1, 1, 2]);
        let (unknowns, knowns) = ([unknown; 1], [known; 2]);
        let saved: &[State] = &[Initialization, Event, Continuous, State::Step, Terminated];
        let late = self.now.kind.version() == 2 && self.is(&[State::Error]);
        let may = (self.is(saved) || late) && nx > 0 && named == 1 && seed[0].is_finite();
        let mut out = [f64::NAN];
        if may {
            self.now.show();
        }
        let full = [seed[0]; 2];
        let status = self.turn.importer.directional(&unknowns, &knowns[..named], &full[..named], &mut out);
        // Derivatives that do not exist here are discarded; those near the edge may be either.
        let exist = may && self.now.derivatives().is_ok();
        let wanted = match () {
            () if !may => ERROR,
            () if exist && seed[0] != 0.0 => OK,
            () => status,
        };
        assert!(status != ERROR || !may, "{}", self.turn.trace);
        [status, wanted]
    }
}
