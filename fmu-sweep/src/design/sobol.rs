//! Sobol's sequence in up to 64 dimensions.
//!
//! Direction numbers: `new-joe-kuo-6.21201` of S. Joe and F. Y. Kuo, *Constructing Sobol sequences with better two-dimensional
//! projections*, SIAM J. Sci. Comput. 30, 2008, <https://web.maths.unsw.edu.au/~fkuo/sobol/>: copyright 2008 Frances Y. Kuo and
//! Stephen Joe, BSD license.

/// Most dimensions.
pub(super) const DIMENSIONS: usize = NUMBERS.len() + 1;

/// Bits of a coordinate that a double represents exactly.
pub(super) const BITS: usize = 52;

/// Direction numbers: the bits of a coordinate flipped by each bit of the Gray code of a point's index, in units of 2^-52.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Dimension([u64; BITS]);

impl Dimension {
    /// Dimension `index`, below [`DIMENSIONS`].
    pub(super) fn new(index: usize) -> Self {
        let mut v = [0; BITS];
        if index == 0 {
            for (k, v) in v.iter_mut().enumerate() {
                *v = 1 << (BITS - 1 - k);
            }
            return Self(v);
        }
        let (degree, coefficients, initial) = NUMBERS[index - 1];
        for k in 0..BITS {
            v[k] = if k < degree {
                u64::from(initial[k]) << (BITS - 1 - k)
            } else {
                let last = v[k - degree] ^ (v[k - degree] >> degree);
                let taken = (1..degree).filter(|i| coefficients >> (degree - 1 - i) & 1 == 1);
                taken.fold(last, |x, i| x ^ v[k - i])
            };
        }
        Self(v)
    }

    /// Coordinate of point `index`, in units of 2^-52. The points follow the Gray code (Antonov and Saleev, 1979); 2^k points
    /// starting at a multiple of 2^k contain one in each of 2^k strata, as in the sequence itself.
    pub(super) fn coordinate(&self, index: u64) -> u64 {
        let gray = index ^ (index >> 1);
        (0..BITS).filter(|bit| gray >> bit & 1 == 1).fold(0, |x, bit| x ^ self.0[bit])
    }
}

