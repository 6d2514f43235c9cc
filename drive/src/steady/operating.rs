//! A point in steady state: the controller's currents, the machine's response, and the powers.

use super::drive::{Condition, SQRT_3, Steady, within};
use super::flux;
use super::sampling::HeldVoltage;
use drive_base::frame::Dq;
use drive_base::motor::Motor;
use drive_control::settled::SettledAt;
use drive_control::weakening::share;
use drive_plant::losses::flow::Dissipation;
use drive_plant::losses::{Losses, conduction, efficiency, switching};
use drive_plant::machine;
use drive_plant::power::Powers;
use serde::{Deserialize, Serialize};

/// Maximum number of iterations for the drop of the devices, and the relative change of their loss at which they end.
const MAX_ITERATIONS: u32 = 20;
const SMALL: f64 = 1e-9;

/// Region of a point, by the active limits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Region {
    /// The plain reference: maximum torque per ampere, i_d = 0 or the low-speed law.
    #[default]
    Mtpa,
    /// Field weakening, within the limits.
    Weakening,
    /// Maximum torque per voltage, below the current limit.
    Mtpv,
    /// The limit of current or torque, or without field weakening the voltage limit.
    Limit,
}

impl Region {
    /// Its name in tables: `mtpa`, `fw`, `mtpv` or `limit`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mtpa => "mtpa",
            Self::Weakening => "fw",
            Self::Mtpv => "mtpv",
            Self::Limit => "limit",
        }
    }
}

/// A point in steady state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Torque reference of the controller in N.m, after its limits.
    pub tau_ref: f64,
    /// Minimum and maximum torque reference in N.m under the condition: the outputs `tau_min` and `tau_max` of the drive.
    pub limits: [f64; 2],
    /// Current at the terminals in A, with [`Steady::sampled`] its mean.
    pub i: Dq,
    /// Flux linkage in Wb.
    pub psi: Dq,
    /// Voltage at the terminals of the machine in V.
    pub u: Dq,
    /// Voltage in V of the legs: with the drop of the devices.
    pub legs: Dq,
    /// Magnitude in V of the voltage requested by the current loop, including the drop of the devices.
    pub requested: f64,
    /// `requested` as a share of u_dc / sqrt 3; 0 without a link voltage.
    pub u_share: f64,
    /// Electromagnetic torque in N.m.
    pub tau_e: f64,
    /// Powers, losses, link current and torque at the shaft.
    pub powers: Powers,
    /// Efficiency, or 0 where it is not defined ([`efficiency`]).
    pub efficiency: f64,
    /// Its region.
    pub region: Region,
    /// Field weakening lowers i_d.
    pub weakens: bool,
    /// The gates are off and the diodes conduct: the flux linkage in Wb at the beginning of a sixth of a period.
    pub diodes: Option<Dq>,
}

/// A drive under a condition.
#[derive(Clone, Debug)]
pub struct At<'a> {
    pub(super) drive: &'a Steady,
    condition: Condition,
    /// The machine at its temperatures.
    pub(super) motor: Motor,
    /// Electrical speed in rad/s.
    pub(super) w: f64,
    /// Resistance in Ohm at this speed, and conductance of the iron in S.
    pub(super) R: f64,
    pub(super) G: f64,
    pub(super) held: HeldVoltage,
    /// Switching loss in W per ampere of the amplitude.
    sw: f64,
    pub(super) friction: f64,
    settled: SettledAt<'a>,
}

impl Steady {
    /// The drive under a condition.
    #[inline]
    pub fn at(&self, condition: &Condition) -> At<'_> {
        At::new(self, condition)
    }
}

