//! Torque, shaft and overload over time: the rates of the states, and a step of any length.
//!
//! In torque mode on an imposed shaft, x is exactly an exponential over the whole step, and so is the overload. Otherwise the
//! step is divided into equal parts, short against the lag of the torque, the speed loop and the drag, and the states advance by
//! Heun's method. The power from the link is the sum of the losses, the power to the load and the change of the kinetic energy,
//! so that the energies balance at any step; with the gates off, the losses are what the shaft loses.

use super::map::SLOW;
use super::state::{MappedDrive, State};
use crate::lag::{integrates, lagging};
use crate::steady::within;
use drive_base::math::exp;
use drive_control::speed::SpeedGains;
use drive_plant::power::Energy;
use fmu_core::Fault;

/// Maximum length of a part relative to the shortest time constant, and maximum number of parts of a step.
const PART: f64 = 0.2;
const MAX_PARTS: f64 = 1e6;

/// Range of the overload below 1 over which the torque falls from the peak to the continuous one.
const FADE: f64 = 0.05;

/// Maximum ratio of the torque to the continuous torque that heats: where there is no continuous torque, any torque overloads.
const HOT: f64 = 10.0;

/// The drive at an instant.
pub(super) struct Point {
    /// Limits of the torque in N.m.
    pub(super) limits: [f64; 2],
    /// Torque at the shaft in N.m, with the gates off the drag torque.
    pub(super) tau: f64,
    /// Losses in W.
    pub(super) p_loss: f64,
    /// Square of the torque relative to the continuous torque.
    heats: f64,
}

/// Rates of the states.
pub(super) struct Rates {
    pub(super) tau: f64,
    pub(super) integral: f64,
    pub(super) speed: f64,
    pub(super) overload: f64,
    pub(super) point: Point,
}

/// Result of a step.
pub(super) struct Passed {
    pub(super) state: State,
    /// Energies in J of the step.
    pub(super) energy: Energy,
}

impl MappedDrive {
    /// The drive in this state.
    pub(super) fn point(&self, state: &State) -> Point {
        let speed = self.speed(state);
        if !self.is_active() {
            let drag = self.map.drag(speed);
            return Point { limits: [0.0; 2], tau: -drag, p_loss: drag * speed, heats: 0.0 };
        }
        let at = self.map.at(speed.abs(), self.inputs.u_dc);
        let share = if self.map.t_overload > 0.0 { ((1.0 - state.overload) / FADE).clamp(0.0, 1.0) } else { 1.0 };
        let [motor, generator] = at.peak.map(|peak| {
            let least = at.continuous.min(peak);
            least + (peak - least) * share
        });
        let back = speed < 0.0;
        let limits = if back { [-motor, generator] } else { [-generator, motor] };
        let heats = if self.map.t_overload > 0.0 && state.tau != 0.0 {
            let ratio = (state.tau / at.continuous.max(1e-9)).clamp(-HOT, HOT);
            ratio * ratio
        } else {
            0.0
        };
        let forward = if back { -state.tau } else { state.tau };
        Point { limits, tau: state.tau, p_loss: at.loss(forward), heats }
    }

    /// The gains of the speed loop, for the torque.
    fn gains(&self) -> SpeedGains {
        SpeedGains::new(&self.speed_loop, self.shaft.J, 1.0)
    }

    /// When the drive starts to operate, its speed loop begins at the present speed and torque, as in
    /// [`PmsmDriveMean`](crate::PmsmDriveMean).
    pub(super) fn take_up(&mut self) {
        let active = self.is_active();
        let before = std::mem::replace(&mut self.active, active);
        if active && !before && !self.speed_loop.torque_mode {
            let speed = self.speed(&self.state);
            let w_ref = if self.speed_loop.ramp > 0.0 { speed } else { self.inputs.speed_ref };
            let integral = self.state.tau - self.gains().wanted(0.0, w_ref, speed);
            (self.state.speed_ref, self.state.integral) = (speed, integral);
        }
    }

    /// The rates in this state.
    pub(super) fn rates(&self, state: &State) -> Rates {
        let (speed, point) = (self.speed(state), self.point(state));
        let to_load = if self.shaft.imposed { 0.0 } else { (point.tau - self.inputs.tau_load) / self.shaft.J };
        let overload =
            if self.map.t_overload > 0.0 { (point.heats - state.overload) / self.map.t_overload } else { 0.0 };
        if !self.is_active() {
            let (tau, integral) = (-self.bandwidth * state.tau, -self.bandwidth * state.integral);
            return Rates { tau, integral, speed: to_load, overload, point };
        }
        let limits = point.limits;
        let (wanted, integral) = if self.speed_loop.torque_mode {
            (self.inputs.tau_ref, 0.0)
        } else {
            let gains = self.gains();
            let error = state.speed_ref - speed;
            let wanted = gains.wanted(state.integral, state.speed_ref, speed);
            let cut = wanted - within(wanted, limits);
            let share = integrates(cut, error, limits[1].max(-limits[0]));
            (wanted, share * gains.slopes()[1] * error)
        };
        let tau = self.bandwidth * (within(wanted, limits) - state.tau);
        Rates { tau, integral, speed: to_load, overload, point }
    }

