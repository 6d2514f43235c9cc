//! Power between DC link, machine and shaft, and the current that the inverter draws from the link.
//!
//! ```text
//! i_dc   = sum of m_x i_x over the legs, m_x = u_x / u_dc the mean switching state      p_in = u_dc i_dc
//! p_loss = 1.5 R_s (i_d^2 + i_q^2) + friction(speed) speed                              p_mech = tau_shaft speed
//! p_in   = p_loss + p_mech + d/dt (magnetic energy + J speed^2 / 2)
//! ```
//!
//! u_x is the voltage that the leg gives on the mean of a PWM period, after the hexagon and with what the dead time takes,
//! or that of its diodes while the gates are off; switches and diodes lose nothing. The magnetic energy is
//! 0.75 (L_d i_d^2 + L_q i_q^2) where nothing saturates. With an imposed speed tau_shaft is tau_e minus friction and the
//! kinetic energy is the drive train's; otherwise tau_shaft is tau_load, and J stores the rest.
//!
//! At a communication point all of them are those of the end of the step: the state there, with the voltages, the load
//! and u_dc that were held in that step. A new voltage shows with the next step. i_dc is defined without u_dc: a link of
//! 0 V still sees the current of the legs that are connected to it.
//!
//! Definitions; the balance is derived from the voltage equation of [`machine`](crate::plant::machine), and tested.

use crate::frame::Phases;
use crate::plant::legs::Legs;
use crate::plant::model::PlantInputs;
use crate::plant::tables::PlantParameters;
use fmu_core::unit::{AMPERE, NEWTON_METRE, WATT};
use fmu_core::{Row, Table};
use serde::{Deserialize, Serialize};

/// The powers at an instant; motor sign, from the DC link to the load.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Powers {
    /// Current that the inverter draws from the DC link in A.
    pub i_dc: f64,
    /// Power from the DC link in W.
    pub p_in: f64,
    /// Power at the shaft to the load in W.
    pub p_mech: f64,
    /// Copper loss and friction in W.
    pub p_loss: f64,
    /// Torque of the shaft on the load in N.m.
    pub tau_shaft: f64,
}

impl Powers {
    /// With the stator currents `i` (A), the electromagnetic torque `tau_e` (N.m) and the mechanical `speed` (rad/s).
    #[inline]
    pub fn new(par: &PlantParameters, inputs: &PlantInputs, legs: &Legs, i: Phases, tau_e: f64, speed: f64) -> Self {
        let PlantParameters { motor, mechanics, .. } = par;
        let friction = mechanics.friction(speed);
        let tau_shaft = if mechanics.imposed { tau_e - friction } else { inputs.tau_load };
        let u = &inputs.u;
        let full = inputs.u_dc.max(u.span());
        // Currents sum to zero, so that a common part of the voltages has no power.
        let apparent = if inputs.enable { (u.a - u.c) * i.a + (u.b - u.c) * i.b } else { 0.0 };
        // -0 A, the product of no current and a negative voltage, is 0 A.
        let i_dc = if full > 0.0 { apparent / full } else { 0.0 } - legs.feed(i) + 0.0;
        let copper = motor.R_s * (i.a * i.a + i.b * i.b + i.c * i.c);
        Self { i_dc, p_in: inputs.u_dc * i_dc, p_mech: tau_shaft * speed, p_loss: copper + friction * speed, tau_shaft }
    }
}

type O = Row<Powers>;

/// The powers' variables.
pub const POWERS: &Table<Powers> = &Table::new(
    const {
        &[
            O::output("i_dc", &AMPERE, "Current that the inverter draws from the DC link", |o| &mut o.i_dc),
            O::output("p_in", &WATT, "Power from the DC link, u_dc i_dc", |o| &mut o.p_in),
            O::output("p_mech", &WATT, "Power delivered to the load at the shaft, tau_shaft speed", |o| &mut o.p_mech),
            O::output("p_loss", &WATT, "Copper loss of the stator and friction", |o| &mut o.p_loss),
            O::output(
                "tau_shaft",
                &NEWTON_METRE,
                "Torque of the shaft on the load: tau_load, or with mechanics.imposed tau_e minus friction",
                |o| &mut o.tau_shaft,
            ),
        ]
    },
);
