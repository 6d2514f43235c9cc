//! Analog-to-digital converter with its amplifier.
//!
//! ```text
//! count = floor(offset + gain x + 1/2), limited to 0 ... 2^bits - 1
//! ```
//!
//! x is the measured quantity in its unit; gain in counts per unit, offset in counts.

/// Channel of a converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adc {
    /// Counts per unit of the quantity.
    pub gain: f64,
    /// Counts at 0.
    pub offset: f64,
    /// Resolution, 1 to 31 bits.
    pub bits: u32,
}

impl Adc {
    /// The count of the quantity `x`.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to 0 ... 2^31")]
    pub fn count(&self, x: f64) -> u32 {
        let most = f64::from((1_u32 << self.bits.clamp(1, 31)) - 1);
        (self.offset + self.gain * x + 0.5).floor().clamp(0.0, most) as u32
    }

    /// The quantity at the middle of a count.
    pub fn value(&self, count: u32) -> f64 {
        (f64::from(count) - self.offset) / self.gain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ADC: Adc = Adc { gain: 204.8, offset: 2048.0, bits: 12 };

    #[test]
    fn counts_are_rounded_and_limited() {
        let counts = [0.0, 1.0, -1.0, 0.5 / 204.8, 0.49 / 204.8, 9.9951, 10.0, 1e9, -10.0, -1e9].map(|i| ADC.count(i));
        assert_eq!(counts, [2048, 2253, 1843, 2049, 2048, 4095, 4095, 4095, 0, 0]);
        assert_eq!(Adc { bits: 31, gain: 1e20, ..ADC }.count(1.0), 0x7fff_ffff);
    }

    #[test]
    fn a_value_is_within_half_a_count() {
        for k in -900..900 {
            let i = 0.01 * f64::from(k);
            assert!((ADC.value(ADC.count(i)) - i).abs() <= 0.5 / 204.8 + 1e-12, "{i} A");
        }
    }
}
