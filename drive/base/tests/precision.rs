//! The greatest error of each elementary function, in units in the last place (ulp) of the exact result, against arithmetic of 200 bits;
//! `precision.csv` has it with its arguments.
//!
//! `PRECISION=1000000 cargo test -p drive-base --test precision` tries that many random arguments of each; a build tries a few. Another
//! error at the known arguments fails, as does a greater one anywhere.
#![allow(missing_docs)]

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use drive_base::math;
use fmu_core::draw::Draw;
use std::fmt::Write;
use std::path::Path;

type Exact = FBig<HalfEven, 2>;

fn exact(x: f64) -> Exact {
    Exact::try_from(x).unwrap().with_precision(200).value()
}

fn exact_sum(x: f64, d: f64) -> Exact {
    exact(x) + exact(d)
}

/// Two arguments, ours, exact.
type Function = (fn(f64, f64) -> f64, fn(f64, f64) -> Exact);

/// A function and the ranges of the magnitudes of its arguments, which have any sign.
struct Row {
    name: &'static str,
    of: Function,
    ranges: [(f64, f64); 2],
}

const NONE: (f64, f64) = (0.0, 0.0);

const ROWS: &[Row] = &[
    Row { name: "sin", of: (|x, _| math::sin_cos(x).0, |x, _| exact(x).sin()), ranges: [(1e-9, 1.6e6), NONE] },
    Row { name: "cos", of: (|x, _| math::sin_cos(x).1, |x, _| exact(x).cos()), ranges: [(1e-9, 1.6e6), NONE] },
    Row {
        name: "sin near a multiple of pi / 2",
        of: (|x, _| math::sin_cos(near(x)).0, |x, _| exact(near(x)).sin()),
        ranges: [(1.0, 1e6), NONE],
    },
    Row { name: "sin large", of: (|x, _| math::sin_cos(x).0, |x, _| exact(x).sin()), ranges: [(1.6e6, 1e20), NONE] },
    Row { name: "cos large", of: (|x, _| math::sin_cos(x).1, |x, _| exact(x).cos()), ranges: [(1.6e6, 1e20), NONE] },
    Row {
        name: "sin small",
        of: (|x, _| math::sin_cos_small(x).0, |x, _| exact(x).sin()),
        ranges: [(1e-9, 0.3), NONE],
    },
    Row {
        name: "cos small",
        of: (|x, _| math::sin_cos_small(x).1, |x, _| exact(x).cos()),
        ranges: [(1e-9, 0.3), NONE],
    },
    Row {
        name: "sin tiny",
        of: (|x, _| math::sin_cos_tiny(x).0, |x, _| exact(x).sin()),
        ranges: [(1e-9, 0.004), NONE],
    },
    Row {
        name: "cos tiny",
        of: (|x, _| math::sin_cos_tiny(x).1, |x, _| exact(x).cos()),
        ranges: [(1e-9, 0.004), NONE],
    },
    Row { name: "atan2", of: (math::atan2, |y, x| exact(y).atan2(&exact(x))), ranges: [(1e-6, 1e6), (1e-6, 1e6)] },
    Row { name: "exp", of: (|x, _| math::exp(x), |x, _| exact(x).exp()), ranges: [(1e-9, 709.0), NONE] },
    Row { name: "ln", of: (|x, _| math::ln(x.abs()), |x, _| exact(x.abs()).ln()), ranges: [(1e-150, 1e150), NONE] },
    Row { name: "ln near 1", of: (|x, _| math::ln(1.0 + x), |x, _| exact(1.0 + x).ln()), ranges: [(1e-9, 0.9), NONE] },
    Row { name: "tanh", of: (|x, _| math::tanh(x), |x, _| exact(x).tanh()), ranges: [(1e-9, 30.0), NONE] },
    Row {
        name: "tanh of a sum",
        of: (|x, d| math::tanh_beside(math::tanh(x.abs()), d.abs()), |x, d| exact_sum(x.abs(), d.abs()).tanh()),
        ranges: [(1e-3, 30.0), (1e-9, 0.5)],
    },
];

/// The double that is nearest to the multiple of pi / 2 below `x`.
fn near(x: f64) -> f64 {
    x.trunc() * std::f64::consts::FRAC_PI_2
}

/// The error in ulp of the exact result.
fn error(row: &Row, (x, y): (f64, f64)) -> f64 {
    let (ours, exactly) = ((row.of.0)(x, y), (row.of.1)(x, y));
    let size = exactly.to_f64().value().abs();
    ((exact(ours) - exactly).to_f64().value() / (size.next_up() - size)).abs()
}

/// Of a random magnitude in the range, and of random sign.
fn drawn(draw: &mut Draw, (low, high): (f64, f64)) -> f64 {
    if high > 0.0 { draw.scaled(low, high) * draw.of(&[-1.0, 1.0]) } else { 0.0 }
}

#[test]
fn no_error_is_greater_than_the_table_says() {
    let count = std::env::var("PRECISION").map_or(2000, |n| n.parse().expect("a number of arguments"));
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/precision.csv");
    let old = std::fs::read_to_string(&file).unwrap();
    let mut new = String::from("function,greatest error in ulp,first argument,second argument\n");
    for (k, row) in ROWS.iter().enumerate() {
        let line = old.lines().find_map(|line| line.strip_prefix(row.name)?.strip_prefix(','));
        let known = |line: &str| line.split(',').skip(1).map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
        let mut at = line.map(known).map_or((row.ranges[0].1, row.ranges[1].1), |x| (x[0], x[1]));
        let mut most = error(row, at);
        let mut draw = Draw(k as u64);
        for _ in 0..count {
            let [x, y] = row.ranges.map(|range| drawn(&mut draw, range));
            let error = error(row, (x, y));
            if error > most {
                (most, at) = (error, (x, y));
            }
        }
        writeln!(new, "{},{most:.4},{:e},{:e}", row.name, at.0, at.1).unwrap();
    }
    print!("{new}");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        return std::fs::write(file, new).unwrap();
    }
    assert_eq!(new, old, "UPDATE_GOLDEN=1 writes tests/precision.csv");
}
