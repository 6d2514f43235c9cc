//! A record of a running drive, checked: voltages and currents as vectors in stator axes, the angle, the load, and the stretches
//! without gaps.

use super::columns::{Naming, Signals};
use crate::error::{Result, WithContext, bail, ensure};
use serde::Deserialize;
use std::f64::consts::PI;
use std::ops::Range;

/// A vector in the plane of the stator.
pub type Complex = nalgebra::Complex<f64>;

/// Information that a record does not contain.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Names and units of columns.
    pub naming: Naming,
    /// Pole pairs.
    pub n_p: Option<i32>,
    /// Maximum current in A, peak value; the maximum of the record if `None`.
    pub current: Option<f64>,
    /// Rated mechanical speed in rad/s; the maximum of the record if `None`.
    pub speed: Option<f64>,
    /// Rated torque in N.m; the maximum of the record if `None`.
    pub torque: Option<f64>,
    /// DC-link voltage in V; the mean of the column `u_dc` if `None`.
    pub u_dc: Option<f64>,
    /// Samples of the controller between a row and the action of its voltage; the best of 0, 0.5, 1, 1.5, 2 if `None`.
    pub delay: Option<f64>,
    /// Samples of the controller per row of the record; 1 if `None`.
    pub every: Option<u32>,
    /// Rows per second, instead of a column `t`.
    pub rate: Option<f64>,
    /// Times in s between which there is no current.
    pub zero: Option<(f64, f64)>,
    /// Column of the load torque, `tau_load` or `tau_shaft`; `none` for a free shaft; the existing column if `None`.
    pub load: Option<String>,
    /// Values that a commissioning run does not provide, by their names in a motor file.
    pub given: Vec<(String, f64)>,
}

/// Minimum number of rows of a record.
const ROWS: usize = 2000;

/// Rows per second.
const RATES: std::ops::RangeInclusive<f64> = 200.0..=200e3;

/// Maximum current of a record over the maximum current.
const MOST: f64 = 3.0;

/// A record. All vectors have one element per row.
#[derive(Clone, Debug)]
pub struct BenchRecord {
    /// Name of the file.
    pub file: String,
    /// Time in s.
    pub t: Vec<f64>,
    /// Median step of the time in s.
    pub step: f64,
    /// Stator voltage in V, stator axes.
    pub u: Vec<Complex>,
    /// The voltage was given in rotor axes of the angle at which it acts.
    pub rotor_voltage: bool,
    /// Stator current in A, stator axes, without its offset.
    pub i: Vec<Complex>,
    /// Electrical angle in rad, unwrapped in each stretch.
    pub theta: Vec<f64>,
    /// Load torque in N.m; `None`: unknown.
    pub load: Option<Vec<f64>>,
    /// Mean DC-link voltage in V.
    pub u_dc: Option<f64>,
    /// Stretches of rows without a gap, a clipped current or open gates.
    pub runs: Vec<Range<usize>>,
    /// Noise of the current vector in A: standard deviation.
    pub sigma: f64,
    /// Notes for the reader.
    pub notes: Vec<String>,
}

impl BenchRecord {
    /// A record without a row.
    #[cfg(test)]
    pub(super) fn empty() -> Self {
        Self {
            file: String::new(),
            t: Vec::new(),
            step: 1e-4,
            u: Vec::new(),
            rotor_voltage: false,
            i: Vec::new(),
            theta: Vec::new(),
            load: None,
            u_dc: None,
            runs: Vec::new(),
            sigma: 0.0,
            notes: Vec::new(),
        }
    }

