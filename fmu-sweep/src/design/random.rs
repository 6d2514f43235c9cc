//! Random numbers as a function of row and column: no generator, no order.

use fmu_core::draw::{GOLDEN, mix};

/// Random bits of a cell.
pub(super) fn bits(seed: u64, column: u64, row: u64) -> u64 {
    let of_column = mix(seed.wrapping_add(GOLDEN.wrapping_mul(column.wrapping_add(1))));
    mix(of_column.wrapping_add(GOLDEN.wrapping_mul(row.wrapping_add(1))))
}

/// A number strictly between 0 and 1: the middle of one of 2^52 intervals.
pub(super) fn unit(bits: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "52 bits and a half are exact")]
    let middle = (bits >> 12) as f64 + 0.5;
    middle / 4_503_599_627_370_496.0
}

/// The position of `row` in a permutation of `0..count` that `key` selects: a Feistel network over an even number of bits, walked
/// until it lands in the range.
pub(super) fn permuted(key: u64, row: u64, count: u64) -> u64 {
    let bits_of_count = u64::BITS - count.saturating_sub(1).leading_zeros();
    let half = bits_of_count.div_ceil(2).max(1);
    let mask = (1_u64 << half) - 1;
    let mut x = row;
    loop {
        let (mut left, mut right) = (x >> half, x & mask);
        for round in 0..6 {
            (left, right) = (right, left ^ (bits(key, round, right) & mask));
        }
        x = (left << half) | right;
        if x < count {
            return x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permutation_has_every_number_once() {
        for count in [1, 2, 3, 7, 64, 1000, 4097] {
            for key in [0, 1, u64::MAX] {
                let mut all: Vec<u64> = (0..count).map(|row| permuted(key, row, count)).collect();
                all.sort_unstable();
                assert_eq!(all, (0..count).collect::<Vec<_>>(), "{count} {key}");
            }
        }
        let order = |key| (0..64).map(|row| permuted(key, row, 64)).collect::<Vec<_>>();
        assert_ne!(order(1), order(2));
    }

    #[test]
    fn cells_are_evenly_and_independently_filled() {
        let n = 100_000_u32;
        let mean = |f: &dyn Fn(u64) -> f64| (0..u64::from(n)).map(f).sum::<f64>() / f64::from(n);
        let (a, b) = (|row| unit(bits(7, 0, row)), |row| unit(bits(7, 1, row)));
        // Standard deviations of these means: 0.0009, 0.0009, 0.0003, 0.0003.
        assert!((mean(&a) - 0.5).abs() < 0.004);
        assert!((mean(&|row| a(row) * a(row)) - 1.0 / 3.0).abs() < 0.004);
        assert!((mean(&|row| (a(row) - 0.5) * (b(row) - 0.5))).abs() < 0.0012);
        assert!((mean(&|row| (a(row) - 0.5) * (a(row + 1) - 0.5))).abs() < 0.0012);
    }

    #[test]
    fn no_number_is_0_or_1() {
        assert!(unit(0) > 0.0 && unit(u64::MAX) < 1.0);
    }
}
