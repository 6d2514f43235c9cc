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
//! A device that conducts subtracts its threshold and its resistance times the current in the direction of the current, so
//! `low` falls and `high` rises by it. A switch that is open (`inverter.open_switch`) leaves its leg to the diodes, and a phase
//! that is open (`inverter.open_phase`) has no limit to its voltage: its current ends at once.
//!
//! After a command, both switches of a leg are off for the dead time; a command that does not last as long vanishes. Where
//! the voltage depends on the sign of the current, a current that reaches zero stays zero as long as the voltage that keeps it
//! there is between `low` and `high`; outside, a diode conducts again. So each leg of zero current has one of three states, and
//! the laws of the three legs have exactly one solution: a linear complementarity problem with a positive definite matrix. u in
//! V, i in A, times in s.

use crate::inverter::Inverter;
use crate::losses::conduction::Devices;
use crate::pwm::OpenSwitch;
use drive_base::frame::{AlphaBeta, Phases, SQRT_3};
use serde::{Deserialize, Serialize};

/// States of a leg without current that are tried in turn: blocking comes first.
const CHOICES: [i8; 3] = [0, 1, -1];

/// Directions of the three phases in stator axes.
pub(super) const DIRECTIONS: [AlphaBeta; 3] =
    [AlphaBeta::new(1.0, 0.0), AlphaBeta::new(-0.5, 0.5 * SQRT_3), AlphaBeta::new(-0.5, -0.5 * SQRT_3)];

/// Command of a leg.
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

    /// Commands the leg without a dead time.
    #[inline]
    pub(super) fn command_at_once(&mut self, command: Command) {
        (self.command, self.wait) = (command, 0.0);
    }

    /// Present state of a leg.
    #[inline]
    pub(super) fn on(&self) -> Command {
        if self.wait > 0.0 { Command::Off } else { self.command }
    }
}

/// How the legs conduct, for each of their states, over a communication step.
pub(super) struct Ways {
    of: [[[Way; 2]; 3]; 3],
    /// A current of the other sign takes another way.
    depends: [[bool; 3]; 3],
}

impl Ways {
    /// On a link of `u_dc` (V).
    pub(super) fn new(Inverter { devices, pwm, .. }: &Inverter, u_dc: f64) -> Self {
        let &Devices { u_transistor, r_transistor, u_diode, r_diode, .. } = devices;
        let through = |rail: f64, is_diode: bool, sign: f64| {
            let (threshold, r) = if is_diode { (u_diode, r_diode) } else { (u_transistor, r_transistor) };
            Way { rail, u: rail - sign * threshold, r }
        };
        let plain = [Command::Off, Command::Lower, Command::Upper].map(|on| {
            let (upper, lower) = (on == Command::Upper, on == Command::Lower);
            let positive = through(if upper { u_dc } else { 0.0 }, !upper, 1.0);
            [positive, through(if lower { 0.0 } else { u_dc }, !lower, -1.0)]
        });
        let mut of = [plain; 3];
        let fault = pwm.open_switch as usize;
        if fault >= OpenSwitch::UpperA as usize {
            let (x, lower) = ((fault - OpenSwitch::UpperA as usize) / 2, fault % 2 == OpenSwitch::LowerA as usize % 2);
            of[x][if lower { Command::Lower } else { Command::Upper } as usize] = plain[Command::Off as usize];
        }
        if let Some(x) = pwm.open_phase.leg() {
            let open = |u| Way { rail: 0.0, u, r: 0.0 };
            of[x] = [[open(f64::NEG_INFINITY), open(f64::INFINITY)]; 3];
        }
        Self { of, depends: of.map(|leg| leg.map(|[positive, negative]| positive != negative)) }
    }

    /// Those of the `legs` in their states.
    pub(super) fn at(&self, legs: &[Leg; 3]) -> [[Way; 2]; 3] {
        [0, 1, 2].map(|x| self.of[x][legs[x].on() as usize])
    }

    /// The paths of the legs at the current `i` (A), which changes by at most `reach` (A), as a number: 8 bits per leg, equal
    /// bits for equal paths. `None` if a sign may change.
    #[inline]
    pub(super) fn numbers(&self, legs: &[Leg; 3], i: AlphaBeta, reach: f64) -> Option<u32> {
        let mut numbers = 0;
        for (x, n) in DIRECTIONS.into_iter().enumerate() {
            let on = legs[x].on();
            let depends = &self.depends[x];
            let number = if depends[on as usize] {
                let i = n.dot(i);
                // An open phase carries no current.
                if i.abs() <= reach || self.of[x][on as usize][1].u == f64::INFINITY {
                    return None;
                }
                let negative = i < 0.0;
                let rail = match (on, negative) {
                    (Command::Off, true) => Command::Upper,
                    (Command::Off, false) => Command::Lower,
                    (on, _) => on,
                };
                2 * rail as u32 + u32::from(negative && depends[rail as usize])
            } else {
                2 * on as u32
            };
            numbers = numbers << 8 | number;
        }
        Some(numbers)
    }

    /// The ways of these `numbers`.
    #[inline]
    pub(super) fn numbered(&self, numbers: u32) -> [Way; 3] {
        let way = |x: usize| {
            let number = (numbers >> (16 - 8 * x) & 7) as usize;
            self.of[x][number / 2 % 3][number % 2]
        };
        [way(0), way(1), way(2)]
    }
}

/// How a leg conducts a current of one sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    /// Voltage of the rail in V.
    pub(super) rail: f64,
    /// Voltage of the leg without current in V.
    pub(super) u: f64,
    /// Resistance in Ohm.
    pub(super) r: f64,
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

    /// The sides of legs with these `bounds` (V): the signs of their currents, or, for a current of at most `tiny` (A), the
    /// solution of the leg equations. Legs that do not depend on the sign have the side 1.
    pub(super) fn sides(&self, bounds: [[f64; 2]; 3], depends: [bool; 3], tiny: f64) -> [i8; 3] {
        let (mut sides, mut zero) = ([1_i8; 3], [false; 3]);
        for x in 0..3 {
            let i = DIRECTIONS[x].dot(self.i);
            if depends[x] {
                (sides[x], zero[x]) = (if i < 0.0 { -1 } else { 1 }, i.abs() <= tiny || bounds[x][1] == f64::INFINITY);
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
