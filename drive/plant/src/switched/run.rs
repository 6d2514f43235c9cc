//! A communication step of the switched inverter: from instant to instant.

use super::bridge::{Command, DIRECTIONS, Way, Ways};
use super::segment::{Point, Voltages};
use super::state::Signals;
use crate::losses::switching;
use crate::model::PmsmPlant;
use crate::tables::PARAMETERS;
use crate::thermal::ThermalMode;
use drive_base::frame::AlphaBeta;
use fmu_core::{Fault, Step};

/// Instants closer than this share of a carrier period are the same instant.
const SAME: f64 = 1e-9;

/// Maximum number of zero crossings between two instants; then the legs keep their sides: it bounds the work of a step.
const MOST_SEARCHES: u32 = 32;

/// Current that counts as zero, as a share of what the link drives through the machine in a carrier period.
const TINY: f64 = 1e-12;

impl PmsmPlant {
    /// The maximum derivative (A/s) of a current.
    fn steepest(&self, at: &Point, i: AlphaBeta) -> f64 {
        let machine = self.machine::<false>();
        let (w, sum) = (machine.electrical(at.speed).abs(), |v: AlphaBeta| v.alpha().abs() + v.beta().abs());
        (self.inputs.u_dc + machine.resistance() * sum(i) + w * sum(at.psi)) / self.warm.least_inductance + w * sum(i)
    }

    /// The voltages of the legs at a point, where some depend on the current.
    #[inline(never)]
    pub(super) fn dependent(&self, ways: [[Way; 2]; 3], at: &Point, tiny: f64) -> Voltages {
        // The drop of the other legs, from the signs of their currents.
        let i = self.current_at(at);
        let signs = DIRECTIONS.map(|n| if n.dot(i) < 0.0 { -1 } else { 1 });
        let response = self.response_at(at, Some(&Voltages::watched(ways, signs).drop()));
        let (bounds, depends) = (ways.map(|ways| ways.map(|way| way.u)), ways.map(|[a, b]| a != b));
        Voltages::watched(ways, response.sides(bounds, depends, tiny))
    }

    /// A communication step with the switched inverter.
    pub(crate) fn advance_switched(&mut self, step: &Step) -> Result<(), Fault> {
        self.advance_bridge(step, Signals::Inputs(self.inputs.gates()))
    }

    /// Advances by a step in which the gates are given instead of the voltage references: the commands of the legs last for the
    /// step. `inverter.dead_time` has no effect: the dead time is what the commands leave. The inputs `u_a`, `u_b`, `u_c`,
    /// `enable` and `asc` have no effect either.
    ///
    /// # Errors
    /// `inverter.mode` is not Switched; or those of [`advance`](fmu_core::Model::advance).
    pub fn advance_gates(&mut self, step: &Step, commands: [Command; 3]) -> Result<(), Fault> {
        if !self.parameters.is_switched() {
            let allowed = "2 (Switched) with gate signals";
            return Err(PARAMETERS.fault(&self.parameters, |p| &mut p.inverter.pwm.mode, allowed));
        }
        let advance = |plant: &mut Self| plant.advance_bridge(step, Signals::Given(commands));
        if self.parameters.thermal.mode == ThermalMode::Constant {
            advance(self)
        } else {
            self.with_temperatures(step.h, advance)
        }
    }

    /// Current (A) that counts as zero.
    pub(super) fn tiny(&self) -> f64 {
        TINY * self.inputs.u_dc * self.parameters.inverter.T_pwm / self.warm.least_inductance
    }

    /// A step with the switched inverter and these signals. An instant at which no leg changes its voltage does not interrupt the
    /// integration: with a dead time, half of them.
    #[inline(never)]
    fn advance_bridge(&mut self, step: &Step, signals: Signals) -> Result<(), Fault> {
        let (state, mut passed) = self.at_the_shaft();
        let inverter = &self.parameters.inverter;
        let (u, u_dc, half) = (self.inputs.u, self.inputs.u_dc, 0.5 * inverter.T_pwm);
        self.count(step.h, 0.25 * half, state.speed)?;
        let (mut bridge, mut at) = (self.bridge.clone(), self.point(&state));
        let (same, tiny) = (SAME * half, self.tiny());
        if let Some(x) = inverter.pwm.open_phase.leg() {
            let lost = self.end_current(&mut at, x);
            passed.energy.loss += lost;
            passed.losses.cu += lost;
        }
        // Energy in J per ampere that a leg loses when its current changes the rail.
        let commutation = half * switching::per_ampere(&inverter.devices, inverter.T_pwm, u_dc);
        let (mut time, mut left) = (bridge.carrier.locate(inverter, step.start, u, u_dc), step.h);
        let mut i = self.current_at(&at);
        let mut steepest = self.steepest(&at, i);
        let ways = Ways::new(inverter, u_dc);
        // Time not yet integrated, in s, and its voltages.
        let (mut pending, mut numbers, mut due) = (0.0, None, [0.0; 3]);
        let mut searches = MOST_SEARCHES;
        let mut voltages = Voltages::fixed([Way { rail: 0.0, u: 0.0, r: 0.0 }; 3]);
        loop {
            let over = left <= 1e-9 * step.h || self.is_too_fast(at.speed);
            if time >= half - same && !over {
                time = bridge.carrier.pass(inverter, time, u, u_dc);
                due = [0.0; 3];
            }
            let next = if over { 0.0 } else { bridge.command(inverter, signals, time, &mut due).min(half - time) };
            let h = if next > left - same { left } else { next };
            let mut found = ways.numbers(&bridge.legs, i, steepest * (pending + h));
            if pending > 0.0 && (over || found != numbers) {
                passed.add(&self.travel(&mut at, pending, &voltages, (tiny, true)).1);
                (pending, i) = (0.0, self.current_at(&at));
                steepest = self.steepest(&at, i);
                found = ways.numbers(&bridge.legs, i, steepest * h);
            }
            if over {
                break;
            }
            if found.is_none() || found != numbers {
                voltages = match found {
                    Some(numbers) => Voltages::fixed(ways.numbered(numbers)),
                    None => self.dependent(ways.at(&bridge.legs), &at, tiny),
                };
                numbers = found;
                let lost = commutation * bridge.commutated(voltages.at_upper_rails(), i);
                passed.energy.r#in += lost;
                passed.energy.loss += lost;
                passed.losses.sw += lost;
            }
            let h = if numbers.is_some() {
                pending += h;
                h
            } else {
                let (done, energy) = self.travel(&mut at, h, &voltages, (tiny, searches > 0));
                searches = if done < h { searches - 1 } else { MOST_SEARCHES };
                let h = done;
                passed.add(&energy);
                i = self.current_at(&at);
                steepest = self.steepest(&at, i);
                h
            };
            bridge.pass(h, same, &mut due);
            (time, left) = (time + h, left - h);
        }
        self.bridge = bridge;
        let (state, legs) = (at.state(self), self.legs(&self.inputs));
        self.conclude(step.h, state, &passed, false, &legs)
    }
}
