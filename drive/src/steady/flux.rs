//! Flux linkage for a terminal current in steady state.
//!
//! The current at the terminals is the sum of the currents of the flux linkage and of the iron, i_s = i(psi) + (h + j g) psi: g
//! = G w, and h = 0 unless the voltage is behind the flux linkage's motion. Newton's method from psi = (L_d i_d + psi_M, L_q
//! i_q); d i/d psi is symmetric. A machine without saturation is linear, and the first step is exact: with h = 0, i_md = (i_d +
//! g L_q (i_q - g psi_M)) / (1 + g^2 L_d L_q). Derived here from the circuit of [`iron`](drive_plant::iron). i in A, psi in Wb,
//! g and h in 1/H.

use drive_base::frame::Dq;
use drive_base::motor::Motor;
use drive_plant::machine::{self, Magnetics};

/// Maximum number of Newton steps for a nonlinear machine.
const STEPS: usize = 12;

/// Residue at which they end, as a share of the current.
const SMALL: f64 = 1e-14;

/// Residue, as a share of the current, that falls no more because of rounding.
const ROUNDED: f64 = 1e-10;

/// The flux linkage (Wb) with the current `i_s` (A) at the terminals.
#[inline]
pub(super) fn linkage(motor: &Motor, magnetics: Magnetics<'_>, i_s: Dq, (h, g): (f64, f64)) -> Dq {
    let mut psi = machine::flux(motor, i_s);
    let linear = matches!(magnetics, Magnetics::Linear);
    if linear && g == 0.0 {
        return psi;
    }
    let mut last = f64::INFINITY;
    for _ in 0..if linear { 1 } else { STEPS } {
        let rest =
            if linear { Dq::ZERO } else { machine::current(motor, magnetics, psi) - i_s } + psi * h + psi.turned() * g;
        let size = rest.magnitude() / (1.0 + i_s.magnitude());
        if !linear && (size <= SMALL || size <= ROUNDED && size >= last) {
            break;
        }
        last = size;
        let [d, cross, q] = machine::slope(motor, magnetics, psi);
        let (d, q, above, below) = (d + h, q + h, cross - g, cross + g);
        let by = 1.0 / (d * q - above * below);
        let step = Dq::new(q * rest.d() - above * rest.q(), d * rest.q() - below * rest.d()) * by;
        psi = psi - step;
    }
    psi
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive_plant::flux_map;
    use drive_plant::saturation::Saturation;

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
