//! State of the switched inverter: the carrier and the legs.

use super::bridge::{Command, DIRECTIONS, Leg};
use super::carrier::Carrier;
use crate::inverter::{Gates, Inverter};
use drive_base::frame::AlphaBeta;
use fmu_core::Elapsed;
use serde::{Deserialize, Serialize};

/// What commands the legs during a communication step.
#[derive(Clone, Copy)]
pub(super) enum Signals {
    /// The carrier, or the inputs that turn the gates off or short-circuit the machine.
    Inputs(Gates),
    /// A timer outside the model, whose commands last for the step. It leaves the dead time itself.
    Given([Command; 3]),
}

/// State of carrier and legs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bridge {
    pub(super) carrier: Carrier,
    pub(super) legs: [Leg; 3],
    /// The current of a leg flows from or to the upper rail.
    upper: [bool; 3],
    /// Model Exchange, since the last event: the sign of each current, where a voltage depends on it; 0: the leg blocks.
    pub(super) sides: Option<[i8; 3]>,
    /// Model Exchange: the time of the last event, and of the next change of a leg within this half of the carrier period.
    pub(super) reached: Elapsed,
    pub(super) next: Option<Elapsed>,
}

impl Bridge {
    /// Commands the legs whose command is due, at the time `at` (s) since the carrier's last extreme; `due` has the times (s) until
    /// the command of each leg is due. Returns the time (s) until a leg changes its state.
    #[inline]
    pub(super) fn command(&mut self, inverter: &Inverter, signals: Signals, at: f64, due: &mut [f64; 3]) -> f64 {
        let mut next = f64::INFINITY;
        for (x, due) in due.iter_mut().enumerate() {
            if *due <= 0.0 {
                let (command, left) = match signals {
                    Signals::Inputs(Gates::Switch) => {
                        let (on, left) = self.carrier.command(x, at, 0.5 * inverter.T_pwm);
                        (if on { Command::Upper } else { Command::Lower }, left)
                    }
                    Signals::Inputs(Gates::Short) => (Command::Lower, f64::INFINITY),
                    Signals::Inputs(Gates::Off) => (Command::Off, f64::INFINITY),
                    Signals::Given(commands) => {
                        // Then it is no new command.
                        self.legs[x].command_at_once(commands[x]);
                        (commands[x], f64::INFINITY)
                    }
                };
                self.legs[x].command(command, inverter.dead_time);
                *due = left;
            }
            let wait = self.legs[x].wait;
            let first = if wait > 0.0 && wait < *due { wait } else { *due };
            next = if first < next { first } else { next };
        }
        next
    }

    /// The sum of the currents' magnitudes (A) that change their rail, with the current `i` (A), where they flow from or to these
    /// `rails`: upper, lower, or none.
    #[inline]
    pub(super) fn commutated(&mut self, rails: [Option<bool>; 3], i: AlphaBeta) -> f64 {
        let mut sum = 0.0;
        for (x, n) in DIRECTIONS.into_iter().enumerate() {
            if let Some(upper) = rails[x]
                && std::mem::replace(&mut self.upper[x], upper) != upper
            {
                sum += n.dot(i).abs();
            }
        }
        sum
    }

    /// Passes `t` (s).
    #[inline]
    pub(super) fn pass(&mut self, t: f64, same: f64, due: &mut [f64; 3]) {
        let after = |time: f64| if time - t > same { time - t } else { 0.0 };
        for (leg, due) in self.legs.iter_mut().zip(due) {
            (leg.wait, *due) = (after(leg.wait), after(*due));
        }
    }
}
