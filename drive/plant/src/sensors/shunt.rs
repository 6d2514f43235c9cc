//! Shunts in the inverter: a shunt below each leg, or one in the link.
//!
//! ```text
//! below leg x: i_x while the current flows from or to the lower rail, else 0          link: sum of i_x of the legs at the upper rail
//! ```
//!
//! The lower rail carries the current of a leg through its lower switch or its lower diode. i in A, positive into the machine.

/// Currents (A) of the shunts below the legs: `i` are those of the phases, `upper` whether each flows from or to the upper rail
/// (`None`: it is zero).
pub fn below(i: [f64; 3], upper: [Option<bool>; 3]) -> [f64; 3] {
    [0, 1, 2].map(|x| if upper[x] == Some(false) { i[x] } else { 0.0 })
}

/// Current (A) of the shunt in the link.
pub fn link(i: [f64; 3], upper: [Option<bool>; 3]) -> f64 {
    (0..3).filter(|&x| upper[x] == Some(true)).map(|x| i[x]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const I: [f64; 3] = [3.0, -1.0, -2.0];

    #[test]
    fn a_shunt_sees_its_leg_at_the_lower_rail_alone() {
        let upper = [Some(true), Some(false), None];
        assert_eq!(below([3.0, -3.0, 0.0], upper).map(f64::to_bits), [0.0, -3.0, 0.0_f64].map(f64::to_bits));
        assert!((link(I, [Some(true), Some(false), Some(true)]) - 1.0).abs() < 1e-15);
        assert!(link(I, [Some(false); 3]).abs() < 1e-15 && link(I, [Some(true); 3]).abs() < 1e-15);
    }
}
