//! The bridge: legs of two switches with diodes, dead time, and the legs whose diodes block.
//!
//! A leg with a current i > 0 into the machine has the voltage `low`, with i < 0 `high`:
//!
//! | on | i > 0 | i < 0 |
//! |---|---|---|
//! | upper switch | u_dc (upper transistor) | u_dc (upper diode) |
//! | lower switch | 0 (lower diode) | 0 (lower transistor) |
//! | none | 0 (lower diode) | u_dc (upper diode) |
//!
//! After a command, both switches of a leg are off for the dead time; a command that does not last as long vanishes. Where
//! the voltage depends on the sign of the current, a current that reaches zero stays zero as long as the voltage that keeps
//! it there lies between `low` and `high`; beyond, a diode conducts again. So each leg of zero current has one of three
//! states, and the laws of the three legs have exactly one solution: a linear complementarity problem with a positive
//! definite matrix. u in V, i in A, times in s.

use drive_base::frame::{AlphaBeta, Phases, SQRT_3};
use serde::{Deserialize, Serialize};

/// States of a leg without current that are tried in turn: blocking comes first.
const CHOICES: [i8; 3] = [0, 1, -1];

/// Directions of the three phases in stator axes.
pub(super) const DIRECTIONS: [AlphaBeta; 3] =
    [AlphaBeta::new(1.0, 0.0), AlphaBeta::new(-0.5, 0.5 * SQRT_3), AlphaBeta::new(-0.5, -0.5 * SQRT_3)];

/// What a leg is commanded to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Command {
    /// Both switches are off.
    #[default]
    Off,
    /// The lower switch is on.
    Lower,
    /// The upper switch is on.
    Upper,
}

/// State of a leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Leg {
    command: Command,
    /// Time in s until the commanded switch is on.
    pub(super) wait: f64,
    /// Sign of the current, where the voltage depends on it; 0: it blocks.
    pub(super) side: i8,
}

impl Leg {
    /// Commands the leg, with a dead time of `dead_time` (s); returns whether the command is new.
    #[inline]
    pub(super) fn command(&mut self, command: Command, dead_time: f64) -> bool {
        let new = command != self.command;
        if new {
            self.command = command;
            self.wait = if command == Command::Off { 0.0 } else { dead_time };
        }
        new
    }

    /// What it does at present.
    #[inline]
    pub(super) fn on(&self) -> Command {
        if self.wait > 0.0 { Command::Off } else { self.command }
    }

    /// Its voltage (V) with a positive and with a negative current, on a link of `u_dc` (V).
    #[inline]
    pub(super) fn bounds(&self, u_dc: f64) -> [f64; 2] {
        match self.on() {
            Command::Off => [0.0, u_dc],
            Command::Lower => [0.0, 0.0],
            Command::Upper => [u_dc, u_dc],
        }
    }
}

/// Stator voltage (V) of these voltages of the legs.
#[inline]
pub(super) fn stator([a, b, c]: [f64; 3]) -> AlphaBeta {
    Phases { a, b, c }.to_stator()
}

/// The machine at an instant: the derivative of its current is affine in the stator voltage.
pub(super) struct Response {
    /// Current in A.
    pub(super) i: AlphaBeta,
    /// Derivative of the current without a voltage, in A/s.
    pub(super) at_0: AlphaBeta,
    /// Derivatives per volt along alpha and beta.
    pub(super) by: [AlphaBeta; 2],
}

impl Response {
    fn slope(&self, u: AlphaBeta) -> AlphaBeta {
        self.at_0 + self.by[0] * u.alpha() + self.by[1] * u.beta()
    }

    /// Voltage (V) of the leg `x` that keeps its current constant, with the stator voltage `u` (V) of the others.
    pub(super) fn floating(&self, x: usize, u: AlphaBeta) -> f64 {
        let n = DIRECTIONS[x];
        let by = n.dot(self.by[0] * n.alpha() + self.by[1] * n.beta()) * (2.0 / 3.0);
        -n.dot(self.slope(u)) / by
    }

    /// Voltages (V) of the legs, except for a common part, that keep all currents constant.
    pub(super) fn resting(&self) -> [f64; 3] {
        let ([p, q], r) = (self.by, self.at_0);
        let by = 1.0 / p.cross(q);
        let u = AlphaBeta::new(-r.cross(q) * by, -p.cross(r) * by);
        DIRECTIONS.map(|n| n.dot(u))
    }

    /// Whether legs with these `bounds` (V) and the `sides` obey their laws.
    fn holds(&self, bounds: [[f64; 2]; 3], zero: [bool; 3], sides: [i8; 3]) -> bool {
        let blocked = |x: usize| zero[x] && sides[x] == 0;
        let fixed = |x: usize| if blocked(x) { 0.0 } else { bounds[x][usize::from(sides[x] < 0)] };
        let u = stator([fixed(0), fixed(1), fixed(2)]);
        let within = |x: usize, u: f64| (bounds[x][0]..=bounds[x][1]).contains(&u);
        let all = [0, 1, 2];
        match all.into_iter().filter(|&x| blocked(x)).count() {
            0 | 1 => {
                let x = all.into_iter().find(|&x| blocked(x));
                let u_x = x.map_or(0.0, |x| self.floating(x, u));
                let u = x.map_or(u, |x| u + DIRECTIONS[x] * (2.0 / 3.0 * u_x));
                let slope = self.slope(u);
                let leaves = |y: usize| f64::from(sides[y]) * DIRECTIONS[y].dot(slope) >= 0.0;
                x.is_none_or(|x| within(x, u_x)) && all.into_iter().all(|y| !zero[y] || blocked(y) || leaves(y))
            }
            2 => {
                let rest = self.resting();
                let x = all.into_iter().find(|&x| !blocked(x)).unwrap_or(0);
                !zero[x] && all.into_iter().all(|y| !blocked(y) || within(y, rest[y] - rest[x] + fixed(x)))
            }
            _ => self.rests(bounds),
        }
    }

    /// Whether three legs without current can all block.
    fn rests(&self, bounds: [[f64; 2]; 3]) -> bool {
        let rest = self.resting();
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for (bounds, rest) in bounds.into_iter().zip(rest) {
            (low, high) = (low.max(bounds[0] - rest), high.min(bounds[1] - rest));
        }
        low <= high
    }

    /// The sides of legs with these `bounds` (V): the signs of their currents, or for a current of at most `tiny` (A) those of the
    /// solution of the laws. Legs whose voltage does not depend on the current have the side 1.
    pub(super) fn sides(&self, bounds: [[f64; 2]; 3], tiny: f64) -> [i8; 3] {
        let (mut sides, mut zero) = ([1_i8; 3], [false; 3]);
        for x in 0..3 {
            let i = DIRECTIONS[x].dot(self.i);
            if bounds[x][0] < bounds[x][1] {
                (sides[x], zero[x]) = (if i < 0.0 { -1 } else { 1 }, i.abs() <= tiny);
            }
        }
        if zero == [false; 3] {
            return sides;
        }
        let choices = |x: usize| if zero[x] { &CHOICES[..] } else { &CHOICES[..1] };
        for &a in choices(0) {
            for &b in choices(1) {
                for &c in choices(2) {
                    let mut tried = sides;
                    for (x, side) in [a, b, c].into_iter().enumerate() {
                        if zero[x] {
                            tried[x] = side;
                        }
                    }
                    if self.holds(bounds, zero, tried) {
                        return tried;
                    }
                }
            }
        }
        // Rounding at the limit of two states: either is right.
        for x in 0..3 {
            if zero[x] {
                sides[x] = 0;
            }
        }
        sides
    }
}