    /// The record in these signals.
    ///
    /// # Errors
    /// A column is missing, time does not increase, or values contradict each other.
    pub fn new(signals: &Signals, options: &Options) -> Result<Self> {
        let mut notes = Vec::new();
        let rows = signals.lines.len();
        ensure!(rows >= ROWS, "{}: has {rows} rows; expected at least {ROWS}: record longer or faster", signals.file);
        let t = time(signals, options)?;
        let step = median(t.windows(2).map(|w| w[1] - w[0]).collect());
        let mut runs = stretches(signals, &t, step)?;
        let rate = 1.0 / step;
        if !RATES.contains(&rate) {
            let what = format!(
                "the rate of {rate:.4} Hz is not within 200 Hz to 200 kHz: check the unit of t, for example t [ms]"
            );
            return signals.refuse(1, "t", &what);
        }
        let theta = angle(signals, options, &runs)?;
        let u_dc_column = signals.get("u_dc");
        let u_dc = options.u_dc.or_else(|| u_dc_column.map(mean));
        let (u, rotor_voltage) = voltage(signals, &theta)?;
        if let Some(u_dc) = u_dc
            && let Some(row) = u.iter().position(|u| u.norm() > u_dc)
        {
            let what = format!(
                "|u| = {:.4} V is above u_dc = {u_dc:.4} V: give phase voltages as means over a period, or check the units",
                u[row].norm()
            );
            return signals.refuse(row, "u", &what);
        }
        ensure!(
            u.iter().any(|u| u.norm() > 0.0),
            "{}: all voltages are 0: record the commanded voltages",
            signals.file
        );
        let clipped = clipped(signals);
        let mut i = current(signals, &theta, &clipped)?;
        if let Some(most) = options.current
            && let Some(row) = i.iter().position(|i| i.norm() > MOST * most)
        {
            let what = format!(
                "|i| = {:.4} A is above {MOST} times --current {most}: check the units, for example i_a [mA]",
                i[row].norm()
            );
            return signals.refuse(row, "i", &what);
        }
        let closed = signals.get("enable").map(|e| e.iter().map(|&e| e > 0.5).collect::<Vec<_>>());
        if clipped.iter().any(|&c| c) {
            let count = clipped.iter().filter(|&&c| c).count();
            notes.push(format!("clipped currents: {count} rows were left out"));
        }
        let good = |row: usize| !clipped[row] && closed.as_ref().is_none_or(|closed| closed[row]);
        runs = runs.into_iter().flat_map(|run| split(run, good)).filter(|run| run.len() >= 64).collect();
        ensure!(
            !runs.is_empty(),
            "{}: has no stretch of 64 rows without a gap, a clipped current or open gates",
            signals.file
        );

        let zero = zero(&t, &u, closed.as_deref(), options)?;
        let sigma = match &zero {
            Some(rows) => noise(&i, &theta, std::slice::from_ref(rows), false),
            None => noise(&i, &theta, &runs, true),
        };
        if let Some(rows) = zero {
            let offset = i[rows.clone()].iter().sum::<Complex>() / rows.len() as f64;
            for i in &mut i {
                *i -= offset;
            }
        } else {
            notes.push("no row is without voltage at the start: the currents are taken without an offset (--zero 0:0.05 names a time without current)".into());
        }
        let load = match options.load.as_deref() {
            Some("none") => Some(vec![0.0; rows]),
            Some(column) => {
                let missing = || format!("{}: --load {column}: the record has no such column", signals.file);
                Some(signals.get(column).with_context(missing)?.to_vec())
            }
            None => signals.get("tau_load").or_else(|| signals.get("tau_shaft")).map(<[f64]>::to_vec),
        };
        Ok(Self { file: signals.file.clone(), t, step, u, rotor_voltage, i, theta, load, u_dc, runs, sigma, notes })
    }

    /// Rows in all stretches.
    pub fn rows(&self) -> impl Iterator<Item = usize> {
        self.runs.iter().flat_map(Clone::clone)
    }

    /// Maximum current in A, without single peaks.
    pub fn peak(&self) -> f64 {
        quantile(self.rows().map(|k| self.i[k].norm()).collect(), 0.999)
    }
}

/// Noise of a current vector, from its third differences, which vanish for a smooth signal. A current that rotates with the
/// rotor is first transformed to rotor axes.
fn noise(i: &[Complex], theta: &[f64], runs: &[Range<usize>], turning: bool) -> f64 {
    /// Rows on each side that determine the slope, and thus the turn, at a row.
    const REACH: usize = 20;
    let (mut squares, mut count) = (0.0, 0.0_f64);
    for run in runs {
        for k in run.start..run.end.saturating_sub(3) {
            let (from, to) = (k.saturating_sub(REACH).max(run.start), (k + 3 + REACH).min(run.end - 1));
            let turn = if turning { (theta[to] - theta[from]) / (to - from) as f64 } else { 0.0 };
            let r = Complex::cis(turn);
            let rest = i[k + 3] - r * (i[k + 2] * 3.0 - r * (i[k + 1] * 3.0 - r * i[k]));
            squares += rest.norm_sqr();
            count += 1.0;
        }
    }
    (squares / (20.0 * count.max(1.0))).sqrt()
}

/// Mean of some values; 0 if there are none.
pub fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}

/// The `p` quantile of the values.
pub fn quantile(mut x: Vec<f64>, p: f64) -> f64 {
    if x.is_empty() {
        return 0.0;
    }
    let place = ((x.len() - 1) as f64 * p).round() as usize;
    *x.select_nth_unstable_by(place, f64::total_cmp).1
}

fn median(x: Vec<f64>) -> f64 {
    quantile(x, 0.5)
}

