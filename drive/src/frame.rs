//! Space vectors typed by frame: vectors of different frames cannot be added.
//!
//! `Vector<Stator>` has components alpha and beta; `Vector<Rotor>` and `Vector<Estimated>` have d and q. An [`Axis`] is
//! the direction of a rotating frame's d-axis; only an axis transforms vectors from one frame to another.

use crate::math::{sin_cos, sin_cos_small, sin_cos_tiny};
use nalgebra::Complex;
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
#[serde(bound = "")]
pub struct Vector<F> {
    z: Complex<f64>,
    #[serde(skip)]
    frame: PhantomData<F>,
}

/// A vector in the stator frame.
pub type AlphaBeta = Vector<Stator>;
/// A vector in the true rotor frame.
pub type Dq = Vector<Rotor>;
/// A vector in the estimated rotor frame.
pub type DqHat = Vector<Estimated>;

impl<F> Clone for Vector<F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F> Copy for Vector<F> {}

impl<F> Default for Vector<F> {
    fn default() -> Self {
        Self::ZERO
    }
}

impl<F> PartialEq for Vector<F> {
    fn eq(&self, other: &Self) -> bool {
        self.z == other.z
    }
}

impl<F> std::fmt::Debug for Vector<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "({}, {})", self.z.re, self.z.im)
    }
}

impl<F> Vector<F> {
    /// The zero vector.
    pub const ZERO: Self = Self { z: Complex::new(0.0, 0.0), frame: PhantomData };

    /// Creates a vector from its components along the frame's two axes.
    #[inline]
    pub const fn new(first: f64, second: f64) -> Self {
        Self { z: Complex::new(first, second), frame: PhantomData }
    }

    #[inline]
    const fn of(z: Complex<f64>) -> Self {
        Self { z, frame: PhantomData }
    }

    /// Length.
    #[inline]
    pub fn magnitude(self) -> f64 {
        (self.z.re * self.z.re + self.z.im * self.z.im).sqrt()
    }

    /// Scalar product.
    #[inline]
    pub fn dot(self, other: Self) -> f64 {
        self.z.re * other.z.re + self.z.im * other.z.im
    }

    /// Cross product `Im(conj(self) other)`: positive when `other` leads.
    #[inline]
    pub fn cross(self, other: Self) -> f64 {
        self.z.re * other.z.im - self.z.im * other.z.re
    }

    /// The vector rotated by +90 degrees (multiplied by j).
    #[inline]
    pub fn turned(self) -> Self {
        Self::new(-self.z.im, self.z.re)
    }

    /// Whether both components are finite.
    pub fn is_finite(self) -> bool {
        self.z.re.is_finite() && self.z.im.is_finite()
    }
}

impl AlphaBeta {
    /// Component along phase a.
    #[inline]
    pub fn alpha(self) -> f64 {
        self.z.re
    }

    /// Component 90 degrees ahead of phase a.
    #[inline]
    pub fn beta(self) -> f64 {
        self.z.im
    }
}

impl<F: Rotating> Vector<F> {
    /// Component along the magnet flux.
    #[inline]
    pub fn d(self) -> f64 {
        self.z.re
    }

    /// Component 90 degrees ahead of the magnet flux.
    #[inline]
    pub fn q(self) -> f64 {
        self.z.im
    }
}

impl<F> Add for Vector<F> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::of(self.z + other.z)
    }
}

impl<F> AddAssign for Vector<F> {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.z += other.z;
    }
}

impl<F> Sub for Vector<F> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::of(self.z - other.z)
    }
}

impl<F> Neg for Vector<F> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::of(-self.z)
    }
}

impl<F> Mul<f64> for Vector<F> {
    type Output = Self;
    #[inline]
    fn mul(self, k: f64) -> Self {
        Self::of(self.z * k)
    }
}

/// Direction of the d-axis of the rotating frame `F`, seen from the stator.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Axis<F: Rotating> {
    direction: Complex<f64>,
    #[serde(skip)]
    frame: PhantomData<F>,
}

impl<F: Rotating> Default for Axis<F> {
    fn default() -> Self {
        Self { direction: Complex::new(1.0, 0.0), frame: PhantomData }
    }
}

impl<F: Rotating> PartialEq for Axis<F> {
    fn eq(&self, other: &Self) -> bool {
        self.direction == other.direction
    }
}

impl<F: Rotating> std::fmt::Debug for Axis<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "({}, {})", self.direction.re, self.direction.im)
    }
}

impl<F: Rotating> Clone for Axis<F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F: Rotating> Copy for Axis<F> {}

impl<F: Rotating> Axis<F> {
    /// The frame at the electrical angle `theta` (rad).
    #[inline]
    pub fn at(theta: f64) -> Self {
        let (sin, cos) = sin_cos(theta);
        Self { direction: Complex::new(cos, sin), frame: PhantomData }
    }

    /// The frame further on by `turn`.
    #[inline]
    pub fn ahead(self, turn: Turn) -> Self {
        Self { direction: self.direction * turn.0, frame: PhantomData }
    }

    /// The stator vector of this `length` along the d-axis.
    #[inline]
    pub fn along(self, length: f64) -> AlphaBeta {
        Vector::of(self.direction * length)
    }

    /// Transforms a stator vector to the rotating frame: v e^{-j theta}.
    #[inline]
    pub fn from_stator(self, v: AlphaBeta) -> Vector<F> {
        Vector::of(v.z * self.direction.conj())
    }

    /// Transforms a vector of the rotating frame to the stator frame: v e^{j theta}.
    #[inline]
    pub fn to_stator(self, v: Vector<F>) -> AlphaBeta {
        Vector::of(v.z * self.direction)
    }
}

/// A rotation by an angle that is usually small: [`Axis::ahead`].
#[derive(Clone, Copy, Debug)]
pub struct Turn(Complex<f64>);

impl Turn {
    /// By `angle` (rad); quick for less than 0.3 rad.
    #[inline]
    pub fn new(angle: f64) -> Self {
        let (sin, cos) = sin_cos_small(angle);
        Self(Complex::new(cos, sin))
    }

    /// By `angle` (rad); quicker still for less than 0.004 rad.
    #[inline]
    pub fn tiny(angle: f64) -> Self {
        let (sin, cos) = sin_cos_tiny(angle);
        Self(Complex::new(cos, sin))
    }
}

/// Three phase quantities a, b, c.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Phases {
    /// Phase a.
    pub a: f64,
    /// Phase b.
    pub b: f64,
    /// Phase c.
    pub c: f64,
}

impl Phases {
    /// Amplitude-invariant Clarke transform; a common part of the three phases has no effect.
    #[inline]
    pub fn to_stator(self) -> AlphaBeta {
        const SQRT_3: f64 = 1.732_050_807_568_877_2;
        Vector::new((2.0 * self.a - self.b - self.c) / 3.0, (self.b - self.c) / SQRT_3)
    }

    /// Inverse Clarke transform, without a zero sequence.
    #[inline]
    pub fn from_stator(v: AlphaBeta) -> Self {
        const HALF_SQRT_3: f64 = 0.866_025_403_784_438_6;
        let (alpha, beta) = (v.alpha(), v.beta());
        Self { a: alpha, b: -0.5 * alpha + HALF_SQRT_3 * beta, c: -0.5 * alpha - HALF_SQRT_3 * beta }
    }

    /// Largest difference between two phases.
    #[inline]
    pub fn span(self) -> f64 {
        // One instruction each, unlike `f64::max`, which also orders NaN.
        let max = |a: f64, b: f64| if a > b { a } else { b };
        let min = |a: f64, b: f64| if a < b { a } else { b };
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
