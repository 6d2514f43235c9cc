//! `PmsmDrive` for Model Exchange: the equations of the plant, and the events of the controller.

use super::{DriveOutputs, Means, PmsmDrive};
use crate::dc_link::ripple::ripple;
use crate::dc_link::{LinkEnergy, LinkOutputs};
use crate::pair::Pair;
use drive_base::frame::Phases;
use drive_control::signals::ControllerOutputs;
use drive_plant::PmsmPlant;
use drive_plant::power::Powers;
use drive_plant::signals::{PlantInputs, PlantOutputs};
use fmu_core::events::{bounded, grid};
use fmu_core::unit::VOLT_PER_S;
use fmu_core::{
    Account, CompletedSteps, ContinuousTime, Differentiable, Dual, Elapsed, Events, Fault, Indicator, Model, Next,
    Outcome, Sampled, Scalar, State,
};

impl PmsmDrive {
    /// Shows the outputs of the controller's last sample and applies them to the plant.
    fn show(&mut self, now: Elapsed) {
        let Pair { plant, controller, .. } = &mut self.pair;
        controller.model.show();
        controller.model.output(now, &mut controller.out);
        plant.model.inputs.apply(controller.out.commanded());
        self.convert_limits();
    }
}

impl PmsmDrive {
    /// The link's outputs at an instant, with the `inputs` and outputs of the plant and the voltages (V) of capacitor and source.
    fn link_outputs<S: Scalar>(
        &self,
        inputs: &PlantInputs<S>,
        plant: &PlantOutputs<S>,
        (u, U): (S, S),
    ) -> LinkOutputs<S> {
        if !self.link_parameters.dc_link.used {
            // The state keeps its set value.
            return LinkOutputs { u, i_source: plant.powers.i_dc, ..LinkOutputs::none() };
        }
        let i_rms = ripple(inputs.voltage(self.modulation()), plant.i.to_stator(), plant.powers.p_in, inputs.u_dc);
        LinkOutputs { i_rms, ..self.link.shown(&self.link_parameters, u, U) }
    }
}

impl ContinuousTime for PmsmDrive {
    const STATES: &'static [State<Self>] = &[
        State::of_part(&PmsmPlant::STATES[0], |m: &mut Self| PmsmPlant::STATES[0].at(&mut m.pair.plant.model)),
        State::of_part(&PmsmPlant::STATES[1], |m: &mut Self| PmsmPlant::STATES[1].at(&mut m.pair.plant.model)),
        State::of_part(&PmsmPlant::STATES[2], |m: &mut Self| PmsmPlant::STATES[2].at(&mut m.pair.plant.model)),
        State::of_part(&PmsmPlant::STATES[3], |m: &mut Self| PmsmPlant::STATES[3].at(&mut m.pair.plant.model)),
        State::<Self>::new("u_cap", &VOLT_PER_S, |m| &mut m.link.u),
    ];

    fn derivatives(&self, now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        let (inputs, plant) = (self.plant_inputs(), &self.pair.plant.model);
        let [dx @ .., du] = dx else { return Ok(()) };
        plant.derivatives_under(&inputs, dx)?;
        *du = if self.link_parameters.dc_link.used {
            let i_dc = plant.outputs_under(&inputs).powers.i_dc;
            self.link.slope(&self.link_parameters, (self.link.u, self.source(now), i_dc))
        } else {
            0.0
        };
        Ok(())
    }

    fn settle(&mut self) {
        self.pair.plant.model.settle();
    }

    fn observe(&self, now: Elapsed, outputs: &mut DriveOutputs) {
        let inputs = self.plant_inputs();
        outputs.plant = self.pair.plant.model.outputs_under(&inputs);
        outputs.controller.clone_from(&self.pair.controller.out);
        self.with_limits(&mut outputs.controller);
        outputs.means = self.period.means();
        outputs.link = self.link_outputs(&inputs, &outputs.plant, (self.link.u, self.source(now)));
    }

    fn integrands(&self, now: Elapsed, outputs: &mut DriveOutputs) {
        let (inputs, (u, U)) = (self.plant_inputs(), (self.link.u, self.source(now)));
        let plant = self.pair.plant.model.outputs_under(&inputs);
        outputs.plant.energy = plant.powers.into();
        if self.link_parameters.dc_link.used {
            let LinkOutputs { i_source, p_chopper, .. } = self.link_outputs(&inputs, &plant, (u, U));
            outputs.link.energy = LinkEnergy { source: U * i_source, resistor: (U - u) * i_source, chopper: p_chopper };
        }
    }
}

