//! The vehicle of `examples/vehicle` on its driving cycle: speed and torque at the shaft of the machine.
#![allow(dead_code, reason = "each test program uses a part")]

const CYCLE: &str = include_str!("../../../examples/vehicle/cycle.csv");
const VEHICLE: &str = include_str!("../../../examples/vehicle/vehicle.toml");

/// Energies of machine c in kWh on a link of 400 V at 20 degC, an independent calculation with steady operating points in the
/// middle of each second: from the link (out, back), and copper, iron, conduction, switching, friction.
pub(crate) const ENERGY: [f64; 3] = [1.322_449, 1.497_219, -0.174_770];
pub(crate) const LOSSES: [f64; 5] = [0.015_373, 0.027_246, 0.014_992, 0.013_319, 0.053_891];

/// A joule in kWh.
pub(crate) const KWH: f64 = 1.0 / 3.6e6;

fn number(text: &str) -> f64 {
    text.trim().parse().unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn value(name: &str) -> f64 {
    let line = VEHICLE.lines().find(|line| line.split('=').next().is_some_and(|key| key.trim() == name));
    let text = line.and_then(|line| line.split(['=', '#']).nth(1));
    number(text.unwrap_or_else(|| panic!("vehicle.toml has no {name}")))
}

/// Vehicle and cycle.
pub(crate) struct Vehicle {
    /// Corners: time in s, speed in m/s.
    corners: Vec<[f64; 2]>,
    mass: f64,
    rolling: f64,
    drag: f64,
    per_wheel: f64,
    J: f64,
}

impl Vehicle {
    pub(crate) fn new() -> Self {
        let rows = CYCLE.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
        let corners = rows.map(|row| {
            let (time, speed) = row.split_once(',').unwrap();
            [number(time), number(speed) / 3.6]
        });
        Self {
            corners: corners.collect(),
            mass: value("mass"),
            rolling: value("mass") * 9.81 * value("rolling_resistance"),
            drag: 0.5 * value("air_density") * value("drag_area"),
            per_wheel: value("gear_ratio") / value("wheel_radius"),
            J: value("rotor_inertia"),
        }
    }

    /// Length of the cycle in s.
    pub(crate) fn end(&self) -> f64 {
        self.corners[self.corners.len() - 1][0]
    }

    /// Speed in rad/s of the machine and torque in N.m at its shaft at the time `t` (s), in the middle of a straight line.
    pub(crate) fn at(&self, t: f64) -> [f64; 2] {
        let k = self.corners.partition_point(|corner| corner[0] <= t).clamp(1, self.corners.len() - 1);
        let ([t_0, v_0], [t_1, v_1]) = (self.corners[k - 1], self.corners[k]);
        let a = (v_1 - v_0) / (t_1 - t_0);
        let v = v_0 + a * (t - t_0);
        let rolling = if v > 0.0 { self.rolling } else { 0.0 };
        let force = self.mass * a + rolling + self.drag * v * v;
        [v * self.per_wheel, force / self.per_wheel + self.J * a * self.per_wheel]
    }
}
