//! Elementary functions, from the `libm` crate or, where speed matters, by series of basic operations: the same bits on
//! every platform, which the C library does not guarantee.

use fmu_core::Scalar;
use std::f64::consts::SQRT_2;

/// Magnitude of `x`.
#[inline]
pub fn abs<S: Scalar>(x: S) -> S {
    x.chain(x.value().abs(), if x.value() == 0.0 { 0.0 } else { 1.0_f64.copysign(x.value()) })
}

/// Sine and cosine of `x` (rad), to 2e-16; twice as fast as the library.
///
/// x - n pi/2, |.| <= pi/4, by subtracting n times the three parts of pi/2 one after the other (Cody & Waite 1980).
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    // n times the first or second part is exact up to n = 2^20.
    const HALF_PI: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
    const MOST: f64 = 1.6e6;
    // NaN is outside.
    let within = x.abs() <= MOST;
    if !within {
        return far(x);
    }
    let shifted = x * std::f64::consts::FRAC_2_PI + ROUNDS;
    let n = shifted - ROUNDS;
    let (s, c) = sin_cos_octant(((x - n * HALF_PI[0]) - n * HALF_PI[1]) - n * HALF_PI[2]);
    // The last two digits of the shifted number are the quadrant.
    let quadrant = shifted.to_bits();
    let (sin, cos) = if quadrant & 1 == 0 { (s, c) } else { (c, s) };
    let sign = |x: f64, flip: u64| f64::from_bits(x.to_bits() ^ ((flip & 2) << 62));
    (sign(sin, quadrant), sign(cos, quadrant.wrapping_add(1)))
}

/// Sine and cosine for |d| <= pi/4, by minimax polynomials (Remez 1934) with an error below 5e-18.
#[inline]
fn sin_cos_octant(d: f64) -> (f64, f64) {
    const S: [f64; 6] = [
        -0.166_666_666_666_666_32,
        0.008_333_333_333_322_51,
        -0.000_198_412_698_298_627,
        2.755_731_370_571_33e-6,
        -2.505_075_967_742_931_3e-8,
        1.589_685_946_806_468e-10,
    ];
    const C: [f64; 6] = [
        0.041_666_666_666_666_6,
        -0.001_388_888_888_887_418_3,
        2.480_158_728_950_784_3e-5,
        -2.755_731_435_717_772_5e-7,
        2.087_572_365_376_844e-9,
        -1.135_965_562_289_860_3e-11,
    ];
    let z = d * d;
    let z_2 = z * z;
    let series = |a: &[f64; 6]| (a[0] + a[1] * z) + z_2 * ((a[2] + a[3] * z) + z_2 * (a[4] + a[5] * z));
    (d + d * z * series(&S), (1.0 - 0.5 * z) + z_2 * series(&C))
}

/// Angle of the point (`x`, `y`) in rad, in (-pi, pi].
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Numbers above this one have no fractional digits, so adding and then subtracting it rounds to the nearest integer.
const ROUNDS: f64 = 6_755_399_441_055_744.0;

