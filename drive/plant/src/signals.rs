//! Inputs and outputs of the plant.

use crate::inverter::Gates;
use crate::legs::Legs;
use crate::losses::efficiency;
use crate::power::{Energy, Powers};
use crate::thermal::{Heat, Temperatures, ThermalInputs};
use drive_base::connection::{Commanded, Measured};
use drive_base::frame::{Phases, Stator, Vector};
use drive_base::overmodulation::ModulationMode;
use fmu_core::{Dual, Scalar};
use serde::{Deserialize, Serialize};

/// Inputs, constant over a communication step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlantInputs<S = f64> {
    /// Stator voltage references in V, averages over a PWM period.
    pub u: Phases<S>,
    /// DC-link voltage in V, >= 0.
    pub u_dc: S,
    /// Load torque in N.m, positive against positive speed; ignored with an imposed speed.
    pub tau_load: S,
    /// Imposed mechanical speed of the shaft in rad/s.
    pub speed_shaft: S,
    /// Imposed mechanical angle of the shaft in rad, at the beginning of the step.
    pub angle_shaft: S,
    /// Whether the gates switch; false: only the diodes conduct.
    pub enable: bool,
    /// Active short circuit: all upper or all lower transistors conduct, regardless of `enable`.
    pub asc: bool,
    /// Temperatures in K.
    pub thermal: ThermalInputs<S>,
}

impl Default for PlantInputs {
    fn default() -> Self {
        let (u, thermal) = (Phases::default(), ThermalInputs::default());
        Self { u, u_dc: 325.0, tau_load: 0.0, speed_shaft: 0.0, angle_shaft: 0.0, enable: true, asc: false, thermal }
    }
}

impl<S: Scalar> PlantInputs<S> {
    /// State of the transistors under these inputs.
    #[inline]
    pub fn gates(&self) -> Gates {
        if self.asc {
            Gates::Short
        } else if self.enable {
            Gates::Switch
        } else {
            Gates::Off
        }
    }

    /// Whether only the diodes conduct.
    #[inline]
    pub fn is_off(&self) -> bool {
        !(self.enable || self.asc)
    }

    /// Voltage (V) of the legs before any drop, of a modulator in this `mode`.
    #[expect(clippy::inline_always, reason = "the compiler would call it")]
    #[inline(always)]
    pub fn voltage(&self, mode: ModulationMode) -> Vector<Stator, S> {
        match self.gates() {
            Gates::Switch => mode.limit(self.u, self.u_dc),
            Gates::Short | Gates::Off => Vector::fixed(Vector::ZERO),
        }
    }

    /// Current (A) that the inverter draws from the DC link at the power `p_in` (W), or without a link voltage with the stator
    /// currents `i` (A).
    #[inline]
    pub fn dc_current(&self, p_in: S, legs: &Legs<S>, i: impl FnOnce() -> Phases<S>) -> S {
        if self.u_dc.value() > 0.0 { p_in / self.u_dc } else { self.link_current(legs, i()) }
    }

    /// [`dc_current`](Self::dc_current) without a link voltage.
    fn link_current(&self, legs: &Legs<S>, i: Phases<S>) -> S {
        let (u, span, zero) = (&self.u, self.u.span(), S::from(0.0));
        let switches = self.gates() == Gates::Switch;
        let full = if self.u_dc.value() > span.value() { self.u_dc } else { span };
        // The currents sum to zero, so a common part of the voltages has no power.
        let apparent = if switches { (u.a - u.c) * i.a + (u.b - u.c) * i.b } else { zero };
        if full.value() > 0.0 { apparent / full - legs.feed(i) + zero } else { zero - legs.feed(i) }
    }
}

impl PlantInputs {
    /// Applies the voltages and gates that a controller commands.
    #[inline]
    pub fn apply(&mut self, Commanded { u, enable, asc }: Commanded) {
        (self.u, self.enable, self.asc) = (u, enable, asc);
    }

    /// What the controller commanded.
    #[inline]
    pub fn commanded(&self) -> Commanded {
        Commanded { u: self.u, enable: self.enable, asc: self.asc }
    }

    /// These inputs with the change `along` of the continuous ones.
    pub fn changing(&self, along: &Self) -> PlantInputs<Dual> {
        self.zip(along, Dual::new)
    }

    /// Inputs at the `share` (0..1) of the straight line from these to those at its `end`; the gates stay.
    pub fn toward(&self, end: &Self, share: f64) -> Self {
        self.zip(end, |a, b| a + (b - a) * share)
    }

    /// Combines each continuous input with the one of `other` by `f`.
    fn zip<T>(&self, other: &Self, f: impl Fn(f64, f64) -> T) -> PlantInputs<T> {
        let (u, v) = (&self.u, &other.u);
        PlantInputs {
            u: Phases { a: f(u.a, v.a), b: f(u.b, v.b), c: f(u.c, v.c) },
            u_dc: f(self.u_dc, other.u_dc),
            tau_load: f(self.tau_load, other.tau_load),
            speed_shaft: f(self.speed_shaft, other.speed_shaft),
            angle_shaft: f(self.angle_shaft, other.angle_shaft),
            enable: self.enable,
            asc: self.asc,
            thermal: self.thermal.zip(&other.thermal, f),
        }
    }
}

/// Outputs, at the end of a communication step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlantOutputs<S = f64> {
    /// Stator currents in A, positive into the machine.
    pub i: Phases<S>,
    /// Mechanical speed in rad/s.
    pub speed: S,
    /// Mechanical angle in rad, not wrapped.
    pub angle: S,
    /// Electrical angle in rad, in (-pi, pi].
    pub theta_e: S,
    /// Electromagnetic torque in N.m.
    pub tau_e: S,
    /// d-axis stator current in A.
    pub i_d: S,
    /// q-axis stator current in A.
    pub i_q: S,
    /// Power between DC link, machine and shaft and torque of the shaft, means over the last step.
    pub powers: Powers<S>,
    /// Energy since the start.
    pub energy: Energy,
    /// Efficiency of the powers.
    pub efficiency: S,
    /// Temperatures in K.
    pub temperatures: Temperatures<S>,
    /// The heat in W among these powers.
    pub heat: Heat<S>,
}

impl PlantOutputs {
    /// Measured values for a controller.
    #[inline]
    pub fn measured(&self) -> Measured {
        Measured { i: self.i, theta_e: self.theta_e, speed: self.speed }
    }

    /// These outputs with other `powers` and their `heat`.
    pub fn with(&self, powers: Powers, heat: Heat) -> Self {
        Self { powers, heat, efficiency: efficiency(powers.p_in, powers.p_mech), ..self.clone() }
    }
}

impl PlantOutputs<Dual> {
    /// The change of the outputs; the energies do not change.
    pub fn change(&self) -> PlantOutputs {
        let Self { i, powers, .. } = self;
        PlantOutputs {
            i: Phases { a: i.a.change, b: i.b.change, c: i.c.change },
            speed: self.speed.change,
            angle: self.angle.change,
            theta_e: self.theta_e.change,
            tau_e: self.tau_e.change,
            i_d: self.i_d.change,
            i_q: self.i_q.change,
            powers: Powers {
                i_dc: powers.i_dc.change,
                p_in: powers.p_in.change,
                p_mech: powers.p_mech.change,
                p_loss: powers.p_loss.change,
                losses: powers.losses.map(|p| p.change),
                tau_shaft: powers.tau_shaft.change,
            },
            energy: Energy::default(),
            efficiency: self.efficiency.change,
            temperatures: self.temperatures.map(|T| T.change),
            heat: self.heat.map(|Q| Q.change),
        }
    }
}
