//! Random machines of every kind, and a search through all currents without the algebra of field weakening.

#![allow(dead_code, reason = "each test program uses a part")]

use super::machines::Machine;
use drive_base::motor::Motor;
use fmu_core::draw::Draw;

/// 200 machines: R i/u from 0 to 0.6, psi_M/(L_d I) from 0.3 to 40, L_q/L_d from 0.8 to 4.
pub(crate) fn all() -> Vec<Machine> {
    let mut random = Draw(45);
    (0..200).map(|_| one(&mut random)).collect()
}

fn one(random: &mut Draw) -> Machine {
    let (u_dc, i) = (random.scaled(12.0, 800.0), random.scaled(1.0, 500.0));
    let U = u_dc / 3.0_f64.sqrt();
    let (psi_M, share) = (U / random.scaled(200.0, 4000.0), random.between(0.0, 0.6));
    let L_d = psi_M / (i * random.scaled(0.3, 40.0));
    let saliency = random.scaled(0.8, 4.0);
    let saliency = if random.between(0.0, 1.0) < 0.3 { 1.0 } else { saliency };
    // L_q < L_d: the torque of i_q must not vanish within the current limit.
    let L_q = (L_d * saliency).max(L_d - 0.8 * psi_M / i);
    Machine { motor: Motor { n_p: 4, R_s: share * U / i, L_d, L_q, psi_M }, i, u_dc, J: 1.0 }
}

/// Electrical speeds in rad/s from near standstill to far above the one at which the EMF equals the voltage.
pub(crate) fn speeds(machine: &Machine) -> [f64; 8] {
    [0.02, 0.3, 0.6, 0.85, 0.98, 1.1, 1.6, 3.0].map(|share| share * machine.U(1.0) / machine.motor.psi_M)
}

/// A machine at a speed under both limits.
pub(crate) struct Brute<'a> {
    pub(crate) motor: &'a Motor,
    pub(crate) I: f64,
    pub(crate) w: f64,
    pub(crate) U: f64,
}

/// Places on a curve, and how often the search zooms in.
const PLACES: u32 = 2000;
const ZOOMS: u32 = 10;

impl Brute<'_> {
    /// Magnitude in V.
    pub(crate) fn voltage(&self, [d, q]: [f64; 2]) -> f64 {
        let Motor { R_s, L_d, L_q, psi_M, .. } = self.motor;
        (R_s * d - self.w * L_q * q).hypot(R_s * q + self.w * (psi_M + L_d * d))
    }

    fn fits(&self, [d, q]: [f64; 2]) -> bool {
        d.hypot(q) <= self.I * (1.0 + 1e-12) && self.voltage([d, q]) <= self.U * (1.0 + 1e-12)
    }

    /// Currents of a voltage at this angle (rad) on the limit: the linear equations by Cramer's rule.
    fn on_the_voltage(&self, angle: f64) -> [f64; 2] {
        let Motor { R_s, L_d, L_q, psi_M, .. } = self.motor;
        let (u_d, u_q) = (self.U * angle.cos(), self.U * angle.sin() - self.w * psi_M);
        let by = R_s * R_s + self.w * self.w * L_d * L_q;
        [(u_d * R_s + self.w * L_q * u_q) / by, (R_s * u_q - self.w * L_d * u_d) / by]
    }

    /// The best value of `worth` on a curve over 0..2 pi among the currents that fit, with its currents: a coarse search, refined
    /// step by step around the best point.
    fn best(&self, curve: impl Fn(f64) -> [f64; 2], worth: impl Fn([f64; 2]) -> f64) -> Option<(f64, [f64; 2])> {
        let (mut middle, mut width, mut places, mut best) = (std::f64::consts::PI, std::f64::consts::TAU, PLACES, None);
        for _ in 0..ZOOMS {
            let step = width / f64::from(places);
            let all = (0..=places).map(|k| middle - 0.5 * width + f64::from(k) * step);
            let fitting = all.map(|x| (x, curve(x))).filter(|&(_, i)| self.fits(i)).map(|(x, i)| (worth(i), x, i));
            let found = fitting.max_by(|a, b| a.0.total_cmp(&b.0))?;
            (middle, width, places, best) = (found.1, 4.0 * step, 40, Some((found.0, found.2)));
        }
        best
    }

    /// Maximum magnitude (N.m) of the torque of sign `s`, with its currents (A); 0: none.
    pub(crate) fn limit(&self, s: f64) -> (f64, [f64; 2]) {
        let motor = self.motor;
        let worth = |[d, q]: [f64; 2]| {
            let acts = s * q > 0.0 && motor.psi_M - (motor.L_q - motor.L_d) * d > 0.0;
            if acts { motor.torque(d, q).abs() } else { 0.0 }
        };
        let circle = |angle: f64| [self.I * angle.cos(), self.I * angle.sin()];
        let all = [self.best(circle, worth), self.best(|angle| self.on_the_voltage(angle), worth)];
        all.into_iter().flatten().fold((0.0, [0.0; 2]), |a, b| if b.0 > a.0 { b } else { a })
    }

    /// The minimum current (A) for the torque `tau` (N.m) within the voltage and roughly within the current limit.
    pub(crate) fn least_current(&self, tau: f64) -> Option<f64> {
        let Motor { n_p, L_d, L_q, psi_M, .. } = self.motor;
        let t = tau / (1.5 * f64::from(*n_p));
        let wide = Brute { motor: self.motor, I: self.I * (1.0 + 1e-6), w: self.w, U: self.U * (1.0 + 1e-9) };
        let curve = |angle: f64| {
            let d = -self.I * angle.cos();
            let l = psi_M - (L_q - L_d) * d;
            [d, if l > 0.0 { t / l } else { f64::INFINITY }]
        };
        wide.best(curve, |[d, q]| -d.hypot(q)).map(|(worth, _)| -worth)
    }
}
