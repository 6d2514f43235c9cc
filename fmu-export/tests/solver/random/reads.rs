//! Calls that read, and change nothing.

use super::super::*;
use super::bits;
use super::turn::{Call, Turn, extent, is_element};
use super::twin::Twin;
use crate::solver::draw::Choices;
use std::fmt::Write;

impl<M: Twin> Turn<'_, M> {
    pub fn get(&mut self) -> Call {
        let references: Vec<u32> =
            (0..self.draw.below(4))
                .map(|_| {
                    if self.draw.rarely() {
                        u32::try_from(self.draw.below(30)).unwrap()
                    } else {
                        self.draw.of(M::REALS)
                    }
                })
                .collect();
        let _ = write!(self.trace, " {references:?}");
        let version = self.now.kind.version();
        let may = version == 3 || self.is("nvcste");
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
        let status = self.fmu.try_get(&references, &mut values);
        if verdict == OK && status == OK {
            assert_eq!(bits(&values), bits(&expected), "{}", self.trace);
        }
        (status, verdict)
    }

    /// The `name` selects states, derivatives, indicators or nominals.
    pub fn values(&mut self, name: &str) -> Call {
        let right = if name == "indicators" { M::CAN.indicators().len() } else { M::CAN.states().len() };
        let n = self.n(right);
        let mut values = vec![f64::NAN; n];
        let may =
            if name == "nominals" { self.in_exchange("invcte", "nvct") } else { self.in_exchange("nvcte", "nvct") };
        let mut expected = Err(ERROR);
        if may && n == right {
            if self.is("n") && name != "nominals" {
                self.now.show();
            }
            expected = match name {
                "states" => Ok(self.now.states()),
                "derivatives" => self.now.derivatives(),
                "indicators" => Ok(self.now.indicators()),
                _ => Ok(M::CAN
                    .rows()
                    .unwrap()
                    .iter()
                    .map(|&r| M::TABLE.locate(r).unwrap().1.nominal.unwrap_or(1.0))
                    .collect()),
            };
        }
        let status = match name {
            "states" => self.fmu.try_states(&mut values),
            "derivatives" => self.fmu.try_derivatives(&mut values),
            "indicators" => self.fmu.try_indicators(&mut values),
            _ => self.fmu.try_nominals(&mut values),
        };
        let wanted = match &expected {
            Ok(_) => OK,
            Err(status) => *status,
        };
        if let Ok(expected) = expected {
            assert_eq!(bits(&values), bits(&expected), "{}", self.trace);
        }
        (status, wanted)
    }

    pub fn directional(&mut self) -> Call {
        let nx = M::CAN.states().len();
        let last = u32::try_from(M::TABLE.len() + nx).unwrap();
        let (unknown, known) = (if nx > 0 { last } else { 1 }, M::SET[0]);
        let seed = [self.draw.of(&[1.0, -2.0, 0.0, f64::NAN])];
        let named = self.draw.of(&[1, 1, 2]);
        let (unknowns, knowns) = ([unknown; 1], [known; 2]);
        let states = if self.now.kind.version() == 2 { "nvcste" } else { "nvcst" };
        let may = self.is(states) && nx > 0 && named == 1 && seed[0].is_finite();
        let mut out = [f64::NAN];
        if may {
            self.now.show();
        }
        let full = [seed[0]; 2];
        let status = self.fmu.directional(&unknowns, &knowns[..named], &full[..named], &mut out);
        // Derivatives that do not exist here are discarded; those near the edge may be either.
        let exist = may && self.now.derivatives().is_ok();
        let wanted = match () {
            () if !may => ERROR,
            () if exist && seed[0] != 0.0 => OK,
            () => status,
        };
        assert!(status != ERROR || !may, "{}", self.trace);
        (status, wanted)
    }
}
