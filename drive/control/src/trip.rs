//! Trips: over-current, over-voltage and under-voltage end the operation of the inverter until `enable` falls.
//!
//! A sample with a phase current above `trip.i` or a DC-link voltage above `trip.u_dc` or below `trip.u_dc_min` trips the drive: from the next sample
//! instant the controller is inactive and the gates are off; with `trip.u_dc_restart` above 0, an under-voltage trip ends once a sample
//! measures that voltage. With `trip.asc` the machine is short-circuited instead where gates
//! off would feed the link through the diodes, that is where its line-to-line back EMF exceeds u_dc:
//!
//! ```text
//! sqrt 3 psi_M |w| > u_dc         and until sqrt 3 psi_M |w| < 0.9 u_dc
//! ```
//!
//! w is the speed of the sensor if the estimator reads it, otherwise the estimate at the trip. After an active short circuit at
//! full torque, the current swings beyond most limits, so a current does not trip a second time.

use drive_base::frame::Phases;
use drive_base::motor::Motor;
use fmu_core::unit::{AMPERE, VOLT};
use fmu_core::{Row, Table, enumeration, table};
use serde::{Deserialize, Serialize};

enumeration! {
    /// The cause of a trip; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum Cause("Trip", "What has tripped") {
        1 None "Nothing";
        2 OverCurrent "A phase current beyond trip.i";
        3 OverVoltage "A DC-link voltage beyond trip.u_dc";
        4 UnderVoltage "A DC-link voltage below trip.u_dc_min";
    }
}

#[expect(clippy::derivable_impls, reason = "the macro writes the variants")]
impl Default for Cause {
    fn default() -> Self {
        Self::None
    }
}

/// Back EMF over u_dc below which a short circuit ends.
const END: f64 = 0.9;

/// Parameters of the trips.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TripParameters {
    /// Trips are in use.
    pub used: bool,
    /// Phase current in A above which the drive trips.
    pub i: f64,
    /// DC-link voltage in V above which the drive trips.
    pub u_dc: f64,
    /// DC-link voltage in V below which the drive trips; 0: none.
    pub u_dc_min: f64,
    /// DC-link voltage in V at which an under-voltage trip ends; 0: when `enable` falls.
    pub u_dc_restart: f64,
    /// A trip short-circuits the machine where its back EMF exceeds u_dc.
    pub asc: bool,
}

impl Default for TripParameters {
    fn default() -> Self {
        Self { used: false, i: 15.0, u_dc: 450.0, u_dc_min: 0.0, u_dc_restart: 0.0, asc: false }
    }
}

impl TripParameters {
    /// The trip caused by the measured currents `i` (A) and the DC-link voltage `u_dc` (V), if any.
    #[inline]
    pub fn cause(&self, Phases { a, b, c }: Phases, u_dc: f64) -> Cause {
        if a.abs().max(b.abs()).max(c.abs()) > self.i { Cause::OverCurrent } else { self.cause_of_voltage(u_dc) }
    }

    /// The trip caused by the DC-link voltage `u_dc` (V), if any.
    #[inline]
    pub fn cause_of_voltage(&self, u_dc: f64) -> Cause {
        if u_dc > self.u_dc {
            Cause::OverVoltage
        } else if u_dc < self.u_dc_min {
            Cause::UnderVoltage
        } else {
            Cause::None
        }
    }

    /// Whether an under-voltage trip ends at the DC-link voltage `u_dc` (V).
    #[inline]
    pub fn restarts(&self, u_dc: f64) -> bool {
        self.u_dc_restart > 0.0 && u_dc >= self.u_dc_restart
    }
}

impl Cause {
    /// The limit that was exceeded, for messages.
    pub fn what(self, par: &TripParameters) -> String {
        match self {
            Self::None => String::new(),
            Self::OverCurrent => format!("trip: a phase current is (trip.i = {} A)", par.i),
            Self::OverVoltage => format!("trip: the DC link is (trip.u_dc = {} V)", par.u_dc),
            Self::UnderVoltage => format!("trip: the DC link is (trip.u_dc_min = {} V)", par.u_dc_min),
        }
    }

    /// What ends the trip, for messages.
    pub fn ends(self, par: &TripParameters) -> String {
        if self == Self::UnderVoltage && par.u_dc_restart > 0.0 {
            format!("the DC link has trip.u_dc_restart = {} V, or enable falls", par.u_dc_restart)
        } else {
            "enable falls".into()
        }
    }
}

/// The cause of the trip, and the state of the inverter since then.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Trip {
    /// What has tripped.
    pub cause: Cause,
    /// The machine is short-circuited.
    pub shorts: bool,
    /// Mechanical speed in rad/s at the trip.
    speed: f64,
}

