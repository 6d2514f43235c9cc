//! Pseudorandom numbers: SplitMix64 (Steele, Lea, Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014;
//! finalizer: variant 13 of Stafford). A seed gives the same bits and shares on every platform; [`Draw::scaled`] and
//! [`Draw::normal`] use the functions of the platform.
//!
//! Sensors and sweeps compute a number from its position with [`mix`]; tests and studies draw a sequence with [`Draw`].

/// 2^64 divided by the golden ratio, odd.
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A bijection that changes about half of the bits when one changes.
pub const fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A sequence of numbers; the field is the seed.
#[derive(Clone, Debug)]
pub struct Draw(pub u64);

impl Draw {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix(self.0)
    }

    /// Uniform from 0 to below 1, with 53 bits.
    pub fn share(&mut self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
        let digits = (self.bits() >> 11) as f64;
        digits / 9_007_199_254_740_992.0
    }

    /// Uniform between two bounds.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }

    /// Uniform between `-size` and `size`.
    pub fn around(&mut self, size: f64) -> f64 {
        self.between(-size, size)
    }

    /// Uniform between two bounds on a logarithmic scale.
    pub fn scaled(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.share())
    }

    /// Normally distributed with standard deviation 1 (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (self.share() + 1e-300, self.share());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// A whole number below `n`.
    ///
    /// # Panics
    /// If `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.bits() >> 33).unwrap_or_default() % n
    }

    /// One of a list.
    ///
    /// # Panics
    /// If the list is empty.
    pub fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first numbers of seed 1234567, as in the reference implementation by Vigna (prng.di.unimi.it/splitmix64.c).
    #[test]
    fn the_bits_are_those_of_the_reference() {
        let mut draw = Draw(1_234_567);
        let found = [0; 5].map(|_| draw.bits());
        let reference = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        assert_eq!(found, reference);
    }

    #[test]
    fn the_distributions_have_their_means_and_variances() {
        let (mut draw, n) = (Draw(1), 100_000);
        let mut mean = |f: &mut dyn FnMut(&mut Draw) -> f64| (0..n).map(|_| f(&mut draw)).sum::<f64>() / f64::from(n);
        // Standard deviations of these means: 0.0009, 0.0018, 0.0032, 0.0045, 0.009.
        assert!((mean(&mut Draw::share) - 0.5).abs() < 0.004);
        assert!((mean(&mut |d| d.scaled(0.1, 10.0).log10())).abs() < 0.01);
        assert!((mean(&mut Draw::normal)).abs() < 0.013);
        assert!((mean(&mut |d| d.normal().powi(2)) - 1.0).abs() < 0.018);
        assert!((mean(&mut |d| f64::from(d.of(&[0, 1, 2, 10]))) - 3.25).abs() < 0.05);
    }
}