/// 2^(j/64) for j = 0 to 63: e^(j ln(2) / 64) to 60 digits, rounded to the nearest double.
#[rustfmt::skip]
const POWERS_OF_2: [f64; 64] = [
    1.0, 1.010_889_286_051_700_5, 1.021_897_148_654_116_6, 1.033_024_879_021_228_4, 1.044_273_782_427_413_8,
    1.055_645_178_360_557_2, 1.067_140_400_676_823_7, 1.078_760_797_757_119_9, 1.090_507_732_665_257_7, 1.102_382_583_307_841,
    1.114_386_742_595_892_4, 1.126_521_618_608_241_8, 1.138_788_634_756_691_6, 1.151_189_229_952_982_7, 1.163_724_858_777_577_5,
    1.176_396_991_650_281_2, 1.189_207_115_002_721, 1.202_156_731_452_703, 1.215_247_359_980_469, 1.228_480_536_106_87,
    1.241_857_812_073_484, 1.255_380_757_024_691, 1.269_050_957_191_733_2, 1.282_870_016_078_778_3, 1.296_839_554_651_009_6,
    1.310_961_211_524_764_4, 1.325_236_643_159_741_3, 1.339_667_524_053_303, 1.354_255_546_936_892_7, 1.369_002_422_974_590_5,
    1.383_909_881_963_832, 1.398_979_672_538_311_2, SQRT_2, 1.429_613_338_391_97, 1.445_180_806_977_046_7,
    1.460_917_794_180_647, 1.476_826_145_939_499_3, 1.492_907_728_291_264_8, 1.509_164_427_593_422_8, 1.525_598_150_744_538_4,
    1.542_210_825_407_940_7, 1.559_004_400_237_837, 1.575_980_845_107_886_5, 1.593_142_151_342_267, 1.610_490_331_949_254_3,
    1.628_027_421_857_347_8, 1.645_755_478_153_965, 1.663_676_580_326_736_4, 1.681_792_830_507_429, 1.700_106_353_718_523_5,
    1.718_619_298_122_478, 1.737_333_835_273_706_2, 1.756_252_160_373_299_5, 1.775_376_492_526_521_2, 1.794_709_075_003_107_2,
    1.814_252_175_500_398_9, 1.834_008_086_409_342_4, 1.853_979_125_083_385_5, 1.874_167_634_110_3, 1.894_575_981_586_965_6,
    1.915_206_561_397_147_4, 1.936_061_793_492_294_3, 1.957_144_124_175_400_2, 1.978_456_026_387_951,
];

/// e to the power `x`, with an error below 1.3 units in the last place.
///
/// e^x = 2^(n/64) e^r with |r| <= ln(2) / 128: a power from the table and a series, whose first omitted term is below
/// 4e-17. Tang 1989, ACM Trans. Math. Softw. 15 (2), without the tail of the table.
#[inline]
pub fn exp(x: f64) -> f64 {
    if x.abs() <= 700.0 { exp_near(x) } else { exp_far(x) }
}

#[inline]
fn exp_near(x: f64) -> f64 {
    use std::f64::consts::LOG2_E;
    // ln(2) / 64 in two parts; n times the first is exact.
    const STEP: [f64; 2] = [6.931_471_803_691_238e-1 / 64.0, 1.908_214_929_270_587_7e-10 / 64.0];
    let shifted = x * (64.0 * LOG2_E) + ROUNDS;
    let n = shifted - ROUNDS;
    let r = (x - n * STEP[0]) - n * STEP[1];
    let r_2 = r * r;
    let rest = r + r_2 * ((0.5 + r * (1.0 / 6.0)) + r_2 * (1.0 / 24.0 + r * (1.0 / 120.0)));
    // The last digits of the shifted number are n: the last six select the power, and the others, moved to the exponent,
    // multiply by 2.
    let n = shifted.to_bits();
    let [last, ..] = n.to_le_bytes();
    let power = POWERS_OF_2[usize::from(last % 64)].to_bits();
    let power = f64::from_bits(power.wrapping_add((n >> 6) << 52));
    power + power * rest
}

/// Kept out of the code that calls [`exp`].
#[cold]
fn exp_far(x: f64) -> f64 {
    libm::exp(x)
}

/// Natural logarithm of `x`.
#[inline]
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// Hyperbolic tangent of `x`: [`tanh_beside`] 0, or 1 - 2 / (e^2x + 1); to 4e-16, twice as fast as the library.
#[inline]
pub fn tanh(x: f64) -> f64 {
    if x.abs() <= 0.5 { tanh_beside(0.0, x) } else { (1.0 - 2.0 / (exp(2.0 * x.abs()) + 1.0)).copysign(x) }
}

/// Sine and cosine of a small angle `d` (rad), by their series; larger angles go to [`sin_cos`].
///
/// For |d| <= 0.3, the first omitted term is below 3e-17.
#[expect(clippy::inline_always, reason = "a crate is compiled apart from those that use it, and they would call it")]
#[inline(always)]
pub fn sin_cos_small(d: f64) -> (f64, f64) {
    if d.abs() > 0.3 {
        return large(d);
    }
    let z = d * d;
    let z_2 = z * z;
    let s =
        (-1.0 / 6.0 + z * (1.0 / 120.0)) + z_2 * ((-1.0 / 5040.0 + z * (1.0 / 362_880.0)) - z_2 * (1.0 / 39_916_800.0));
    let c = (1.0 / 24.0 - z * (1.0 / 720.0))
        + z_2 * ((1.0 / 40_320.0 - z * (1.0 / 3_628_800.0)) + z_2 * (1.0 / 479_001_600.0));
    (d + d * z * s, (1.0 - 0.5 * z) + z_2 * c)
}

