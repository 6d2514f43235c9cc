//! Direct current along an angle phi, which aligns the rotor, and the test that the rotor is at rest.
//!
//! ```text
//! along phi        PI on the current
//! across           u_q = 0, with R known 0.5 R i_q: the machine brakes its swing, for every J
//!                  u_q = -2 K_p (i_q -+ 0.35 I) beyond 0.35 I
//! at rest          means of i_q over 10 ms within 0.002 I + 4 sigma / sqrt N for 0.4 s
//! ```

use super::bench::{Bench, Sample};
use super::status::CommissionFault as Fault;
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::math::within;
use serde::{Deserialize, Serialize};

/// Share of I below which the current across is not corrected.
const ACROSS: f64 = 0.35;
/// Longest time in s of an alignment, of a swing and of coasting.
pub(super) const LONGEST: f64 = 12.0;
/// Share of U of all voltages.
pub(super) const VOLTAGE: f64 = 0.95;

/// The control of a dc current.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Dc {
    /// Direction of the current.
    pub(super) axis: Axis<Estimated>,
    /// Integral in V.
    pub(super) u: f64,
}

impl Dc {
    /// No current yet, along the angle `phi` (rad).
    pub(super) fn at(phi: f64) -> Self {
        Self { axis: Axis::at(phi), u: 0.0 }
    }

    /// Turns to the angle `phi` (rad); the integral stays.
    pub(super) fn turn(&mut self, phi: f64) {
        self.axis = Axis::at(phi);
    }

    /// Command in V for the current `i_ref` (A).
    pub(super) fn command(&mut self, bench: &Bench, sample: &Sample, i_ref: f64) -> AlphaBeta {
        let e = i_ref - self.axis.from_stator(sample.i).d();
        let (asked, most) = (bench.K_p() * e + self.u, VOLTAGE * bench.U);
        let u = within(asked, most);
        self.u = within(self.u + bench.K_i() * bench.T * e + (u - asked), most);
        self.axis.to_stator(DqHat::new(u, self.across(bench, sample)))
    }

    /// Command in V with the constant voltage `u` (V) along phi.
    pub(super) fn open(&self, bench: &Bench, sample: &Sample, u: f64) -> AlphaBeta {
        self.axis.to_stator(DqHat::new(u, self.across(bench, sample)))
    }

    fn across(&self, bench: &Bench, sample: &Sample) -> f64 {
        let i = self.axis.from_stator(sample.i).q();
        let beyond = i - within(i, ACROSS * bench.I);
        let u = 0.5 * bench.R * (i - beyond) - 2.0 * bench.K_p() * beyond;
        within(u, 0.25 * bench.U)
    }
}

/// Whether the rotor is at rest, from the mean of `samples` with the sum `sum` (A).
pub(super) fn is_still(bench: &Bench, sum: f64, samples: f64) -> bool {
    (sum / samples).abs() < 0.002 * bench.I + 4.0 * bench.sigma / samples.sqrt()
}

/// Whether the rotor is at rest, from the current across phi.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Rest {
    sum: f64,
    samples: f64,
    quiet: f64,
}

impl Rest {
    /// Takes a sample of the current across phi in A; true: at rest.
    pub(super) fn update(&mut self, bench: &Bench, i_q: f64) -> bool {
        self.sum += i_q;
        self.samples += 1.0;
        if self.samples * bench.T >= 0.01 && self.samples >= 10.0 {
            let still = is_still(bench, self.sum, self.samples);
            self.quiet = if still { self.quiet + 1.0 } else { 0.0 };
            (self.sum, self.samples) = (0.0, 0.0);
        }
        self.quiet >= 40.0
    }
}

/// An alignment of the rotor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Align {
    pub(super) dc: Dc,
    rest: Rest,
    /// Samples since its beginning.
    pub(super) k: f64,
}

impl Align {
    pub(super) fn new(dc: Dc) -> Self {
        Self { dc, rest: Rest::default(), k: 0.0 }
    }

    /// Restarts with the present direct current.
    pub(super) fn restart(&mut self) {
        (self.rest, self.k) = (Rest::default(), 0.0);
    }

    /// Time in s since the beginning.
    pub(super) fn time(&self, bench: &Bench) -> f64 {
        self.k * bench.T
    }

    /// The current of the alignment after a ramp of `rise` (s): the command in V, and whether the rotor rests.
    ///
    /// # Errors
    /// It does not come to rest.
    pub(super) fn update(&mut self, bench: &Bench, sample: &Sample, rise: f64) -> Result<(AlphaBeta, bool), Fault> {
        self.k += 1.0;
        let t = self.time(bench);
        let u = self.dc.command(bench, sample, bench.aligned() * (t / rise).min(1.0));
        let rests = t > rise && self.rest.update(bench, self.dc.axis.from_stator(sample.i).q());
        if !rests && t > LONGEST {
            return Err(Fault::NotFollowing);
        }
        Ok((u, rests))
    }

    /// The whole current at once: the command in V, and whether the rotor rests.
    pub(super) fn hold(&mut self, bench: &Bench, sample: &Sample) -> (AlphaBeta, bool) {
        self.k += 1.0;
        let u = self.dc.command(bench, sample, bench.aligned());
        (u, self.rest.update(bench, self.dc.axis.from_stator(sample.i).q()))
    }
}
