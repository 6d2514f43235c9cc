//! `MappedDrive` for Model Exchange: the rates of its states; the energies are states too, and the ramp follows the speed
//! reference as in `PmsmDriveMean`.

use super::state::{MappedDrive, MappedOutputs, State};
use drive_base::math::all_finite;
use fmu_core::unit::{Exponents, PER_SECOND, Quantity, RAD_PER_S2, SPEED, Unit, WATT};
use fmu_core::{ContinuousTime, Elapsed, Events, Fault, Next, Outcome, State as Variable};

const NEWTON_METER_PER_S: Quantity = Quantity::new("TorqueRate", Unit::si("N.m/s", Exponents::mechanical(1, 2, -3, 0)));

impl MappedDrive {
    /// The state with the speed reference of the loop, ramped if a ramp is set.
    fn referred(&self) -> State {
        let ramp = self.speed_loop.ramp > 0.0;
        State { speed_ref: if ramp { self.state.speed_ref } else { self.inputs.speed_ref }, ..self.state }
    }
}

impl ContinuousTime for MappedDrive {
    const STATES: &'static [Variable<Self>] = &[
        Variable::<Self>::new("tau_lag", &NEWTON_METER_PER_S, |m| &mut m.state.tau),
        Variable::<Self>::new("speed_loop_integral", &NEWTON_METER_PER_S, |m| &mut m.state.integral),
        Variable::<Self>::new("speed_ref_ramp", &RAD_PER_S2, |m| &mut m.state.speed_ref),
        Variable::<Self>::new("speed", &RAD_PER_S2, |m| &mut m.state.speed),
        Variable::<Self>::new("angle", &SPEED, |m| &mut m.state.angle),
        Variable::<Self>::new("overload", &PER_SECOND, |m| &mut m.state.overload),
        Variable::<Self>::new("energy_in", &WATT, |m| &mut m.energy.r#in),
        Variable::<Self>::new("energy_mech", &WATT, |m| &mut m.energy.mech),
        Variable::<Self>::new("energy_loss", &WATT, |m| &mut m.energy.loss),
    ];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        let state = self.referred();
        let rates = self.rates(&state);
        let speed = self.speed(&state);
        let powers = self.instant(&state, &rates.point);
        let to = self.bandwidth * (self.inputs.speed_ref - self.state.speed_ref);
        let ramp = self.speed_loop.ramp;
        let ramp = if ramp > 0.0 { to.clamp(-ramp, ramp) } else { to };
        let energy = [powers.p_in, powers.p_mech, powers.p_loss];
        let all =
            [rates.tau, rates.integral, ramp, rates.speed, speed, rates.overload, energy[0], energy[1], energy[2]];
        if !all_finite(all) {
            return Err(Fault::new(format!("the drive has no finite derivatives at {speed} rad/s, {} N.m", state.tau)));
        }
        dx.copy_from_slice(&all);
        Ok(())
    }

    fn observe(&self, _now: Elapsed, out: &mut MappedOutputs) {
        let state = self.referred();
        self.show(&state, &self.instant(&state, &self.point(&state)), out);
    }
}

impl Events for MappedDrive {
    fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
        self.take_up();
        Ok(Outcome::default())
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}