fn time(signals: &Signals, options: &Options) -> Result<Vec<f64>> {
    match (options.rate, signals.get("t")) {
        (Some(rate), _) => Ok((0..signals.lines.len()).map(|k| k as f64 / rate).collect()),
        (None, Some(t)) => Ok(t.to_vec()),
        (None, None) => {
            bail!("{}: has no column t; add it, name it with --map t=..., or give --rate in Hz", signals.file)
        }
    }
}

/// Rows between gaps in time.
fn stretches(signals: &Signals, t: &[f64], step: f64) -> Result<Vec<Range<usize>>> {
    let mut runs = Vec::new();
    let mut start = 0;
    for k in 1..t.len() {
        let dt = t[k] - t[k - 1];
        if dt <= 0.0 {
            return signals.refuse(k, "t", &format!("{} s does not follow {} s: time must increase", t[k], t[k - 1]));
        }
        if dt > 1.5 * step {
            runs.push(start..k);
            start = k;
        } else if (dt - step).abs() > 0.2 * step {
            let what = format!(
                "the step of {dt:.4e} s is not the usual {step:.4e} s: record at a constant rate, or give --rate"
            );
            return signals.refuse(k, "t", &what);
        }
    }
    runs.push(start..t.len());
    Ok(runs)
}

/// The electrical angle, unwrapped.
fn angle(signals: &Signals, options: &Options, runs: &[Range<usize>]) -> Result<Vec<f64>> {
    let n_p = options.n_p.map(f64::from);
    let (name, mut theta, factor) = match (signals.get("theta"), signals.get("angle"), n_p) {
        (Some(theta), ..) => ("theta", theta.to_vec(), 1.0),
        (None, Some(angle), Some(n_p)) => ("angle", angle.to_vec(), n_p),
        (None, Some(_), None) => {
            bail!("{}: has the mechanical angle; --n-p gives the number of pole pairs", signals.file)
        }
        (None, None, _) => {
            bail!(
                "{}: has no angle: add theta (electrical) or angle (mechanical), or name it with --map theta=...",
                signals.file
            )
        }
    };
    for run in runs {
        let mut turns = 0.0;
        let mut last = theta[run.start];
        for (k, theta) in theta.iter_mut().enumerate().take(run.end).skip(run.start + 1) {
            let jump = *theta - last;
            if jump.abs() > 2.2 * PI {
                let what = format!(
                    "jumps by {jump:.4} rad, more than a turn, between two rows: check its unit, for example {name} [deg]"
                );
                return signals.refuse(k, name, &what);
            }
            last = *theta;
            turns -= (jump / (2.0 * PI)).round();
            *theta += turns * 2.0 * PI;
        }
    }
    for x in &mut theta {
        *x *= factor;
    }
    Ok(theta)
}

