//! First look at the machine: short pulses in six directions.
//!
//! A pulse is +V for n samples and -V for n; then 0 V until the current is gone. V grows from 0.004 u_dc to u_dc/(2 sqrt 3),
//! then n to 64, until one of three directions carries 0.15 I. With V and 0.6 V the dead time cancels:
//!
//! ```text
//! L(phi) = 0.4 V n T / (i(V) - i(0.6 V))        i along phi at the end of the pulse
//! 1/L(phi) = g_0 + g_c cos 2 phi + g_s sin 2 phi
//! ```

use super::bench::{Bench, Sample};
use super::status::CommissionFault as Fault;
use super::tensor::Tensor;
use drive_base::frame::{AlphaBeta, Axis, Estimated};
use serde::{Deserialize, Serialize};

/// First and last voltage as shares of u_dc and of u_dc / sqrt 3, and the factor from one level to the next.
const LEVELS: (f64, f64, f64) = (0.004, 0.5, 1.5);
/// Share of I that a pulse must reach.
const REACHED: f64 = 0.15;
/// Longest pulse in samples.
const LONGEST: f64 = 64.0;
/// Repetitions of each direction and level.
const REPEATED: f64 = 4.0;
/// Maximum decay time (s) of a current.
const DECAY: f64 = 5.0;

/// The pulses.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Probe {
    /// Voltage in V and samples of a pulse.
    V: f64,
    n: f64,
    /// The levels are found: the six directions follow.
    measures: bool,
    /// Sixths of a turn.
    #[serde(with = "crate::commission::fixed_size")]
    direction: u64,
    repetition: f64,
    /// The weaker pulse of the two.
    weak: bool,
    /// Samples since the pulse began, and samples in a row without current.
    k: f64,
    quiet: f64,
    /// Maximum current of this level in A; sums of the stronger and the weaker pulses in A.
    reached: f64,
    sums: [f64; 2],
    /// Sums of 1/L in 1/H at 0, 60 and 120 degrees, and the smallest L in H.
    y: [f64; 3],
    L_c: f64,
}

/// Result of a sample of the probe.
pub(super) enum Probed {
    /// The voltage of this sample in V.
    Voltage(AlphaBeta),
    /// The smallest inductance in H, and all.
    Done(f64, Tensor),
    /// The machine cannot reach this current.
    Refused(Fault),
}

impl Probe {
    /// The six directions again, once the current has ended.
    pub(super) fn again(&self, bench: &Bench) -> Self {
        let Self { V, n, .. } = *self;
        Self { V, n, direction: 2, reached: bench.I, k: 2.0 * n + bench.delay, ..Self::default() }
    }

    pub(super) fn update(&mut self, bench: &Bench, sample: &Sample) -> Probed {
        if self.V == 0.0 {
            (self.V, self.n) = (LEVELS.0 * sample.u_dc, 1.0);
        }
        let axis = Axis::<Estimated>::at(std::f64::consts::FRAC_PI_3 * self.sixths());
        let k = self.k;
        self.k += 1.0;
        // The end of the pulse that acts `delay` samples later.
        if (k - self.n - bench.delay).abs() < 0.5 {
            let i = axis.from_stator(sample.i).d();
            self.reached = self.reached.max(i);
            self.sums[usize::from(self.weak)] += i;
        }
        if k >= 2.0 * self.n + bench.delay {
            let none = sample.i.magnitude() < 0.01 * bench.I + 4.0 * bench.sigma;
            self.quiet = if none { self.quiet + 1.0 } else { 0.0 };
            if self.quiet >= 5.0 {
                (self.k, self.quiet) = (0.0, 0.0);
                return self.next(bench);
            }
            if self.k * bench.T > DECAY {
                return Probed::Refused(Fault::NotFollowing);
            }
        }
        let V = if self.weak { 0.6 * self.V } else { self.V };
        let u = if k < self.n {
            V
        } else if k < 2.0 * self.n {
            -V
        } else {
            0.0
        };
        Probed::Voltage(axis.along(u))
    }

    /// The direction in sixths of a turn.
    fn sixths(&self) -> f64 {
        u32::try_from(self.direction).map_or(0.0, f64::from)
    }

    /// The pulse is over.
    fn next(&mut self, bench: &Bench) -> Probed {
        let wait = Probed::Voltage(AlphaBeta::ZERO);
        if !self.measures {
            self.direction += 1;
            if self.direction < 3 {
                return wait;
            }
            self.direction = 0;
            self.sums = [0.0; 2];
            if self.reached >= REACHED * bench.I {
                self.measures = true;
                return wait;
            }
            self.reached = 0.0;
            let most = LEVELS.1 * bench.U;
            if self.V < most {
                self.V = (self.V * LEVELS.2).min(most);
            } else if self.n < LONGEST {
                self.n *= 2.0;
            } else {
                return Probed::Refused(Fault::Inductance);
            }
            return wait;
        }
        self.weak = !self.weak;
        if self.weak {
            return wait;
        }
        self.repetition += 1.0;
        if self.repetition < REPEATED {
            return wait;
        }
        self.repetition = 0.0;
        let more = (self.sums[0] - self.sums[1]) / REPEATED;
        self.sums = [0.0; 2];
        if more <= 0.0 {
            return Probed::Refused(Fault::Inductance);
        }
        let L = 0.4 * self.V * self.n * bench.T / more;
        self.L_c = if self.L_c == 0.0 { L } else { self.L_c.min(L) };
        self.y[usize::try_from(self.direction % 3).unwrap_or(0)] += 0.5 / L;
        self.direction += 1;
        if self.direction < 6 { wait } else { Probed::Done(self.L_c, Tensor::through(self.y)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The end of the probe of an inductance L (H) without resistance.
    fn probed(L: f64) -> (Probe, Result<(f64, Tensor), Fault>) {
        let bench = Bench { T: 1e-4, delay: 1.0, I: 10.0, U: 170.0, ..Bench::default() };
        let (mut probe, mut sample) = (Probe::default(), Sample { u_dc: 300.0, ..Sample::default() });
        let mut command = AlphaBeta::ZERO;
        for _ in 0..20_000 {
            sample.u = command;
            match probe.update(&bench, &sample) {
                Probed::Voltage(u) => command = u,
                Probed::Done(L_c, tensor) => return (probe, Ok((L_c, tensor))),
                Probed::Refused(fault) => return (probe, Err(fault)),
            }
            sample.i_last = sample.i;
            sample.i += sample.u * (bench.T / L);
        }
        panic!("no end");
    }

    #[test]
    fn a_linear_inductance_comes_back() {
        let (L_c, tensor) = probed(5e-3).1.unwrap();
        assert!((L_c / 5e-3 - 1.0).abs() < 1e-9, "{L_c}");
        assert!((tensor.inductance(0.3) / 5e-3 - 1.0).abs() < 1e-9, "{tensor:?}");
    }

    /// The voltage grows to its limit, then the pulse to 64 samples.
    #[test]
    fn a_machine_that_takes_no_current_is_refused_after_the_longest_pulse() {
        let (Probe { V, n, .. }, end) = probed(1e3);
        assert_eq!((end, V, n), (Err(Fault::Inductance), 85.0, 64.0));
    }
}
