//! `PmsmPlant` for Model Exchange: its states, their derivatives and tangents, and the events of blocking diodes.
//!
//! In the rotor frame, d psi_d/dt = u_d - R_s i_d + w psi_q and d psi_q/dt = u_q - R_s i_q - w psi_d, from the same
//! equations as a step of [`PmsmPlant`]. They are continuous in states and inputs, with kinks at the hexagon limit and at
//! the edges of the dead-time zone. With an imposed shaft, speed_shaft and angle_shaft replace the two mechanical states;
//! the stator flux linkage stays in the rotor frame, so angle_shaft must be the integral of speed_shaft between events.
//!
//! The energies are counted over completed steps of the solver ([`counters`](crate::counters)). Above the speed of any machine
//! there are no derivatives, so the solver tries a shorter step.
//!
//! Whether the diodes block is decided in events only. While they block, the current is zero. Two indicators mark when
//! blocking begins or ends: the maximum current divided by the zone of [`legs`](crate::legs), and the line-to-line back EMF
//! divided by the DC-link voltage, both minus 1.

use crate::circuit::{Circuit, Rates, blocked_rates};
use crate::losses::flow::Path;
use crate::machine;
use crate::mechanics::{Shaft, Standstill};
use crate::model::PmsmPlant;
use crate::power::Powers;
use crate::signals::{PlantInputs, PlantOutputs};
use crate::state::Instant;
use crate::tables::PlantParameters;
use crate::thermal::ThermalMode;
use drive_base::connection::Measured;
use drive_base::frame::{Axis, Phases, Rotor, Vector};
use drive_base::math::wrap;
use fmu_core::unit::{RAD_PER_S2, SPEED, VOLT};
use fmu_core::{
    Account, CompletedSteps, ContinuousTime, Differentiable, Dual, Elapsed, Events, Fault, Indicator, Next, Outcome,
    Scalar, State,
};

/// Shift of the indicators toward the decision of the last event, so that none stays at 0.
const SHIFT: f64 = 1e-9;

impl PmsmPlant {
    /// The instant of flux linkage (Wb), speed (rad/s) and angle (rad) under these `inputs`, as the equations use it.
    #[inline]
    fn instant<S: Scalar>(&self, inputs: &PlantInputs<S>, (psi, speed, angle): (Vector<Rotor, S>, S, S)) -> Instant<S> {
        let PlantParameters { mechanics, iron, thermal, .. } = &self.parameters;
        let motor = &self.motor(inputs);
        let theta = |angle: S| angle * f64::from(motor.n_p);
        let (speed, angle, axis) = if mechanics.imposed {
            (inputs.speed_shaft, inputs.angle_shaft, Axis::at(theta(inputs.angle_shaft)))
        } else {
            (speed, angle, self.state.axis.with(theta(angle)))
        };
        let idle = self.idles(inputs);
        // The flux linkage then follows the speed, through the iron, and the temperature of the magnets.
        let follows = idle && !(iron.is_none() && thermal.mode != ThermalMode::Imposed);
        let psi = if follows { self.idle_flux(motor, speed) } else { psi };
        let i = if idle { self.idle_current(motor, speed) } else { self.machine_of(motor).current(psi) };
        Instant { psi, i, speed, angle, axis, idle }
    }

    /// The present instant under these `inputs`.
    #[inline]
    fn present(&self, inputs: &PlantInputs) -> Instant {
        self.instant(inputs, (self.state.psi, self.state.speed, self.state.angle))
    }

    /// The present instant and its change `along` the change of `inputs` and states.
    fn changing(&self, inputs: &PlantInputs<Dual>, along: &Self) -> Instant<Dual> {
        let (x, v) = (&self.state, &along.state);
        let psi = Vector::new(Dual::new(x.psi.d(), v.psi.d()), Dual::new(x.psi.q(), v.psi.q()));
        self.instant(inputs, (psi, Dual::new(x.speed, v.speed), Dual::new(x.angle, v.angle)))
    }

    /// Derivatives and powers at an instant.
    #[expect(clippy::inline_always, reason = "the derivatives need half of it")]
    #[inline(always)]
    pub(super) fn rates<S: Scalar>(&self, inputs: &PlantInputs<S>, at: &Instant<S>) -> Rates<S> {
        let mechanics = &self.parameters.mechanics;
        let machine = self.machine_of(&self.motor(inputs));
        let shaft = Shaft::new(mechanics, inputs.tau_load, Standstill::new(mechanics, at.speed.value()));
        if at.idle {
            return blocked_rates(&machine, &shaft, at.psi, at.i, at.speed);
        }
        if self.parameters.is_switched() {
            return self.switched_rates(inputs, (machine, shaft), at);
        }
        let path = Path {
            u: inputs.voltage(self.parameters.inverter.pwm.modulation.mode),
            dissipation: self.parameters.dissipation(machine.resistance(), machine.electrical(at.speed)),
            drops: self.switches(inputs, self.legs(inputs)),
        };
        let psi = machine.to_stator(at.axis, at.psi);
        Circuit { machine, path, shaft }.rates(at.axis, psi, at.speed)
    }

