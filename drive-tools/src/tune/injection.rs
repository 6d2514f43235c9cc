//! The rules for the methods that inject a voltage and find the rotor by the saliency, and for the hybrid.
//!
//! The carrier's current on the d-axis is the same share of the maximum current as in the Kim & Sul review, for the saliency s = (L_q -
//! L_d) / (L_q + L_d) = 0.17 of its machine, less for more saliency, because the noise of the sensors is a share of the maximum current,
//! and the answer on the q-axis is s times the carrier:
//!
//! | method | period | voltage |
//! |---|---|---|
//! | RotatingInjection, PulsatingInjection | 10 samples | V / (w_h L) = 0.02 i_max 0.17 / s, at most a quarter of u_dc / sqrt(3) |
//! | SquareWaveInjection, Hybrid | 2 samples | V T_s / (2 L) = 0.014 i_max 0.17 / s, at most half of u_dc / sqrt(3) |
//! | NearPwmInjection | 3 samples | the same |
//!
//! L is the lower inductance; the factor 0.17 / s is 0.25 to 4. The voltage left by the carrier sets the highest speed at rated
//! torque, by maximum torque per ampere, at most 0.2 of the rated speed, the bound of the review.
//!
//! **Start.** With a known saturation (`saturation.s_2`), injection and voltage pulses find the rotor at rest: the pulses reach 0.22 of
//! the maximum current, and more, up to a half, where their peaks differ by less than 10 %. Otherwise the saliency shows the axis and not
//! the pole, and an I-f start takes the rotor along.

use super::bandwidth::{Bandwidths, EMF_PER_TRACKER};
use super::loops;
use super::motor::{MotorFile, electrical};
use super::setting::{Setting, Value, given, real, set};
use crate::error::{Result, bail};
use drive::control::envelope::Envelope;
use drive::control::reference::max_torque_per_ampere;
use drive::control::weakening::WeakeningParameters;
use drive::motor::Motor;
use std::f64::consts::TAU;

/// Saliency of the review's machine, and bounds of the carrier's current relative to its.
const REVIEW: f64 = 0.17;
const FACTOR: (f64, f64) = (0.25, 4.0);
/// Minimum saliency: the noise of the sensors, 1 / 1500 of the maximum current, is then a tenth of the answer of the largest carrier.
const LEAST_SALIENCY: f64 = 0.03;
/// Injected current as a share of the maximum current: sinusoidal and square wave.
const CURRENT: (f64, f64) = (0.02, 0.014);
/// Maximum carrier voltage as a share of u_dc / sqrt(3).
const VOLTAGE: (f64, f64) = (0.25, 0.5);
/// Samples per period of the sinusoidal carrier.
const SAMPLES: f64 = 10.0;
/// Highest speed of an injection method, and minimum, in pu.
const REACH: (f64, f64) = (0.2, 0.05);
/// Peak current of the pulses as a share of the maximum current, at most, and the minimum difference of the peaks.
const PULSE: (f64, f64) = (0.22, 0.5);
const DIFFERENCE: f64 = 0.1;

/// A carrier: its settings and its voltage in V.
pub type Injected = (Vec<Setting>, f64);

/// The machine at the carrier frequency.
pub struct View {
    machine: Motor,
    /// Maximum current in A.
    i: f64,
    /// u_dc / sqrt(3) in V.
    U: f64,
    T_s: f64,
    /// Share by which the carrier's current is larger than the review's.
    factor: f64,
}

impl View {
    fn of(motor: &MotorFile, bandwidths: &Bandwidths) -> Result<Self> {
        let data = &motor.data;
        let machine = electrical(data);
        let saliency = (machine.L_q - machine.L_d).abs() / (machine.L_q + machine.L_d);
        if saliency < LEAST_SALIENCY {
            bail!(
                "{}: |L_q - L_d| / (L_q + L_d) = {saliency:.3} with L_d = {} H and L_q = {} H: injection needs \
                {LEAST_SALIENCY} or more, because it locates the rotor by the saliency; choose a method that needs none, \
                such as Rasmussen or ExtendedEmf",
                motor.place(&data.machine.L_q),
                machine.L_d,
                machine.L_q
            );
        }
        Ok(Self {
            i: *data.rating.current.get_ref(),
            U: data.dc_link.u_dc.get_ref() / 3.0_f64.sqrt(),
            T_s: bandwidths.T_s.value,
            factor: (REVIEW / saliency).clamp(FACTOR.0, FACTOR.1),
            machine,
        })
    }

