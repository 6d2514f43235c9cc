//! Conditions under which the plant's parameters and inputs have an effect; setting one without effect is reported by name.
//!
//! Every parameter and every input is listed exactly once; `no_variable_is_forgotten` checks it.

use crate::tables::PlantParameters as Par;
use crate::thermal::ThermalMode;
use fmu_core::idle::Acts;

/// Conditions of the plant.
#[rustfmt::skip]
pub const ACTS: &[Acts<Par>] = &[
    Acts { names: &[
        "motor.n_p", "motor.R_s", "motor.L_d", "motor.L_q", "motor.psi_M", "flux_map.use", "mechanics.B", "mechanics.tau_coulomb",
        "mechanics.k_w", "mechanics.imposed", "inverter.dead_time", "inverter.u_transistor", "inverter.r_transistor",
        "inverter.u_diode", "inverter.r_diode", "inverter.E_sw", "iron.G_e", "iron.G_h", "winding.k_ac", "winding.alpha",
        "magnet.alpha", "thermal.mode", "thermal.T_start", "inverter.mode", "modulation.mode",
        "u_a", "u_b", "u_c", "u_dc", "enable", "asc",
    ], when: |_| true, why: "" },
    Acts { names: &["saturation.s_2", "saturation.s_3", "saturation.s_dq"], when: |p| !p.flux_map.used,
        why: "no effect with flux_map.use" },
    Acts { names: &["flux_map.d_min", "flux_map.d_max", "flux_map.q_max", "flux_map.w"], when: |p| p.flux_map.used,
        why: "no effect without flux_map.use" },
    Acts { names: &["mechanics.J", "initial.theta_e", "initial.speed", "tau_load"], when: |p| !p.mechanics.imposed,
        why: "no effect with mechanics.imposed" },
    Acts { names: &["speed_shaft", "angle_shaft"], when: |p| p.mechanics.imposed, why: "no effect without mechanics.imposed" },
    Acts { names: &["mechanics.w_coulomb"], when: |p| p.mechanics.tau_coulomb > 0.0, why: "no effect without mechanics.tau_coulomb" },
    Acts { names: &["inverter.T_pwm"],
        when: |p| p.inverter.dead_time > 0.0 || p.inverter.devices.E_sw > 0.0 || p.is_switched(),
        why: "no effect without inverter.dead_time and inverter.E_sw, unless inverter.mode = Switched" },
    Acts { names: &["inverter.i_zero"],
        when: |p| !p.is_switched() && (p.inverter.dead_time > 0.0 || !p.inverter.devices.is_none()),
        why: "no effect without inverter.dead_time and losses of the devices, nor with inverter.mode = Switched" },
    Acts { names: &["inverter.update", "inverter.zero_sequence", "inverter.pulse_min", "inverter.carrier_delay",
        "inverter.open_switch", "inverter.open_phase"], when: Par::is_switched,
        why: "no effect unless inverter.mode = Switched" },
    Acts { names: &["inverter.i_sw", "inverter.u_sw", "inverter.k_sw"], when: |p| p.inverter.devices.E_sw > 0.0,
        why: "no effect without inverter.E_sw" },
    Acts { names: &["iron.w_0"], when: |p| p.iron.G_h > 0.0, why: "no effect without iron.G_h" },
    Acts { names: &["thermal.T_ref"], when: |p| p.thermal.alpha_R != 0.0 || p.thermal.alpha_psi != 0.0,
        why: "no effect without winding.alpha and magnet.alpha" },
    Acts { names: &["iron.rotor_share", "thermal.C_winding", "thermal.C_stator", "thermal.C_rotor", "thermal.C_inverter", "thermal.G_ws",
        "thermal.G_sc", "thermal.G_sr", "thermal.G_inverter", "T_coolant"], when: |p| p.thermal.mode == ThermalMode::Network,
        why: "no effect unless thermal.mode = Network" },
    Acts { names: &["T_winding_imposed", "T_stator_imposed", "T_magnet_imposed", "T_inverter_imposed"],
        when: |p| p.thermal.mode == ThermalMode::Imposed, why: "no effect unless thermal.mode = Imposed" },
];

/// Message for a link without voltage.
pub const NO_VOLTAGE: &str = "the DC link has no voltage: feed u_dc";

/// Message for an imposed shaft at rest.
pub const AT_REST: &str = "speed_shaft and angle_shaft are 0, and the shaft stands still: feed them";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PmsmPlant;
    use fmu_core::Model;
    use fmu_core::idle::unstated;

    #[test]
    fn no_variable_is_forgotten() {
        let missing = unstated(ACTS, PmsmPlant::TABLE);
        assert!(missing.is_empty(), "{missing:?} must be in ACTS once");
    }
}