/// The vector of three phases, without their common part.
fn vector(a: f64, b: f64, c: f64) -> Complex {
    Complex::new((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}

fn turned(d: &[f64], q: &[f64], theta: &[f64]) -> Vec<Complex> {
    d.iter().zip(q).zip(theta).map(|((d, q), theta)| Complex::new(*d, *q) * Complex::cis(*theta)).collect()
}

/// The voltage vector, and whether it was given in rotor axes.
fn voltage(signals: &Signals, theta: &[f64]) -> Result<(Vec<Complex>, bool)> {
    let rows = 0..theta.len();
    if let Some([a, b, c]) = signals.all(["u_a", "u_b", "u_c"]) {
        return Ok((rows.map(|k| vector(a[k], b[k], c[k])).collect(), false));
    }
    if let Some([ab, bc]) = signals.all(["u_ab", "u_bc"]) {
        return Ok((rows.map(|k| vector(ab[k], 0.0, -bc[k])).collect(), false));
    }
    if let Some([alpha, beta]) = signals.all(["u_alpha", "u_beta"]) {
        return Ok((rows.map(|k| Complex::new(alpha[k], beta[k])).collect(), false));
    }
    if let Some([d, q]) = signals.all(["u_d", "u_q"]) {
        return Ok((turned(d, q, theta), true));
    }
    if let Some([a, b, c]) = signals.all(["d_a", "d_b", "d_c"]) {
        let Some(u_dc) = signals.get("u_dc") else { bail!("{}: has duties but no u_dc: add the column", signals.file) };
        for (name, duty) in [("d_a", a), ("d_b", b), ("d_c", c)] {
            if let Some(row) = duty.iter().position(|d| !(-0.01..=1.01).contains(d)) {
                return signals.refuse(
                    row,
                    name,
                    &format!("the duty {} is not within 0 to 1: check its unit, for example {name} [%]", duty[row]),
                );
            }
        }
        return Ok((rows.map(|k| vector(a[k], b[k], c[k]) * u_dc[k]).collect(), false));
    }
    bail!(
        "{}: has no voltage: expected u_a,u_b,u_c, or u_ab,u_bc, or u_alpha,u_beta, or u_d,u_q, or d_a,d_b,d_c with u_dc; it has {}",
        signals.file,
        signals.names()
    )
}

/// The current vector. The sum of the phases is judged where no current is `clipped`.
fn current(signals: &Signals, theta: &[f64], clipped: &[bool]) -> Result<Vec<Complex>> {
    let rows = 0..theta.len();
    let phases = ["i_a", "i_b", "i_c"].map(|name| signals.get(name));
    match phases {
        [Some(a), Some(b), Some(c)] => {
            let whole: Vec<usize> = rows.clone().filter(|&k| !clipped[k]).collect();
            let sum: Vec<f64> = whole.iter().map(|&k| a[k] + b[k] + c[k]).collect();
            let shift = mean(&sum);
            let count = sum.len().max(1) as f64;
            // Changes from row to row are sensor noise.
            let noise = sum.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f64>() / (2.0 * count);
            let spread = sum.iter().map(|s| (s - shift).powi(2)).sum::<f64>() / count;
            let rest = (spread - noise).max(0.0).sqrt();
            let square = |k: usize| a[k] * a[k] + b[k] * b[k] + c[k] * c[k];
            let all = (whole.iter().map(|&k| square(k)).sum::<f64>() / count).sqrt();
            if rest > 0.05 * all {
                let worst = (0..sum.len()).max_by(|&x, &y| (sum[x] - shift).abs().total_cmp(&(sum[y] - shift).abs()));
                let what = format!(
                    "i_a + i_b + i_c has {:.1} % of the currents: check signs, units and the wiring of the sensors",
                    100.0 * rest / all
                );
                return signals.refuse(worst.map_or(0, |k| whole[k]), "i_a", &what);
            }
            Ok(rows.map(|k| vector(a[k], b[k], c[k])).collect())
        }
        [Some(a), Some(b), None] => Ok(rows.map(|k| vector(a[k], b[k], -a[k] - b[k])).collect()),
        [Some(a), None, Some(c)] => Ok(rows.map(|k| vector(a[k], -a[k] - c[k], c[k])).collect()),
        [None, Some(b), Some(c)] => Ok(rows.map(|k| vector(-b[k] - c[k], b[k], c[k])).collect()),
        _ => {
            if let Some([alpha, beta]) = signals.all(["i_alpha", "i_beta"]) {
                return Ok(rows.map(|k| Complex::new(alpha[k], beta[k])).collect());
            }
            if let Some([d, q]) = signals.all(["i_d", "i_q"]) {
                return Ok(turned(d, q, theta));
            }
            bail!(
                "{}: has no current: expected two of i_a,i_b,i_c, or i_alpha,i_beta, or i_d,i_q; it has {}",
                signals.file,
                signals.names()
            )
        }
    }
}

/// Rows at or near a clipped current: its extreme three times in a row.
fn clipped(signals: &Signals) -> Vec<bool> {
    let rows = signals.lines.len();
    let mut marked = vec![false; rows];
    for x in ["i_a", "i_b", "i_c"].iter().filter_map(|name| signals.get(name)) {
        let (low, high) = x.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
        for (k, w) in x.windows(3).enumerate() {
            if w.iter().all(|x| *x >= high) || w.iter().all(|x| *x <= low) {
                marked[k.saturating_sub(5)..(k + 8).min(rows)].fill(true);
            }
        }
    }
    marked
}

/// The parts of a stretch whose rows are good.
fn split(run: Range<usize>, good: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut parts = Vec::new();
    let mut start = run.start;
    for k in run.clone() {
        if !good(k) {
            parts.push(start..k);
            start = k + 1;
        }
    }
    parts.push(start..run.end);
    parts
}

/// Rows without current, for the offset: given by `--zero`, or the initial rows without voltage.
fn zero(t: &[f64], u: &[Complex], closed: Option<&[bool]>, options: &Options) -> Result<Option<Range<usize>>> {
    if let Some((from, to)) = options.zero {
        let row = |time: f64| t.partition_point(|&t| t < time);
        let rows = row(from)..row(to);
        ensure!(rows.len() >= 20, "--zero {from}:{to} has {} rows; expected at least 20", rows.len());
        return Ok(Some(rows));
    }
    let rest = |k: usize| u[k].norm() == 0.0 || closed.is_some_and(|closed| !closed[k]);
    let end = (0..t.len()).find(|&k| !rest(k)).unwrap_or(t.len());
    // The voltage of a row may act a row later, and the previous row's voltage until then.
    Ok((end >= 20).then_some(0..end))
}
