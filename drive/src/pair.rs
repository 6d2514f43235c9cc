//! Plant and controller as a pair. They exchange values as an importer does: read all outputs, set all inputs, step both
//! (Jacobi). The packed FMUs must match this native reference bit for bit.

use drive_control::model::SensorlessController;
use drive_plant::PmsmPlant;
use drive_plant::pwm::InverterMode;
use fmu_core::{Block, Elapsed, Fault, Model, Step};
use serde::{Deserialize, Serialize};

/// Smallest plausible `inverter.i_zero`, as a share of the current limit: a tenth of the rule of `fmu tune`.
const NARROW: f64 = 0.002;
/// Largest plausible ratio between the zones of the inverter and of the controller.
const APART: f64 = 2.0;

/// The closed loop of plant and controller.
#[derive(Clone, Default, Serialize, Deserialize)]
pub struct Pair {
    /// Inverter, machine and mechanics.
    pub plant: Block<PmsmPlant>,
    /// The digital controller.
    pub controller: Block<SensorlessController>,
    /// Time since the start.
    pub now: Elapsed,
}

impl Pair {
    /// Sets the parameters and starts both.
    ///
    /// # Errors
    /// Those of [`Model::validate`] of either model.
    pub fn start(&mut self) -> Result<(), Fault> {
        self.initialize();
        self.plant.model.validate()?;
        self.controller.model.validate()
    }

    /// Sets state and outputs of both to those at the start.
    pub fn initialize(&mut self) {
        self.now = Elapsed::ZERO;
        self.plant.initialize();
        self.controller.initialize();
    }

    /// External inputs: speed reference (rad/s), load torque (N.m), DC-link voltage of both (V).
    pub fn set_inputs(&mut self, speed_ref: f64, tau_load: f64, u_dc: f64) {
        self.controller.model.inputs.speed_ref = speed_ref;
        self.controller.model.inputs.u_dc = u_dc;
        self.plant.model.inputs.tau_load = tau_load;
        self.plant.model.inputs.u_dc = u_dc;
    }

    /// Why some of the controller's commands never reach the machine: the carrier takes over fewer than the controller gives.
    pub(crate) fn skips_commands(&self) -> Option<String> {
        let (plant, T_s) = (&self.plant.model.parameters, self.controller.model.parameters.T_s);
        let period = plant.inverter.update_period().filter(|period| *period > T_s * (1.0 + 1e-9))?;
        let T_pwm = plant.inverter.T_pwm;
        Some(format!(
            "plant.inverter.T_pwm = {T_pwm} s: the carrier takes over a command every {period} s, and the controller gives one every \
             {T_s} s (controller.T_s), so commands are lost; set plant.inverter.T_pwm to at most {} s",
            T_pwm / period * T_s
        ))
    }

    /// Why `inverter.i_zero` is wrong in [`InverterMode::Average`]: too small for the drive, or different from the zone that the
    /// controller compensates.
    pub(crate) fn wrong_zone(&self) -> Option<String> {
        let (inverter, par) = (&self.plant.model.parameters.inverter, &self.controller.model.parameters);
        let (i_zero, limit, compensated) = (inverter.i_zero, par.limit.i, par.compensation.i_zero);
        if inverter.pwm.mode != InverterMode::Average || inverter.dead_time == 0.0 || i_zero == 0.0 {
            return None;
        }
        if i_zero < NARROW * limit {
            let (share, proposed) = (100.0 * i_zero / limit, 0.02 * limit);
            return Some(format!(
                "plant.inverter.i_zero = {i_zero} A is {share:.2} % of controller.limit.i = {limit} A: at light load, the dead time costs more \
                 voltage than on a real inverter, and the simulation is slow; set plant.inverter.i_zero and \
                 controller.compensation.i_zero to about {proposed} A (2 %), or plant.inverter.i_zero to 0 for the zone of the ripple"
            ));
        }
        let differs = compensated < i_zero / APART || compensated > i_zero * APART;
        (par.compensation.u_dead > 0.0 && differs).then(|| {
            format!(
                "controller.compensation.i_zero = {compensated} A differs from plant.inverter.i_zero = {i_zero} A: the controller compensates \
                 for a different inverter, and at light load the current oscillates or the estimated speed is wrong; set both to the \
                 same value"
            )
        })
    }

    /// One communication step of `h` (s): exchanges values, then advances both.
    ///
    /// # Errors
    /// Those of [`Model::advance`] of either model.
    #[inline]
    pub fn step(&mut self, h: f64) -> Result<(), Fault> {
        self.exchange();
        self.advance(h)?;
        self.output();
        Ok(())
    }

    /// Passes the outputs of each to the other.
    #[inline]
    pub(crate) fn exchange(&mut self) {
        let Self { plant, controller, .. } = self;
        plant.model.inputs.apply(controller.out.commanded());
        controller.model.inputs.measure(plant.out.measured());
    }

    /// Passes the present outputs while the blocks still contain older ones.
    #[inline]
    pub(crate) fn exchange_present(&mut self) {
        let Self { plant, controller, .. } = self;
        plant.model.inputs.apply(controller.model.shown().commanded());
        controller.model.inputs.measure(plant.model.measured());
    }

    /// Sets the voltage `u_dc` (V) of the link, and whether the controller operates, from this instant on.
    #[inline]
    pub(crate) fn supply(&mut self, u_dc: f64, enable: bool) {
        let controller = &mut self.controller.model.inputs;
        (controller.u_dc, controller.enable) = (u_dc, enable);
        self.plant.model.inputs.u_dc = u_dc;
    }

    /// Advances both by `h` (s); the outputs stay.
    ///
    /// # Errors
    /// Those of [`Model::advance`] of either model.
    #[inline]
    pub(crate) fn advance(&mut self, h: f64) -> Result<(), Fault> {
        let step = Step { start: self.now, h };
        self.plant.model.advance(&step)?;
        self.controller.model.advance(&step)?;
        self.now = step.end();
        Ok(())
    }

    /// Computes the outputs of both.
    #[inline]
    pub(crate) fn output(&mut self) {
        let Self { plant, controller, now } = self;
        plant.model.output(*now, &mut plant.out);
        controller.model.output(*now, &mut controller.out);
    }
}