    fn L(&self) -> f64 {
        self.machine.L_d.min(self.machine.L_q)
    }
}

fn carrier(view: &View) -> Injected {
    let w_h = TAU / (SAMPLES * view.T_s);
    let V = (CURRENT.0 * view.factor * view.i * w_h * view.L()).min(VOLTAGE.0 * view.U);
    let voltage =
        real("carrier.voltage", V, "0.02 of the maximum current for a saliency of 0.17, at most u_dc / (4 sqrt(3))");
    (vec![voltage, real("carrier.frequency", w_h, "10 samples per period")], V)
}

fn square(name: &'static str, view: &View) -> Injected {
    let V = (2.0 * CURRENT.1 * view.factor * view.i * view.L() / view.T_s).min(VOLTAGE.1 * view.U);
    (vec![real(name, V, "0.014 of the maximum current for a saliency of 0.17, at most u_dc / (2 sqrt(3))")], V)
}

/// Rotating injection.
pub fn rotating(view: &View) -> Injected {
    carrier(view)
}

/// Pulsating injection.
pub fn pulsating(view: &View) -> Injected {
    carrier(view)
}

/// Square-wave injection.
pub fn square_wave(view: &View) -> Injected {
    square("square_wave.voltage", view)
}

/// Injection near the PWM frequency.
pub fn near_pwm(view: &View) -> Injected {
    square("near_pwm.voltage", view)
}

/// The highest speed in pu at which a carrier of `V` (V) leaves enough voltage for the rated torque, at most `most`.
fn reach(motor: &MotorFile, view: &View, V: f64, most: f64) -> f64 {
    let (rating, machine) = (&motor.data.rating, &view.machine);
    let U = WeakeningParameters::default().k_u * view.U - V;
    let i = max_torque_per_ampere(machine, *rating.torque.get_ref());
    let envelope = Envelope::new(machine, view.i);
    let w = f64::from(machine.n_p) * rating.speed.get_ref();
    let fits = |share: f64| U > 0.0 && envelope.excess(i, share * w, U) <= 0.0;
    let (mut low, mut high) = (0.0, most);
    if fits(most) {
        return most;
    }
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if fits(middle) { low = middle } else { high = middle }
    }
    low
}

/// Values of the controller for a carrier; `steady`: the estimator does not bear a quick change of the current at the hand-over.
///
/// # Errors
/// The machine has too little saliency, or the carrier leaves too little voltage.
pub fn settings(
    motor: &MotorFile,
    bandwidths: &Bandwidths,
    (carrier, steady): (impl Fn(&View) -> Injected, bool),
    notes: &mut Vec<String>,
) -> Result<Vec<Setting>> {
    let view = View::of(motor, bandwidths)?;
    let (own, V) = carrier(&view);
    let reach = reached(motor, &view, V)?;
    let speed = *motor.data.rating.speed.get_ref();
    notes.push(format!(
        "injection works up to {reach:.2} of the rated speed: the carrier of {V:.3} V takes voltage that the drive needs above; choose Hybrid"
    ));
    let mut all = loops::settings(&motor.data, true);
    all.push(loops::limit(&motor.data));
    all.push(real("tracker.bandwidth", bandwidths.observer.value, "bandwidth.observer"));
    all.push(observed());
    all.extend(own);
    all.extend(start(motor, &view, bandwidths, (0.5 * reach * speed, "half of the highest speed"), steady, notes));
    Ok(all)
}

/// The tracker with the torque: the angle shows up to 45 deg only, which a load step exceeds without it.
fn observed() -> Setting {
    set("tracker.kind", Value::Item("MechanicalObserver".into()), "uses the torque: the saliency shows at most 45 deg")
}

fn reached(motor: &MotorFile, view: &View, V: f64) -> Result<f64> {
    let reach = reach(motor, view, V, REACH.0);
    if reach < REACH.1 {
        bail!(
            "{}: a carrier of {V:.3} V leaves {:.3} V of 0.95 u_dc / sqrt(3) = {:.3} V, and the rated torque fits up to {reach:.3} of the rated \
             speed, expected {} or more: raise dc_link.u_dc, or choose a method that does not inject",
            motor.place(&motor.data.dc_link.u_dc),
            WeakeningParameters::default().k_u * view.U - V,
            WeakeningParameters::default().k_u * view.U,
            REACH.1
        );
    }
    Ok(reach)
}

