//! The outputs.

use super::motion::Point;
use super::state::{Last, MappedDrive, MappedOutputs, State};
use drive_plant::losses::efficiency;

impl MappedDrive {
    /// The outputs in this state, with powers and torque.
    pub(super) fn show(&self, state: &State, last: &Last, out: &mut MappedOutputs) {
        let Last { p_in, p_mech, p_loss, tau_shaft } = *last;
        let [tau_min, tau_max] = self.point(state).limits;
        let u_dc = self.inputs.u_dc;
        *out = MappedOutputs {
            speed: self.speed(state),
            angle: state.angle,
            tau_shaft,
            i_dc: if u_dc > 0.0 { p_in / u_dc } else { 0.0 },
            p_in,
            p_mech,
            p_loss,
            efficiency: efficiency(p_in, p_mech),
            energy: self.energy,
            Q_coolant: p_loss,
            tau_max,
            tau_min,
            overload: state.overload,
            enabled: self.is_active(),
        };
    }

    /// Powers and torque at an instant.
    pub(super) fn instant(&self, state: &State, point: &Point) -> Last {
        let speed = self.speed(state);
        let tau_shaft = if self.shaft.imposed { point.tau } else { self.inputs.tau_load };
        let p_in = if self.is_active() { point.tau * speed + point.p_loss } else { 0.0 };
        Last { p_in, p_mech: tau_shaft * speed, p_loss: point.p_loss, tau_shaft }
    }
}