    /// The derivatives of the states at an instant.
    #[inline]
    fn slopes<S: Scalar>(&self, inputs: &PlantInputs<S>, at: &Instant<S>) -> [S; 4] {
        let rates = self.rates(inputs, at);
        let w = at.speed * f64::from(self.parameters.motor.n_p);
        let d_psi = if at.idle {
            Vector::fixed(Vector::ZERO)
        } else {
            at.axis.from_stator(rates.d_psi) - at.psi.turned().scaled(w)
        };
        [d_psi.d(), d_psi.q(), rates.acceleration, at.speed]
    }

    /// The outputs at an instant, with instantaneous powers.
    fn outputs<S: Scalar>(&self, inputs: &PlantInputs<S>, at: &Instant<S>) -> PlantOutputs<S> {
        let Rates { p_in, losses, tau_given, i, .. } = self.rates(inputs, at);
        let tau_shaft = self.parameters.mechanics.tau_shaft(tau_given, inputs.tau_load);
        let p_mech = tau_shaft * at.speed;
        let i = if self.parameters.iron.is_none() { at.i } else { at.axis.from_stator(i) };
        // -0 W, the product of no current and a negative voltage, is 0 W.
        let p_in = p_in + 0.0.into();
        let currents = || Phases::from_stator(at.axis.to_stator(i));
        let i_dc = inputs.dc_current(p_in, &self.legs(inputs), currents);
        let powers = Powers { i_dc, p_in, p_mech, p_loss: losses.sum(), losses, tau_shaft };
        self.shown(inputs, at, i, self.temperatures(inputs), powers)
    }

    /// [`ContinuousTime::derivatives`] under these `inputs`.
    ///
    /// # Errors
    /// Those of [`ContinuousTime::derivatives`]: the shaft is too fast, or a derivative is not finite.
    pub fn derivatives_under(&self, inputs: &PlantInputs, dx: &mut [f64]) -> Result<(), Fault> {
        let at = self.present(inputs);
        if self.is_too_fast(at.speed) {
            let (speed, fastest) = (at.speed, self.fastest());
            return Err(Fault::new(format!(
                "the shaft turns at {speed} rad/s, beyond the {fastest} rad/s of any machine: there are no derivatives"
            )));
        }
        let slopes = self.slopes(inputs, &at);
        if !drive_base::math::all_finite(slopes) {
            return Err(Fault::new(format!("the machine has no finite derivatives at {}", self.state.described())));
        }
        dx.copy_from_slice(&slopes);
        Ok(())
    }

    /// [`ContinuousTime::observe`] under these `inputs`.
    pub fn outputs_under(&self, inputs: &PlantInputs) -> PlantOutputs {
        self.outputs(inputs, &self.present(inputs))
    }

    /// The measurements of a controller's sensors under these `inputs`: the same as in the outputs, to the last bit.
    pub fn measured_under(&self, inputs: &PlantInputs) -> Measured {
        let at = self.present(inputs);
        let theta_e = wrap(at.angle * f64::from(self.parameters.motor.n_p));
        let iron = !self.parameters.iron.is_none();
        let i = if iron { at.axis.from_stator(self.rates(inputs, &at).i) } else { at.i };
        Measured { i: Phases::from_stator(at.axis.to_stator(i)), theta_e, speed: at.speed }
    }

    /// [`Differentiable::tangent`] under these changing `inputs`.
    pub fn tangent_under(&self, inputs: &PlantInputs<Dual>, along: &Self, dx: &mut [f64]) -> PlantOutputs {
        let at = self.changing(inputs, along);
        dx.copy_from_slice(&self.slopes(inputs, &at).map(|slope| slope.change));
        self.outputs(inputs, &at).change()
    }

    /// [`Events::indicators`] under these `inputs`.
    pub fn indicators_under(&self, inputs: &PlantInputs, z: &mut [f64]) {
        if self.parameters.is_switched() {
            return self.leg_indicators(inputs, &self.present(inputs), z);
        }
        z.fill(1.0);
        if !inputs.is_off() {
            return;
        }
        let shift = if self.blocked { -SHIFT } else { SHIFT };
        for (z, excess) in z.iter_mut().zip(self.diodes(inputs).1) {
            let shifted = excess + shift;
            *z = if shifted == 0.0 { shift } else { shifted };
        }
    }