/// Sine and cosine of a tiny angle `d` (rad), by shorter series; larger angles go to [`sin_cos`].
///
/// For |d| <= 0.004, the first omitted term is below 6e-18.
#[inline]
pub fn sin_cos_tiny(d: f64) -> (f64, f64) {
    if d.abs() > 0.004 {
        return large(d);
    }
    let z = d * d;
    (d - d * z * (1.0 / 6.0 - z * (1.0 / 120.0)), 1.0 - z * (0.5 - z * (1.0 / 24.0)))
}

/// Kept out of the code that calls [`sin_cos_small`] in a loop.
#[cold]
#[inline(never)]
fn large(d: f64) -> (f64, f64) {
    sin_cos(d)
}

/// Sine and cosine of an angle outside the range of [`sin_cos`], or of NaN.
#[cold]
#[inline(never)]
fn far(x: f64) -> (f64, f64) {
    libm::sincos(x)
}

/// tanh(x + d) from `t` = tanh(x), for |d| <= 0.5.
///
/// tanh d is its continued fraction to the seventh order (Lambert 1768), whose error is below 2e-16 there; the addition
/// theorem gives (t + tanh d) / (1 + t tanh d), here with one division.
#[inline]
pub fn tanh_beside(t: f64, d: f64) -> f64 {
    let z = d * d;
    let above = d * (135_135.0 + z * (17_325.0 + z * (378.0 + z)));
    let below = 135_135.0 + z * (62_370.0 + z * (3_150.0 + z * 28.0));
    (t * below + above) / (below + t * above)
}

/// The smaller of two numbers: one instruction, unlike [`f64::min`], which also orders NaN. If either is NaN, the result is `x`.
#[inline]
pub fn at_most(x: f64, most: f64) -> f64 {
    if most < x { most } else { x }
}

/// The larger of two numbers, as fast as [`at_most`]. If either is NaN, the result is `x`.
#[inline]
pub fn at_least(x: f64, least: f64) -> f64 {
    if least > x { least } else { x }
}

/// `x` within +-`limit`, by [`at_most`] and [`at_least`].
#[inline]
pub fn within(x: f64, limit: f64) -> f64 {
    at_least(at_most(x, limit), -limit)
}

/// 1/x for x > 0; finite even for a subnormal `x`, so that a product with 0 is 0.
#[inline]
pub fn reciprocal(x: f64) -> f64 {
    (1.0 / x).min(f64::MAX)
}

/// Whether all values are finite.
#[inline]
pub fn all_finite<const N: usize>(values: [f64; N]) -> bool {
    // The sum of finite numbers is finite, unless it overflows.
    values.iter().sum::<f64>().abs() <= f64::MAX || values.iter().all(|x| x.is_finite())
}

