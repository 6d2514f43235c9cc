//! Power between DC link, machine and shaft, its mean over a step, and the energy since the start.
//!
//! ```text
//! i_dc   = sum of m_x i_x over the legs, m_x = u_x / u_dc the mean switching state      p_in = u_dc i_dc
//! p_loss = p_cu + p_iron + p_cond + p_sw + p_friction                                   p_mech = tau_shaft speed
//! p_in   = p_loss + p_mech + d/dt (magnetic energy + J speed^2 / 2)
//! ```
//!
//! u_x is the voltage that the leg supplies on average over a PWM period, after the hexagon limit and the dead-time
//! loss, or the voltage of its diodes while the gates are off, but before the drop of its devices
//! ([`losses`](crate::losses)). A switching loss increases i_dc by p_sw / u_dc. The magnetic energy is
//! 0.75 (L_d i_d^2 + L_q i_q^2) without saturation. With an imposed speed, tau_shaft is tau_e minus friction and the
//! kinetic energy belongs to the drive train; otherwise tau_shaft is tau_load, and J stores the rest.
//!
//! With a constant voltage and a turning rotor, power and torque change within the step, so an instantaneous value does not
//! represent them. The outputs are therefore means over the plant's last step, integrated by the same method as the state;
//! `energy_in`, `energy_mech` and `energy_loss` are the time integrals of the powers. A drive train that integrates
//! tau_shaft over the angle of its shaft receives `energy_mech`. Before the first step, the powers are the initial values.
//! In Model Exchange, where the importer integrates, the powers and tau_shaft are instantaneous, and the energies are counted
//! over the importer's steps ([`counters`](crate::counters)). i_dc is also defined for u_dc = 0 V, where the link still carries
//! the current of the legs connected to it: it is then the value at the end of the step.
//!
//! Two events transfer energy instantly and count in the step in which they occur: a jump of the imposed angle, where
//! the magnetic field does work on the shaft, and blocking diodes, where the energy of the remaining current is lost.
//!
//! These are definitions; the balance is derived from the voltage equation of [`machine`](crate::machine) and
//! tested.

use crate::losses::{LOSSES, Losses};
use fmu_core::unit::{AMPERE, JOULE, WATT};
use fmu_core::{Part, Row, Table, table};
use serde::{Deserialize, Serialize};

/// Powers; motor sign, from the DC link to the load.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Powers<S = f64> {
    /// Current that the inverter draws from the DC link in A.
    pub i_dc: S,
    /// Power from the DC link in W.
    pub p_in: S,
    /// Power at the shaft to the load in W.
    pub p_mech: S,
    /// All losses in W.
    pub p_loss: S,
    /// Each loss in W.
    pub losses: Losses<S>,
    /// Torque of the shaft on the load in N.m.
    pub tau_shaft: S,
}

impl Powers {
    /// Means over a step of `h` (s) with this `energy` and these `losses` (J) and the mean torque `tau_shaft` (N.m); `i_dc` gives
    /// the current (A) from the DC link at the power from there (W).
    #[inline]
    pub fn mean(energy: &Energy, losses: Losses, tau_shaft: f64, h: f64, i_dc: impl FnOnce(f64) -> f64) -> Self {
        // -0 W, the product of no current and a negative voltage, is 0 W.
        let rate = 1.0 / h;
        let p_in = energy.r#in * rate + 0.0;
        let i_dc = i_dc(p_in);
        let (p_mech, p_loss) = (energy.mech * rate, energy.loss * rate);
        Self { i_dc, p_in, p_mech, p_loss, losses: losses.map(|e| e * rate), tau_shaft }
    }

    /// The mean of this value and `last`, with the weight `share` (0..1) on `last`.
    #[inline]
    pub fn with(self, last: Self, share: f64) -> Self {
        let mean = |a: f64, b: f64| a + (b - a) * share;
        Self {
            i_dc: mean(self.i_dc, last.i_dc),
            p_in: mean(self.p_in, last.p_in),
            p_mech: mean(self.p_mech, last.p_mech),
            p_loss: mean(self.p_loss, last.p_loss),
            losses: self.losses.with(&last.losses, mean),
            tau_shaft: mean(self.tau_shaft, last.tau_shaft),
        }
    }
}

/// Transferred energy in J; motor sign, from the DC link to the load.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Energy {
    /// From the DC link.
    pub r#in: f64,
    /// To the load at the shaft.
    pub mech: f64,
    /// Lost: copper, iron, inverter, friction.
    pub loss: f64,
}

impl From<Powers> for Energy {
    /// The energies of one second at these powers.
    fn from(powers: Powers) -> Self {
        Self { r#in: powers.p_in, mech: powers.p_mech, loss: powers.p_loss }
    }
}

impl Energy {
    /// Adds the energy transferred in a step.
    #[inline]
    pub fn add(&mut self, step: &Self) {
        self.r#in += step.r#in;
        self.mech += step.mech;
        self.loss += step.loss;
    }
}

type P = Row<Powers>;

/// Variables of the powers.
pub const POWERS: &Table<Powers> = table![
            P::output(
                "i_dc",
                &AMPERE,
                "Current that the inverter draws from the DC link, mean over the last step (PmsmDrive: over the last T_s; Model Exchange: at the instant)",
                |p| &mut p.i_dc,
            )
            .mean(),
            P::output(
                "p_in",
                &WATT,
                "Power from the DC link, u_dc i_dc, mean over the last step (PmsmDrive: over the last T_s; Model Exchange: at the instant)",
                |p| &mut p.p_in,
            )
            .mean(),
            P::output(
                "p_mech",
                &WATT,
                "Power delivered to the load at the shaft, tau_shaft speed, mean over the last step (PmsmDrive: over the last \
                 T_s; Model Exchange: at the instant)",
                |p| &mut p.p_mech,
            )
            .mean(),
            P::output(
                "p_loss",
                &WATT,
                "All losses, p_cu + p_iron + p_cond + p_sw + p_friction, mean over the last step (PmsmDrive: over the last T_s; \
                 Model Exchange: at the instant)",
                |p| &mut p.p_loss,
            )
            .mean(),
            P::part("", &Part { table: LOSSES, lens: |p| &mut p.losses }),
        ];

type E = Row<Energy>;

/// Variables of the energies; their owner supplies the prefix `energy_`.
pub const ENERGY: &Table<Energy> = table![
    E::output(
        "in",
        &JOULE,
        "Energy from the DC link since the start, the integral of p_in; in Model Exchange up to the last completed integrator step \
                 or event, as exact as in Co-Simulation if inputs are constant or linear between two of them",
        |e| &mut e.r#in,
    ),
    E::output(
        "mech",
        &JOULE,
        "Energy delivered to the load since the start, the integral of p_mech; in Model Exchange as energy_in",
        |e| &mut e.mech,
    ),
    E::output(
        "loss",
        &JOULE,
        "Energy lost since the start, the integral of p_loss; in Model Exchange as energy_in",
        |e| &mut e.loss,
    ),
];
