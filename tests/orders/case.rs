//! The simulated cases: FMUs, inputs over time, outputs to compare.

use fmu_import::Fmu;
use fmu_system::cosimulation::{Integration, Method, Schedule, Settings, Solver, System};
use std::ops::ControlFlow;
use std::path::Path;

/// An input over time: values that apply from their times on, or straight lines between them.
pub struct Input {
    pub name: &'static str,
    pub points: &'static [(f64, f64)],
    pub linear: bool,
    pub discrete: bool,
    pub boolean: bool,
}

impl Input {
    pub fn at(&self, t: f64) -> f64 {
        self.schedule().at(t)
    }

    fn schedule(&self) -> Schedule {
        let points = self.points.to_vec();
        if self.linear { Schedule::lines(points) } else { Schedule::steps(points) }.unwrap()
    }
}

pub const fn steps(name: &'static str, points: &'static [(f64, f64)]) -> Input {
    Input { name, points, linear: false, discrete: false, boolean: false }
}

const fn lines(name: &'static str, points: &'static [(f64, f64)]) -> Input {
    Input { linear: true, ..steps(name, points) }
}

const fn discrete(name: &'static str, points: &'static [(f64, f64)]) -> Input {
    Input { discrete: true, ..steps(name, points) }
}

pub const fn boolean(name: &'static str, points: &'static [(f64, f64)]) -> Input {
    Input { boolean: true, ..discrete(name, points) }
}

/// A run of one FMU.
pub struct Case {
    pub fmu: &'static str,
    pub inputs: &'static [Input],
    pub outputs: &'static [&'static str],
    /// Distance in s between compared points; none coincides with a sample.
    pub apart: f64,
    pub points: u32,
    /// Largest deviation, as a part of the largest value of the output.
    pub tolerance: f64,
}

impl Case {
    pub fn point(&self, k: u32) -> f64 {
        f64::from(k) * self.apart
    }

    /// The case whose inputs jump at its points: our importer ends a step where an input jumps.
    pub fn jumping_at_points(self) -> Self {
        let moved = |input: &Input| {
            let points = input.points.iter().map(|(t, x)| ((t / self.apart).ceil() * self.apart, *x));
            let points = if input.linear { input.points } else { points.collect::<Vec<_>>().leak() };
            Input { points, ..*input }
        };
        Self { inputs: self.inputs.iter().map(moved).collect::<Vec<_>>().leak(), ..self }
    }

    pub fn stop(&self) -> f64 {
        self.point(self.points)
    }

    /// Times at which an input jumps or bends.
    pub fn jumps(&self) -> Vec<f64> {
        let mut all: Vec<f64> =
            self.inputs.iter().flat_map(|i| i.points.iter().map(|(t, _)| *t)).filter(|t| *t > 0.0).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }

    /// Largest deviation where samples are up to `late` (s) late. `p_in_mean` is the energy from one sample to the next over T_s =
    /// 0.1 ms; each of the two instants moves it by `late` times the power.
    pub fn allowed(&self, late: f64) -> f64 {
        let moved = if self.outputs.contains(&"p_in_mean") { 2.0 * late / 1e-4 } else { 0.0 };
        self.tolerance + moved
    }

    /// Our importer, in the order of the standards, at a tighter tolerance.
    pub fn reference(&self, file: &Path) -> Vec<Vec<f64>> {
        self.recorded(
            file,
            Method::ModelExchange(Integration { solver: Solver::Dopri { rtol: 1e-11 }, ..Integration::default() }),
        )
    }

    /// Our importer with a method.
    pub fn recorded(&self, file: &Path, method: Method) -> Vec<Vec<f64>> {
        let mut system = System::new(method);
        system.add("it", &Fmu::open(file).unwrap(), false).unwrap();
        for input in self.inputs {
            system.input(&format!("it.{}", input.name), input.schedule()).unwrap();
        }
        for name in self.outputs {
            system.record_as(&format!("it.{name}"), name).unwrap();
        }
        let settings = Settings { start: 0.0, stop: self.stop(), step: self.apart, sequential: false };
        let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
        let row = |i: usize| self.outputs.iter().map(|name| recording.column(name).unwrap().values[i]).collect();
        let at = |k: u32| recording.time.iter().position(|t| (t - self.point(k)).abs() < 1e-9).expect("a point");
        (1..=self.points).map(|k| row(at(k))).collect()
    }

    /// The largest difference of the rows, each output as a part of its largest value.
    pub fn deviation(&self, rows: &[Vec<f64>], reference: &[Vec<f64>]) -> (f64, &'static str) {
        assert_eq!(rows.len(), reference.len());
        let of = |i: usize| {
            let scale = reference.iter().map(|row| row[i].abs()).fold(1e-9, f64::max);
            rows.iter().zip(reference).map(|(a, b)| (a[i] - b[i]).abs() / scale).fold(0.0, f64::max)
        };
        self.outputs
            .iter()
            .enumerate()
            .map(|(i, name)| (of(i), *name))
            .fold((0.0, "-"), |a, b| if b.0 >= a.0 { b } else { a })
    }
}