impl<'a> At<'a> {
    fn new(drive: &'a Steady, condition: &Condition) -> Self {
        let Steady { plant, controller, settled, derating, sampled } = drive;
        let &Condition { speed, u_dc, temperatures } = condition;
        let motor = plant.thermal.motor(&plant.motor, &temperatures);
        let w = f64::from(motor.n_p) * speed;
        let Dissipation { R, G } = plant.dissipation(motor.R_s, w);
        let inverter = &plant.inverter;
        let sw = switching::per_ampere(&inverter.devices, inverter.T_pwm, u_dc) * switching::MEAN_OF_MAGNITUDES;
        Self {
            drive,
            condition: *condition,
            motor,
            w,
            R,
            G: G.unwrap_or(0.0),
            held: if *sampled { HeldVoltage::new(w * controller.T_s) } else { HeldVoltage::NOT },
            sw,
            friction: plant.mechanics.friction(speed),
            settled: settled.at(controller, (speed, u_dc), 0.0, derating.share(temperatures.winding)),
        }
    }

    /// Without the current of the low-speed law, if the shaft is to be free.
    #[must_use]
    pub(crate) fn freed(self, frees: bool) -> Self {
        Self { settled: self.settled.freed(frees), ..self }
    }

    /// The condition.
    pub fn condition(&self) -> &Condition {
        &self.condition
    }

    /// Minimum and maximum torque reference in N.m: the outputs `tau_min` and `tau_max` of the drive.
    #[inline]
    pub fn limits(&self) -> [f64; 2] {
        self.settled.limits()
    }

    /// Maximum fundamental voltage in V of `modulation.mode`.
    pub(super) fn highest(&self) -> f64 {
        self.full(self.drive.controller.modulation.mode.reach())
    }

    /// This share of u_dc / sqrt 3 in V.
    pub(super) fn full(&self, share: f64) -> f64 {
        self.condition.u_dc / SQRT_3 * share
    }

    /// This condition, with the trim `trim` (V) of field weakening.
    pub(super) fn trimmed(&self, trim: f64) -> Self {
        let (Steady { controller, settled, derating, .. }, Condition { speed, u_dc, temperatures }) =
            (self.drive, self.condition);
        let derating = derating.share(temperatures.winding);
        let settled = settled.at(controller, (speed, u_dc), trim, derating).freed(self.settled.frees());
        Self { settled, ..self.clone() }
    }

    /// The point of the torque reference `tau` (N.m), which the limits clip.
    #[inline]
    pub fn by_reference(&self, tau: f64) -> Point {
        let point = self.of_reference(tau);
        if point.requested > self.allowed() { self.within_voltage(tau, point) } else { point }
    }

    /// The points of minimum and maximum torque.
    pub fn ends(&self) -> [Point; 2] {
        self.limits().map(|tau| self.by_reference(tau))
    }

    /// The point of the torque reference `tau` (N.m), regardless of the voltage.
    #[inline]
    pub(super) fn of_reference(&self, tau: f64) -> Point {
        let limits = self.settled.limits();
        let [low, high] = limits;
        let tau_ref = within(tau, limits);
        let (i, weakens) = self.references(tau_ref);
        let near = 1e-9 * high.max(-low);
        let clipped = tau_ref >= high - near || tau_ref <= low + near;
        let below = i.dot(i) < (1.0 - 1e-9) * self.drive.controller.limit.i * self.drive.controller.limit.i;
        let region = match (clipped, weakens) {
            (true, true) if below => Region::Mtpv,
            (true, _) => Region::Limit,
            (false, true) => Region::Weakening,
            (false, false) => Region::Mtpa,
        };
        Point { tau_ref, limits, region, weakens, ..self.by_current(i) }
    }

    /// The current references (A) of the torque `tau` (N.m), which the limits clip, and whether field weakening lowers i_d.
    #[inline]
    pub(super) fn references(&self, tau: f64) -> (Dq, bool) {
        let (i, weakens) = self.settled.currents(within(tau, self.settled.limits()));
        (Dq::new(i.d(), i.q()), weakens)
    }

