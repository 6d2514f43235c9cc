//! The steady state with the gates off, where the diodes rectify: the motion that repeats after a sixth of an electrical period.
//!
//! Each leg is at the rail that its current selects, so the voltage has six steps per period and turned by a sixth it is the same
//! again: with psi(x) the flux linkage in rotor axes,
//!
//! ```text
//! psi(start + pi/3) = psi(start)                        two equations for psi(start), solved by Newton's method
//! i, psi, tau_e, losses                                 means over the sixth
//! ```
//!
//! The sixth is integrated as in a step of [`PmsmPlant`], with its diodes, which block between two pulses of a small current. The
//! fundamental alone would be a machine on a resistance, with the voltage U = 2/pi (u_dc + 2 u_diode) against the current
//! (`fundamental`):
//!
//! ```text
//! |i| (r - R) = U,  |i| = w psi_M sqrt(r^2 + w^2 L_q^2) / (r^2 + w^2 L_d L_q)        R with the resistance of the diodes
//! ```
//!
//! It is the start of the search; its harmonics change the torque by some percent. With L_q > L_d, U has a maximum above w psi_M:
//! below the speed at which the diodes open, two currents satisfy the equation, and a current that flows continues to flow
//! (uncontrolled generation) down to that maximum. Derived here; `tests/rectifier.rs` compares it with the running plant.

use crate::circuit::{Passed, blocked_rates};
use crate::losses::Losses;
use crate::losses::flow::{Path, Switches};
use crate::model::PmsmPlant;
use crate::signals::PlantInputs;
use crate::state::State;
use crate::tables::PlantParameters;
use crate::thermal::Temperatures;
use drive_base::frame::{AlphaBeta, Dq};
use drive_base::motor::Motor;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_3};

/// Number of pieces of a sixth, at whose ends the diodes may block or open, and number of them that are passed at once while a current
/// is far beyond the zone of the legs.
const PIECES: u32 = 192;
const AT_ONCE: u32 = 8;

/// Maximum current, as a multiple of the zone, at which the diodes may soon block.
const NEAR: f64 = 3.0;

/// Maximum number of Newton steps, and the step at which they end, as a share of the flux linkage of the magnet.
const ROUNDS: u32 = 8;
const SMALL: f64 = 1e-6;

/// Largest such step at which the noise of the integration may end the search.
const NOISE: f64 = 1e-4;

/// Difference of the flux linkage for the slope, as a share of that of the magnet.
const DIFFERENCE: f64 = 1e-4;

/// Maximum number of sixths that are followed until a current is settled.
const FOLLOWED: f64 = 300.0;

/// Conductance of the iron times resistance above which no machine is described: it is about 1e-3.
const MOST_BY_IRON: f64 = 0.2;

/// Smallest inductance of a map, as a share of the inductances, below which no machine is described.
const LEAST_INDUCTANCE: f64 = 0.02;

/// Electrical speed in rad/s below which no motion is sought.
const SLOWEST: f64 = 35.0;

/// Time constants of the winding after which Newton's method completes the settling.
const SETTLED: f64 = 3.0;

/// Number of resistances among which the fundamental is searched, and their ratio.
const TRIALS: u32 = 160;
const RATIO: f64 = 1.08;

/// The means over a sixth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rectified {
    /// Current at the terminals in A.
    pub i: Dq,
    /// Flux linkage in Wb.
    pub psi: Dq,
    /// Electromagnetic torque in N.m.
    pub tau_e: f64,
    /// Losses in W, without friction.
    pub losses: Losses,
    /// Flux linkage in Wb at the beginning of the sixth.
    pub start: Dq,
}

/// A sixth that was passed.
struct Sixth {
    /// Flux linkage in Wb at its end.
    end: Dq,
    means: Rectified,
    /// Whether the diodes conducted.
    conducts: bool,
}

/// Where the search begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum From {
    /// Near this flux linkage (Wb), which a similar sixth had at its beginning.
    Near(Dq),
    /// The gates were just switched off with this flux linkage (Wb): the current settles from there.
    Off(Dq),
    /// The fundamental.
    Fundamental,
}

/// A plant with the gates off on an imposed shaft, at the mechanical `speed` (rad/s), on a link of `u_dc` (V).
fn resting(par: &PlantParameters, at: Temperatures, speed: f64, u_dc: f64) -> PmsmPlant {
    let mut plant = PmsmPlant { parameters: par.clone(), ..PmsmPlant::default() };
    plant.parameters.mechanics.imposed = true;
    plant.inputs = PlantInputs { u_dc, speed_shaft: speed, enable: false, ..PlantInputs::default() };
    plant.warm.least_inductance = plant.parameters.least_inductance();
    plant.take(at);
    plant
}