/// The FMUs of the drive.
pub const OURS: &[Case] = &[
    Case {
        fmu: "PmsmPlant",
        inputs: &[
            lines("u_a", &[(0.0, 0.0), (5e-3, 20.0), (2e-2, 60.0), (2.5e-2, 30.0)]),
            lines("u_b", &[(0.0, 0.0), (5e-3, -10.0), (2e-2, -20.0), (2.5e-2, 30.0)]),
            lines("u_c", &[(0.0, 0.0), (5e-3, -10.0), (2e-2, -40.0), (2.5e-2, -60.0)]),
            steps("tau_load", &[(0.0, 0.0), (1e-2, 0.5)]),
            // The diodes then block one phase after the other: state events.
            boolean("enable", &[(0.0, 1.0), (3e-2, 0.0)]),
        ],
        outputs: &["speed", "i_d", "i_q", "i_a", "energy_in", "energy_mech", "energy_loss"],
        apart: 7.313_7e-4,
        points: 60,
        tolerance: 2e-6,
    },
    Case {
        fmu: "PmsmDrive",
        inputs: &[
            discrete("speed_ref", &[(0.0, 0.0), (1.003e-2, 60.0)]),
            steps("tau_load", &[(0.0, 0.0), (3.007e-2, 1.0)]),
        ],
        outputs: &["speed", "i_d", "i_q", "u_a", "p_in_mean", "energy_in", "energy_mech", "energy_loss"],
        apart: 7.313_7e-4,
        points: 80,
        tolerance: 2e-6,
    },
    Case {
        fmu: "PmsmDriveMean",
        inputs: &[
            discrete("speed_ref", &[(0.0, 0.0), (1.003e-2, 60.0)]),
            steps("tau_load", &[(0.0, 0.0), (0.13, 1.0)]),
        ],
        outputs: &["speed", "i_d", "i_q", "energy_in", "energy_mech", "energy_loss"],
        apart: 2.313_7e-3,
        points: 100,
        tolerance: 2e-6,
    },
    Case {
        fmu: "MappedDrive",
        inputs: &[
            discrete("speed_ref", &[(0.0, 0.0), (1.003e-2, 60.0)]),
            steps("tau_load", &[(0.0, 0.0), (0.13, 1.0)]),
        ],
        outputs: &["speed", "tau_max", "energy_in", "energy_mech", "energy_loss"],
        apart: 2.313_7e-3,
        points: 100,
        tolerance: 2e-6,
    },
    Case {
        fmu: "SensorlessController",
        inputs: &[
            lines("i_a", &[(0.0, 0.0), (5e-3, 3.0), (2e-2, -2.0)]),
            lines("i_b", &[(0.0, 0.0), (5e-3, -2.0), (2e-2, 1.5)]),
            lines("i_c", &[(0.0, 0.0), (5e-3, -1.0), (2e-2, 0.5)]),
            steps("u_dc", &[(0.0, 325.0), (1.203e-2, 300.0)]),
            discrete("speed_ref", &[(0.0, 0.0), (3.03e-3, 60.0)]),
            boolean("enable", &[(0.0, 1.0), (1.707e-2, 0.0)]),
        ],
        outputs: &["u_a", "u_b", "u_c", "speed_est", "theta_est", "i_q_ref"],
        apart: 3.137e-4,
        points: 60,
        tolerance: 2e-6,
    },
];

/// Those of the Reference-FMUs in Rust that an explicit method integrates (not Roberts), without clocks and arrays of variable size.
pub const REFERENCE: &[Case] = &[
    Case { fmu: "BouncingBall", inputs: &[], outputs: &["h", "v"], apart: 0.013_137, points: 180, tolerance: 1e-5 },
    Case { fmu: "Dahlquist", inputs: &[], outputs: &["x"], apart: 0.137, points: 70, tolerance: 1e-6 },
    // It ends the simulation at 9 s.
    Case { fmu: "Stair", inputs: &[], outputs: &["counter"], apart: 0.137, points: 65, tolerance: 0.0 },
    Case { fmu: "VanDerPol", inputs: &[], outputs: &["x0", "x1"], apart: 0.137, points: 140, tolerance: 1e-5 },
    Case {
        fmu: "Feedthrough",
        inputs: &[
            lines("Float64_continuous_input", &[(0.0, 0.0), (1.003, 3.0), (1.5, -1.0)]),
            discrete("Float64_discrete_input", &[(0.0, 0.0), (0.503, 1.0)]),
        ],
        outputs: &["Float64_continuous_output", "Float64_discrete_output"],
        apart: 0.031_37,
        points: 60,
        tolerance: 1e-12,
    },
];
