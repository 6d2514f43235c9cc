//! Space vectors typed by frame: vectors of different frames cannot be added.
//!
//! `Vector<Stator>` has components alpha and beta; `Vector<Rotor>` and `Vector<Estimated>` have d and q. An [`Axis`] is
//! the direction of a rotating frame's d-axis; only an axis transforms vectors from one frame to another.
//!
//! Components are numbers, or with `S` = [`Dual`](fmu_core::Dual) numbers with their change.

use crate::math::{sin_cos, sin_cos_small, sin_cos_tiny};
use fmu_core::Scalar;
use serde::{Deserialize, Serialize};
use std::marker::PhantomData;
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// The stator frame: alpha along phase a, beta 90 degrees ahead.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stator;

/// The true rotor frame: d along the magnet flux, q 90 degrees ahead.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rotor;

/// The estimated rotor frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimated;

/// A rotating frame.
pub trait Rotating {}
impl Rotating for Rotor {}
impl Rotating for Estimated {}

/// A peak-valued space vector in frame `F`, in the unit of its quantity.
#[derive(Serialize, Deserialize)]
#[serde(bound(serialize = "S: Serialize", deserialize = "S: Deserialize<'de>"))]
pub struct Vector<F, S = f64> {
    re: S,
    im: S,
    #[serde(skip)]
    frame: PhantomData<F>,
}

/// A vector in the stator frame.
pub type AlphaBeta = Vector<Stator>;
/// A vector in the true rotor frame.
pub type Dq = Vector<Rotor>;
/// A vector in the estimated rotor frame.
pub type DqHat = Vector<Estimated>;

impl<F, S: Copy> Clone for Vector<F, S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F, S: Copy> Copy for Vector<F, S> {}

impl<F> Default for Vector<F> {
    fn default() -> Self {
        Self::ZERO
    }
}

impl<F, S: PartialEq> PartialEq for Vector<F, S> {
    fn eq(&self, other: &Self) -> bool {
        self.re == other.re && self.im == other.im
    }
}

impl<F, S: std::fmt::Display> std::fmt::Debug for Vector<F, S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "({}, {})", self.re, self.im)
    }
}

impl<F> Vector<F> {
    /// The zero vector.
    pub const ZERO: Self = Self::new(0.0, 0.0);

    /// Length.
    #[inline]
    pub fn magnitude(self) -> f64 {
        (self.re * self.re + self.im * self.im).sqrt()
    }

    /// Whether both components are finite.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.re.is_finite() && self.im.is_finite()
    }
}

impl<F, S> Vector<F, S> {
    /// Creates a vector from its components along the frame's two axes.
    #[inline]
    pub const fn new(first: S, second: S) -> Self {
        Self { re: first, im: second, frame: PhantomData }
    }
}

impl<F, S: Scalar> Vector<F, S> {
    /// The vector `v` of fixed length and direction.
    #[inline]
    pub fn fixed(v: Vector<F>) -> Self {
        Self::new(v.re.into(), v.im.into())
    }

    /// Scalar product.
    #[inline]
    pub fn dot(self, other: Self) -> S {
        self.re * other.re + self.im * other.im
    }

    /// Cross product `Im(conj(self) other)`: positive when `other` leads.
    #[inline]
    pub fn cross(self, other: Self) -> S {
        self.re * other.im - self.im * other.re
    }

    /// The vector rotated by +90 degrees (multiplied by j).
    #[inline]
    pub fn turned(self) -> Self {
        Self::new(-self.im, self.re)
    }

    /// The vector `k` times as long.
    #[inline]
    pub fn scaled(self, k: S) -> Self {
        Self::new(self.re * k, self.im * k)
    }
}

impl<S: Copy> Vector<Stator, S> {
    /// Component along phase a.
    #[inline]
    pub fn alpha(self) -> S {
        self.re
    }

    /// Component 90 degrees ahead of phase a.
    #[inline]
    pub fn beta(self) -> S {
        self.im
    }
}