/// For dimensions 2 to 64: degree of the primitive polynomial, its inner coefficients as bits, and initial numbers.
#[rustfmt::skip]
const NUMBERS: [(usize, u32, &[u32]); 63] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
    (5, 11, &[1, 1, 5, 1, 1]),
    (5, 13, &[1, 1, 1, 3, 11]),
    (5, 14, &[1, 3, 5, 5, 31]),
    (6, 1, &[1, 3, 3, 9, 7, 49]),
    (6, 13, &[1, 1, 1, 15, 21, 21]),
    (6, 16, &[1, 3, 1, 13, 27, 49]),
    (6, 19, &[1, 1, 1, 15, 7, 5]),
    (6, 22, &[1, 3, 1, 15, 13, 25]),
    (6, 25, &[1, 1, 5, 5, 19, 61]),
    (7, 1, &[1, 3, 7, 11, 23, 15, 103]),
    (7, 4, &[1, 3, 7, 13, 13, 15, 69]),
    (7, 7, &[1, 1, 3, 13, 7, 35, 63]),
    (7, 8, &[1, 3, 5, 9, 1, 25, 53]),
    (7, 14, &[1, 3, 1, 13, 9, 35, 107]),
    (7, 19, &[1, 3, 1, 5, 27, 61, 31]),
    (7, 21, &[1, 1, 5, 11, 19, 41, 61]),
    (7, 28, &[1, 3, 5, 3, 3, 13, 69]),
    (7, 31, &[1, 1, 7, 13, 1, 19, 1]),
    (7, 32, &[1, 3, 7, 5, 13, 19, 59]),
    (7, 37, &[1, 1, 3, 9, 25, 29, 41]),
    (7, 41, &[1, 3, 5, 13, 23, 1, 55]),
    (7, 42, &[1, 3, 7, 3, 13, 59, 17]),
    (7, 50, &[1, 3, 1, 3, 5, 53, 69]),
    (7, 55, &[1, 1, 5, 5, 23, 33, 13]),
    (7, 56, &[1, 1, 7, 7, 1, 61, 123]),
    (7, 59, &[1, 1, 7, 9, 13, 61, 49]),
    (7, 62, &[1, 3, 3, 5, 3, 55, 33]),
    (8, 14, &[1, 3, 1, 15, 31, 13, 49, 245]),
    (8, 21, &[1, 3, 5, 15, 31, 59, 63, 97]),
    (8, 22, &[1, 3, 1, 11, 11, 11, 77, 249]),
    (8, 38, &[1, 3, 1, 11, 27, 43, 71, 9]),
    (8, 47, &[1, 1, 7, 15, 21, 11, 81, 45]),
    (8, 49, &[1, 3, 7, 3, 25, 31, 65, 79]),
    (8, 50, &[1, 3, 1, 1, 19, 11, 3, 205]),
    (8, 52, &[1, 1, 5, 9, 19, 21, 29, 157]),
    (8, 56, &[1, 3, 7, 11, 1, 33, 89, 185]),
    (8, 67, &[1, 3, 3, 3, 15, 9, 79, 71]),
    (8, 70, &[1, 3, 7, 11, 15, 39, 119, 27]),
    (8, 84, &[1, 1, 3, 1, 11, 31, 97, 225]),
    (8, 97, &[1, 1, 1, 3, 23, 43, 57, 177]),
    (8, 103, &[1, 3, 7, 7, 17, 17, 37, 71]),
    (8, 115, &[1, 3, 1, 5, 27, 63, 123, 213]),
    (8, 122, &[1, 1, 3, 5, 11, 43, 53, 133]),
    (9, 8, &[1, 3, 5, 5, 29, 17, 47, 173, 479]),
    (9, 13, &[1, 3, 3, 11, 3, 1, 109, 9, 69]),
    (9, 16, &[1, 1, 1, 5, 17, 39, 23, 5, 343]),
    (9, 22, &[1, 3, 1, 5, 25, 15, 31, 103, 499]),
    (9, 25, &[1, 1, 1, 11, 11, 17, 63, 105, 183]),
    (9, 44, &[1, 1, 5, 11, 9, 29, 97, 231, 363]),
    (9, 47, &[1, 1, 5, 15, 19, 45, 41, 7, 383]),
    (9, 52, &[1, 3, 7, 7, 31, 19, 83, 137, 221]),
    (9, 55, &[1, 1, 1, 3, 23, 15, 111, 223, 83]),
    (9, 59, &[1, 1, 5, 13, 31, 15, 55, 25, 161]),
    (9, 62, &[1, 1, 3, 13, 25, 47, 39, 87, 257]),
];

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact")]
mod tests {
    use super::*;

    /// `scipy.stats.qmc.Sobol(64, scramble=False).random(2048)` of SciPy 1.17.1: row, and some of its coordinates.
    #[test]
    fn points_are_those_of_scipy() {
        const COLUMNS: [usize; 7] = [0, 1, 2, 7, 20, 40, 63];
        #[rustfmt::skip]
        let scipy = [
            (0, [0.0; 7]),
            (1, [0.5; 7]),
            (2, [0.75, 0.25, 0.25, 0.75, 0.25, 0.25, 0.75]),
            (5, [0.875, 0.875, 0.125, 0.375, 0.625, 0.375, 0.625]),
            (1000, [0.219_726_562_5, 0.096_679_687_5, 0.518_554_687_5, 0.899_414_062_5, 0.522_460_937_5, 0.913_085_937_5,
                    0.446_289_062_5]),
            (2047, [0.000_488_281_25, 0.627_441_406_25, 0.931_152_343_75, 0.031_738_281_25, 0.357_910_156_25,
                    0.791_503_906_25, 0.988_769_531_25]),
        ];
        for (index, expected) in scipy {
            #[expect(clippy::cast_precision_loss, reason = "52 bits are exact")]
            let found = COLUMNS.map(|d| Dimension::new(d).coordinate(index) as f64 / (1_u64 << BITS) as f64);
            assert_eq!(found, expected, "{index}");
        }
    }

    #[test]
    fn every_coordinate_has_one_point_per_stratum() {
        for index in 0..DIMENSIONS {
            let dimension = Dimension::new(index);
            let mut strata: Vec<u64> = (256..512).map(|k| dimension.coordinate(k) >> (BITS - 8)).collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..256).collect::<Vec<_>>(), "{index}");
        }
    }
}