/// The angle `x` (rad) wrapped to (-pi, pi].
#[inline]
pub fn wrap(x: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if x > -PI && x <= PI {
        return x;
    }
    let turns = x * (1.0 / TAU);
    let whole = if turns.abs() < 1e15 { (turns + ROUNDS) - ROUNDS } else { turns.round() };
    let turned = x - TAU * whole;
    if turned <= -PI { turned + TAU } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn small_angles_and_neighbors_are_as_exact_as_the_library() {
        for k in -1000..=1000 {
            let d = 4e-4 * f64::from(k);
            for (angle, (sin, cos)) in [(d, sin_cos_small(d)), (0.0125 * d, sin_cos_tiny(0.0125 * d))] {
                let (exact_sin, exact_cos) = sin_cos(angle);
                assert!((sin - exact_sin).abs() < 1e-16 && (cos - exact_cos).abs() < 2.3e-16, "{angle}: {sin} {cos}");
            }
            for x in [-30.0, -2.0, -0.3, 0.0, 1e-3, 0.7, 19.0, 21.0] {
                let (near, exact) = (tanh_beside(tanh(x), d), libm::tanh(x + d));
                assert!((near - exact).abs() < 5e-16, "tanh({x} + {d}): {near} {exact}");
                assert!((tanh(x + d) - exact).abs() < 4e-16, "tanh({})", x + d);
            }
        }
    }

    #[test]
    fn sine_and_cosine_are_as_exact_as_the_library() {
        let mut angles: Vec<f64> = (-40_000..40_000).map(|k| 0.037 * f64::from(k)).collect();
        // Around the edges and centers of the quadrants, and where the library takes over.
        for n in [-1_018_590, -77_777, -3, -2, -1, 0, 1, 2, 3, 4, 5, 1000, 65_537, 1_018_591, 3_000_001] {
            for d in [-1e-3, -1e-9, 0.0, 1e-12, 1e-6] {
                angles.push(f64::from(n) * std::f64::consts::FRAC_PI_4 + d);
            }
        }
        for x in angles {
            let ((sin, cos), (exact_sin, exact_cos)) = (sin_cos(x), libm::sincos(x));
            assert!((sin - exact_sin).abs() < 2.3e-16 && (cos - exact_cos).abs() < 2.3e-16, "{x}: {sin} {cos}");
        }
        assert!(sin_cos(f64::NAN).0.is_nan() && sin_cos(f64::INFINITY).1.is_nan());
        assert!(sin_cos(0.0) == (0.0, 1.0));
    }

    #[test]
    fn exp_is_as_exact_as_the_library() {
        for (power, exponent) in POWERS_OF_2.into_iter().zip(0_u8..) {
            let exact = libm::exp2(f64::from(exponent) / 64.0);
            assert!((power - exact).abs() <= f64::EPSILON, "2^({exponent}/64): {power} {exact}");
        }
        for k in -720_000..=720_000 {
            let x = 1e-3 * f64::from(k) + 1.7e-5;
            let (ours, exact) = (exp(x), libm::exp(x));
            assert!(
                (ours - exact).abs() <= 1.5 * f64::EPSILON * exact || ours.to_bits() == exact.to_bits(),
                "{x}: {ours} {exact}"
            );
        }
        assert!(exp(f64::NAN).is_nan() && exp(f64::NEG_INFINITY) == 0.0 && exp(f64::INFINITY) == f64::INFINITY);
        assert!(tanh(f64::NAN).is_nan() && tanh(f64::NEG_INFINITY).to_bits() == (-1.0_f64).to_bits());
        assert!(exp(0.0).to_bits() == 1.0_f64.to_bits() && exp(-0.0).to_bits() == 1.0_f64.to_bits());
    }

    #[test]
    fn no_number_stays_none() {
        assert!(all_finite([f64::MAX, f64::MAX, -1.0]) && all_finite([0.0; 3]), "a sum that overflows is no fault");
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(!all_finite([1.0, x]) && !all_finite([f64::INFINITY, 1.0, x, f64::MAX, f64::MAX]));
        }
        assert!(within(f64::NAN, 1.0).is_nan() && at_most(f64::NAN, 1.0).is_nan() && at_least(f64::NAN, 1.0).is_nan());
        for (x, expected) in [(-3.0, -2.0), (0.5, 0.5), (f64::INFINITY, 2.0)] {
            assert!((within(x, 2.0) - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn wrap_is_half_open() {
        assert!((wrap(PI) - PI).abs() < 1e-15 && (wrap(-PI) - PI).abs() < 1e-15);
        assert!((wrap(3.0 * PI) - PI).abs() < 1e-14 && (wrap(-7.0) - (-7.0 + 2.0 * PI)).abs() < 1e-14);
        for i in -1000..1000 {
            let x = wrap(0.37 * f64::from(i));
            assert!(x > -PI && x <= PI);
            assert!((sin_cos(x).0 - sin_cos(0.37 * f64::from(i)).0).abs() < 1e-12);
        }
    }
}
