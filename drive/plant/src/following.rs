//! Whether the angle of an imposed shaft follows its speed.
//!
//! With `mechanics.imposed`, speed and angle of the shaft are inputs. An angle that is not connected, that is in degrees, electrical, reversed
//! or behind a gear puts the rotor back or ahead in every step: the flux linkage of the stator stays where it is, and the currents
//! and the torque of the machine are wrong.
//!
//! ```text
//! turn = speed h          off = wrap(angle - angle expected from the last step) sign(turn), limited to +-|turn|
//! reported: |sum of off| > 0.7 sum of |turn| > 0.7 rad, over the last one or two radians
//! ```
//!
//! The limit makes an angle that is wrapped, or jumps once, count little. After n steps of a steady acceleration from rest, the angle
//! is ahead by a share of 1/n, because each step continues with the speed at its beginning. Derived here; mechanical angles in rad,
//! speed in rad/s, h in s.

use drive_base::math::wrap;
use fmu_core::log::Warnings;
use serde::{Deserialize, Serialize};

/// Minimum turn of the shaft in rad for a verdict. Both sums are halved at twice this turn, so that the last radians decide.
const ENOUGH: f64 = 1.0;

/// Share of the turn by which the angle may deviate.
const ALLOWED: f64 = 0.7;

/// Turn and deviation of the last radians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Following {
    /// Angle in rad by which the shaft turned at its speed, in both directions.
    turned: f64,
    /// Angle in rad by which its angle turned more than that.
    off: f64,
}

impl Following {
    /// Counts a step in which the shaft turned by `turn` (rad) at its speed, and its angle by `off` (rad) more.
    pub fn count(&mut self, turn: f64, off: f64) {
        let most = turn.abs();
        self.turned += most;
        self.off += (wrap(off) * turn.signum()).max(-most).min(most);
        if self.turned > 2.0 * ENOUGH {
            (self.turned, self.off) = (0.5 * self.turned, 0.5 * self.off);
        }
    }

    fn fails(self) -> bool {
        self.turned > ENOUGH && self.off.abs() > ALLOWED * self.turned
    }

    /// Warns of an angle (rad) that does not follow the speed (rad/s).
    pub fn warn(self, angle: f64, speed: f64, log: &mut Warnings<'_>) {
        if self.fails() {
            log.warn("angle_shaft", || {
                format!(
                    "angle_shaft = {angle} rad does not follow speed_shaft = {speed} rad/s, and the results are wrong: give the mechanical \
                     angle of the same shaft in rad, the integral of the speed; it may be wrapped to a turn"
                )
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether 1000 steps of 1 ms at the speed (rad/s) `speed(t)` and the angle `of(angle)` fail, and after how many.
    fn first(speed: impl Fn(f64) -> f64, of: impl Fn(f64) -> f64) -> Option<usize> {
        let (mut following, mut angle, h) = (Following::default(), 0.3, 1e-3);
        let mut expected = of(angle);
        (0..1000)
            .find(|&k| {
                let t = f64::from(k) * h;
                let w = speed(t);
                following.count(w * h, of(angle) - expected);
                expected = of(angle) + w * h;
                // The drive train turns on with its own steps.
                angle += 0.5 * (w + speed(t + h)) * h;
                following.fails()
            })
            .map(|k| usize::try_from(k).unwrap())
    }

    #[test]
    fn wrong_angles_are_found_and_right_ones_are_not() {
        use std::f64::consts::TAU;
        let speeds: [fn(f64) -> f64; 4] = [|_| 200.0, |_| -200.0, |t| 2000.0 * t, |t| 100.0 + 50.0 * (300.0 * t).sin()];
        for (k, speed) in speeds.into_iter().enumerate() {
            assert_eq!(first(speed, |angle| angle), None, "{k}");
            assert_eq!(first(speed, |angle| angle.rem_euclid(TAU)), None, "{k}, wrapped");
            assert_eq!(first(speed, |angle| 5.0 + angle), None, "{k}, from another angle");
            let wrong: [fn(f64) -> f64; 5] =
                [|_| 0.0, |angle| angle.to_degrees(), |angle| 3.0 * angle, |angle| -angle, |angle| angle / 9.0];
            for (m, of) in wrong.into_iter().enumerate() {
                assert!(first(speed, of).is_some_and(|k| k < 100), "{k}, {m}: {:?}", first(speed, of));
            }
        }
        // From rest, with steps in which the speed doubles, triples and so on.
        assert_eq!(first(|t| 1e5 * t, |angle| angle), None, "100 rad/s more in each step");
        assert_eq!(first(|_| 0.0, |angle| angle * 2.0), None, "at rest");
        // Through zero.
        assert_eq!(first(|t| 50.0 * (40.0 * t).cos(), |angle| angle), None, "to and fro");
        assert!(first(|t| 50.0 * (40.0 * t).cos(), |_| 1.0).is_some(), "to and fro with a fixed angle");
        // A vibration of ±0.125 rad: the turns in both directions count.
        assert!(first(|t| 50.0 * (400.0 * t).cos(), |_| 1.0).is_some(), "a vibration with a fixed angle");
        let jumps = |angle: f64| if angle > 50.0 { angle + 2.0 } else { angle };
        assert_eq!(first(|_| 200.0, jumps), None, "an angle that jumps once");
    }
}
