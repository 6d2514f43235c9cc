//! Stator resistance and the loss of an inverter leg, from a staircase of direct currents of one sign.
//!
//! Along phase a, the legs reduce the commanded voltage by (2/3)(l(i) + l(i/2)). Where all legs carry current,
//!
//! ```text
//! u = R i + (4/3) u_dead - u_dead i_x / i
//! ```
//!
//! gives R, u_dead and i_x by least squares over nine controlled currents. Nine smaller ones follow at constant
//! voltages; f(i) = u - R i of all eighteen, and l(i) = 1.5 f(i) - l(i/2) from the smallest current upward. An error of f
//! returns in each higher octave with the other sign, undiminished, and the bend of f about i_x makes one of some percent of
//! u_dead. So the same equation also leads downward, from u_dead (1 - i_x / (2 i)) at the largest currents, and the curve passes
//! from one to the other near i_x.

use super::align::{Dc, is_still};
use super::bench::{Bench, Sample};
use super::curve::{Curve, OCTAVE, POINTS};
use super::least_squares::{Normal, Solution};
use super::status::CommissionFault as Fault;
use drive_base::frame::AlphaBeta;
use drive_base::math::ln;
use serde::{Deserialize, Serialize};

/// Controlled currents as shares of 0.95 I, then constant voltages for these shares of I.
const HIGH: [f64; 9] = [1.0, 0.85, 0.7, 0.58, 0.46, 0.36, 0.27, 0.2, 0.14];
const LOW: [f64; 9] = [0.11, 0.085, 0.065, 0.05, 0.036, 0.025, 0.016, 0.01, 0.005];
/// Share of I up to which no current flows.
const BLOCKED: f64 = 0.001;
/// All steps.
const STEPS: usize = 18;

/// Result of one staircase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Line {
    /// Resistance in Ohm, dead-time voltage in V and their half-widths.
    pub(super) R: [f64; 2],
    pub(super) u_dead: [f64; 2],
    /// End of the line of a leg in A, and its half-width.
    pub(super) i_x: [f64; 2],
}

/// One staircase.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Staircase {
    /// Mean voltage (V) and current (A) of the steps, from the largest current down.
    points: [[f64; 2]; STEPS],
    #[serde(with = "crate::commission::fixed_size")]
    step: u64,
    /// Samples of this step, windows of it, and the sums of the current window.
    k: f64,
    windows: f64,
    sums: [f64; 4],
    u_last: f64,
    pub(super) line: Line,
}

impl Staircase {
    fn at(&self) -> usize {
        usize::try_from(self.step).unwrap_or(STEPS)
    }

    /// One sample; the command in V, or `Ok(None)`: the staircase is over.
    pub(super) fn update(&mut self, bench: &Bench, dc: &mut Dc, sample: &Sample) -> Result<Option<AlphaBeta>, Fault> {
        let n = self.at();
        let held = n < HIGH.len();
        let i = dc.axis.from_stator(sample.i).d();
        let u = dc.axis.from_stator(sample.u).d();
        let command = if held {
            dc.command(bench, sample, 0.95 * bench.I * HIGH[n])
        } else {
            let i_ref = LOW[n - HIGH.len()] * bench.I;
            dc.open(bench, sample, self.line.R[0] * i_ref + self.line.loss(i_ref))
        };
        self.k += 1.0;
        let (wait, window) = if held {
            let R = if bench.R > 0.0 { bench.R } else { (dc.u / (0.5 * bench.I * HIGH[n])).max(0.0) };
            ((0.06 + 6.0 * (R + bench.K_p()) / bench.K_i()).min(3.0), 0.1)
        } else {
            ((0.02 + 32.0 * bench.L_c / self.line.R[0]).min(0.3), 0.08)
        };
        if self.k * bench.T <= wait {
            return Ok(Some(command));
        }
        let [sum_u, sum_i, sum_q, samples] = &mut self.sums;
        *sum_q += dc.axis.from_stator(sample.i).q();
        (*sum_u, *sum_i, *samples) = (*sum_u + u, *sum_i + i, *samples + 1.0);
        if *samples * bench.T < window {
            return Ok(Some(command));
        }
        let (u, i) = (*sum_u / *samples, *sum_i / *samples);
        // Beyond psi_M / (L_q - L_d) the rotor turns with each step.
        let rests = is_still(bench, *sum_q, *samples);
        self.sums = [0.0; 4];
        self.windows += 1.0;
        let settled = self.windows >= 2.0 && (u - self.u_last).abs() < 0.0005 * u.abs() && rests;
        self.u_last = u;
        if held && !settled && self.windows < 30.0 {
            return Ok(Some(command));
        }
        if held && i < 0.9 * 0.95 * bench.I * HIGH[n] {
            return Err(Fault::Voltage);
        }
        self.points[n] = [u, i];
        (self.k, self.windows) = (0.0, 0.0);
        self.step += 1;
        if n + 1 == HIGH.len() {
            self.line = self.fit().ok_or(Fault::Resistance)?;
        }
        Ok((n + 1 < STEPS).then_some(command))
    }

