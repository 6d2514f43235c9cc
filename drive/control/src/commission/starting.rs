//! I-f start of the identified machine: a rotating current takes the aligned rotor to w_h, where its EMF shows it.
//!
//! ```text
//! I_f     = 0.6 I, at most 0.3 psi_0 / (L_q - L_d)                  the active flux keeps its sign
//! w_h     = 0.12 w_r;  a = min(0.2 w_0^2 I_f / (0.4 I), 4 w_h / s), at least w_h / 45 s; a / 5 at each new try
//! e       = delta / T in the frame of the current, low-passed       j w eta
//! i_q     = damping of the drive's start with w_0^2 I_f / (0.4 I), J / (n_p K) = 0.4 I / w_0^2
//! psi_M   = |e| / w - (L_d - L_q) i_d, above 0.3 w_h, within 0.25 and 1.15 psi_r
//! ```
//!
//! The rotor follows if the mean of |e| / w - (L_d - L_q) i_d is within 0.3 and 1.3 psi_r and the observer turns at w_h, over the second half of
//! the hold. If not, the gates go off and the rotor coasts. Zero voltage would short-circuit a turning machine: the current of
//! a pulse as long as the delay shows whether the rotor still turns. Then it is aligned again, at most three times. Derived
//! here, except for the damping of [`start`](crate::start).

use super::align::{Dc, LONGEST, Rest};
use super::bench::{Bench, Sample};
use super::status::CommissionFault as Fault;
use super::turning::Turning;
use crate::start::damping;
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use serde::{Deserialize, Serialize};

/// Speed of the hand-over relative to the rated speed.
const HAND_OVER: f64 = 0.12;
/// Current over I.
const CURRENT: f64 = 0.6;
/// Tries.
const TRIES: f64 = 3.0;
/// Shortest time in s with the gates off before a pulse, and the current over I that shows a turning rotor.
const COAST: (f64, f64) = (0.5, 0.05);

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Phase {
    #[default]
    Align,
    Ramp,
    Hold,
    Coast,
    Pulse,
}

/// The start on its way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Starting {
    phase: Phase,
    /// Samples in this phase, and of coasting.
    k: f64,
    coasted: f64,
    tries: f64,
    dc: Dc,
    rest: Rest,
    /// Frame of the current: angle in rad and speed in rad/s, and its EMF in V.
    theta: f64,
    w: f64,
    e: DqHat,
    /// Means of the active flux in Wb, and of the current along it in A.
    eta: f64,
    i_d: f64,
    /// Sums over the second half of the hold: psi_M in Wb, the observer's speed, the current i_q that gives the
    /// same torque at i_d = 0 in A, samples.
    sums: [f64; 4],
}

/// Result of a sample of the start.
pub(super) enum Started {
    /// The voltage of this sample in V.
    Voltage(AlphaBeta),
    /// Gates off.
    Off,
    /// The rotor follows, with the current (A) that its load needs.
    Done(f64),
}

impl Starting {
    /// Speed in rad/s at which the observer takes over.
    fn w_h(bench: &Bench) -> f64 {
        HAND_OVER * bench.w_r()
    }

    fn enter(&mut self, phase: Phase) {
        (self.phase, self.k) = (phase, 0.0);
    }

    /// One sample.
    pub(super) fn update(&mut self, bench: &Bench, turning: &mut Turning, sample: &Sample) -> Result<Started, Fault> {
        self.k += 1.0;
        let t = self.k * bench.T;
        match self.phase {
            Phase::Align => {
                let u = self.dc.command(bench, sample, bench.aligned() * (t / 0.1).min(1.0));
                if t > 0.1 && self.rest.update(bench, self.dc.axis.from_stator(sample.i).q()) {
                    turning.begin(bench, sample, 0.0);
                    turning.motor.psi_M = bench.psi_0;
                    (self.theta, self.w, self.e, self.sums) = (0.0, 0.0, DqHat::ZERO, [0.0; 4]);
                    self.i_d = bench.aligned();
                    self.eta = bench.psi_0 + (turning.motor.L_d - turning.motor.L_q) * self.i_d;
                    self.enter(Phase::Ramp);
                } else if t > LONGEST {
                    return Err(Fault::NotFollowing);
                }
                Ok(Started::Voltage(u))
            }
            Phase::Ramp | Phase::Hold => Ok(self.turn(bench, turning, sample)?),
            Phase::Coast => {
                if t >= COAST.0 {
                    self.coasted += t;
                    self.enter(Phase::Pulse);
                }
                Ok(Started::Off)
            }
            Phase::Pulse => {
                if self.k <= bench.delay + 2.0 {
                    return Ok(Started::Voltage(AlphaBeta::ZERO));
                }
                if sample.i.magnitude() < COAST.1 * bench.I + 4.0 * bench.sigma {
                    (self.dc, self.rest) = (Dc::default(), Rest::default());
                    self.enter(Phase::Align);
                } else if self.coasted > LONGEST {
                    return Err(Fault::NotFollowing);
                } else {
                    self.enter(Phase::Coast);
                }
                Ok(Started::Off)
            }
        }
    }

