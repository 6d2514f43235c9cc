//! Watches of the drives without sampling: the ways in which speed control fails to reach its reference.

use crate::backward::Backward;
use crate::unsettled::Unsettled;
use drive_control::overload::Overload;
use fmu_core::log::Warnings;
use serde::{Deserialize, Serialize};

/// A drive after an interval.
pub(crate) struct Watched {
    /// Whether speed control is at work.
    pub(crate) controls: bool,
    /// Whether the drive train imposes the speed.
    pub(crate) imposed: bool,
    /// Whether a limit of the torque acts against the error of the speed.
    pub(crate) limited: bool,
    /// Reference of the speed in rad/s, on its ramp.
    pub(crate) speed_ref: f64,
    /// Load in N.m.
    pub(crate) tau_load: f64,
    /// Speeds in rad/s at the beginning and at the end.
    pub(crate) speeds: [f64; 2],
}

/// What has been seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct SpeedWatch {
    /// A load above the torque of the drive.
    overload: Overload,
    /// The shaft against the direction of its reference.
    backward: Backward,
    /// A speed that does not settle.
    unsettled: Unsettled,
}

impl SpeedWatch {
    /// After an interval of `h` (s).
    pub(crate) fn update(&mut self, h: f64, is: &Watched) {
        let &Watched { controls, imposed, limited, speed_ref, tau_load, speeds } = is;
        self.overload.update(h, limited, speed_ref, speeds);
        self.backward.update(h, controls, speed_ref, speeds[1]);
        if controls && !imposed {
            self.unsettled.update(h, limited, [speed_ref, tau_load], speeds[1]);
        } else {
            self.unsettled = Unsettled::default();
        }
    }

    /// Reports what has been found, with the speed (rad/s) and its reference (rad/s), the bandwidths (rad/s) of the torque and of the
    /// speed loop, and the limits of the torque (N.m).
    pub(crate) fn warn(
        &self,
        speeds: [f64; 2],
        bandwidths: [f64; 2],
        limits: impl FnOnce() -> [f64; 2],
        log: &mut Warnings<'_>,
    ) {
        self.overload.warn(false, speeds, limits, log);
        self.backward.warn(speeds[1], speeds[0], log);
        self.unsettled.warn(bandwidths, log);
    }
}
