//! A communication step of the switched inverter: from instant to instant.

use super::bridge::{Command, Leg};
use super::carrier::Carrier;
use super::segment::{Point, Voltages};
use crate::inverter::{Gates, Inverter};
use crate::model::PmsmPlant;
use fmu_core::{Fault, Step};
use serde::{Deserialize, Serialize};

/// Instants closer than this share of a carrier period are the same instant.
const SAME: f64 = 1e-9;

/// Current that counts as zero, as a share of what the link drives through the machine in a carrier period.
const TINY: f64 = 1e-12;

/// State of carrier and legs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bridge {
    carrier: Carrier,
    legs: [Leg; 3],
}

impl Bridge {
    /// Commands the legs at the time `at` (s) since the carrier's last extreme; returns the time (s) until the next command.
    #[inline]
    fn command(&mut self, inverter: &Inverter, gates: Gates, at: f64) -> f64 {
        let mut next = f64::INFINITY;
        for x in 0..3 {
            let command = match gates {
                Gates::Switch => {
                    let (on, left) = self.carrier.command(x, at, 0.5 * inverter.T_pwm);
                    next = next.min(left);
                    if on { Command::Upper } else { Command::Lower }
                }
                Gates::Short => Command::Lower,
                Gates::Off => Command::Off,
            };
            self.legs[x].command(command, inverter.dead_time);
            if self.legs[x].wait > 0.0 {
                next = next.min(self.legs[x].wait);
            }
        }
        next
    }

    /// Passes `t` (s).
    #[inline]
    fn pass(&mut self, t: f64, same: f64) {
        for leg in &mut self.legs {
            let left = leg.wait - t;
            leg.wait = if left > same { left } else { 0.0 };
        }
    }
}

impl PmsmPlant {
    /// The voltages of the legs at a point.
    fn voltages(&self, legs: &[Leg; 3], at: &Point, tiny: f64) -> Voltages {
        let bounds = [0, 1, 2].map(|x| legs[x].bounds(self.inputs.u_dc));
        let mut voltages = Voltages { bounds, sides: [1; 3] };
        if voltages.any_depends() {
            voltages.sides = self.response_at(at).sides(bounds, tiny);
        }
        voltages
    }

    /// A communication step with the switched inverter.
    #[inline(never)]
    pub(crate) fn advance_switched(&mut self, step: &Step) -> Result<(), Fault> {
        let (state, mut passed) = self.at_the_shaft();
        let (inverter, gates) = (&self.parameters.inverter, self.inputs.gates());
        let (u, u_dc, half) = (self.inputs.u, self.inputs.u_dc, 0.5 * inverter.T_pwm);
        self.count(step.h, 0.25 * half, state.speed)?;
        let (mut bridge, mut at) = (self.bridge.clone(), self.point(&state));
        let (same, tiny) = (SAME * half, TINY * u_dc * inverter.T_pwm / self.warm.least_inductance);
        let (mut time, mut left) = (bridge.carrier.place(inverter, step.start, u, u_dc), step.h);
        while left > 1e-9 * step.h {
            time = bridge.carrier.pass(inverter, time, u, u_dc);
            let next = bridge.command(inverter, gates, time).min(half - time);
            let voltages = self.voltages(&bridge.legs, &at, tiny);
            let h = if next > left - same { left } else { next };
            let (h, energy) = self.travel(&mut at, h, &voltages, tiny);
            if self.is_too_fast(at.speed) {
                break;
            }
            passed.add(&energy);
            bridge.pass(h, same);
            (time, left) = (time + h, left - h);
        }
        self.bridge = bridge;
        let (state, legs) = (at.state(self), self.legs(&self.inputs));
        self.conclude(step.h, state, &passed, false, &legs)
    }
}