    /// Whether no current flows at the terminals.
    #[inline]
    pub(super) fn idles<S: Scalar>(&self, inputs: &PlantInputs<S>) -> bool {
        if self.parameters.is_switched() { self.rests(inputs.u_dc.value()) } else { self.blocked && inputs.is_off() }
    }

    /// Whether the gates are off and the diodes block the current of the flux linkage.
    pub(super) fn blocks(&self, inputs: &PlantInputs) -> bool {
        inputs.is_off() && !self.parameters.is_switched() && self.diodes(inputs).0
    }

    /// Whether diodes block the current of the flux linkage, and by how much the limits are exceeded.
    fn diodes(&self, inputs: &PlantInputs) -> (bool, [f64; 2]) {
        let motor = &self.motor(inputs);
        let Instant { psi, speed, axis, .. } = self.present(inputs);
        let idle = self.idle_current(motor, speed);
        let (legs, i) = (self.legs(inputs), machine::current(motor, self.parameters.magnetics(), psi) - idle);
        let w = f64::from(motor.n_p) * speed;
        (legs.block(motor, axis, i, w), legs.excess(motor, axis, i, w))
    }
}

impl ContinuousTime for PmsmPlant {
    const STATES: &'static [State<Self>] = &[
        State::<Self>::new("psi_d", &VOLT, |m| m.state.psi.parts_mut().0).reinit(),
        State::<Self>::new("psi_q", &VOLT, |m| m.state.psi.parts_mut().1).reinit(),
        State::<Self>::new("speed", &RAD_PER_S2, |m| &mut m.state.speed).reinit(),
        State::<Self>::new("angle", &SPEED, |m| &mut m.state.angle).reinit(),
    ];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        self.derivatives_under(&self.inputs, dx)
    }

    fn settle(&mut self) {
        self.state.axis = Axis::at(f64::from(self.parameters.motor.n_p) * self.state.angle);
    }

    fn observe(&self, _now: Elapsed, outputs: &mut PlantOutputs) {
        *outputs = self.outputs_under(&self.inputs);
    }

    fn integrands(&self, _now: Elapsed, outputs: &mut PlantOutputs) {
        outputs.energy = self.outputs_under(&self.inputs).powers.into();
    }
}

impl CompletedSteps for PmsmPlant {
    fn complete(&mut self, now: Elapsed) -> Result<(), Fault> {
        let inputs = self.inputs.clone();
        self.complete_under(&inputs, now)
    }

    fn account(&mut self, account: Account) {
        PmsmPlant::account(self, account);
    }
}

impl Differentiable for PmsmPlant {
    fn tangent(&self, _now: Elapsed, along: &Self, dx: &mut [f64], outputs: &mut PlantOutputs) -> Result<(), Fault> {
        *outputs = self.tangent_under(&self.inputs.changing(&along.inputs), along, dx);
        Ok(())
    }
}

impl Events for PmsmPlant {
    const INDICATORS: &'static [Indicator] = &[
        Indicator {
            name: "block_1",
            description: "Gates off: maximum phase current divided by the zone in which diodes can block, minus 1; otherwise 1. With \
                          inverter.mode = Switched, leg a: margin of its current or voltage, if a diode decides",
        },
        Indicator {
            name: "block_2",
            description: "Gates off: maximum line-to-line back EMF divided by the DC-link voltage, minus 1; otherwise 1. With \
                          inverter.mode = Switched, leg b",
        },
        Indicator { name: "block_3", description: "With inverter.mode = Switched, leg c; otherwise 1" },
    ];

    fn indicators(&self, _now: Elapsed, z: &mut [f64]) {
        self.indicators_under(&self.inputs, z);
    }

    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        if self.parameters.thermal.mode == ThermalMode::Imposed {
            self.check_temperatures(&self.inputs)?;
        }
        let Instant { psi, speed, angle, axis, .. } = self.present(&self.inputs);
        let mut state = crate::state::State { psi, speed, angle, axis };
        if !state.is_finite() {
            return Err(Fault::new(format!("the machine's state is not finite: {}", state.described())));
        }
        if self.parameters.is_switched() {
            return Ok(self.switch(now, &state));
        }
        self.blocked = self.blocks(&self.inputs);
        if self.blocked {
            let motor = self.motor(&self.inputs);
            let idle = self.idle_flux(&motor, state.speed);
            let stored = |psi| machine::magnetic_energy(&motor, self.parameters.magnetics(), psi);
            self.energy.loss += stored(state.psi) - stored(idle);
            state.psi = idle;
        }
        let states_changed = state != self.state;
        self.state = state;
        Ok(Outcome { states_changed, ..Outcome::default() })
    }

    fn next(&self, now: Elapsed) -> Next {
        if self.parameters.is_switched() { self.next_instant(now) } else { Next::Never }
    }
}
