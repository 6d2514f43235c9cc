//! Cost of the controller's constant inductances if the machine saturates: torque and loss at the rated point.

use super::sheet;
use drive::frame::Dq;
use drive::plant::machine::Magnetics;
use drive::steady::{At, Point, Steady};

/// The rated point of the controller, and the most efficient point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Electromagnetic torque in N.m for the rated torque as reference.
    pub torque: f64,
    /// The point with the rated torque at the shaft, with the controller's currents.
    pub now: Point,
    /// The point with minimum losses for that torque, within the same current and voltage.
    pub best: Point,
}

/// Directions of the current that are tried, and halvings of its magnitude.
const DIRECTIONS: u32 = 720;
const HALVINGS: u32 = 50;

/// The cost at the rated `speed` (rad/s) and `torque` (N.m) on a link of `u_dc` (V) at the temperature `T` (K); `None` for a machine
/// with constant inductances, or where the point is out of reach.
pub fn cost(drive: &Steady, [speed, torque]: [f64; 2], u_dc: f64, T: f64) -> Option<Cost> {
    if matches!(drive.plant.magnetics(), Magnetics::Linear) {
        return None;
    }
    let at = sheet::at(drive, speed, u_dc, T);
    let now = at.by_shaft(torque).filter(|point| drive.fits(point))?;
    let share = now.u_share.max(drive.controller.weakening.k_u);
    let angle = |k: u32| std::f64::consts::PI * (0.25 + 0.75 * f64::from(k) / f64::from(DIRECTIONS));
    let points = (0..=DIRECTIONS).filter_map(|k| with_torque(&at, torque, angle(k), drive.controller.limit.i));
    let allowed = points.filter(|point| point.u_share <= share).chain([now]);
    let best = allowed.min_by(|a, b| a.powers.losses.sum().total_cmp(&b.powers.losses.sum()))?;
    Some(Cost { torque: at.by_reference(torque).tau_e, now, best })
}

/// The point of the torque (N.m) at the shaft with the current in the direction `angle` (rad), at most `i` (A).
fn with_torque(at: &At<'_>, torque: f64, angle: f64, i: f64) -> Option<Point> {
    let (sin, cos) = angle.sin_cos();
    let point = |i: f64| at.by_current(Dq::new(i * cos, i * sin));
    let (mut low, mut high) = (0.0, i);
    if point(high).powers.tau_shaft < torque {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        *(if point(middle).powers.tau_shaft < torque { &mut low } else { &mut high }) = middle;
    }
    Some(point(high))
}
