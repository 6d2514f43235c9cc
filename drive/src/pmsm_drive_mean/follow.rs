//! What `PmsmDriveMean` follows: the references, standstill or no torque, and the limits of torque and speed beside those of the
//! drive. As in the controller's [`modes`](drive_control::modes).

use super::{PmsmDriveMean, State};
use crate::lag::integrates;
use crate::steady::{At, Condition, Point, within};
use drive_base::math::{at_least, at_most};
use drive_control::modes::{Follows, ModeInputs};

impl PmsmDriveMean {
    /// Whether a torque is followed, not a speed.
    pub(super) fn torque_mode(&self) -> bool {
        match self.follows {
            Follows::Reference => self.drive.controller.speed_loop.torque_mode,
            Follows::Brake => false,
            Follows::Coast => true,
        }
    }

    /// The drive under this condition.
    pub(super) fn under(&self, condition: &Condition) -> At<'_> {
        let frees = self.follows == Follows::Coast || self.drive.controller.modes.frees(self.follows);
        self.drive.at(condition).freed(frees)
    }

    /// The torque reference in N.m.
    pub(super) fn tau_ref(&self) -> f64 {
        if self.follows == Follows::Reference { self.inputs.tau_ref } else { 0.0 }
    }

    /// The speed reference (rad/s) and the maximum rate (rad/s2) at which it is approached; 0: no ramp.
    pub(super) fn speed_ref(&self) -> (f64, f64) {
        match self.follows {
            Follows::Brake => (0.0, 0.0),
            _ => (self.inputs.speed_ref, self.drive.controller.speed_loop.ramp),
        }
    }

    /// The speed reference (rad/s) after `h` (s) from `start` (rad/s).
    pub(super) fn ramped(&self, start: f64, h: f64) -> f64 {
        let (speed_ref, ramp) = self.speed_ref();
        if ramp > 0.0 { self.drive.controller.speed_loop.ramped(start, speed_ref, h) } else { speed_ref }
    }

    /// The limits (N.m) of a point in this state, narrowed by inputs and brake.
    pub(super) fn narrowed(&self, state: &State, point: &Point) -> [f64; 2] {
        let (modes, inputs) = (&self.drive.controller.modes, &self.inputs.modes);
        let [low, high] = point.limits;
        if !(modes.tau_used || inputs.brake) {
            return [low, high];
        }
        let mut inputs = *inputs;
        if self.at_shaft() && modes.tau_used && self.gates() {
            let [low, high] = self.at(state, point).references_for([inputs.tau_min, inputs.tau_max]);
            inputs = ModeInputs { tau_min: low, tau_max: high, ..inputs };
        }
        let [least, most] = modes.torques(&inputs);
        [at_least(low, least), at_most(high, most)]
    }

    /// In torque mode, the torque (N.m) for the `wanted` one (N.m) within these limits (N.m) and the range of the speed at the mechanical
    /// `speed` (rad/s), the rate (A/s) of the integral part, and whether a bound of the speed acts.
    pub(super) fn in_range(&self, state: &State, speed: f64, wanted: f64, limits: [f64; 2]) -> (f64, f64, bool) {
        let controller = &self.drive.controller;
        let (range, (gains, k)) = (&controller.modes.speed, self.drive.settled().speed_loop());
        if !range.used {
            return (wanted, 0.0, false);
        }
        let [lower, upper] = range.bounds(gains, state.integral, speed).map(|i| k * i);
        let wanted = within(wanted, limits);
        let bound = if wanted > upper {
            (upper, range.max - speed)
        } else if wanted < lower {
            (lower, range.min - speed)
        } else {
            return (wanted, -controller.speed_loop.bandwidth * state.integral, false);
        };
        let ((tau, error), highest) = (bound, limits[1].max(-limits[0]));
        let cut = tau - within(tau, limits);
        (tau, integrates(cut, error, highest) * gains.slopes()[1] * error, cut == 0.0)
    }

    /// After a change of what is followed, or once the gates switch: both loops begin at the present speed and torque, as those of
    /// `PmsmDrive` with `start.catch`.
    pub(super) fn follow(&mut self) {
        let (follows, gates) = (self.inputs.modes.follows(), self.gates());
        let before = (std::mem::replace(&mut self.follows, follows), std::mem::replace(&mut self.gates_on, gates));
        if before.0 == follows && (before.1 || !gates) {
            return;
        }
        let speed = self.speed(&self.state);
        (self.state.integral, self.known) = (0.0, false);
        if follows == Follows::Reference && !self.drive.controller.speed_loop.torque_mode {
            let w_ref = self.ramped(speed, self.drive.controller.T_s);
            let (gains, k) = self.drive.settled().speed_loop();
            let integral = self.state.tau / k - gains.wanted(0.0, w_ref, speed);
            (self.state.speed_ref, self.state.integral) = (speed, integral);
        }
    }
}
