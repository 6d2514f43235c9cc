//! Location of a state event: the first instant in a step at which the sign of an event indicator differs from that at its
//! beginning.

use fmu_import::Error;

/// Whether an indicator is on the other side: the domains are z > 0 and z <= 0 (FMI 2.0.5, 3.1; FMI 3.0.2, 3.1.1).
pub(super) fn crossed(before: &[f64], after: &[f64]) -> bool {
    before.iter().zip(after).any(|(a, b)| (*a > 0.0) != (*b > 0.0))
}

/// The first crossing in (0, 1], as the end of an interval of at most `width` that begins before it. `z_0` and `z_1` are the
/// indicators at 0 and 1, between which one of them crosses; `indicators` computes them between.
///
/// Regula falsi on the indicator that seems to cross first, with the weights of the Illinois method (M. Dowell, P. Jarratt,
/// BIT 11 (1971) 168-174), and bisection where that does not halve the interval in two steps.
pub(super) fn first_crossing(
    z_0: &[f64],
    z_1: &[f64],
    width: f64,
    mut indicators: impl FnMut(f64, &mut [f64]) -> Result<(), Error>,
) -> Result<f64, Error> {
    let (mut left, mut right) = (0.0, 1.0);
    let (mut z_left, mut z_right) = (z_0.to_vec(), z_1.to_vec());
    let mut z = z_0.to_vec();
    // Illinois: an end that stays a second time counts half.
    let (mut weight_left, mut weight_right) = (1.0, 1.0);
    let mut right_moved = None;
    let mut before_last = [f64::INFINITY; 2];
    while right - left > width {
        let length = right - left;
        let falsi = z_left.iter().zip(&z_right).filter(|(a, b)| (**a > 0.0) != (**b > 0.0)).map(|(a, b)| {
            let (a, b) = (weight_left * a.abs(), weight_right * b.abs());
            left + length * a / (a + b)
        });
        let guess = falsi.fold(f64::INFINITY, f64::min);
        let slow = length > 0.5 * before_last[0];
        let middle = left + 0.5 * length;
        let at = if slow || !guess.is_finite() { middle } else { guess.clamp(left + 0.5 * width, right - 0.5 * width) };
        before_last = if slow { [f64::INFINITY; 2] } else { [before_last[1], length] };
        indicators(at, &mut z)?;
        if crossed(z_0, &z) {
            right = at;
            z_right.copy_from_slice(&z);
            weight_left *= if right_moved == Some(true) { 0.5 } else { 1.0 };
            (weight_right, right_moved) = (1.0, Some(true));
        } else {
            left = at;
            z_left.copy_from_slice(&z);
            weight_right *= if right_moved == Some(false) { 0.5 } else { 1.0 };
            (weight_left, right_moved) = (1.0, Some(false));
        }
    }
    Ok(right)
}
