//! Means over the sample periods of `PmsmDrive`, and their variables.

use drive_plant::counters::Total;
use drive_plant::power::Powers;
use fmu_core::unit::{NEWTON_METER, WATT};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Means over the last sample period; 0 before the end of the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Means {
    /// Power from the DC link in W.
    pub p_in: f64,
    /// Power at the shaft to the load in W.
    pub p_mech: f64,
    /// All losses in W.
    pub p_loss: f64,
    /// Torque of the shaft on the load in N.m.
    pub tau_shaft: f64,
}

/// Mean powers over the sample periods; a communication step may end within a period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Period {
    /// Mean over the last complete period.
    pub(super) last: Powers,
    /// Whether a period is complete.
    over: bool,
    /// Mean over the current period so far.
    mean: Powers,
    /// Elapsed part of the current period in s.
    time: f64,
    /// Model Exchange: the totals at the start of the current period.
    start: Total,
}

impl Period {
    /// At the start, with the `powers` there.
    pub(super) fn new(powers: Powers) -> Self {
        Self { last: powers, ..Self::default() }
    }

    /// Begins anew with the means of the last period.
    pub(super) fn begun(self) -> Self {
        Self { last: self.last, over: true, ..Self::default() }
    }

    /// Adds the `powers` of a step of `h` (s), at whose end a period may end.
    pub(super) fn add(&mut self, powers: Powers, h: f64, ends: bool) {
        self.time += h;
        // The powers of a step over the whole period are used unchanged, bit for bit.
        let mean = if self.time > h { self.mean.with(powers, h / self.time) } else { powers };
        if ends {
            (self.last, self.over, self.time) = (mean, true, 0.0);
        } else {
            self.mean = mean;
        }
    }

    /// Model Exchange: ends a period, with the `total` since the start.
    pub(super) fn end(&mut self, total: Total) {
        let start = std::mem::replace(&mut self.start, total);
        let time = total.time.since(start.time);
        if time > 0.0 {
            let mean = |end: f64, start: f64| (end - start) / time;
            let (e, s) = (&total.energy, &start.energy);
            let [p_in, p_mech, p_loss] = [mean(e.r#in, s.r#in), mean(e.mech, s.mech), mean(e.loss, s.loss)];
            let tau_shaft = mean(total.impulse, start.impulse);
            (self.last, self.over) = (Powers { p_in, p_mech, p_loss, tau_shaft, ..Powers::default() }, true);
        }
    }

    /// The values of the outputs.
    pub(super) fn means(&self) -> Means {
        let Powers { p_in, p_mech, p_loss, tau_shaft, .. } = self.last;
        if self.over { Means { p_in, p_mech, p_loss, tau_shaft } } else { Means::default() }
    }
}

type M = Row<Means>;

/// The means over the last sample period.
pub(super) const MEANS: &Table<Means> = table![
    M::discrete_output(
        "p_in_mean",
        &WATT,
        "Power from the DC link, mean over the last T_s in Co-Simulation and in Model Exchange; 0 before the end of the first",
        |m| &mut m.p_in,
    ),
    M::discrete_output("p_mech_mean", &WATT, "Power delivered to the load at the shaft, mean as p_in_mean", |m| &mut m
        .p_mech,),
    M::discrete_output("p_loss_mean", &WATT, "All losses, mean as p_in_mean", |m| &mut m.p_loss),
    M::discrete_output("tau_shaft_mean", &NEWTON_METER, "Torque of the shaft on the load, mean as p_in_mean", |m| {
        &mut m.tau_shaft
    },),
];
