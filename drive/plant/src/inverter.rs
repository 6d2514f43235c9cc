//! Parameters of the average inverter: the dead time between the two switches of a leg.
//!
//! While both switches are off, the current direction selects the diode: averaged over a PWM period, the leg voltage
//! has an error of -u_dead sign(i) with u_dead = dead_time u_dc / T_pwm. Below i_zero, the current crosses zero within
//! the dead time (ripple, switch capacitances) and the error falls linearly: -u_dead i / i_zero. With i_zero = 0 the
//! zone follows from the ripple ([`legs`](crate::legs)).
//!
//! [`modulation`](drive_base::modulation) computes the voltages. This is the usual mean-value model of the dead time;
//! neither paper contains it. u in V, i in A, times in s.

use crate::losses::conduction::{DEVICES, Devices};
use crate::pwm::{InverterMode, Pwm};
use drive_base::implausible;
use fmu_core::digits::rounded;
use fmu_core::log::Warnings;
use fmu_core::unit::{AMPERE, SECOND};
use fmu_core::{Part, Row, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters; zero dead time gives the ideal average inverter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inverter {
    /// Dead time in s, >= 0.
    pub dead_time: f64,
    /// PWM period in s, > 0.
    pub T_pwm: f64,
    /// Current in A below which the error falls linearly; 0: by the ripple of the current.
    pub i_zero: f64,
    /// Losses of transistors and diodes.
    pub devices: Devices,
    /// The modulator of the switched inverter.
    pub pwm: Pwm,
}

impl Default for Inverter {
    fn default() -> Self {
        Self { dead_time: 0.0, T_pwm: 1e-4, i_zero: 0.1, devices: Devices::default(), pwm: Pwm::default() }
    }
}

impl Inverter {
    /// Voltage lost per leg in V at the DC-link voltage `u_dc` (V).
    #[inline]
    pub fn u_dead(&self, u_dc: f64) -> f64 {
        self.dead_time / self.T_pwm * u_dc
    }

    /// Time in s between two instants at which the carrier takes over voltage references; `None` without a carrier.
    pub fn update_period(&self) -> Option<f64> {
        (self.pwm.mode == InverterMode::Switched).then(|| self.T_pwm / self.pwm.update.each_period())
    }
}

/// Largest plausible switching loss, as a share of the power that is switched: tens of times that of real inverters.
pub const LOST: f64 = 0.3;

impl Inverter {
    /// Warns of a PWM period and of a switching loss that no inverter has.
    pub fn warn(&self, log: &mut Warnings<'_>) {
        let &Self { T_pwm, devices: Devices { E_sw, i_sw, u_sw, .. }, .. } = self;
        implausible::period("inverter.T_pwm", T_pwm, log);
        let switched = i_sw * u_sw * T_pwm;
        if E_sw > LOST * switched {
            log.warn("inverter.E_sw", || {
                format!(
                    "inverter.E_sw = {E_sw} J in each inverter.T_pwm = {T_pwm} s is {} times the power inverter.i_sw inverter.u_sw = \
                     {i_sw} A {u_sw} V, and a real inverter loses about a hundredth; give J, A, V and s",
                    rounded(E_sw / switched, 3)
                )
            });
        }
    }
}

/// State of the inverter's transistors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Gates {
    /// They switch and produce the voltage references.
    #[default]
    Switch,
    /// All upper or all lower transistors conduct: the terminals of the machine are short-circuited.
    Short,
    /// Only the diodes conduct.
    Off,
}

type P = Row<Inverter>;

/// Variables of the inverter; their owner supplies the prefix `inverter.`.
pub const INVERTER: &Table<Inverter> = table![
    P::parameter("dead_time", &SECOND, "Dead time between the two switches of a leg; 0: ideal inverter", |p| {
        &mut p.dead_time
    })
    .at_least(0.0),
    P::parameter("T_pwm", &SECOND, "PWM period", |p| &mut p.T_pwm).above(0.0),
    P::parameter(
        "i_zero",
        &AMPERE,
        "Current below which the dead-time voltage falls linearly to zero; 0: by the ripple",
        |p| { &mut p.i_zero }
    )
    .at_least(0.0),
    P::part("", &Part { table: DEVICES, lens: |p| &mut p.devices }),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_voltage_lost_is_the_share_of_the_dead_time() {
        let inverter = Inverter { dead_time: 2e-6, ..Inverter::default() };
        assert!((inverter.u_dead(540.0) - 10.8).abs() < 1e-12);
    }
}
