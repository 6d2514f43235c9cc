//! `PmsmDriveMean` for Model Exchange: the rates of its states; the energies are states too.
//!
//! The ramp follows the speed reference with the bandwidth of the current loop, limited to its rate. Without switching, the
//! model causes no events, and a solver can take long steps while inputs and limits are smooth. The Boolean outputs of the
//! controller change only at the importer's events.

use super::{MeanOutputs, PmsmDriveMean, State};
use crate::pmsm_drive::Means;
use drive_base::math::all_finite;
use drive_control::signals::ControllerOutputs;
use drive_plant::power::{Energy, Powers};
use fmu_core::unit::{AMPERE_PER_S, Exponents, Quantity, RAD_PER_S2, SPEED, Unit, WATT};
use fmu_core::{ContinuousTime, Elapsed, Events, Fault, Next, Outcome, State as Variable};

const NEWTON_METER_PER_S: Quantity = Quantity::new("TorqueRate", Unit::si("N.m/s", Exponents::mechanical(1, 2, -3, 0)));

impl PmsmDriveMean {
    /// The state with the speed reference of the loop, ramped if a ramp is set.
    fn referred(&self) -> State {
        let (speed_ref, ramp) = self.speed_ref();
        State { speed_ref: if ramp > 0.0 { self.state.speed_ref } else { speed_ref }, ..self.state }
    }
}

impl ContinuousTime for PmsmDriveMean {
    const STATES: &'static [Variable<Self>] = &[
        Variable::<Self>::new("tau_lag", &NEWTON_METER_PER_S, |m| &mut m.state.tau),
        Variable::<Self>::new("speed_loop_integral", &AMPERE_PER_S, |m| &mut m.state.integral),
        Variable::<Self>::new("speed_ref_ramp", &RAD_PER_S2, |m| &mut m.state.speed_ref),
        Variable::<Self>::new("speed", &RAD_PER_S2, |m| &mut m.state.speed),
        Variable::<Self>::new("angle", &SPEED, |m| &mut m.state.angle),
        Variable::<Self>::new("energy_in", &WATT, |m| &mut m.energy.r#in),
        Variable::<Self>::new("energy_mech", &WATT, |m| &mut m.energy.mech),
        Variable::<Self>::new("energy_loss", &WATT, |m| &mut m.energy.loss),
        Variable::<Self>::new("energy_source", &WATT, |m| &mut m.link_energy.source),
        Variable::<Self>::new("energy_resistor", &WATT, |m| &mut m.link_energy.resistor),
        Variable::<Self>::new("energy_chopper", &WATT, |m| &mut m.link_energy.chopper),
    ];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        let state = self.referred();
        let rates = self.rates(&state, self.temperatures());
        let speed = self.speed(&state);
        let powers = self.powers_of(&rates.point, speed);
        let (energy, link) = (Energy::from(powers), self.link_powers(powers.p_in));
        let par = &self.drive.controller;
        let (speed_ref, ramp) = self.speed_ref();
        let to = par.current.bandwidth * (speed_ref - self.state.speed_ref);
        let ramp = if ramp > 0.0 { to.clamp(-ramp, ramp) } else { to };
        let [source, resistor, chopper] = [link.source, link.resistor, link.chopper];
        let energies = [energy.r#in, energy.mech, energy.loss, source, resistor, chopper];
        let [a, b, c, d, e, f] = energies;
        let all = [rates.tau, rates.integral, ramp, rates.speed, speed, a, b, c, d, e, f];
        if !all_finite(all) {
            return Err(Fault::new(format!("the drive has no finite derivatives at {speed} rad/s, {} N.m", state.tau)));
        }
        dx.copy_from_slice(&all);
        Ok(())
    }

    fn observe(&self, _now: Elapsed, out: &mut MeanOutputs) {
        let (temperatures, state) = (self.temperatures(), self.referred());
        let point = self.point_at(&state, temperatures);
        self.show(&state, &point, temperatures, out);
        let Powers { p_in, p_mech, p_loss, tau_shaft, .. } = out.drive.plant.powers;
        out.drive.means = Means { p_in, p_mech, p_loss, tau_shaft };
        let ControllerOutputs { enabled, voltage_limited, current_limited, weakens, start_state, .. } = self.held;
        let now = self.controller(&state, &point);
        out.drive.controller =
            ControllerOutputs { enabled, voltage_limited, current_limited, weakens, start_state, ..now };
    }
}

impl Events for PmsmDriveMean {
    fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
        self.follow();
        let state = self.referred();
        self.leave(&state);
        self.point = self.point_at(&state, self.temperatures());
        self.known = false;
        self.settle();
        self.watch_voltage(self.voltage(self.point.powers.p_in));
        self.follow();
        let state = self.referred();
        self.held = self.controller(&state, &self.point_at(&state, self.temperatures()));
        Ok(Outcome::default())
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}