impl<F: Rotating, S: Copy> Vector<F, S> {
    /// Component along the magnet flux.
    #[inline]
    pub fn d(self) -> S {
        self.re
    }

    /// Component 90 degrees ahead of the magnet flux.
    #[inline]
    pub fn q(self) -> S {
        self.im
    }

    /// Both components, mutable.
    pub fn parts_mut(&mut self) -> (&mut S, &mut S) {
        (&mut self.re, &mut self.im)
    }
}

impl<F, S: Scalar> Add for Vector<F, S> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }
}

impl<F, S: Scalar> AddAssign for Vector<F, S> {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<F, S: Scalar> Sub for Vector<F, S> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.im - other.im)
    }
}

impl<F, S: Scalar> Neg for Vector<F, S> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::new(-self.re, -self.im)
    }
}

impl<F, S: Scalar> Mul<f64> for Vector<F, S> {
    type Output = Self;
    #[inline]
    fn mul(self, k: f64) -> Self {
        Self::new(self.re * k, self.im * k)
    }
}

/// Direction of the d-axis of the rotating frame `F`, in stator axes.
#[derive(Serialize, Deserialize)]
#[serde(bound(serialize = "S: Serialize", deserialize = "S: Deserialize<'de>"))]
pub struct Axis<F: Rotating, S = f64> {
    cos: S,
    sin: S,
    #[serde(skip)]
    frame: PhantomData<F>,
}

impl<F: Rotating> Default for Axis<F> {
    fn default() -> Self {
        Self::new(1.0, 0.0)
    }
}

impl<F: Rotating> PartialEq for Axis<F> {
    fn eq(&self, other: &Self) -> bool {
        self.cos == other.cos && self.sin == other.sin
    }
}

impl<F: Rotating> std::fmt::Debug for Axis<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "({}, {})", self.cos, self.sin)
    }
}

impl<F: Rotating, S: Copy> Clone for Axis<F, S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F: Rotating, S: Copy> Copy for Axis<F, S> {}

impl<F: Rotating> Axis<F> {
    /// The frame rotated ahead by `turn`.
    #[inline]
    pub fn ahead(self, turn: Turn) -> Self {
        let Turn { cos, sin } = turn;
        Self::new(self.cos * cos - self.sin * sin, self.cos * sin + self.sin * cos)
    }

    /// The frame rotated ahead by a small `angle` (rad); the error is angle^3 / 6.
    #[inline]
    pub fn slightly_ahead(self, angle: f64) -> Self {
        let half = 0.5 * angle;
        Self::new(self.cos - angle * (self.sin + half * self.cos), self.sin + angle * (self.cos - half * self.sin))
    }

    /// This frame, whose electrical angle is `theta` (rad), with the change of `theta`.
    #[inline]
    pub fn with<S: Scalar>(self, theta: S) -> Axis<F, S> {
        Axis::new(theta.chain(self.cos, -self.sin), theta.chain(self.sin, self.cos))
    }
}

impl<F: Rotating, S> Axis<F, S> {
    #[inline]
    const fn new(cos: S, sin: S) -> Self {
        Self { cos, sin, frame: PhantomData }
    }
}

impl<F: Rotating, S: Scalar> Axis<F, S> {
    /// The frame at the electrical angle `theta` (rad).
    #[expect(
        clippy::inline_always,
        reason = "a crate is compiled apart from those that use it, and they would call it"
    )]
    #[inline(always)]
    pub fn at(theta: S) -> Self {
        let (sin, cos) = sin_cos(theta.value());
        Axis::<F>::new(cos, sin).with(theta)
    }

    /// The stator vector of this `length` along the d-axis.
    #[inline]
    pub fn along(self, length: S) -> Vector<Stator, S> {
        Vector::new(self.cos * length, self.sin * length)
    }

    /// Transforms a stator vector to the rotating frame: v e^{-j theta}.
    #[inline]
    pub fn from_stator(self, v: Vector<Stator, S>) -> Vector<F, S> {
        Vector::new(v.re * self.cos + v.im * self.sin, v.im * self.cos - v.re * self.sin)
    }

    /// Transforms a vector of the rotating frame to the stator frame: v e^{j theta}.
    #[inline]
    pub fn to_stator(self, v: Vector<F, S>) -> Vector<Stator, S> {
        Vector::new(v.re * self.cos - v.im * self.sin, v.re * self.sin + v.im * self.cos)
    }
}

