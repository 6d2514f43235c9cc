//! What a step changes: kept before a step and restored if the step fails, by callers that go on with the plant.

use crate::following::Following;
use crate::model::PmsmPlant;
use crate::power::{Energy, Powers};
use crate::signals::PlantInputs;
use crate::state::State;
use crate::switched::state::Bridge;
use crate::thermal::warm::Warm;
use drive_base::frame::Dq;

/// Inputs and state of a plant in Co-Simulation. The parameters are not in it: a step never changes them.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    inputs: PlantInputs,
    state: State,
    blocked: bool,
    powers: Powers,
    energy: Energy,
    warm: Warm,
    by_iron: Dq,
    bridge: Bridge,
    following: Following,
}

impl PmsmPlant {
    /// A checkpoint of the present state.
    pub fn checkpoint(&self) -> Checkpoint {
        // Every field is named, so a new one does not compile until it is considered here. Model Exchange alone uses `point` and
        // `kept`.
        let Self {
            inputs,
            parameters: _,
            state,
            blocked,
            powers,
            energy,
            point: _,
            kept: _,
            warm,
            by_iron,
            bridge,
            following,
        } = self;
        Checkpoint {
            inputs: inputs.clone(),
            state: *state,
            blocked: *blocked,
            powers: *powers,
            energy: *energy,
            warm: warm.clone(),
            by_iron: *by_iron,
            bridge: bridge.clone(),
            following: *following,
        }
    }

    /// Goes back to a checkpoint.
    pub fn restore(&mut self, checkpoint: Checkpoint) {
        let Checkpoint { inputs, state, blocked, powers, energy, warm, by_iron, bridge, following } = checkpoint;
        (self.inputs, self.state, self.blocked, self.powers) = (inputs, state, blocked, powers);
        (self.energy, self.warm, self.by_iron, self.bridge) = (energy, warm, by_iron, bridge);
        self.following = following;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverter::Inverter;
    use crate::pwm::InverterMode;
    use crate::thermal::ThermalMode;
    use drive_base::frame::Phases;
    use fmu_core::{Block, Elapsed, Step};

    /// Restoring a checkpoint gives back the same plant, with any parameters.
    #[test]
    fn a_restored_plant_goes_on_as_it_was() {
        for kind in 0..8 {
            let mut block = Block::<PmsmPlant>::default();
            let par = &mut block.model.parameters;
            if kind % 2 == 1 {
                par.inverter.pwm.mode = InverterMode::Switched;
            } else {
                par.iron.G_e = 1e-3;
            }
            par.inverter = Inverter { dead_time: 2e-6, ..par.inverter.clone() };
            if kind / 2 % 2 == 1 {
                par.thermal.mode = ThermalMode::Network;
                let network = &mut par.thermal.network;
                (network.C_winding, network.C_stator, network.C_rotor, network.C_inverter) = (9.0, 9.0, 9.0, 9.0);
                par.thermal.alpha_R = 4e-3;
            }
            block.initialize();
            let mut now = Elapsed::ZERO;
            let mut go = |block: &mut Block<PmsmPlant>, k: u32| {
                block.model.inputs.u = Phases { a: 60.0, b: -20.0 * f64::from(k % 3), c: -30.0 };
                block.model.inputs.enable = kind < 4 || k % 4 > 1;
                let step = Step { start: now, h: 37e-6 };
                block.step(&step).unwrap();
                now = step.end();
            };
            (0..20).for_each(|k| go(&mut block, k));
            let (checkpoint, before) = (block.model.checkpoint(), block.model.clone());
            (0..9).for_each(|k| go(&mut block, k));
            assert!(block.model != before, "{kind}");
            block.model.restore(checkpoint);
            assert!(block.model == before, "{kind}");
        }
    }
}