impl CompletedSteps for PmsmDrive {
    fn complete(&mut self, now: Elapsed) -> Result<(), Fault> {
        let (inputs, U) = (self.plant_inputs(), self.source(now));
        let plant = &mut self.pair.plant.model;
        plant.complete_under(&inputs, now)?;
        if self.link_parameters.dc_link.used {
            self.link.complete(&self.link_parameters, now, U, plant.total().energy.r#in);
        }
        Ok(())
    }

    fn account(&mut self, account: Account) {
        self.pair.plant.model.account(account);
        self.link.account(account);
    }
}

impl Differentiable for PmsmDrive {
    fn tangent(&self, now: Elapsed, along: &Self, dx: &mut [f64], outputs: &mut DriveOutputs) -> Result<(), Fault> {
        // The controller's outputs and the means are constant.
        let linked = self.link_parameters.dc_link.used;
        let wave = self.link_parameters.dc_link.wave(now.seconds());
        let U = Dual::new(self.inputs.u_dc * wave, along.inputs.u_dc * wave);
        let u = Dual::new(self.link.u, along.link.u);
        let u_dc = if linked { along.link.u } else { along.inputs.u_dc };
        let change = PlantInputs { u: Phases::default(), u_dc, ..along.plant_inputs() };
        let inputs = self.plant_inputs().changing(&change);
        let [dx @ .., du] = dx else { return Ok(()) };
        outputs.plant = self.pair.plant.model.tangent_under(&inputs, &along.pair.plant.model, dx);
        (outputs.controller, outputs.means) = (ControllerOutputs::default(), Means::default());
        let at = self.pair.plant.model.outputs_under(&self.plant_inputs());
        let with = |at: f64, change: f64| Dual::new(at, change);
        let (i, di) = (&at.i, &outputs.plant.i);
        let plant = PlantOutputs {
            i: Phases { a: with(i.a, di.a), b: with(i.b, di.b), c: with(i.c, di.c) },
            powers: Powers {
                i_dc: with(at.powers.i_dc, outputs.plant.powers.i_dc),
                p_in: with(at.powers.p_in, outputs.plant.powers.p_in),
                ..Powers::default()
            },
            ..PlantOutputs::default()
        };
        outputs.link = self.link_outputs(&inputs, &plant, (u, U)).change();
        *du = if linked { self.link.slope(&self.link_parameters, (u, U, plant.powers.i_dc)).change } else { 0.0 };
        Ok(())
    }
}

impl Events for PmsmDrive {
    const INDICATORS: &'static [Indicator] = &[
        PmsmPlant::INDICATORS[0],
        PmsmPlant::INDICATORS[1],
        PmsmPlant::INDICATORS[2],
        Indicator {
            name: "chopper",
            description: "Voltage of the capacitor divided by that at which the chopper switches next, minus 1; without a chopper 1",
        },
        Indicator {
            name: "source",
            description: "Above 0 while a battery is within the limits of its current, or a rectifier blocks; an ideal source has 1",
        },
    ];

    fn indicators(&self, now: Elapsed, z: &mut [f64]) {
        let [z @ .., chopper, source] = z else { return };
        self.pair.plant.model.indicators_under(&self.plant_inputs(), z);
        *chopper = self.link.indicator(&self.link_parameters);
        *source = self.link.source_indicator(&self.link_parameters, self.source(now), self.inputs.u_dc);
    }

    fn begin(&mut self, now: Elapsed) {
        let controller = &self.pair.controller.model;
        if grid(controller).reached(controller.samples(), now) {
            self.period.end(self.pair.plant.model.total());
            self.show(now);
        }
    }

    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        self.set_inputs();
        bounded(&self.pair.controller.model, now)?;
        if self.link_parameters.dc_link.used {
            self.link.event(&self.link_parameters);
        }
        let grid = grid(&self.pair.controller.model);
        while grid.reached(self.pair.controller.model.samples(), now) {
            self.show(now);
            if self.link.precharges {
                self.link.sample(self.inputs.u_dc);
                self.set_inputs();
            }
            // With iron loss, the currents depend on the voltages: the controller samples before the voltages change.
            let Pair { plant, controller, .. } = &mut self.pair;
            let mut inputs = plant.model.inputs.clone();
            inputs.apply(self.before);
            let measured = plant.model.measured_under(&inputs);
            controller.model.inputs.measure(measured);
            controller.model.sample()?;
            self.before = plant.model.inputs.commanded();
            self.watch_load();
            self.watch_estimate(grid.period, (measured.theta_e, measured.speed));
        }
        self.pair.plant.model.event(now)
    }

    fn next(&self, now: Elapsed) -> Next {
        let Pair { plant, controller, .. } = &self.pair;
        controller.model.next(now).or(plant.model.next(now), now)
    }
}
