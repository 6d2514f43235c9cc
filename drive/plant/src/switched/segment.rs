//! The machine between two instants at which a leg changes its voltage.
//!
//! The stator voltage is constant, or one leg without current has the voltage that keeps its current at zero, or no leg
//! conducts. Kutta's method of third order in stator axes, where the flux linkage is the integral of the voltage minus the
//! small resistive part: with psi' = f,
//!
//! ```text
//! k_1 = f(psi), k_2 = f(psi + h/2 k_1), k_3 = f(psi + h (2 k_2 - k_1))          psi + h/6 (k_1 + 4 k_2 + k_3)
//! ```
//!
//! A segment lasts a part of a carrier period; over the 100 us of the average inverter the classical method needs its fourth
//! order; over a quarter of that, this one is equally exact. A segment ends early where a current whose sign determines a
//! voltage reaches zero, or where a blocked leg begins to conduct.

use super::bridge::{DIRECTIONS, Response, Way, stator};
use crate::circuit::{Circuit, Passed, Rates, blocked_rates};
use crate::losses::conduction::{Affine, symmetric};
use crate::losses::flow::{Dissipation, Drops, Ideal, Path};
use crate::machine::{magnetic_energy, slope};
use crate::mechanics::{Coulomb, Shaft, Standstill, Whole};
use crate::model::PmsmPlant;
use crate::state::{State, axis_at};
use drive_base::frame::{AlphaBeta, Axis, Dq, Phases, Rotor, Stator, Turn, Vector};
use fmu_core::Scalar;

/// Maximum integration step as a share of that of the method of fourth order.
const SHARE: f64 = 0.5;

/// Largest electrical angle in rad that the rotor turns in an integration step.
const LARGEST_TURN: f64 = 0.1;

/// Maximum number of steps of the search for the end of a segment.
const MOST_SEARCHES: u32 = 60;

/// The machine at an instant, in stator axes.
#[derive(Clone, Copy)]
pub(super) struct Point {
    /// Stator flux linkage in Wb.
    pub(super) psi: AlphaBeta,
    /// Mechanical speed in rad/s.
    pub(super) speed: f64,
    /// Mechanical angle in rad, not wrapped.
    pub(super) angle: f64,
    pub(super) axis: Axis<Rotor>,
}

/// Legs over a segment.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Voltages {
    /// How each leg conducts; one that blocks has no voltage.
    ways: [Way; 3],
    /// Voltages of each leg in V with a positive and with a negative current.
    bounds: [[f64; 2]; 3],
    /// Signs of the currents; 0: the leg blocks.
    sides: [i8; 3],
    /// The leg conducts in another way as soon as its current changes its sign.
    watched: [bool; 3],
}

/// Legs without current.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Blocked {
    None,
    One(usize),
    All,
}

impl Voltages {
    /// Legs that conduct in these `ways` for the duration of the voltages.
    #[inline]
    pub(super) fn fixed(ways: [Way; 3]) -> Self {
        Self { ways, bounds: [[0.0; 2]; 3], sides: [1; 3], watched: [false; 3] }
    }

    /// Legs that conduct in the `ways` of their `sides`, or block, while these last.
    pub(super) fn watched(ways: [[Way; 2]; 3], sides: [i8; 3]) -> Self {
        let none = Way { rail: 0.0, u: 0.0, r: 0.0 };
        let watched = ways.map(|[a, b]| a != b);
        let way = |x: usize| if watched[x] && sides[x] == 0 { none } else { ways[x][usize::from(sides[x] < 0)] };
        Self { ways: [way(0), way(1), way(2)], bounds: ways.map(|ways| ways.map(|way| way.u)), sides, watched }
    }

    /// The legs that block.
    #[inline]
    pub(super) fn blocked(&self) -> Blocked {
        let mut found = Blocked::None;
        for x in 0..3 {
            if self.watched[x] && self.sides[x] == 0 {
                found = if found == Blocked::None { Blocked::One(x) } else { Blocked::All };
            }
        }
        found
    }

    /// Whether the current of each leg flows from or to the upper rail; `None` if it blocks.
    pub(super) fn at_upper_rails(&self) -> [Option<bool>; 3] {
        let rail = |x: usize| (!self.watched[x] || self.sides[x] != 0).then(|| self.ways[x].rail > 0.0);
        [rail(0), rail(1), rail(2)]
    }

    /// The sides of the legs whose voltage depends on them.
    pub(super) fn watched_sides(&self) -> [Option<i8>; 3] {
        [0, 1, 2].map(|x| self.watched[x].then_some(self.sides[x]))
    }

    /// Stator voltage of the legs at the upper rail, as a share of the link's.
    pub(super) fn upper(&self) -> AlphaBeta {
        stator(self.ways.map(|way| if way.rail > 0.0 { 1.0 } else { 0.0 }))
    }