impl Trip {
    /// After the trip `cause` at the mechanical `speed` (rad/s).
    pub fn new(cause: Cause, speed: f64) -> Self {
        Self { cause, shorts: false, speed }
    }

    /// At a sample with the link's `u_dc` (V): whether the machine is short-circuited. `measured`: the sensor's speed (rad/s),
    /// if available.
    pub fn update(&mut self, par: &TripParameters, motor: &Motor, u_dc: f64, measured: Option<f64>) {
        self.speed = measured.unwrap_or(self.speed);
        let emf = 3.0_f64.sqrt() * motor.psi_M * (f64::from(motor.n_p) * self.speed).abs();
        self.shorts = par.asc && emf > if self.shorts { END * u_dc } else { u_dc };
    }
}

type P = Row<TripParameters>;

/// Variables of the trips; their owner supplies the prefix `trip.`.
pub const TRIP: &Table<TripParameters> = table![
    P::boolean_parameter(
        "use",
        "Trips by current and DC-link voltage: the gates are off until enable falls; false: no trip",
        |p| &mut p.used,
    ),
    P::parameter("i", &AMPERE, "Measured phase current beyond which the drive trips; above limit.i", |p| { &mut p.i }),
    P::parameter("u_dc", &VOLT, "Measured DC-link voltage beyond which the drive trips", |p| &mut p.u_dc),
    P::parameter("u_dc_min", &VOLT, "Measured DC-link voltage below which the drive trips; 0: none", |p| {
        &mut p.u_dc_min
    })
    .at_least(0.0),
    P::parameter(
        "u_dc_restart",
        &VOLT,
        "Measured DC-link voltage at which an under-voltage trip ends; 0: only when enable falls",
        |p| &mut p.u_dc_restart,
    )
    .at_least(0.0),
    P::boolean_parameter(
        "asc",
        "A trip short-circuits the machine where its back EMF exceeds u_dc; false: gates off at any speed",
        |p| &mut p.asc,
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Any phase in either direction and the link trip, and only beyond their limits.
    #[test]
    fn each_phase_and_the_link_trip() {
        let par = TripParameters { i: 15.0, u_dc: 450.0, ..TripParameters::default() };
        for side in [1.0, -1.0] {
            for (i, cause) in [(14.9, Cause::None), (15.1, Cause::OverCurrent)] {
                let i = side * i;
                for (a, b, c) in [(i, 0.0, 0.0), (0.0, i, 0.0), (0.0, 0.0, i)] {
                    assert_eq!(par.cause(Phases { a, b, c }, 449.0), cause, "{a} {b} {c} A");
                }
            }
        }
        assert_eq!(par.cause(Phases::default(), 451.0), Cause::OverVoltage);
        assert_eq!(par.cause(Phases::default(), 0.0), Cause::None, "0: no trip by a low voltage");
        let par = TripParameters { u_dc_min: 200.0, ..par };
        assert_eq!([199.0, 201.0].map(|u| par.cause(Phases::default(), u)), [Cause::UnderVoltage, Cause::None]);
        assert!(!par.restarts(1e9), "0: only when enable falls");
        let par = TripParameters { u_dc_restart: 250.0, ..par };
        assert_eq!([249.0, 251.0].map(|u| par.restarts(u)), [false, true]);
    }

    /// sqrt 3 psi_M n_p |w| is the line-to-line EMF: beyond u_dc the machine is shorted until 0.9 u_dc, based on the measured
    /// speed, or on the speed at the trip.
    #[test]
    fn a_short_circuit_begins_and_ends_by_the_emf() {
        let (mut par, motor) = (TripParameters { asc: true, ..TripParameters::default() }, Motor::default());
        let at = 300.0 / (3.0_f64.sqrt() * motor.psi_M * 3.0);
        for side in [1.0, -1.0] {
            let mut trip = Trip::new(Cause::OverVoltage, 0.0);
            for (share, shorts) in [(0.95, false), (1.01, true), (0.91, true), (0.89, false), (0.99, false)] {
                trip.update(&par, &motor, 300.0, Some(side * share * at));
                assert_eq!(trip.shorts, shorts, "{share} of the speed, {side}");
                let mut without = Trip::new(Cause::OverVoltage, side * 1.01 * at);
                without.update(&par, &motor, 300.0, None);
                assert!(without.shorts, "the speed at the trip stays");
            }
        }
        par.asc = false;
        let mut trip = Trip::new(Cause::OverVoltage, 2.0 * at);
        trip.update(&par, &motor, 300.0, None);
        assert!(!trip.shorts);
    }
}
