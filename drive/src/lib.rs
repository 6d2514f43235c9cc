//! Permanent-magnet synchronous machine drives: the whole drive, built from plant and controller.
//!
//! | crate | folder | contents |
//! |---|---|---|
//! | `drive-base` | `drive/base/` | frames, elementary functions, the data of a machine, modulation; the conventions |
//! | `drive-plant` | `drive/plant/` | [`PmsmPlant`]: machine, inverter, losses, temperatures, mechanics |
//! | `drive-control` | `drive/control/` | [`SensorlessController`], and every [`estimator`] |
//! | `drive` | `drive/src/` | [`PmsmDrive`], the [`Pair`] of plant and controller, [`PmsmDriveMean`], [`MappedDrive`]; [`steady`] state by algebra |

#![forbid(unsafe_code)]
// The papers' symbols keep their case: psi_M, R_s, L_d, T_s.
#![allow(non_snake_case)]

mod apart;
mod backward;
pub mod beginning;
pub mod dc_link;
pub mod derating;
pub mod documentation;
mod happened;
mod idle;
mod lag;
pub mod mapped_drive;
pub mod pair;
pub mod pmsm_drive;
pub mod pmsm_drive_mean;
mod rules;
mod speed_watch;
pub mod steady;
mod terminals;
pub mod torque;
mod unsettled;

pub use drive_base::{frame, implausible, integrate, math, modulation, motor, overmodulation};
pub use drive_control::clocked::SensorlessControllerClocked;
pub use drive_control::model::SensorlessController;
pub use drive_control::{self as control, estimator};
pub use drive_plant::{self as plant, PmsmPlant};
pub use mapped_drive::MappedDrive;
pub use pair::Pair;
pub use pmsm_drive::PmsmDrive;
pub use pmsm_drive_mean::PmsmDriveMean;