    /// Stator voltage (V) of the rails.
    #[inline]
    fn rails(&self) -> AlphaBeta {
        let [a, b, c] = &self.ways;
        stator([a.rail, b.rail, c.rail])
    }

    /// Voltage (V) of the leg `x` with the current `i` (A); `None` if it blocks.
    pub(super) fn leg(&self, x: usize, i: f64) -> Option<f64> {
        let blocks = self.watched[x] && self.sides[x] == 0;
        (!blocks).then(|| self.ways[x].u - self.ways[x].r * i)
    }

    /// Stator voltage (V) of the legs without current.
    #[inline]
    pub(super) fn stator(&self) -> AlphaBeta {
        stator(self.ways.map(|way| way.u))
    }

    /// Drop of the devices.
    pub(super) fn drop(&self) -> Affine {
        let [a, b, c] = self.ways.map(|way| way.r);
        Affine { at_0: stator(self.ways.map(|way| way.rail - way.u)), by: symmetric(Phases { a, b, c }) }
    }
}

/// Devices, each carrying current of one sign.
#[derive(Clone, Copy)]
pub(super) struct OneWay(pub(super) Option<Affine>);

impl<S: Scalar> Drops<S> for OneWay {
    #[inline]
    fn legs(&self, u: Vector<Stator, S>, _steady: impl FnOnce() -> Vector<Stator, S>) -> Vector<Stator, S> {
        u
    }

    #[inline]
    fn devices(&self, _u: Vector<Stator, S>, i: Vector<Stator, S>) -> Option<Vector<Stator, S>> {
        self.0.map(|drop| drop.at(i))
    }

    #[inline]
    fn switching(&self, _i: Vector<Stator, S>) -> Option<S> {
        None
    }
}

impl Point {
    /// In rotor axes.
    pub(super) fn state(&self, plant: &PmsmPlant) -> State {
        let axis = axis_at(&plant.warm.motor, self.angle);
        let psi = plant.machine::<false>().from_stator(axis, self.psi);
        State { psi, speed: self.speed, angle: self.angle, axis }
    }
}

impl PmsmPlant {
    /// The point of a state.
    pub(super) fn point(&self, &State { psi, speed, angle, axis }: &State) -> Point {
        Point { psi: self.machine::<false>().to_stator(axis, psi), speed, angle, axis }
    }

    /// Current (A) at a point.
    #[inline]
    pub(super) fn current_at(&self, at: &Point) -> AlphaBeta {
        self.machine::<false>().stator_current(at.axis, at.psi)
    }

    /// Derivatives of the current there by the voltage.
    fn by_voltage(&self, at: &Point) -> [AlphaBeta; 2] {
        let psi = self.machine::<false>().from_stator(at.axis, at.psi);
        let [d, cross, q] = slope(&self.warm.motor, self.parameters.magnetics(), psi);
        [AlphaBeta::new(1.0, 0.0), AlphaBeta::new(0.0, 1.0)].map(|e| {
            let e = at.axis.from_stator(e);
            at.axis.to_stator(Dq::new(d * e.d() + cross * e.q(), cross * e.d() + q * e.q()))
        })
    }

    /// The response of the currents there, with the derivative `d_psi` (V) of the flux linkage without a voltage.
    fn response(&self, at: &Point, d_psi: AlphaBeta) -> Response {
        let (machine, by) = (self.machine::<false>(), self.by_voltage(at));
        let (w, i) = (machine.electrical(at.speed), self.current_at(at));
        // In rotor axes: di/dt = H (d psi/dt - j w psi), and the axes turn.
        let driven = d_psi - at.psi.turned() * w;
        let at_0 = by[0] * driven.alpha() + by[1] * driven.beta() + i.turned() * w;
        Response { i, at_0, by }
    }

    /// The response of the currents at a point, with the `drop` of the devices.
    pub(super) fn response_at(&self, at: &Point, drop: Option<&Affine>) -> Response {
        let machine = self.machine::<false>();
        let R = self.parameters.dissipation(machine.resistance(), machine.electrical(at.speed)).R;
        let i = self.current_at(at);
        // The thresholds belong to the voltages of the legs.
        let by_devices = drop.map_or(AlphaBeta::ZERO, |drop| drop.at(i) - drop.at_0);
        self.response(at, i * -R - by_devices)
    }

    /// Ends the current of the leg `x`; returns the energy (J) that it had.
    pub(super) fn end_current(&self, at: &mut Point, x: usize) -> f64 {
        let (n, before) = (DIRECTIONS[x], self.stored(at));
        for _ in 0..3 {
            let by = self.by_voltage(at);
            let i = n.dot(self.current_at(at));
            at.psi += n * (-i / n.dot(by[0] * n.alpha() + by[1] * n.beta()));
            if self.parameters.is_linear() {
                break;
            }
        }
        before - self.stored(at)
    }

