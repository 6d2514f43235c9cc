//! Code shared by the plant and the controller of a drive: frames and space vectors, elementary functions, the data of a machine,
//! the average inverter, and the connections between the two.
//!
//! Conventions throughout the drive: SI units; motor sign (currents flow into the machine, torque is positive with positive
//! speed); space vectors are peak-valued (amplitude-invariant Clarke transform), so torque and power carry a factor
//! 3/2; angles are electrical unless the name says mechanical; the d-axis is the magnet axis. Each angle error states
//! its sign: `theta~ = theta - theta^` (Kim & Sul: how far the rotor is ahead) in estimators, trackers and the
//! comparison; `theta^ - theta` (Rasmussen: how far the estimate is ahead) in his observer and in the figures of his
//! paper. A value with `_hat` belongs to an estimator; the controller never reads the plant's parameters.
//!
//! Papers: Rasmussen, *Sensorless speed control including zero speed of non salient PM synchronous drives*, Bull. Polish
//! Acad. Sci. Tech. Sci. 54 (3), 2006, quoted as "Rasmussen (n)"; Kim & Sul, *Sensorless control of AC motor - where are
//! we now?*, ICEMS 2011, quoted as "Kim & Sul (n)".

#![forbid(unsafe_code)]
// The papers' symbols keep their case: psi_M, R_s, L_d, T_s.
#![allow(non_snake_case)]

pub mod connection;
pub mod documentation;
pub mod frame;
pub mod hexagon;
pub mod implausible;
pub mod integrate;
pub mod math;
pub mod modulation;
pub mod motor;
pub mod overmodulation;

/// Information common to all models of a drive; each adds its name, description and documentation.
pub const PROJECT: fmu_core::Info = fmu_core::Info {
    version: env!("CARGO_PKG_VERSION"),
    author: "The sensorless-drive developers",
    license: "MIT OR Apache-2.0",
    copyright: "Copyright (c) 2026 The sensorless-drive developers",
    experiment: fmu_core::Experiment { stop: 1.0, step: 1e-4, ..fmu_core::Experiment::DEFAULT },
    ..fmu_core::Info::DEFAULT
};