/// The means of a short circuit through devices with thresholds, near the flux linkage `psi` (Wb); arguments as for [`rectified`].
pub fn shorted(par: &PlantParameters, at: Temperatures, speed: f64, psi: Dq) -> Option<Rectified> {
    let mut plant = resting(par, at, speed, 0.0);
    plant.inputs.asc = true;
    if plant.is_possible() { plant.repeated(psi) } else { None }
}

/// The steady state of the plant with the gates off at the temperatures `at` (K), the mechanical `speed` (rad/s) and the voltage
/// `u_dc` (V) of the link; `None` where the diodes block.
pub fn rectified(par: &PlantParameters, at: Temperatures, speed: f64, u_dc: f64, from: From) -> Option<Rectified> {
    let plant = resting(par, at, speed, u_dc);
    let motor = &plant.warm.motor;
    let w = f64::from(motor.n_p) * speed;
    if !plant.is_possible() || u_dc <= 0.0 {
        return None;
    }
    let start = match from {
        From::Near(psi) => psi,
        From::Off(psi) => plant.followed(psi, plant.settling())?,
        From::Fundamental => {
            let inverter = &par.inverter.devices;
            fundamental(motor, w, FRAC_2_PI * (u_dc + 2.0 * inverter.u_diode), inverter.r_diode)
                .unwrap_or_else(|| plant.idle_flux(motor, speed))
        }
    };
    plant.repeated(start)
}

/// The flux linkage (Wb) of the fundamental of the larger current at the electrical speed `w` (rad/s) against the voltage `U`
/// (V) and the resistance `r_diode` (Ohm) of the diodes, without iron loss and saturation; `None` if no current flows.
fn fundamental(motor: &Motor, w: f64, U: f64, r_diode: f64) -> Option<Dq> {
    let &Motor { R_s, L_d, L_q, psi_M, .. } = motor;
    let R = R_s + r_diode;
    let current = |r: f64| {
        let by = -w * psi_M / (r * r + w * w * L_d * L_q);
        Dq::new(w * L_q * by, r * by)
    };
    let over = |r: f64| current(r).magnitude() * (r - R) - U;
    let mut low = R;
    for _ in 0..TRIALS {
        let mut high = low * RATIO + 1e-3 * w.abs() * L_d;
        if over(high) >= 0.0 {
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                *(if over(middle) < 0.0 { &mut low } else { &mut high }) = middle;
            }
            return Some(crate::machine::flux(motor, current(high)));
        }
        low = high;
    }
    None
}

impl PmsmPlant {
    /// Whether the shaft turns fast enough for a search. A description is probed with impossible machines too.
    fn is_possible(&self) -> bool {
        let (motor, par) = (&self.warm.motor, &self.parameters);
        let w = f64::from(motor.n_p) * self.inputs.speed_shaft;
        let by_iron = par.iron.conductance(w) * motor.R_s * (1.0 + par.winding.k_ac * w * w);
        let narrow = self.warm.least_inductance < LEAST_INDUCTANCE * motor.L_d.min(motor.L_q);
        w.abs() >= SLOWEST && motor.R_s > 0.0 && motor.psi_M > 0.0 && by_iron < MOST_BY_IRON && !narrow
    }

    /// Number of sixths after which a current is nearly settled.
    fn settling(&self) -> f64 {
        let (motor, speed) = (&self.warm.motor, self.inputs.speed_shaft);
        let time = SETTLED * motor.L_q.max(motor.L_d) / motor.R_s;
        (time * (f64::from(motor.n_p) * speed).abs() / FRAC_PI_3).min(FOLLOWED)
    }

    /// The flux linkage (Wb) after this number of `sixths` from `psi` (Wb) on; `None` if the diodes block.
    fn followed(&self, mut psi: Dq, sixths: f64) -> Option<Dq> {
        let mut count = 0.0;
        while count < sixths {
            let passed = self.sixth(psi);
            if !passed.conducts {
                return None;
            }
            psi = passed.end;
            count += 1.0;
        }
        Some(psi)
    }

