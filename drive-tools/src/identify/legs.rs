//! Voltage that the inverter's legs lose to the dead time.

use super::record::Complex;

/// Loss of a leg for a dead-time voltage of 1 V at the current `i`: it rises linearly up to the current `bend` and then approaches
/// 1 V with a tail in 1/i, because the ripple of the current crosses zero.
fn leg(i: f64, bend: f64) -> f64 {
    if i.abs() < bend { i / (2.0 * bend) } else { i.signum() * (1.0 - bend / (2.0 * i.abs())) }
}

/// Loss of the three legs for a dead-time voltage of 1 V, stator axes; `i` is the current vector in A.
pub fn loss(i: Complex, bend: f64) -> Complex {
    let beta = i.im * 0.75_f64.sqrt();
    let [a, b, c] = [i.re, -0.5 * i.re + beta, -0.5 * i.re - beta].map(|i| leg(i, bend));
    Complex::new((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}
