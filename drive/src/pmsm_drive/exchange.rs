//! `PmsmDrive` for Model Exchange: the equations of the plant, and the events of the controller.

use super::{DriveOutputs, Means, PmsmDrive};
use crate::pair::Pair;
use drive_base::frame::Phases;
use drive_control::signals::ControllerOutputs;
use drive_plant::PmsmPlant;
use drive_plant::signals::PlantInputs;
use fmu_core::events::{bounded, grid};
use fmu_core::{
    CompletedSteps, ContinuousTime, Differentiable, Elapsed, Events, Fault, Indicator, Model, Next, Outcome, Sampled,
    State,
};

impl PmsmDrive {
    /// Makes the outputs of the controller's last sample visible and applies them to the plant.
    fn show(&mut self, now: Elapsed) {
        let Pair { plant, controller, .. } = &mut self.pair;
        controller.model.show();
        controller.model.output(now, &mut controller.out);
        plant.model.inputs.apply(controller.out.commanded());
    }
}

impl ContinuousTime for PmsmDrive {
    const STATES: &'static [State<Self>] = &[
        State::of_part(&PmsmPlant::STATES[0], |m: &mut Self| (PmsmPlant::STATES[0].at)(&mut m.pair.plant.model)),
        State::of_part(&PmsmPlant::STATES[1], |m: &mut Self| (PmsmPlant::STATES[1].at)(&mut m.pair.plant.model)),
        State::of_part(&PmsmPlant::STATES[2], |m: &mut Self| (PmsmPlant::STATES[2].at)(&mut m.pair.plant.model)),
        State::of_part(&PmsmPlant::STATES[3], |m: &mut Self| (PmsmPlant::STATES[3].at)(&mut m.pair.plant.model)),
    ];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        self.pair.plant.model.derivatives_under(&self.plant_inputs(), dx)
    }

    fn settle(&mut self) {
        self.pair.plant.model.settle();
    }

    fn observe(&self, _now: Elapsed, outputs: &mut DriveOutputs) {
        outputs.plant = self.pair.plant.model.outputs_under(&self.plant_inputs());
        outputs.controller.clone_from(&self.pair.controller.out);
        outputs.means = self.period.means();
    }

    fn integrands(&self, _now: Elapsed, outputs: &mut DriveOutputs) {
        outputs.plant.energy = self.pair.plant.model.outputs_under(&self.plant_inputs()).powers.into();
    }
}

impl CompletedSteps for PmsmDrive {
    fn complete(&mut self, now: Elapsed) -> Result<(), Fault> {
        let inputs = self.plant_inputs();
        self.pair.plant.model.complete_under(&inputs, now)
    }
}

impl Differentiable for PmsmDrive {
    fn tangent(&self, _now: Elapsed, along: &Self, dx: &mut [f64], outputs: &mut DriveOutputs) -> Result<(), Fault> {
        // The controller's outputs and the means are held.
        let change = PlantInputs { u: Phases::default(), ..along.plant_inputs() };
        let inputs = self.plant_inputs().changing(&change);
        outputs.plant = self.pair.plant.model.tangent_under(&inputs, &along.pair.plant.model, dx);
        (outputs.controller, outputs.means) = (ControllerOutputs::default(), Means::default());
        Ok(())
    }
}

impl Events for PmsmDrive {
    const INDICATORS: &'static [Indicator] = PmsmPlant::INDICATORS;

    fn indicators(&self, _now: Elapsed, z: &mut [f64]) {
        self.pair.plant.model.indicators_under(&self.plant_inputs(), z);
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
        let grid = grid(&self.pair.controller.model);
        while grid.reached(self.pair.controller.model.samples(), now) {
            self.show(now);
            // With iron loss, the currents depend on the voltages: the controller samples them before they change.
            let shown = self.pair.plant.model.inputs.clone();
            let Pair { plant, controller, .. } = &mut self.pair;
            plant.model.inputs.apply(self.before);
            plant.model.observe(now, &mut plant.out);
            plant.model.inputs = shown;
            controller.model.inputs.measure(plant.out.measured());
            controller.model.sample()?;
            self.before = plant.model.inputs.commanded();
            self.watch_load();
        }
        self.pair.plant.model.event(now)
    }

    fn next(&self, now: Elapsed) -> Next {
        self.pair.controller.model.next(now)
    }
}
