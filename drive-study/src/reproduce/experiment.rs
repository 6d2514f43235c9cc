//! The paper's experiments as data: parameters, events and recorded quantities.

use std::f64::consts::PI;

/// 1 rpm in rad/s.
pub const RPM: f64 = PI / 30.0;

/// Values of one input over time: each holds from its time (s) to the next.
pub type Schedule = &'static [(f64, f64)];

/// An experiment with plant and controller.
#[derive(Clone, Copy, Debug)]
pub struct Experiment {
    /// Short name, also of files.
    pub id: &'static str,
    /// Figure of the paper.
    pub figure: &'static str,
    /// What happens.
    pub title: &'static str,
    /// Parameters of the plant that differ from the start values, in SI units.
    pub plant: &'static [(&'static str, f64)],
    /// Parameters of the controller that differ from the start values, in SI units.
    pub controller: &'static [(&'static str, f64)],
    /// Speed reference in rpm.
    pub speed_ref: Schedule,
    /// Load torque in N.m.
    pub load: Schedule,
    /// Duration in s.
    pub duration: f64,
}

/// An experiment without settings and events.
pub const REST: Experiment =
    Experiment { id: "", figure: "", title: "", plant: &[], controller: &[], speed_ref: &[], load: &[], duration: 1.0 };

/// Start from the worst angle, stop, second start.
pub const START: Experiment = Experiment {
    id: "start-180",
    figure: "4a, 4b",
    title: "first start with the rotor opposite to its estimate, stop, second start",
    plant: &[("initial.theta_e", PI)],
    speed_ref: &[(0.2, 500.0), (1.2, 0.0), (2.2, 500.0)],
    duration: 3.2,
    ..REST
};
/// A speed step at 0.1 s.
const fn speed_step(id: &'static str, figure: &'static str, title: &'static str, speed_ref: Schedule) -> Experiment {
    Experiment { id, figure, title, speed_ref, duration: 1.1, ..REST }
}

/// Speed step to 20 rpm.
pub const STEP_20: Experiment = speed_step("step-20", "4c", "speed step 0 - 20 rpm", &[(0.1, 20.0)]);
/// Speed step to 500 rpm.
pub const STEP_500: Experiment = speed_step("step-500", "4d", "speed step 0 - 500 rpm", &[(0.1, 500.0)]);
/// Speed step to 1000 rpm.
pub const STEP_1000: Experiment = speed_step("step-1000", "4e", "speed step 0 - 1000 rpm", &[(0.1, 1000.0)]);
/// Speed step to 1500 rpm.
pub const STEP_1500: Experiment = speed_step("step-1500", "4f", "speed step 0 - 1500 rpm", &[(0.1, 1500.0)]);
/// Load step at standstill.
pub const LOAD_0: Experiment = Experiment {
    id: "load-0",
    figure: "5a, 5c, 5e",
    title: "load step 0 - 2 N.m at 0 rpm",
    load: &[(0.5, 2.0)],
    duration: 6.5,
    ..REST
};
/// Load step at 1000 rpm.
pub const LOAD_1000: Experiment = Experiment {
    id: "load-1000",
    figure: "5b, 5d, 5f",
    title: "load step 0 - 2 N.m at 1000 rpm",
    speed_ref: &[(0.0, 1000.0)],
    load: &[(1.0, 2.0)],
    duration: 2.0,
    ..REST
};

/// All experiments that `reproduce` runs, in the paper's order.
pub const ALL: [Experiment; 7] = [START, STEP_20, STEP_500, STEP_1000, STEP_1500, LOAD_0, LOAD_1000];

/// Value of a schedule at time `t` (s); 0 before its first entry.
pub fn at(schedule: Schedule, t: f64) -> f64 {
    schedule.iter().rev().find(|(from, _)| t >= from - 1e-9).map_or(0.0, |(_, value)| *value)
}