    /// Magnetic energy (J) at a point.
    pub(super) fn stored(&self, at: &Point) -> f64 {
        let psi = self.machine::<false>().from_stator(at.axis, at.psi);
        magnetic_energy(&self.warm.motor, self.parameters.magnetics(), psi)
    }

    /// Margin by which the `voltages` stay valid: below 0, a leg has changed sides.
    fn margin(&self, at: &Point, voltages: &Voltages) -> f64 {
        let i = self.current_at(at);
        let mut least = f64::INFINITY;
        for (x, n) in DIRECTIONS.into_iter().enumerate() {
            if voltages.watched[x] && voltages.sides[x] != 0 {
                least = least.min(f64::from(voltages.sides[x]) * n.dot(i));
            }
        }
        least.min(self.blocking(at, voltages))
    }

    /// Margin (V) by which legs without current block.
    pub(super) fn blocking(&self, at: &Point, voltages: &Voltages) -> f64 {
        match voltages.blocked() {
            Blocked::None => f64::INFINITY,
            Blocked::One(x) => {
                let ([low, high], drop) = (voltages.bounds[x], voltages.drop());
                let u = self.response_at(at, Some(&drop)).floating(x, voltages.stator());
                (u - low).min(high - u)
            }
            Blocked::All => {
                let (rest, bounds) = (self.response_at(at, None).resting(), voltages.bounds);
                let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
                for (bounds, rest) in bounds.into_iter().zip(rest) {
                    (low, high) = (low.max(bounds[0] - rest), high.min(bounds[1] - rest));
                }
                high - low
            }
        }
    }

    /// Advances `at` by `h` (s) under the `voltages`, or up to the instant at which a leg has another side; returns the time
    /// (s) and what passed. Currents of at most `tiny` (A) are zero. Without `search`, the legs keep their sides.
    pub(super) fn travel(
        &self,
        at: &mut Point,
        h: f64,
        voltages: &Voltages,
        (tiny, search): (f64, bool),
    ) -> (f64, Passed) {
        let mut left = h;
        let watched = search && voltages.watched.contains(&true);
        let w = f64::from(self.warm.motor.n_p) * at.speed;
        if !watched && h <= SHARE * self.warm.longest && w.abs() * h <= LARGEST_TURN {
            let (next, passed) = self.segment(at, h, voltages);
            if self.parameters.mechanics.shorter(h, at.speed, next.speed).is_none() {
                *at = next;
                return (h, passed);
            }
        }
        let (mut passed, mut limit) = (Passed::default(), f64::INFINITY);
        loop {
            let longest =
                (SHARE * self.warm.longest).min(LARGEST_TURN / (f64::from(self.warm.motor.n_p) * at.speed).abs());
            let step = if left <= longest { left } else { left / (left / longest - 1e-9).ceil() }.min(limit);
            let (next, energy) = self.segment(at, step, voltages);
            if let Some(shorter) = self.parameters.mechanics.shorter(step, at.speed, next.speed) {
                limit = shorter;
                continue;
            }
            limit = f64::INFINITY;
            if watched && self.margin(&next, voltages) < -tiny {
                let (share, next, energy) = self.end_of(at, step, voltages);
                passed.add(&energy);
                *at = next;
                return (h - left + share, passed);
            }
            passed.add(&energy);
            *at = next;
            left -= step;
            if left <= 1e-9 * h || self.is_too_fast(at.speed) {
                return (h, passed);
            }
        }
    }

    /// The instant within `h` (s) at which a leg has another side, as the time (s) from `at` on, the point there, and what
    /// passed: bisection and false position (Illinois) in turn.
    #[inline(never)]
    fn end_of(&self, at: &Point, h: f64, voltages: &Voltages) -> (f64, Point, Passed) {
        let (mut low, mut high) = (0.0, h);
        let mut at_low = self.margin(at, voltages).max(0.0);
        let mut found = self.segment(at, h, voltages);
        let mut at_high = self.margin(&found.0, voltages);
        for k in 0..MOST_SEARCHES {
            if high - low <= 1e-12 * h {
                break;
            }
            let middle = if k % 3 == 2 || at_low == 0.0 {
                0.5 * (low + high)
            } else {
                low + (high - low) * (at_low / (at_low - at_high)).clamp(1e-9, 1.0 - 1e-9)
            };
            let tried = self.segment(at, middle, voltages);
            let margin = self.margin(&tried.0, voltages);
            if margin > 0.0 {
                (low, at_low) = (middle, margin);
            } else {
                (high, at_high, found) = (middle, margin, tried);
                if margin > -1e-15 {
                    break;
                }
            }
        }
        (high, found.0, found.1)
    }