    /// A step of `h` (s).
    pub(super) fn pass(&self, h: f64) -> Result<Passed, Fault> {
        if self.shaft.imposed && (self.speed_loop.torque_mode || !self.is_active()) {
            return Ok(self.pass_imposed(h));
        }
        let drag = self.map.drag(SLOW) / (SLOW * self.shaft.J);
        let rate =
            if self.is_active() { self.bandwidth.max(self.speed_loop.bandwidth) } else { self.bandwidth.max(drag) };
        // Importers round their step: the same number of parts.
        let parts = (h * rate / PART * (1.0 - 1e-9)).ceil().max(1.0);
        if parts > MAX_PARTS {
            return Err(Fault::new(format!("a step of {h} s takes more than {MAX_PARTS:e} parts; shorten it")));
        }
        let part = h / parts;
        let (mut state, mut energy) = (self.state, Energy::default());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 1e6")]
        for _ in 0..parts as u32 {
            let (next, added) = self.part(&state, part);
            energy.add(&added);
            state = next;
        }
        if self.shaft.imposed {
            state = self.on_the_shaft(state, h);
        }
        Ok(Passed { state, energy })
    }

    /// `state` after a step of `h` (s) with the imposed shaft.
    fn on_the_shaft(&self, state: State, h: f64) -> State {
        let speed = self.inputs.speed_shaft;
        State { speed, angle: self.inputs.angle_shaft + speed * h, ..state }
    }

    /// A step of `h` (s) in torque mode, or with the gates off, on an imposed shaft.
    fn pass_imposed(&self, h: f64) -> Passed {
        let start = self.state;
        let (active, speed) = (self.is_active(), self.inputs.speed_shaft);
        let target = if active { within(self.inputs.tau_ref, self.point(&start).limits) } else { 0.0 };
        let (tau, share) = lagging(self.bandwidth, start.tau, target, h);
        let mean = tau + (start.tau - tau) * share;
        let at = |tau: f64| self.point(&State { tau, ..start });
        let (from, to) = (at(start.tau), at(tau));
        let (tau_shaft, p_loss) =
            if active { (mean, to.p_loss + (from.p_loss - to.p_loss) * share) } else { (to.tau, to.p_loss) };
        let p_mech = tau_shaft * speed;
        let p_in = if active { p_mech + p_loss } else { 0.0 };
        let overload = if self.map.t_overload > 0.0 {
            let heats = to.heats + (from.heats - to.heats) * share;
            heats + (start.overload - heats) * exp(-h / self.map.t_overload)
        } else {
            0.0
        };
        let state = State { tau, integral: 0.0, speed_ref: self.inputs.speed_ref, overload, ..start };
        let energy = Energy { r#in: p_in * h, mech: p_mech * h, loss: p_loss * h };
        Passed { state: self.on_the_shaft(state, h), energy }
    }

    /// A part of a step, of `h` (s): the state after it, and its energies.
    fn part(&self, start: &State, h: f64) -> (State, Energy) {
        let reached = self.speed_loop.ramped(start.speed_ref, self.inputs.speed_ref, h);
        let mut y = *start;
        y.speed_ref = if self.speed_loop.ramp > 0.0 { 0.5 * (start.speed_ref + reached) } else { reached };
        let one = self.rates(&y);
        let ahead = State {
            tau: y.tau + h * one.tau,
            integral: y.integral + h * one.integral,
            speed: y.speed + h * one.speed,
            overload: y.overload + h * one.overload,
            ..y
        };
        let two = self.rates(&ahead);
        let half = 0.5 * h;
        let speed = y.speed + half * (one.speed + two.speed);
        let state = State {
            tau: y.tau + half * (one.tau + two.tau),
            integral: y.integral + half * (one.integral + two.integral),
            speed_ref: reached,
            speed,
            angle: y.angle + half * (y.speed + speed),
            overload: y.overload + half * (one.overload + two.overload),
        };
        let active = self.is_active();
        let mean = 0.5 * (one.point.tau + two.point.tau);
        let (mech, kept) = if self.shaft.imposed {
            (mean * self.inputs.speed_shaft * h, 0.0)
        } else {
            let load = self.inputs.tau_load;
            let kept = 0.5 * self.shaft.J * (speed * speed - start.speed * start.speed);
            (load * half * (start.speed + speed), kept)
        };
        let energy = if active {
            let loss = half * (one.point.p_loss + two.point.p_loss);
            Energy { r#in: mech + kept + loss, mech, loss }
        } else {
            Energy { r#in: 0.0, mech, loss: -(mech + kept) }
        };
        (state, energy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_step_has_the_same_parts() {
        let mut drive = MappedDrive::default();
        drive.inputs.speed_ref = 100.0;
        drive.inputs.u_dc = drive.map.u_dc;
        // A whole number of parts.
        let h = 30.0 * PART / drive.bandwidth;
        let tau = |h: f64| drive.pass(h).unwrap().state.tau;
        let exact = tau(h);
        assert!(exact > 0.0);
        for rounded in [h * (1.0 - 1e-14), h * (1.0 + 1e-14)] {
            assert!((tau(rounded) - exact).abs() < 1e-12 * exact, "{} and {exact} N.m", tau(rounded));
        }
    }
}
