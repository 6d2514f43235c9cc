//! Sensors of a drive, as the peripherals of a microcontroller read them: counts and bits.
//!
//! | file | contents |
//! |---|---|
//! | [`adc`] | counts of an analog-to-digital converter |
//! | [`shunt`] | currents through shunts in the legs or in the link |
//! | [`encoder`] | incremental encoder: count, A, B and index |
//! | [`hall`] | three Hall sensors |
//!
//! Each is a function of the machine's state at an instant: a sensor has no state.

pub mod adc;
pub mod encoder;
pub mod hall;
pub mod shunt;
