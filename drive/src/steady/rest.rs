//! The steady state of a drive whose gates do not switch: the diodes block or rectify, or the machine is short-circuited.
//!
//! A short circuit through devices with the drop D per ampere is the machine on a resistance, R + D, at the voltage 0:
//!
//! ```text
//! (R + D) i_s + j w psi = 0,  i_s = i(psi) + G j w psi         i(psi) + (G + 1/(R + D)) j w psi = 0
//! |i_s| (D - r) = u                                            for devices with the threshold u and the resistance r
//! ```
//!
//! without D, i_d = -w^2 L_q psi_M / (R^2 + w^2 L_d L_q), i_q = -w R psi_M / (R^2 + w^2 L_d L_q). The drop is that of a
//! sinusoidal current; where the back EMF is only a few thresholds, their harmonics matter, and the motion is that of the
//! [`rectifier`], which also has the diodes. Derived here. i in A, psi in Wb.

use super::drive::Condition;
use super::flux;
use super::operating::{At, Point};
use super::search::root;
use drive_base::frame::Dq;
use drive_plant::losses::conduction::{self, Devices};
use drive_plant::losses::{Losses, efficiency};
use drive_plant::machine;
use drive_plant::power::Powers;
use drive_plant::rectifier::{self, From, Rectified, rectified};
use serde::{Deserialize, Serialize};

/// Maximum ratio of the resistances among which that of a short circuit is sought.
const WIDEST: f64 = 1e9;

/// Relative error of a threshold at which the resistance is found.
const SMALL: f64 = 1e-12;

/// Back EMF over the threshold below which the harmonics of the thresholds matter.
const BY_HARMONICS: f64 = 12.0;

/// The diodes before a point with the gates off: the current that flows, continues to flow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Diodes {
    /// They blocked.
    #[default]
    Blocked,
    /// They conducted; the flux linkage in Wb at the beginning of a sixth of a period.
    Conducted(Dq),
    /// The gates were on, or the machine short-circuited, with this flux linkage in Wb.
    Open(Dq),
}

impl At<'_> {
    /// The point with the gates off, after these `diodes`.
    pub fn off(&self, diodes: Diodes) -> Point {
        let condition = self.condition();
        let plant = &self.drive.plant;
        if condition.u_dc <= 0.0 {
            // The link has no voltage against which a diode could block.
            let &Devices { u_diode, r_diode, .. } = &plant.inverter.devices;
            let diodes = Devices { u_transistor: u_diode, r_transistor: r_diode, ..plant.inverter.devices.clone() };
            return self.shorted_through(&diodes);
        }
        let temperatures = condition.temperatures;
        let opens = condition.speed.abs() > self.drive.diode_speed(condition.u_dc, temperatures.magnet);
        let from = match diodes {
            Diodes::Conducted(psi) => From::Near(psi),
            Diodes::Open(psi) => From::Off(psi),
            Diodes::Blocked if opens => From::Fundamental,
            Diodes::Blocked => return self.blocked(),
        };
        let Some(found) = rectified(plant, temperatures, condition.speed, condition.u_dc, from) else {
            return self.blocked();
        };
        let Rectified { i, psi, tau_e, losses, start } = found;
        let losses = Losses { friction: self.friction * self.condition().speed, ..losses };
        self.point(Point { i, psi, tau_e, diodes: Some(start), ..Point::default() }, losses)
    }

    /// The point with the gates off and blocking diodes: iron and friction brake.
    fn blocked(&self) -> Point {
        let Self { motor, w, G, .. } = self;
        let i_m = self.drive.plant.iron.idle_current(motor, *w);
        let psi = machine::flux(motor, i_m);
        let e = psi.turned() * *w;
        let iron = 1.5 * G * e.dot(e);
        let losses = Losses { iron, friction: self.friction * self.condition().speed, ..Losses::default() };
        let tau_e = 1.5 * f64::from(motor.n_p) * psi.cross(i_m);
        self.without_link(Point { psi, u: e, tau_e, ..Point::default() }, losses)
    }

    /// The point of an active short circuit.
    pub fn shorted(&self) -> Point {
        self.shorted_through(&self.drive.plant.inverter.devices)
    }

    /// The point of a short circuit through these devices.
    fn shorted_through(&self, devices: &Devices) -> Point {
        let Self { motor, w, R, G, .. } = self;
        let (w, R, G) = (*w, *R, *G);
        if w == 0.0 {
            return self.blocked();
        }
        let magnetics = self.drive.plant.magnetics();
        let with = |D: f64| {
            let psi = flux::linkage(motor, magnetics, Dq::ZERO, (0.0, (G + 1.0 / (R + D)) * w));
            (psi, psi.turned() * (-w / (R + D)))
        };
        // The drop of a current of 1 A without its threshold, and the threshold.
        let per_ampere = |i: f64| conduction::mean(devices, 0.0, 1.0, i) / (1.5 * i * i);
        let r = 2.0 * per_ampere(2.0) - per_ampere(1.0);
        let u = per_ampere(1.0) - r;
        let mut D = r;
        if u > 0.0 {
            let over = |D: f64| with(D).1.magnitude() * (D - r) - u;
            let (mut low, mut step) = (r, 1e-3 * (R + w.abs() * motor.L_d));
            while over(low + step) < 0.0 {
                if step > WIDEST * R {
                    return self.blocked();
                }
                (low, step) = (low + step, 1.5 * step);
            }
            D = root([(low, over(low)), (low + step, over(low + step))], SMALL * u, over);
        }
        let (psi, i) = with(D);
        let Condition { speed, u_dc, temperatures } = *self.condition();
        if u_dc > 0.0 && w.abs() * motor.psi_M < BY_HARMONICS * u {
            let found = rectifier::shorted(&self.drive.plant, temperatures, speed, psi);
            if let Some(Rectified { i, psi, tau_e, losses, .. }) = found {
                let losses = Losses { friction: self.friction * speed, ..losses };
                return self.without_link(Point { i, psi, tau_e, ..Point::default() }, losses);
            }
        }
        let (e, square) = (psi.turned() * w, i.dot(i));
        let losses = Losses {
            cu: 1.5 * R * square,
            iron: 1.5 * G * e.dot(e),
            cond: 1.5 * D * square,
            sw: 0.0,
            friction: self.friction * self.condition().speed,
        };
        let tau_e = 1.5 * f64::from(motor.n_p) * psi.cross(i - e * G);
        self.without_link(Point { i, psi, tau_e, ..Point::default() }, losses)
    }

    /// `point` with these losses and exactly no power from the link.
    fn without_link(&self, point: Point, losses: Losses) -> Point {
        let point = self.point(point, losses);
        let powers = Powers { p_in: 0.0, i_dc: 0.0, ..point.powers };
        Point { powers, efficiency: efficiency(0.0, powers.p_mech), ..point }
    }
}