    /// The line through the controlled currents, and half-widths: those of white residuals, or 2.36 standard errors of the
    /// jackknife that leaves out one current at a time, which reveals a tail other than 1/i.
    fn fit(&self) -> Option<Line> {
        let whole = self.without(HIGH.len())?;
        let (mut half, mut squares) = (whole.half_width, [0.0; 3]);
        for n in 0..HIGH.len() {
            let less = self.without(n)?;
            squares = std::array::from_fn(|k| squares[k] + (less.x[k] - whole.x[k]) * (less.x[k] - whole.x[k]));
        }
        half = std::array::from_fn(|k| half[k].max(2.36 * (squares[k] * (8.0 / 9.0)).sqrt()));
        let [R, four_thirds, tail] = whole.x;
        let u_dead = 0.75 * four_thirds;
        let (i_x, i_x_half) = if u_dead > 0.0 { (tail / u_dead, half[2] / u_dead) } else { (0.0, 0.0) };
        (R > 0.0).then_some(Line { R: [R, half[0]], u_dead: [u_dead, 0.75 * half[1]], i_x: [i_x, i_x_half] })
    }

    /// Least squares without the current `left_out`; without the tail if that is negative.
    fn without(&self, left_out: usize) -> Option<Solution<3>> {
        let solve = |tail: f64| {
            let mut normal = Normal::default();
            for (n, &[u, i]) in self.points[..HIGH.len()].iter().enumerate() {
                if n != left_out {
                    normal.add(&[i, 1.0, -tail / i], u);
                }
            }
            normal.solve(0.0)
        };
        let found = solve(1.0)?;
        if found.x[2] < 0.0 || found.x[1] <= 0.0 { solve(0.0) } else { Some(found) }
    }

    /// f(i) = u - R i in V at the current `i` (A), with this `R` (Ohm): linear in ln i between the points.
    fn lost(&self, R: f64, i: f64, I: f64) -> f64 {
        let f = |n: usize| self.points[n][0] - R * self.points[n][1];
        let last = self.carrying(I).max(1) - 1;
        let lowest = self.points[last][1];
        if i <= lowest {
            return f(last) * i / lowest;
        }
        // The first point from above that is not greater.
        let n = (0..=last).find(|&n| self.points[n][1] <= i).unwrap_or(last);
        if n == 0 {
            return f(0);
        }
        let (below, above) = (self.points[n][1], self.points[n - 1][1]);
        f(n) + (f(n - 1) - f(n)) * ln(i / below) / ln(above / below)
    }

    /// Number of points from the largest current down to the smallest one that flows. At a voltage below the loss of legs that
    /// block without current, none does.
    fn carrying(&self, I: f64) -> usize {
        let mut last = f64::INFINITY;
        let flows = |p: &&[f64; 2]| {
            let less = p[1] > BLOCKED * I && p[1] < last;
            last = p[1];
            less
        };
        self.points.iter().take_while(flows).count()
    }
}

impl Line {
    /// Voltage (V) that the legs lose along a phase at the current `i` (A).
    fn loss(&self, i: f64) -> f64 {
        let [u_dead, i_x] = [self.u_dead[0], self.i_x[0]];
        let leg = |i: f64| if i < i_x { 0.5 * u_dead * i / i_x } else { u_dead * (1.0 - 0.5 * i_x / i) };
        (2.0 / 3.0) * (leg(i) + leg(0.5 * i))
    }
}

/// Adopts the results of the `staircases` (at 120 degrees, and at 0): R, u_dead, i_x and the curve.
pub(super) fn adopt(bench: &mut Bench, staircases: &[Staircase]) -> Result<(), Fault> {
    let each = if staircases.len() == 2 { 0.5 } else { 1.0 };
    let mean = |get: &dyn Fn(&Line) -> f64| staircases.iter().map(|s| get(&s.line)).sum::<f64>() * each;
    (bench.R, bench.u_dead, bench.i_x) = (mean(&|l| l.R[0]), mean(&|l| l.u_dead[0]), mean(&|l| l.i_x[0]));
    if !staircases.iter().all(|s| s.carrying(bench.I) >= HIGH.len()) {
        return Err(Fault::Resistance);
    }
    let R = bench.R;
    let f = |i: f64| staircases.iter().map(|s| s.lost(R, i, bench.I)).sum::<f64>() * each;
    let (mut up, mut down) = (Curve::new(1.024 * bench.I), Curve::new(1.024 * bench.I));
    for n in 0..POINTS {
        let i = up.current(n);
        // Below the table, a leg is a resistance, and f = l.
        let half = if n < OCTAVE { f(0.5 * i) } else { up.at(n - OCTAVE) };
        up.set(n, 1.5 * f(i) - half);
    }
    for n in (0..POINTS).rev() {
        let i = down.current(n);
        let l = if n + OCTAVE < POINTS {
            1.5 * f(2.0 * i) - down.at(n + OCTAVE)
        } else {
            bench.u_dead * (1.0 - 0.5 * bench.i_x / i)
        };
        down.set(n, l);
    }
    // From half an octave below i_x to one and a half above.
    for n in 0..POINTS {
        let octaves = ln(up.current(n) / bench.i_x) / std::f64::consts::LN_2;
        let share = (0.5 * octaves + 0.25).clamp(0.0, 1.0);
        up.set(n, up.at(n) + share * (down.at(n) - up.at(n)));
    }
    bench.curve = up;
    Ok(())
}