    /// The current turns.
    fn turn(&mut self, bench: &Bench, turning: &mut Turning, sample: &Sample) -> Result<Started, Fault> {
        let (T, I, w_h) = (bench.T, bench.I, Self::w_h(bench));
        turning.observe(bench, sample);
        self.theta += T * self.w;
        let salient = (turning.motor.L_q - turning.motor.L_d).max(1e-3 * turning.motor.L_d);
        let I_f = (CURRENT * I).min(0.3 * bench.psi_0 / salient);
        let inertia = bench.inertia();
        let w_0 = (I_f / inertia).sqrt();
        let fastest = (0.2 * I_f / inertia).min(4.0 * w_h);
        let a = if w_h > 45.0 * fastest { w_h / 15.0 } else { fastest } * [1.0, 0.2, 0.04][self.tried()];

        let axis = Axis::<Estimated>::at(self.theta - 0.5 * T * self.w);
        let e = axis.from_stator(turning.delta) * (1.0 / T);
        let rate = (4.0 * w_0).max(377.0).min(0.2 / T);
        self.e += (e - self.e) * (1.0 - drive_base::math::exp(-rate * T));
        let i = Axis::<Estimated>::at(self.theta).from_stator(sample.i);
        let size = self.e.magnitude();
        let saliency = turning.motor.L_d - turning.motor.L_q;
        let i_d = (i.d() * self.e.q() - i.q() * self.e.d()) / size.max(1e-12);
        // Over the swings of the rotor on its current.
        let slow = T / (10.0 / w_0).max(0.05);
        self.i_d += slow * (i_d - self.i_d);
        if self.w > 0.3 * w_h {
            self.eta += slow * (size / self.w - self.eta);
            let psi = self.eta - saliency * self.i_d;
            turning.motor.psi_M = psi.clamp(bench.psi_least(), 1.15 * bench.psi_r);
        }
        let t = self.k * T;
        if self.phase == Phase::Ramp {
            self.w = (self.w + a * T).min(w_h);
            if self.w >= w_h {
                self.enter(Phase::Hold);
            }
        } else {
            let hold = (10.0 / bench.w_0).max(0.5).max(12.0 / w_h);
            if t > 0.5 * hold {
                let i = turning.current(sample);
                let across = (1.0 + saliency * i.d() / turning.motor.psi_M) * i.q();
                for (sum, x) in self.sums.iter_mut().zip([self.eta - saliency * self.i_d, turning.w, across, 1.0]) {
                    *sum += x;
                }
            }
            if t > hold {
                let [psi, w, i_q, _] = self.sums.map(|sum| sum / self.sums[3]);
                let follows = (w / w_h - 1.0).abs() < 0.1;
                if psi > 1.2 * bench.psi_least() && psi < 1.3 * bench.psi_r && follows {
                    turning.hand_over();
                    return Ok(Started::Done(i_q));
                }
                self.tries += 1.0;
                if self.tries >= TRIES {
                    return Err(if follows { Fault::Flux } else { Fault::NotFollowing });
                }
                self.coasted = 0.0;
                self.enter(Phase::Coast);
                return Ok(Started::Off);
            }
        }
        let grown = if self.phase == Phase::Ramp {
            bench.aligned() + (I_f - bench.aligned()) * (t / 0.1).min(1.0)
        } else {
            I_f
        };
        let slip = self.e.q() / self.eta.max(0.4 * bench.psi_least()) - self.w;
        let i_q = damping(w_0, inertia, 1.0, slip, 0.5 * I_f);
        Ok(Started::Voltage(turning.in_any_frame(bench, sample, (self.theta, self.w), DqHat::new(grown, i_q))))
    }

    fn tried(&self) -> usize {
        if self.tries < 0.5 {
            0
        } else if self.tries < 1.5 {
            1
        } else {
            2
        }
    }

    /// The gates are off.
    pub(super) fn coasts(&self) -> bool {
        self.phase == Phase::Coast
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After coasting, the pulse of zero voltage distinguishes a turning rotor, which coasts on, from one at rest.
    #[test]
    fn a_pulse_shows_a_turning_rotor() {
        let bench = Bench { T: 1e-4, delay: 1.0, I: 10.0, ..Bench::default() };
        for (i, next) in [(1.0, Phase::Coast), (0.1, Phase::Align)] {
            let mut starting = Starting { phase: Phase::Coast, ..Starting::default() };
            let (mut turning, sample) = (Turning::default(), Sample { i: AlphaBeta::new(i, 0.0), ..Sample::default() });
            let mut pulse = 0;
            for _ in 0..5000 + 4 {
                let step = starting.update(&bench, &mut turning, &sample).ok().unwrap();
                pulse += u32::from(matches!(step, Started::Voltage(u) if u.magnitude() == 0.0));
            }
            assert_eq!((starting.phase, pulse), (next, 3), "{i} A");
        }
    }
}
