//! The switched inverter: its carrier, its bridge of six switches and diodes, and the machine between two instants.
//!
//! | file | contents |
//! |---|---|
//! | [`carrier`] | duty cycles, zero sequences, and the instants at which a leg is commanded |
//! | [`bridge`] | legs with dead time and diodes: which of them conduct, and which block |
//! | `segment` | the machine between two instants |
//! | [`state`] | the state of carrier and legs |
//! | `run` | a communication step: from instant to instant |
//! | `exchange` | Model Exchange: from event to event |
//! | [`terminals`] | voltages of the terminals, and the rail of each leg's current |
//!
//! `inverter.mode` = Average replaces all this by the mean over a PWM period ([`inverter`](crate::inverter)).

pub mod bridge;
pub mod carrier;
mod exchange;
mod run;
mod segment;
pub mod state;
pub mod terminals;