    /// One integration step of `h` (s).
    #[inline]
    fn segment(&self, from: &Point, h: f64, voltages: &Voltages) -> (Point, Passed) {
        let mechanics = &self.parameters.mechanics;
        if mechanics.is_whole(from.speed) {
            self.segment_on(from, h, voltages, Whole::new(mechanics, from.speed))
        } else {
            self.segment_on(from, h, voltages, Standstill::new(mechanics, from.speed))
        }
    }

    fn segment_on<C: Coulomb<f64> + Copy>(
        &self,
        from: &Point,
        h: f64,
        voltages: &Voltages,
        coulomb: C,
    ) -> (Point, Passed) {
        let shaft = Shaft::new(&self.parameters.mechanics, self.inputs.tau_load, coulomb);
        let (machine, blocked) = (self.machine::<true>(), voltages.blocked());
        let lossless = self.parameters.inverter.devices.is_none();
        if lossless && blocked == Blocked::None && self.parameters.is_linear() && self.parameters.winding.k_ac == 0.0 {
            let dissipation = Dissipation { R: machine.resistance(), G: None };
            let circuit = Circuit { machine, path: Path { u: voltages.rails(), dissipation, drops: Ideal }, shaft };
            return self.third_order::<Ideal, _>(from, h, &shaft, |axis, psi, speed| circuit.rates(axis, psi, speed));
        }
        let machine = self.machine::<false>();
        let dissipation = self.parameters.dissipation(machine.resistance(), machine.electrical(from.speed));
        let (u, drop) = (voltages.rails(), (!lossless).then(|| voltages.drop()));
        let under = |u, axis, psi, speed| {
            Circuit { machine, path: Path { u, dissipation, drops: OneWay(drop) }, shaft }.rates(axis, psi, speed)
        };
        match blocked {
            Blocked::None => {
                self.third_order::<OneWay, _>(from, h, &shaft, |axis, psi, speed| under(u, axis, psi, speed))
            }
            Blocked::One(x) => {
                let stage = |axis, psi, speed| {
                    let at = Point { psi, speed, angle: 0.0, axis };
                    let floating = self.response_at(&at, drop.as_ref()).floating(x, voltages.stator());
                    under(u + DIRECTIONS[x] * (2.0 / 3.0 * floating), axis, psi, speed)
                };
                let (mut next, passed) = self.third_order::<OneWay, _>(from, h, &shaft, stage);
                self.end_current(&mut next, x);
                (next, passed)
            }
            Blocked::All => {
                let none = Dq::new(self.warm.motor.psi_M, 0.0);
                let stage = |_, _, speed| blocked_rates(&machine, &shaft, none, Dq::ZERO, speed);
                let (next, passed) = self.third_order::<OneWay, _>(from, h, &shaft, stage);
                (Point { psi: machine.to_stator(next.axis, none), ..next }, passed)
            }
        }
    }

    /// Kutta's step of `h` (s) with these rates.
    #[expect(clippy::inline_always, reason = "as for `integrate`")]
    #[inline(always)]
    fn third_order<D: Drops<f64>, C: Coulomb<f64>>(
        &self,
        from: &Point,
        h: f64,
        shaft: &Shaft<'_, C>,
        rates: impl Fn(Axis<Rotor>, AlphaBeta, f64) -> Rates,
    ) -> (Point, Passed) {
        let &Point { psi, speed, angle, axis } = from;
        let (n_p, sixth) = (f64::from(self.warm.motor.n_p), h * (1.0 / 6.0));
        let k_1 = rates(axis, psi, speed);
        let a_1 = k_1.acceleration;
        let middle = axis.ahead(Turn::new(n_p * h * (0.5 * speed + 0.125 * h * a_1)));
        let k_2 = rates(middle, psi + k_1.d_psi * (0.5 * h), speed + 0.5 * h * a_1);
        let a_2 = k_2.acceleration;
        let turned = h * (speed + sixth * (a_1 + 2.0 * a_2));
        let end = axis.ahead(Turn::new(n_p * turned));
        let k_3 = rates(end, psi + (k_2.d_psi * 2.0 - k_1.d_psi) * h, speed + h * (2.0 * a_2 - a_1));
        let next = Point {
            psi: psi + (k_1.d_psi + k_2.d_psi * 4.0 + k_3.d_psi) * sixth,
            speed: speed + sixth * (a_1 + 4.0 * a_2 + k_3.acceleration),
            angle: angle + turned,
            axis: end,
        };
        (next, Passed::over::<D, C>(h, turned, [&k_1, &k_2, &k_2, &k_3], shaft))
    }
}
