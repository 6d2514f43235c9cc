//! Three Hall sensors, 120 degrees apart in the electrical angle.
//!
//! ```text
//! a = 1 for theta in [0, pi), b = a turned by 2 pi / 3, c by 4 pi / 3          theta = theta_e - offset
//! sector floor(theta / (pi / 3)):  0    1    2    3    4    5
//!                         c b a:  101  001  011  010  110  100
//! ```
//!
//! Angles in rad.

use std::f64::consts::FRAC_PI_3;

/// Three Hall sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hall {
    /// Electrical angle at which sensor a rises, in rad.
    pub offset: f64,
}

/// Bits of the six sectors: bit 0 is sensor a, bit 1 sensor b, bit 2 sensor c.
const SECTORS: [u32; 6] = [0b101, 0b001, 0b011, 0b010, 0b110, 0b100];

impl Hall {
    /// The bits at the electrical angle `theta_e` (rad): bit 0 is sensor a, bit 1 sensor b, bit 2 sensor c.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 5")]
    pub fn bits(&self, theta_e: f64) -> u32 {
        let sector = ((theta_e - self.offset) / FRAC_PI_3).floor().rem_euclid(6.0);
        SECTORS[(sector as usize).min(5)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Each sensor is high over half a period that begins at its own angle.
    #[test]
    fn each_sensor_is_high_for_half_a_period() {
        let hall = Hall { offset: 0.2 };
        for k in -400..400 {
            let theta = 0.2 + 0.031 * f64::from(k);
            let expected: u32 = (0..3_u32)
                .map(|x| {
                    let turned = (theta - 0.2 - f64::from(x) * 2.0 * FRAC_PI_3).rem_euclid(2.0 * PI);
                    u32::from(turned < PI) << x
                })
                .sum();
            assert_eq!(hall.bits(theta), expected, "{theta}");
        }
    }

    #[test]
    fn forward_the_bits_have_their_order() {
        let bits: Vec<u32> = (0..7_u32).map(|k| Hall::default().bits((f64::from(k) + 0.5) * FRAC_PI_3)).collect();
        assert_eq!(bits, [5, 1, 3, 2, 6, 4, 5]);
    }
}