/// A rotation, usually by a small angle: see [`Axis::ahead`].
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    cos: f64,
    sin: f64,
}

impl Turn {
    /// By `angle` (rad); quick for less than 0.3 rad.
    #[inline]
    pub fn new(angle: f64) -> Self {
        let (sin, cos) = sin_cos_small(angle);
        Self { cos, sin }
    }

    /// By `angle` (rad); quicker still for less than 0.004 rad.
    #[inline]
    pub fn tiny(angle: f64) -> Self {
        let (sin, cos) = sin_cos_tiny(angle);
        Self { cos, sin }
    }
}

/// Three phase quantities a, b, c.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Phases<S = f64> {
    /// Phase a.
    pub a: S,
    /// Phase b.
    pub b: S,
    /// Phase c.
    pub c: S,
}

/// The square root of 3.
pub const SQRT_3: f64 = 1.732_050_807_568_877_2;

impl<S: Scalar> Phases<S> {
    /// Amplitude-invariant Clarke transform; a common part of the three phases has no effect.
    #[inline]
    pub fn to_stator(self) -> Vector<Stator, S> {
        let Self { a, b, c } = self;
        Vector::new((a * 2.0 - b - c) * (1.0 / 3.0), (b - c) * (1.0 / SQRT_3))
    }

    /// Inverse Clarke transform, without a zero sequence.
    #[inline]
    pub fn from_stator(v: Vector<Stator, S>) -> Self {
        const HALF_SQRT_3: f64 = 0.866_025_403_784_438_6;
        let (alpha, beta) = (v.alpha(), v.beta());
        Self { a: alpha, b: alpha * -0.5 + beta * HALF_SQRT_3, c: alpha * -0.5 - beta * HALF_SQRT_3 }
    }

    /// Largest difference between two phases.
    #[inline]
    pub fn span(self) -> S {
        // One instruction each, unlike `f64::max`, which also orders NaN.
        let max = |a: S, b: S| if a.value() > b.value() { a } else { b };
        let min = |a: S, b: S| if a.value() < b.value() { a } else { b };
        max(max(self.a, self.b), self.c) - min(min(self.a, self.b), self.c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clarke_keeps_the_amplitude_and_drops_the_common_part() {
        for i in 0..36 {
            let theta = f64::from(i) * 0.1745;
            let phase = |shift: f64| 5.0 * (theta - shift).cos() + 3.0;
            let v = Phases { a: phase(0.0), b: phase(2.094_395_102_393_195_3), c: phase(4.188_790_204_786_391) };
            let vector = v.to_stator();
            assert!((vector.alpha() - 5.0 * theta.cos()).abs() < 1e-13);
            assert!((vector.beta() - 5.0 * theta.sin()).abs() < 1e-13);
            let back = Phases::from_stator(vector);
            assert!((back.a - (v.a - 3.0)).abs() < 1e-13 && (back.c - (v.c - 3.0)).abs() < 1e-13);
        }
    }

    #[test]
    fn a_vector_on_the_d_axis_has_no_q() {
        let axis = Axis::<Rotor>::at(0.7);
        let v = axis.from_stator(AlphaBeta::new(0.7_f64.cos(), 0.7_f64.sin()));
        assert!((v.d() - 1.0).abs() < 1e-15 && v.q().abs() < 1e-15);
        let back = axis.to_stator(Dq::new(0.0, 1.0));
        assert!((back.alpha() + 0.7_f64.sin()).abs() < 1e-15, "q leads d by 90 degrees");
    }
}
