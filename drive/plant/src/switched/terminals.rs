//! The terminals of the machine at an instant: their voltages, and the rail from or to which the current of each leg flows.
//!
//! A leg that conducts has the voltage of its rail minus the drop of its device. One leg that blocks has the voltage that keeps its
//! current at zero: a current of zero needs `di/dt = 0`. If no current flows, the voltages between the terminals are those of the
//! machine, its back EMF. With a leg whose switch is on, they refer to the rail of that leg. If no switch is on, the lowest terminal
//! is at the lower rail, as with voltage dividers from the terminals to that rail. Voltages in V to the lower rail, i in A.

use super::bridge::{DIRECTIONS, Ways};
use super::segment::Blocked;
use crate::model::PmsmPlant;

/// The terminals of the machine at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terminals {
    /// Voltages of the terminals to the lower rail in V.
    pub u: [f64; 3],
    /// The current of a leg flows from or to the upper rail; `None` if the leg blocks.
    pub upper: [Option<bool>; 3],
}

impl PmsmPlant {
    /// The terminals at the present instant, before the commands of this instant take effect; `None` unless `inverter.mode` is
    /// Switched: the average inverter has no legs.
    pub fn terminals(&self) -> Option<Terminals> {
        if !self.parameters.is_switched() {
            return None;
        }
        let at = self.point(&self.state);
        let ways = Ways::new(&self.parameters.inverter, self.inputs.u_dc).at(&self.bridge.legs);
        let (voltages, i) = (self.dependent(ways, &at, self.tiny()), self.current_at(&at));
        let legs = [0, 1, 2].map(|x| voltages.leg(x, DIRECTIONS[x].dot(i)));
        let mut u = legs.map(Option::unwrap_or_default);
        match voltages.blocked() {
            Blocked::None => {}
            Blocked::One(x) => {
                u[x] = self.response_at(&at, Some(&voltages.drop())).floating(x, voltages.stator());
            }
            Blocked::All => {
                let rest = self.response_at(&at, None).resting();
                let held = [0, 1, 2].into_iter().find_map(|x| Some(legs[x]? - rest[x]));
                let common = held.unwrap_or(-rest[0].min(rest[1]).min(rest[2]));
                u = rest.map(|rest| rest + common);
            }
        }
        Some(Terminals { u, upper: voltages.at_upper_rails() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pwm::InverterMode;
    use crate::switched::bridge::Command;
    use drive_base::frame::{Dq, Phases};
    use fmu_core::{Block, Elapsed, Step};

    /// A plant with the switched inverter, whose shaft turns at the `speed` (rad/s).
    fn turning(speed: f64) -> Block<PmsmPlant> {
        let mut block = Block::<PmsmPlant>::default();
        let par = &mut block.model.parameters;
        (par.inverter.pwm.mode, par.mechanics.imposed) = (InverterMode::Switched, true);
        (par.inverter.devices.u_diode, par.inverter.devices.r_transistor) = (0.8, 0.05);
        block.model.inputs.speed_shaft = speed;
        block.initialize();
        block
    }

    /// Gates off and no current: the differences are those of the back EMF, and no terminal is below the lower rail.
    #[test]
    fn with_all_gates_off_the_terminals_have_the_back_emf() {
        let mut block = turning(100.0);
        let mut now = Elapsed::ZERO;
        for k in 0..50_u32 {
            let step = Step { start: now, h: 37e-6 };
            block.model.inputs.angle_shaft = 100.0 * now.seconds();
            block.model.advance_gates(&step, [Command::Off; 3]).unwrap();
            now = step.end();
            let Terminals { u, upper } = block.model.terminals().unwrap();
            let motor = &block.model.parameters.motor;
            let emf = Dq::new(0.0, f64::from(motor.n_p) * 100.0 * motor.psi_M);
            let Phases { a, b, c } = Phases::from_stator(block.model.state.axis.to_stator(emf));
            assert!((u[0] - u[1] - (a - b)).abs() < 1e-9 && (u[1] - u[2] - (b - c)).abs() < 1e-9, "{k}: {u:?}");
            assert!(u[0].min(u[1]).min(u[2]).abs() < 1e-9 && upper == [None; 3], "{k}: {u:?} {upper:?}");
        }
    }

    /// Six-step operation: the phase whose gates are off carries no current, and its terminal has the mean of the others plus 3/2
    /// of its back EMF (equal inductances).
    #[test]
    fn the_floating_terminal_has_the_back_emf() {
        let mut block = turning(50.0);
        let (mut now, mut u_dc) = (Elapsed::ZERO, 0.0);
        for _ in 0..40 {
            let step = Step { start: now, h: 5e-6 };
            block.model.inputs.angle_shaft = 50.0 * now.seconds();
            block.model.advance_gates(&step, [Command::Upper, Command::Lower, Command::Off]).unwrap();
            now = step.end();
            u_dc = block.model.inputs.u_dc;
        }
        let Terminals { u, upper } = block.model.terminals().unwrap();
        let i = block.model.reached().axis.to_stator(block.model.reached().i);
        let i = Phases::from_stator(i);
        assert!(i.a > 0.5 && i.c.abs() < 1e-9, "{i:?}");
        assert_eq!(upper, [Some(true), Some(false), None]);
        assert!((u[0] - (u_dc - 0.05 * i.a)).abs() < 1e-9 && (u[1] + 0.05 * i.b).abs() < 1e-9, "{u:?} {i:?}");
        let motor = &block.model.parameters.motor;
        let emf = Dq::new(0.0, f64::from(motor.n_p) * 50.0 * motor.psi_M);
        let emf = Phases::from_stator(block.model.state.axis.to_stator(emf));
        let expected = 0.5 * (u[0] + u[1]) + 1.5 * emf.c;
        assert!((u[2] - expected).abs() < 1e-6, "{u:?}, not {expected} V");
    }

    /// In the dead time, the diodes carry the currents: from the lower rail into the machine, out of it to the upper one.
    #[test]
    fn diodes_carry_the_currents_to_their_rails() {
        let mut block = turning(0.0);
        let mut now = Elapsed::ZERO;
        for (h, commands) in [(2e-4, [Command::Upper, Command::Lower, Command::Lower]), (1e-6, [Command::Off; 3])] {
            let step = Step { start: now, h };
            block.model.advance_gates(&step, commands).unwrap();
            now = step.end();
        }
        let Terminals { u, upper } = block.model.terminals().unwrap();
        assert_eq!(upper, [Some(false), Some(true), Some(true)]);
        assert!((u[0] + 0.8).abs() < 1e-12 && (u[1] - 325.8).abs() < 1e-12 && (u[2] - 325.8).abs() < 1e-12, "{u:?}");
    }

    #[test]
    fn the_average_inverter_has_no_legs() {
        let mut block = Block::<PmsmPlant>::default();
        block.initialize();
        assert_eq!(block.model.terminals(), None);
        let fault = block.model.advance_gates(&Step { start: Elapsed::ZERO, h: 1e-6 }, [Command::Off; 3]).unwrap_err();
        let expected = "inverter.mode = 1 (Average) is not allowed: 2 (Switched) with gate signals";
        assert_eq!(fault.message(), expected);
    }
}
