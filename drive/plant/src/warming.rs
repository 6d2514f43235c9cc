//! Temperatures in [`PmsmPlant`]: constant over a step, with changes at its ends.
//!
//! A step begins with the imposed temperatures and ends with the network's. In Model Exchange, the imposed
//! temperatures act at once, and the derivatives depend on them.

use crate::losses::Losses;
use crate::machine::{Inverse, Machine};
use crate::model::PmsmPlant;
use crate::rules;
use crate::signals::PlantInputs;
use crate::tables::{PARAMETERS, PlantParameters};
use crate::thermal::warm::{LONGEST_STEP, Warm};
use crate::thermal::{Heat, Temperatures, ThermalMode};
use drive_base::motor::Motor;
use fmu_core::{Fault, Interface, Scalar};

/// Remedy if the temperatures of the network leave their valid range.
const RUNAWAY: &str = "the network became too hot; reduce the current, or raise thermal.G_ws and thermal.G_sc: at constant \
                       current, the winding runs away where winding.alpha p_cu(T_ref) (1/G_ws + 1/G_sc) reaches 1";

/// Integration step as a share of the shortest time constant: the local error of a decay is 2e-5 of it.
const SHARE_OF_TIME: f64 = 0.3;

impl PmsmPlant {
    /// The temperatures (K) under these `inputs`.
    #[inline]
    pub fn temperatures<S: Scalar>(&self, inputs: &PlantInputs<S>) -> Temperatures<S> {
        if self.parameters.thermal.mode == ThermalMode::Imposed {
            return inputs.thermal.imposed;
        }
        self.warm.at.map(S::from)
    }

    /// The machine under these `inputs`.
    #[inline]
    pub(crate) fn motor<S: Scalar>(&self, inputs: &PlantInputs<S>) -> Motor<S> {
        if self.parameters.thermal.mode == ThermalMode::Imposed {
            return self.parameters.thermal.motor(&self.parameters.motor, &inputs.thermal.imposed);
        }
        let Motor { n_p, R_s, L_d, L_q, psi_M } = self.warm.motor;
        Motor { n_p, R_s: R_s.into(), L_d, L_q, psi_M: psi_M.into() }
    }

    /// The machine at its temperatures.
    #[expect(clippy::inline_always, reason = "the compiler would call it")]
    #[inline(always)]
    pub(crate) fn machine<const LINEAR: bool>(&self) -> Machine<'_, f64, LINEAR> {
        Machine::with(&self.warm.motor, self.parameters.magnetics(), self.warm.inverse)
    }

    /// The machine of [`motor`](Self::motor); the inductances do not depend on the temperature.
    #[inline]
    pub(crate) fn machine_of<S: Scalar>(&self, motor: &Motor<S>) -> Machine<'_, S> {
        Machine::with(motor, self.parameters.magnetics(), self.warm.inverse)
    }

    /// The heat (W) of these `losses` (W) at the temperatures `at` (K) under these `inputs`.
    #[inline]
    pub fn heat<S: Scalar>(&self, inputs: &PlantInputs<S>, at: &Temperatures<S>, losses: &Losses<S>) -> Heat<S> {
        self.parameters.thermal.heat_at(inputs.thermal.coolant, at, losses)
    }

    /// Sets the temperatures (K) of the parts.
    pub(crate) fn take(&mut self, at: Temperatures) {
        let motor = self.parameters.thermal.motor(&self.parameters.motor, &at);
        let (inverse, ideal) = (Inverse::of(&motor), self.parameters.is_ideal());
        let longest = self.longest_step(&motor);
        self.warm = Warm { at, motor, inverse, longest, ideal, ..self.warm };
    }

    /// Maximum integration step in s for this machine: [`LONGEST_STEP`], or a share of its shortest time constant, which is L/R, J/B or the
    /// reciprocal of the frequency at which inertia and inductance exchange energy.
    fn longest_step(&self, motor: &Motor) -> f64 {
        let (PlantParameters { mechanics, inverter, .. }, L) = (&self.parameters, self.warm.least_inductance);
        let devices = &inverter.devices;
        let R = motor.R_s + devices.r_transistor.max(devices.r_diode);
        let exchange = f64::from(motor.n_p) * motor.psi_M * (1.5 / (mechanics.J * L)).sqrt();
        let mechanical = if mechanics.imposed { 0.0 } else { exchange.max(mechanics.B / mechanics.J) };
        LONGEST_STEP.min(SHARE_OF_TIME / mechanical.max(R / L))
    }

    /// The temperatures (K) given by parameters and `inputs`, and the names of the temperatures of winding and magnets.
    fn given(&self, inputs: &PlantInputs) -> (Temperatures, [&'static str; 2]) {
        match self.parameters.thermal.mode {
            ThermalMode::Imposed => (inputs.thermal.imposed, ["T_winding_imposed", "T_magnet_imposed"]),
            _ => (Temperatures::all(self.parameters.thermal.T_start), ["thermal.T_start"; 2]),
        }
    }

    /// Sets the temperatures at the start.
    pub(crate) fn start_temperatures(&mut self) {
        self.warm.least_inductance = self.parameters.least_inductance();
        self.take(self.given(&self.inputs).0);
    }

    /// Applies the imposed temperatures at the beginning of a step.
    #[inline(never)]
    pub(crate) fn impose(&mut self) -> Result<(), Fault> {
        let at = self.inputs.thermal.imposed;
        if at != self.warm.at {
            self.check_temperatures(&self.inputs)?;
            self.change(at);
        }
        Ok(())
    }

    /// Advances the network by a step of `h` (s) with its mean losses.
    #[inline(never)]
    pub(crate) fn warm_up(&mut self, h: f64) -> Result<(), Fault> {
        let thermal = &self.parameters.thermal;
        let heat = thermal.heat(&self.powers.losses);
        let at = thermal.network.step(&self.warm.at, &heat, self.inputs.thermal.coolant, h);
        rules::check_temperatures(&self.parameters, &at, ["T_winding", "T_magnet"], RUNAWAY)?;
        self.change(at);
        Ok(())
    }

    /// Changes the temperatures (K) between two steps. The flux linkage cannot jump, but while the diodes block it equals the
    /// magnets'.
    fn change(&mut self, at: Temperatures) {
        self.take(at);
        if self.blocked {
            self.state.psi = self.idle_flux(&self.warm.motor, self.state.speed);
        }
    }

    /// Refuses impossible temperatures.
    pub(crate) fn check_temperatures(&self, inputs: &PlantInputs) -> Result<(), Fault> {
        let (at, names) = self.given(inputs);
        let remedy = "temperatures are in K (20 degC are 293.15 K); correct the temperature or the coefficient";
        rules::check_temperatures(&self.parameters, &at, names, remedy)
    }

    /// Refuses the network in Model Exchange.
    pub(crate) fn validate_network(&self, interface: Interface) -> Result<(), Fault> {
        if interface != Interface::ModelExchange || self.parameters.thermal.mode != ThermalMode::Network {
            return Ok(());
        }
        let allowed = "1 (Constant) or 3 (Imposed) in Model Exchange: the network advances with the steps of \
                       Co-Simulation; use Co-Simulation, or connect a thermal model to the inputs T_winding_imposed ... \
                       with thermal.mode = 3";
        Err(PARAMETERS.fault(&self.parameters, |p| &mut p.thermal.mode, allowed))
    }
}
