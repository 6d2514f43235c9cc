//! Flux linkage for a terminal current in steady state.
//!
//! The current at the terminals is the sum of the currents of the flux linkage and of the iron, i_s = i(psi) + (h + j g) psi: g
//! = G w, and h = 0 unless the voltage is behind the flux linkage's motion. Newton's method from psi = (L_d i_d + psi_M, L_q
//! i_q); d i/d psi is symmetric. A machine without saturation is linear, and the first step is exact: with h = 0, i_md = (i_d +
//! g L_q (i_q - g psi_M)) / (1 + g^2 L_d L_q). Derived here from the circuit of [`iron`](drive_plant::iron). i in A, psi in Wb,
//! g and h in 1/H.

use drive_base::frame::Dq;
use drive_base::math::sin_cos;
use drive_base::motor::Motor;
use drive_control::estimator::contract::Class;
use drive_control::tables::ControllerParameters;
use drive_plant::machine::{self, Magnetics, is_stable};
use drive_plant::tables::{PARAMETERS, PlantParameters};
use fmu_core::Fault;

/// Maximum number of flux linkages that are tried for a nonlinear machine.
const TRIALS: usize = 24;

/// Residue at which they end, as a share of the current.
const SMALL: f64 = 1e-14;

/// Residue, as a share of the current, that falls no more because of rounding.
const ROUNDED: f64 = 1e-10;

/// Angles (deg) from the d-axis at which [`check_saturation`] asks for the maximum current.
const ANGLES: [f64; 7] = [90.0, 105.0, 120.0, 135.0, 150.0, 165.0, 180.0];

/// The flux linkage (Wb) with the current `i_s` (A) at the terminals; NaN for a polynomial that gives none.
#[inline]
pub(super) fn linkage(motor: &Motor, magnetics: Magnetics<'_>, i_s: Dq, (h, g): (f64, f64)) -> Dq {
    let mut psi = machine::flux(motor, i_s);
    let linear = matches!(magnetics, Magnetics::Linear);
    if linear && g == 0.0 {
        return psi;
    }
    let (mut last, mut before) = (f64::INFINITY, Dq::new(motor.psi_M, 0.0));
    for _ in 0..TRIALS {
        let rest =
            if linear { Dq::ZERO } else { machine::current(motor, magnetics, psi) - i_s } + psi * h + psi.turned() * g;
        let size = rest.magnitude() / (1.0 + i_s.magnitude());
        if !linear && (size <= SMALL || size <= ROUNDED && size >= last) {
            return psi;
        }
        let slope = machine::slope(motor, magnetics, psi);
        // More flux needs more current in a machine, and Newton's step then lowers the residue; too long a step is halved.
        if !(is_stable(slope) && size < last) {
            psi = (psi + before) * 0.5;
            continue;
        }
        (last, before) = (size, psi);
        let [d, cross, q] = slope;
        let (d, q, above, below) = (d + h, q + h, cross - g, cross + g);
        let by = 1.0 / (d * q - above * below);
        let step = Dq::new(q * rest.d() - above * rest.q(), d * rest.q() - below * rest.d()) * by;
        psi = psi - step;
        if linear {
            return psi;
        }
    }
    Dq::new(f64::NAN, f64::NAN)
}