/// The highest speed in pu of an injection method with this carrier.
///
/// # Errors
/// As [`settings`].
pub fn highest(motor: &MotorFile, bandwidths: &Bandwidths, carrier: impl Fn(&View) -> Injected) -> Result<f64> {
    let view = View::of(motor, bandwidths)?;
    reached(motor, &view, carrier(&view).1)
}

/// Values of the hybrid.
///
/// # Errors
/// As [`settings`].
pub fn hybrid(motor: &MotorFile, bandwidths: &Bandwidths, notes: &mut Vec<String>) -> Result<Vec<Setting>> {
    let (view, rho) = (View::of(motor, bandwidths)?, bandwidths.observer.value);
    let (own, V) = square_wave(&view);
    let reach = reached(motor, &view, V)?;
    let rated = *motor.data.rating.speed.get_ref();
    let w_high = f64::from(view.machine.n_p) * reach * rated;
    let mut all = loops::settings(&motor.data, true);
    all.push(loops::limit(&motor.data));
    all.extend(own);
    all.extend([
        real("tracker.bandwidth", rho, "bandwidth.observer"),
        observed(),
        real(
            "hybrid.bandwidth",
            bandwidths.by_emf(&motor.data),
            "bandwidth.observer, limited by the gain through the change of i_q",
        ),
        real("hybrid.w_high", w_high, "0.2 of the rated speed, less where the carrier leaves no voltage"),
        real("hybrid.w_low", 0.5 * w_high, "half of hybrid.w_high"),
        real("emf.bandwidth", EMF_PER_TRACKER * rho, "7.5 times the tracker's; at least 3 times is needed"),
        real("emf.w_sign", 0.1 * w_high, "0.1 of hybrid.w_high"),
    ]);
    // With dead time that is not compensated, the hand-over from a start above the d-axis loses the rotor.
    all.extend(start(motor, &view, bandwidths, (0.5 * reach * rated, "half of hybrid.w_high"), true, notes));
    Ok(all)
}

/// The start: by injection with pulses for the pole, or by I-f up to `speed`.
fn start(
    motor: &MotorFile,
    view: &View,
    bandwidths: &Bandwidths,
    speed: (f64, &str),
    steady: bool,
    notes: &mut Vec<String>,
) -> Vec<Setting> {
    let data = &motor.data;
    let L_d = view.machine.L_d;
    let s_2 = data.saturation.as_ref().and_then(|s| s.s_2.as_ref()).filter(|s_2| *s_2.get_ref() > 0.0);
    let pulse = s_2.and_then(|s_2| {
        let x = (PULSE.0 * view.i * L_d).max(0.5 * DIFFERENCE / (s_2.get_ref() * L_d));
        let peak = x / L_d + s_2.get_ref() * x * x;
        (peak <= PULSE.1 * view.i).then_some((s_2, x))
    });
    let Some((s_2, x)) = pulse else {
        // The peak 0.5 d (1 + 0.5 d) / (s_2 L_d^2) is the highest allowed one.
        let least = 0.5 * DIFFERENCE * (1.0 + 0.5 * DIFFERENCE) / (PULSE.1 * view.i * L_d * L_d);
        notes.push(format!(
            "saturation.s_2 is not known or too small to distinguish the poles by voltage pulses: the start is I-f, and the rotor turns to the \
             current before it; from s_2 = {least:.3} A/Wb2 on, injection finds the pole at rest, and the start has the full torque"
        ));
        return loops::start(data, speed, steady, notes);
    };
    let samples = (x / (VOLTAGE.1 * view.U * view.T_s)).ceil().max(2.0);
    #[expect(clippy::cast_possible_truncation, reason = "some samples")]
    let count = samples as i32;
    vec![
        set(
            "start.mode",
            Value::Item("Injection".into()),
            "the saliency shows the axis at standstill, saturation the pole",
        ),
        given("saturation.s_2", s_2),
        real("polarity.t_find", (25.0 / bandwidths.observer.value).max(0.1), "25 / bandwidth.observer, at least 0.1 s"),
        real(
            "polarity.voltage",
            x / (samples * view.T_s),
            "pulses of 0.22 of the maximum current, or more for a difference of 10 %",
        ),
        set("polarity.samples", Value::Integer(count), "with at most half of u_dc / sqrt(3)"),
    ]
}
