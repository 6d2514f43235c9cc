//! Conditions under which the variables of plant, controller and DC link have an effect.

use crate::dc_link::{DcSource, LinkParameters};
use crate::derating::Derating;
use drive_control::idle as control;
use drive_control::tables::ControllerParameters;
use drive_plant::idle as plant;
use drive_plant::tables::PlantParameters;
use fmu_core::idle::{Acts, why};

/// Conditions of the DC link.
const LINK: &[Acts<LinkParameters>] = &[
    Acts { names: &["dc_link.use", "chopper.use"], when: |_| true, why: "" },
    Acts {
        names: &["dc_link.C", "dc_link.source", "dc_link.R_source", "dc_link.R_precharge"],
        when: |p| p.dc_link.used,
        why: "no effect without dc_link.use",
    },
    Acts {
        names: &["dc_link.i_max", "dc_link.i_min"],
        when: |p| p.dc_link.used && p.dc_link.source == DcSource::Battery,
        why: "no effect without dc_link.use and dc_link.source = 2 (Battery)",
    },
    Acts {
        names: &["dc_link.f_mains"],
        when: |p| p.dc_link.used && p.dc_link.pulsates(),
        why: "no effect without dc_link.use and dc_link.source = 3 (RectifierSingle) or 4 (RectifierThree)",
    },
    Acts {
        names: &["chopper.u_on", "chopper.u_off", "chopper.R"],
        when: |p| p.chopper.used,
        why: "no effect without chopper.use",
    },
];

/// Conditions of the derating.
const HEAT: &[Acts<Derating>] = &[
    Acts { names: &["limit.T_winding_use"], when: |_| true, why: "" },
    Acts {
        names: &["limit.T_winding", "limit.T_winding_max"],
        when: |p| p.used && !p.by_table,
        why: "no effect without limit.T_winding_use, or with limit.T_winding_table",
    },
    Acts { names: &["limit.T_winding_table"], when: |p| p.used, why: "no effect without limit.T_winding_use" },
    Acts {
        names: &["limit.T_winding_at", "limit.T_winding_share"],
        when: |p| p.used && p.by_table,
        why: "no effect without limit.T_winding_use and limit.T_winding_table",
    },
];

/// Why the parameter or input `name` of a drive has no effect, with the inputs `u_dc` (V), `speed_shaft` and `angle_shaft`.
pub(crate) fn of_drive(
    (plant, controller, link, derating): (&PlantParameters, &ControllerParameters, &LinkParameters, &Derating),
    (u_dc, shaft): (f64, [f64; 2]),
    name: &str,
) -> Option<&'static str> {
    if name == "u_dc" && u_dc == 0.0 {
        return Some(control::NO_VOLTAGE);
    }
    if let Some(name) = name.strip_prefix("plant.") {
        let rests = name == "mechanics.imposed" && shaft.iter().all(|&x| x == 0.0);
        return if rests { Some(plant::AT_REST) } else { why(plant::ACTS, plant, name) };
    }
    match name.strip_prefix("controller.") {
        Some(name) => why(control::ACTS, controller, name),
        None => why(LINK, link, name)
            .or_else(|| why(HEAT, derating, name))
            .or_else(|| why(control::ACTS, controller, name))
            .or_else(|| why(plant::ACTS, plant, name)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PmsmDrive;
    use crate::dc_link;
    use crate::derating;
    use fmu_core::idle::unstated;
    use fmu_core::{Causality, Model};

    /// Every input belongs to the plant or the controller, so their lists contain it.
    #[test]
    fn no_variable_is_forgotten() {
        let missing = unstated(LINK, dc_link::LINK);
        assert!(missing.is_empty(), "{missing:?} must be in LINK once");
        let missing = unstated(HEAT, derating::DERATING);
        assert!(missing.is_empty(), "{missing:?} must be in HEAT once");
        let lists = |name: &str| {
            control::ACTS.iter().any(|acts| acts.names.contains(&name))
                || plant::ACTS.iter().any(|acts| acts.names.contains(&name))
        };
        for index in PmsmDrive::TABLE.indices() {
            let (name, meta, _) = PmsmDrive::TABLE.locate(index).unwrap();
            assert!(meta.causality != Causality::Input || lists(&name), "{name}");
        }
    }
}