    /// The sixth that ends as it begins, near a flux linkage of `psi` (Wb); `None` if the diodes block in it.
    fn repeated(&self, mut psi: Dq) -> Option<Rectified> {
        let psi_M = self.warm.motor.psi_M;
        let mut passed = self.sixth(psi);
        let mut settled = false;
        for _ in 0..ROUNDS {
            let (rest, small) = (passed.end - psi, DIFFERENCE * psi_M);
            let column = |d, q| (self.sixth(psi + Dq::new(d, q)).end - passed.end) * (1.0 / small);
            let (a, b) = (column(small, 0.0), column(0.0, small));
            // (J - 1) step = -rest
            let (dd, dq, qd, qq) = (a.d() - 1.0, b.d(), a.q(), b.q() - 1.0);
            let by = -1.0 / (dd * qq - dq * qd);
            let step = Dq::new(qq * rest.d() - dq * rest.q(), dd * rest.q() - qd * rest.d()) * by;
            settled = step.magnitude() <= SMALL * psi_M;
            if settled {
                break;
            }
            let tried = self.sixth(psi + step);
            let rested = (tried.end - (psi + step)).magnitude();
            if rested < rest.magnitude() {
                (psi, passed) = (psi + step, tried);
            } else if step.magnitude() <= NOISE * psi_M {
                settled = true;
                break;
            } else {
                // Far from the solution, the motion itself settles.
                psi = self.followed(passed.end, 3.0)?;
                passed = self.sixth(psi);
            }
        }
        if !settled {
            psi = self.followed(psi, self.settling())?;
            passed = self.sixth(psi);
        }
        passed.conducts.then_some(Rectified { start: psi, ..passed.means })
    }

    /// A sixth of an electrical period from the flux linkage `psi` (Wb) on.
    fn sixth(&self, psi: Dq) -> Sixth {
        let (motor, machine, speed) = (&self.warm.motor, self.machine::<false>(), self.inputs.speed_shaft);
        let piece = FRAC_PI_3 / (f64::from(PIECES) * machine.electrical(speed).abs());
        let legs = self.legs(&self.inputs);
        let switches = self.switches(&self.inputs, legs);
        let (shaft, off) = (self.shaft(speed), self.inputs.is_off());
        let idle = self.idle_flux(motor, speed);
        let mut state = State::new(motor, psi, speed, 0.0);
        let (mut passed, mut i, mut sum, mut conducts) = (Passed::default(), Dq::ZERO, Dq::ZERO, false);
        let mut left = PIECES;
        while left > 0 {
            let current = self.terminal(&state, switches);
            let [beyond, _] = legs.excess(motor, state.axis, current, 0.0);
            let pieces = if off && beyond + 1.0 < NEAR { 1 } else { AT_ONCE.min(left) };
            let (h, share) = (piece * f64::from(pieces), f64::from(pieces) / f64::from(PIECES));
            left -= pieces;
            if let Some(lost) = self.remaining(&state, &legs).filter(|_| off) {
                let rates = blocked_rates(&machine, &shaft, idle, self.idle_current(motor, speed), speed);
                passed.losses.cu += lost;
                passed.losses.iron += h * rates.losses.iron;
                passed.impulse += h * rates.tau_given;
                state = State::new(motor, idle, speed, state.angle + h * speed);
                sum += idle * share;
                continue;
            }
            conducts = true;
            let before = state.psi;
            let (step, _) = self.pass_kinks(&mut state, h, AlphaBeta::ZERO, &legs, switches);
            passed.add(&step);
            i += (current + self.terminal(&state, switches)) * (0.5 * share);
            sum += (before + state.psi) * (0.5 * share);
        }
        let by = 1.0 / (f64::from(PIECES) * piece);
        let Losses { cu, iron, cond, .. } = passed.losses;
        let losses = Losses { cu: cu * by, iron: iron * by, cond: cond * by, ..Losses::default() };
        let tau_e = passed.impulse * by + self.parameters.mechanics.friction(speed);
        let means = Rectified { i, psi: sum, tau_e, losses, start: psi };
        Sixth { end: state.psi, means, conducts }
    }

    /// Current (A) at the terminals in this state with these `switches`.
    fn terminal(&self, state: &State, switches: Switches) -> Dq {
        let i = self.machine::<false>().current(state.psi);
        let machine = self.machine::<false>();
        let dissipation = self.parameters.dissipation(machine.resistance(), machine.electrical(state.speed));
        i + self.by_iron_at(state, &Path { u: AlphaBeta::ZERO, dissipation, drops: switches })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The machine on a resistance: r i_d = w L_q i_q and r i_q = -w (L_d i_d + psi_M), in either direction.
    #[test]
    fn the_fundamental_is_a_machine_on_a_resistance() {
        let motor = Motor { n_p: 4, R_s: 0.5, L_d: 2e-3, L_q: 3e-3, psi_M: 0.1 };
        let (U, r_diode) = (50.0, 0.01);
        for w in [800.0, 2000.0, -2000.0] {
            let psi = fundamental(&motor, w, U, r_diode).unwrap();
            let i = Dq::new((psi.d() - motor.psi_M) / motor.L_d, psi.q() / motor.L_q);
            let r = motor.R_s + r_diode + U / i.magnitude();
            let rest = [r * i.d() - w * psi.q(), r * i.q() + w * psi.d()];
            assert!(rest.iter().all(|rest| rest.abs() < 1e-9 * U) && i.magnitude() > 1.0, "{w}: {rest:?}");
        }
        // The EMF is below the voltage.
        assert!(fundamental(&motor, 400.0, U, r_diode).is_none());
    }
}