/// The recorded communication points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// Time in s.
    pub t: Vec<f64>,
    /// Speed reference in rpm.
    pub speed_ref: Vec<f64>,
    /// True mechanical speed in rpm.
    pub speed: Vec<f64>,
    /// Estimated mechanical speed in rpm.
    pub speed_est: Vec<f64>,
    /// True electrical angle in deg, in (-180, 180].
    pub theta_e: Vec<f64>,
    /// Estimated electrical angle in deg, in (-180, 180].
    pub theta_est: Vec<f64>,
    /// Angle error theta^ - theta in deg, in (-180, 180].
    pub error: Vec<f64>,
    /// d-axis current in the estimated rotor frame in A.
    pub i_d: Vec<f64>,
    /// q-axis current in the estimated rotor frame in A.
    pub i_q: Vec<f64>,
}

/// One communication point, in the FMUs' own SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Plant's `speed`, rad/s.
    pub speed: f64,
    /// Plant's `theta_e`, rad.
    pub theta_e: f64,
    /// Controller's `speed_est`, rad/s.
    pub speed_est: f64,
    /// Controller's `theta_est`, rad.
    pub theta_est: f64,
    /// Controller's `i_d`, A.
    pub i_d: f64,
    /// Controller's `i_q`, A.
    pub i_q: f64,
}

impl Record {
    /// Appends a communication point of `experiment` at time `t` (s).
    pub fn push(&mut self, experiment: &Experiment, t: f64, point: &Point) {
        self.t.push(t);
        self.speed_ref.push(at(experiment.speed_ref, t));
        self.speed.push(point.speed / RPM);
        self.speed_est.push(point.speed_est / RPM);
        self.theta_e.push(point.theta_e.to_degrees());
        self.theta_est.push(point.theta_est.to_degrees());
        let error = (point.theta_est - point.theta_e).to_degrees();
        self.error.push(error - 360.0 * ((error - 180.0) / 360.0).ceil());
        self.i_d.push(point.i_d);
        self.i_q.push(point.i_q);
    }

    /// Columns with their headings, for CSV.
    pub fn columns(&self) -> [(&'static str, &[f64]); 9] {
        [
            ("t [s]", &self.t),
            ("speed_ref [rpm]", &self.speed_ref),
            ("speed [rpm]", &self.speed),
            ("speed_est [rpm]", &self.speed_est),
            ("theta_e [deg]", &self.theta_e),
            ("theta_est [deg]", &self.theta_est),
            ("theta_est - theta_e [deg]", &self.error),
            ("i_d [A]", &self.i_d),
            ("i_q [A]", &self.i_q),
        ]
    }
}

/// Number of communication steps of `h` (s) between recorded points. Between its samples (0.1 ms apart) the controller
/// holds its estimate while the rotor turns on, so only points on the sample grid are comparable.
pub fn samples_apart(h: f64) -> u32 {
    let mut steps = 1;
    while f64::from(steps) * h < 1e-4 - 1e-9 {
        steps += 1;
    }
    steps
}

/// A closed loop that can run an experiment: the packed FMUs, or the native models in the tests.
pub trait ClosedLoop {
    /// Runs `experiment` with communication steps of `h` (s) and records every [`samples_apart`]th point.
    ///
    /// # Errors
    /// A step or a set call fails.
    fn run(&self, experiment: &Experiment, h: f64) -> Result<Record, fmu_import::Error>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schedule_holds_its_values() {
        let s: Schedule = &[(0.2, 500.0), (1.2, 0.0)];
        assert!(
            [(0.0, 0.0), (0.2, 500.0), (1.199, 500.0), (1.2, 0.0)].iter().all(|&(t, v)| (at(s, t) - v).abs() < 1e-12)
        );
    }

    #[test]
    fn errors_wrap_to_half_open_turn() {
        let mut record = Record::default();
        for (theta_est, theta_e) in [(PI, -PI / 2.0), (0.0, PI), (0.1, -0.1)] {
            record.push(&REST, 0.0, &Point { theta_e, theta_est, ..Point::default() });
        }
        for (error, expected) in record.error.iter().zip([-90.0, 180.0, 0.2_f64.to_degrees()]) {
            assert!((error - expected).abs() < 1e-9, "{error} {expected}");
        }
    }
}