    /// The point of the current `i_s` (A) at the terminals, as sampled by the controller; its torque reference follows from the
    /// controller's estimates.
    #[inline]
    pub fn by_current(&self, i_s: Dq) -> Point {
        let Self {
            drive: Steady { plant, controller, .. },
            motor,
            w,
            R,
            G,
            held: HeldVoltage { share: held, late, ripple },
            ..
        } = self;
        let g = G * w;
        // j times the late part.
        let (mut psi, mut i) = (flux::linkage(motor, plant.magnetics(), i_s, (-g * late[1], g * late[0])), i_s);
        let at_sample = psi.turned() * *w;
        let (mut e, mut rippled) = (at_sample, 0.0);
        if *held < 1.0 {
            // The constant voltage, including R i, as a flux linkage.
            let chord = psi - i_s.turned() * (R / w);
            let [d, cross, q] = machine::slope(motor, plant.magnetics(), psi);
            let along = Dq::new(d * chord.d() + cross * chord.q(), cross * chord.d() + q * chord.q());
            rippled = ripple * along.dot(along);
            psi = psi - chord * (1.0 - held * held);
            e = psi.turned() * *w;
            i = machine::current(motor, plant.magnetics(), psi) + e * *G;
        }
        let u = i * *R + e;
        let square = i.dot(i);
        let amplitude = square.sqrt();
        let (cond, drop) = self.conduction(u, i, amplitude);
        let losses = Losses {
            cu: 1.5 * R * (square + rippled),
            // The magnitude of the voltage is constant.
            iron: 1.5 * G * held * held * at_sample.dot(at_sample),
            cond,
            sw: self.sw * amplitude,
            friction: self.friction * self.condition.speed,
        };
        // The current of the flux linkage is the terminal current minus the iron current.
        let tau_e = 1.5 * f64::from(motor.n_p) * psi.cross(i - e * *G);
        let legs = i * (R + drop) + e;
        let requested = legs.magnitude() / held;
        let u_share = share(requested, self.condition.u_dc);
        let tau_ref = controller.motor.torque(i_s.d(), i_s.q());
        self.point(
            Point { tau_ref, limits: self.limits(), i, psi, u, legs, requested, u_share, tau_e, ..Point::default() },
            losses,
        )
    }

    /// Conduction loss (W) with the voltage `u` (V) at the machine and the current `i` (A) of this amplitude, and the drop along
    /// the current per ampere (Ohm). The voltage of the legs includes the drop and determines how long transistor and diode
    /// conduct: a fixed point, where each iteration multiplies the error by about drop / u_dc.
    fn conduction(&self, u: Dq, i: Dq, amplitude: f64) -> (f64, f64) {
        let (devices, u_dc) = (&self.drive.plant.inverter.devices, self.condition.u_dc);
        let (mut loss, mut drop) = (0.0, 0.0);
        if devices.is_none() || amplitude == 0.0 {
            return (loss, drop);
        }
        for _ in 0..MAX_ITERATIONS {
            let leg = u + i * drop;
            let magnitude = leg.magnitude();
            let product = amplitude * magnitude;
            let cos_phi = if product > 0.0 { (leg.dot(i) / product).clamp(-1.0, 1.0) } else { 1.0 };
            let m = if u_dc > 0.0 { 2.0 * magnitude / u_dc } else { 0.0 };
            let last = loss;
            loss = conduction::mean(devices, m, cos_phi, amplitude);
            drop = loss / (1.5 * amplitude * amplitude);
            if (loss - last).abs() <= SMALL * loss {
                break;
            }
        }
        (loss, drop)
    }

    /// `point` with the powers of its torque and these losses.
    #[inline]
    pub(super) fn point(&self, point: Point, losses: Losses) -> Point {
        let Condition { speed, u_dc, .. } = self.condition;
        let tau_shaft = point.tau_e - self.friction;
        let (p_mech, p_loss) = (tau_shaft * speed, losses.sum());
        let p_in = p_mech + p_loss;
        let i_dc = if u_dc > 0.0 { p_in / u_dc } else { 0.0 };
        let powers = Powers { i_dc, p_in, p_mech, p_loss, losses, tau_shaft };
        Point { powers, efficiency: efficiency(p_in, p_mech), ..point }
    }
}
