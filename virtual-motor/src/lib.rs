//! A permanent-magnet synchronous motor with inverter and sensors, for motor-control firmware that runs on a PC.
//!
//! [`VirtualMotor`] is the plant of the FMU `PmsmPlant`: the same equations, the same variables and, with the same duty cycles,
//! the same state, bit for bit. Here the importer is a firmware, so its inputs are duty cycles or gate signals, and its outputs
//! are counts and bits.
//!
//! ```
//! use virtual_motor::{VirtualMotor, find};
//!
//! let mut motor = VirtualMotor::default();
//! motor.set(find("inverter.T_pwm")?, 50e-6)?;
//! let speed = find("speed")?;
//! for k in 1..=200_u32 {
//!     let counts = motor.adc()?;
//!     assert!(counts.i[0] < 4096);
//!     motor.advance_duties(50e-6 * f64::from(k), [0.5, 0.52, 0.48], true)?;
//! }
//! assert!(motor.get(speed)?.abs() > 0.0 && motor.encoder().count < 4096);
//! let refused = motor.advance_duties(1.0, [0.5, 1.5, 0.5], true).unwrap_err();
//! assert_eq!(refused.to_string(), "duties[1] = 1.5 is not allowed: 0 to 1");
//! # Ok::<(), virtual_motor::Error>(())
//! ```
//!
//! | file | contents |
//! |---|---|
//! | [`motor`] | [`VirtualMotor`]: values, time, duty cycles, gate signals |
//! | [`create`] | a motor from a motor file or from a preset |
//! | [`sensing`] | what a firmware reads: converter, encoder, Hall sensors, terminals |
//! | [`variables`] | the variables of `PmsmPlant` by their names and numbers |
//! | [`pool`] | motors by ids, for C |
//! | [`abi`] | the C functions of `include/virtual_motor.h`; the only unsafe code |

#![deny(unsafe_code)]

#[allow(unsafe_code)]
pub mod abi;
pub mod create;
pub mod error;
pub mod motor;
pub mod pool;
pub mod sensing;
pub mod variables;

pub use error::{Error, ErrorCode, Result};
pub use motor::VirtualMotor;
pub use variables::find;