/// Refuses a saturation that describes no machine at the maximum current of the `controller`, or at the current of its low-speed law.
///
/// # Errors
/// A current that no flux linkage gives, because more flux would need less current.
pub(crate) fn check_saturation(plant: &PlantParameters, controller: &ControllerParameters) -> Result<(), Fault> {
    if plant.saturation.is_none() {
        return Ok(());
    }
    let (motor, limit) = (&plant.motor, &controller.limit);
    let most = ANGLES.map(|angle| {
        let (sin, cos) = sin_cos(if motor.L_d > motor.L_q { 180.0 - angle } else { angle }.to_radians());
        (Dq::new(limit.i * cos, limit.i * sin), "controller.limit.i", limit.i)
    });
    let i_0 = controller.zero_speed.i_0;
    let law = (Dq::new(i_0, limit.i_q_beside(i_0)), "controller.zero_speed.i_0", i_0);
    let has_law = controller.estimator.class() == Class::FluxObserver;
    for (i, name, value) in most.into_iter().chain(has_law.then_some(law)) {
        if linkage(motor, plant.magnetics(), i, (0.0, 0.0)).d().is_nan() {
            let tell = |get: fn(&mut PlantParameters) -> &mut f64| PARAMETERS.tell(plant, get);
            return Err(Fault::new(format!(
                "{} with {} and {}: these describe no machine up to {name} = {value} A, because at i_d = {:.3} A and i_q = {:.3} A, \
                 more flux needs less current; use coefficients closer to 0, or a lower limit",
                tell(|p| &mut p.saturation.s_2),
                tell(|p| &mut p.saturation.s_3),
                tell(|p| &mut p.saturation.s_dq),
                i.d(),
                i.q()
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive_control::estimator::Kind;
    use drive_plant::flux_map;
    use drive_plant::saturation::Saturation;

    /// The flux linkage is found where Newton's first step goes to a flux linkage of no machine, and there is none beyond the
    /// current at which d i_d / d psi_d = 1 / L_d + 2 s_2 x is 0: x / (2 L_d) at x = -1 / (2 L_d s_2).
    #[test]
    fn no_flux_linkage_beyond_the_last_current() {
        let motor = Motor { L_d: 6e-3, L_q: 6e-3, ..Motor::default() };
        let controller = |i| {
            let mut controller = ControllerParameters { estimator: Kind::DirectEmf, ..Default::default() };
            controller.limit.i = i;
            controller
        };
        let plant = |s_2| PlantParameters {
            motor: motor.clone(),
            saturation: Saturation { s_2, ..Saturation::default() },
            ..PlantParameters::default()
        };
        let last = 1.0 / (4.0 * 6e-3 * 6e-3 * 1000.0);
        for (share, exists) in [(0.9, true), (0.999, true), (1.001, false), (1.5, false)] {
            let (plant, i) = (plant(1000.0), Dq::new(-share * last, 0.0));
            let psi = linkage(&motor, plant.magnetics(), i, (0.0, 0.0));
            assert_eq!(psi.d().is_finite(), exists, "{share}: {psi:?}");
            assert!(!exists || (machine::current(&motor, plant.magnetics(), psi) - i).magnitude() < 1e-10);
            assert_eq!(check_saturation(&plant, &controller(share * last)).is_ok(), exists, "{share}");
        }
        let refused = check_saturation(&plant(1000.0), &controller(10.0)).unwrap_err().to_string();
        assert!(
            refused.starts_with("saturation.s_2 = 1000") && refused.contains("controller.limit.i = 10 A"),
            "{refused}"
        );
        assert_eq!(
            check_saturation(&plant(-1000.0), &controller(10.0)),
            Ok(()),
            "saturates with more negative current"
        );
        // The low-speed law magnetizes the d-axis.
        let flux_observer = ControllerParameters { estimator: Kind::Rasmussen, ..controller(10.0) };
        let refused = check_saturation(&plant(-10_000.0), &flux_observer).unwrap_err().to_string();
        assert!(refused.contains("up to controller.zero_speed.i_0 = "), "{refused}");
    }

    #[test]
    fn current_of_flux_and_iron_is_that_of_the_terminals() {
        let motor = Motor::IPMSM_2_2_KW;
        let saturation = Saturation { s_2: 6.0, s_3: 20.0, s_dq: 5.0 };
        let map = flux_map::linear(&motor, [-0.6, 0.1], 0.4);
        for magnetics in [Magnetics::Linear, Magnetics::Polynomial(&saturation), Magnetics::Map(&map)] {
            for (i, iron) in [
                ((-3.0, 5.0), (0.02, 0.3)),
                ((-8.0, -6.0), (-0.03, -0.4)),
                ((0.0, 1.0), (0.0, 0.1)),
                ((2.0, 0.0), (0.0, 0.0)),
            ] {
                let i_s = Dq::new(i.0, i.1);
                let psi = linkage(&motor, magnetics, i_s, iron);
                let found = machine::current(&motor, magnetics, psi) + psi * iron.0 + psi.turned() * iron.1;
                assert!((found - i_s).magnitude() < 1e-12, "{magnetics:?}, {iron:?}: {found:?}, not {i_s:?}");
            }
        }
    }

    /// The closed form of the linear machine.
    #[test]
    fn one_step_is_exact_for_a_linear_machine() {
        let (motor, i_s, g) = (Motor::IPMSM_2_2_KW, Dq::new(-1.0, 5.6), 0.15);
        let Motor { L_d, L_q, psi_M, .. } = motor;
        let i_d = (i_s.d() + g * L_q * (i_s.q() - g * psi_M)) / (1.0 + g * g * L_d * L_q);
        let i_q = i_s.q() - g * (psi_M + L_d * i_d);
        let psi = linkage(&motor, Magnetics::Linear, i_s, (0.0, g));
        assert!((psi - Dq::new(psi_M + L_d * i_d, L_q * i_q)).magnitude() < 1e-15, "{psi:?}");
    }
}
