//! The rules that derive parameter values from machine data and bandwidths.
//!
//! The rules choose Rasmussen's observer, which holds standstill, for a machine without saliency (L_q within a tenth of
//! L_d), and the extended EMF with an I-f start for a salient one. Rules for Rasmussen's observer: w_n = observer, zeta = 1;
//! c_1 = 4 |R - R^| i_0 / psi_M within 50..200 1/s, c_2 = c_1 / 50; K i_0 = 1.35 times the rated torque; w_0 = 30 rad/s
//! electrical within 5..40 rad/s mechanical; w_s <= w_n / 3; w_n >= sqrt(alpha / 0.35) with the greatest electrical
//! acceleration alpha = n_p K i_q / J. R^ = 0.9 R: the safe side at standstill, where R^ > R runs away; closer to R where the
//! rotor is too heavy to follow the estimate ([`limits`]). T_s and the bandwidths: [`bandwidth`](super::bandwidth).
//!
//! The I-f start: the rotor swings on the current vector with w_0 = sqrt(n_p K I / J), damped by 0.5, and the reluctance takes
//! the share (L_q - L_d) I / psi_M of stiffness and damping away. The alignments take 3 of its time constants each, the speed
//! before the hand-over 4.
//!
//! Field weakening is used where rated torque at rated speed takes more than its share of the voltage (k_u u_dc / sqrt 3).
//!
//! The current loop must be stable with every current in use. Its gain, w_c L or with active resistance 2 w_c L - R,
//! acts on the incremental inductance, which saturation lowers. During a start, while the frame is not yet aligned with
//! the rotor, the gain of one axis acts on the inductance of the other. With one sample of delay, `i[k+2] = i[k+1] -
//! (gain T_s / L) i[k]` is undamped at gain T_s / L = 1. The rules allow half of that (gain margin 6 dB) and lower w_c
//! to meet it.

use super::bandwidth::{Bandwidths, least_observer};
use super::check::check;
use super::iron;
use super::limits::{self, Limit, resistance_margin, swing, zero_speed_current};
use super::motor::{Data, MotorFile, Number};
use super::{plausible, saturation};
use anyhow::{Result, bail};
use drive::control::envelope::{Envelope, Warm};
use drive::control::reference::max_torque_per_ampere;
use drive::control::tables::ControllerParameters;
use drive::control::weakening::WeakeningParameters;
use drive::frame::DqHat;
use drive::motor::Motor;
use std::f64::consts::TAU;

/// A value for a variable.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Of a real variable.
    Real(f64),
    /// Of an integer.
    Integer(i32),
    /// Of a Boolean.
    Boolean(bool),
    /// Of an enumeration: the name of an item.
    Item(String),
}

/// A variable with its value and the origin of the value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Variable of the model.
    pub name: &'static str,
    /// The value, in the unit of the variable.
    pub value: Value,
    /// The rule.
    pub rule: String,
    /// Offset of the source value in the machine's file.
    pub origin: Option<usize>,
}

/// Values of both FMUs.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// Name of the machine.
    pub name: String,
    /// Source of its data.
    pub source: String,
    /// Values of `PmsmPlant`.
    pub plant: Vec<Setting>,
    /// Values of `SensorlessController`.
    pub controller: Vec<Setting>,
    /// Warnings: values outside the ranges that the rules were tested in.
    pub notes: Vec<String>,
    /// What the drive will not hold, with the remedy.
    pub limits: Vec<Limit>,
    /// Rated mechanical speed in rad/s.
    pub speed: f64,
    /// Rated torque in N.m.
    pub torque: f64,
    /// Time in s at rest before the first speed reference, in which the rotor aligns itself.
    pub rest: f64,
}

fn given(name: &'static str, x: &Number) -> Setting {
    Setting { name, value: Value::Real(*x.get_ref()), rule: "as given".into(), origin: Some(x.span().start) }
}

fn set(name: &'static str, value: Value, rule: &str) -> Setting {
    Setting { name, value, rule: rule.into(), origin: None }
}

fn real(name: &'static str, x: f64, rule: &str) -> Setting {
    set(name, Value::Real(x), rule)
}

/// Derives the values.
///
/// # Errors
/// Inconsistent values, with their position and a remedy.
pub fn tune(motor: &MotorFile) -> Result<Tuned> {
    let data = &motor.data;
    let mut plant = plant(data);
    let estimator = estimator(motor)?;
    let mut notes = Vec::new();
    let bandwidths = Bandwidths::of(data, estimator == "Rasmussen");
    let mut controller = common(data, &bandwidths, &estimator);
    // Check the given values before computing anything from them.
    check(&plant, &controller, motor)?;
    ratings(motor)?;
    plausible::check(motor)?;
    saturation::check(motor)?;
    fits(motor, &bandwidths, &mut notes)?;
    plant.extend(iron::fit(motor)?);
    let observes_flux = estimator == "Rasmussen";
    if observes_flux {
        controller.extend(flux_observer(motor, &bandwidths, &mut notes)?);
    } else {
        controller.extend(extended_emf(data, &bandwidths, &mut notes));
    }
    controller.extend(weakening(motor, !observes_flux, &mut notes)?);
    cap_current_loop(data, &bandwidths, &mut controller, &mut notes);
    check(&plant, &controller, motor)?;
    let (limits, narrow) = limits::of(data, &bandwidths, observes_flux);
    notes.extend(narrow);
    // Five periods of the swing that the observer damps, over 2 pi.
    let rest = if observes_flux { (5.0 / swing(data, zero_speed_current(data))).max(REST) } else { 0.0 };
    if rest > REST {
        notes.push(format!(
            "keep speed_ref at 0 for the first {rest:.2} s: the rotor turns to the current that holds standstill"
        ));
    }
    let (speed, torque) = (*data.rating.speed.get_ref(), *data.rating.torque.get_ref());
    Ok(Tuned {
        name: data.name.clone(),
        source: data.source.clone(),
        plant,
        controller,
        notes,
        limits,
        speed,
        torque,
        rest,
    })
}

/// Time in s at rest that every drive needs before the first speed reference.
const REST: f64 = 0.2;

fn estimator(motor: &MotorFile) -> Result<String> {
    let machine = &motor.data.machine;
    let salient = (machine.L_q.get_ref() / machine.L_d.get_ref() - 1.0).abs() > 0.1;
    match &motor.data.control.estimator {
        None => Ok(if salient { "ExtendedEmf" } else { "Rasmussen" }.into()),
        Some(name) if ["ExtendedEmf", "Rasmussen"].contains(&name.get_ref().as_str()) => Ok(name.get_ref().clone()),
        Some(name) => {
            let what = name.get_ref();
            bail!(
                "{}: there are no rules for {what}: choose Rasmussen or ExtendedEmf, or leave it out",
                motor.place(name)
            )
        }
    }
}

fn plant(data: &Data) -> Vec<Setting> {
    let Data { machine, mechanics, saturation, .. } = data;
    let n_p = &machine.n_p;
    let mut all = vec![
        Setting { origin: Some(n_p.span().start), ..set("motor.n_p", Value::Integer(*n_p.get_ref()), "as given") },
        given("motor.R_s", &machine.R_s),
        given("motor.L_d", &machine.L_d),
        given("motor.L_q", &machine.L_q),
        given("motor.psi_M", &machine.psi_M),
        given("mechanics.J", &mechanics.J),
    ];
    let optional =
        |name, x: &Option<Number>| x.as_ref().map_or_else(|| real(name, 0.0, "none given"), |x| given(name, x));
    all.push(optional("mechanics.B", &mechanics.B));
    all.push(optional("mechanics.tau_coulomb", &mechanics.tau_coulomb));
    all.extend(mechanics.w_coulomb.as_ref().map(|x| given("mechanics.w_coulomb", x)));
    if let Some(s) = saturation {
        all.push(optional("saturation.s_2", &s.s_2));
        all.push(optional("saturation.s_3", &s.s_3));
        all.push(optional("saturation.s_dq", &s.s_dq));
    }
    all.push(given("u_dc", &data.dc_link.u_dc));
    all
}

/// Values that every estimator needs.
fn common(data: &Data, bandwidths: &Bandwidths, estimator: &str) -> Vec<Setting> {
    let Data { machine, mechanics, .. } = data;
    let mut all = vec![set("estimator", Value::Item(estimator.into()), "by the saliency, or as given"), lock(data)];
    all.push(bandwidths.T_s.setting("T_s"));
    all.extend([
        set("motor.n_p", Value::Integer(*machine.n_p.get_ref()), "as given"),
        resistance(data, estimator),
        given("motor.L_d", &machine.L_d),
        given("motor.L_q", &machine.L_q),
        given("motor.psi_M", &machine.psi_M),
        given("mechanics.J", &mechanics.J),
        given("u_dc", &data.dc_link.u_dc),
        bandwidths.current.setting("current.bandwidth"),
        bandwidths.speed.setting("speed_loop.bandwidth"),
        real("speed_loop.t_is", 4.0, "K_i = K_p w_s / 4"),
        given("limit.i", &data.rating.current),
    ]);
    all
}

fn resistance(data: &Data, estimator: &str) -> Setting {
    let R_s = data.machine.R_s.get_ref();
    let margin = if estimator == "Rasmussen" { resistance_margin(data) } else { 0.1 };
    if margin < 0.1 {
        let rule = format!("{:.3} R_s: below R_s, and the rotor follows the estimate at rest", 1.0 - margin);
        return real("motor.R_s", (1.0 - margin) * R_s, &rule);
    }
    real("motor.R_s", 0.9 * R_s, "0.9 R_s: the safe side at standstill")
}

/// The voltage error that `lock_lost` tolerates, scaled to the machine: a share of the EMF at rated speed, 5 V for the
/// reference motor, and at least twice what R^ = 0.9 R leaves at the greatest current.
fn lock(data: &Data) -> Setting {
    const SHARE: f64 = 5.0 / 141.4;
    let Data { machine, rating, .. } = data;
    let emf = f64::from(*machine.n_p.get_ref()) * rating.speed.get_ref() * machine.psi_M.get_ref();
    let resistive = 0.2 * machine.R_s.get_ref() * rating.current.get_ref();
    let rule = "0.035 of the EMF at rated speed, at least 0.2 R_s times the greatest current";
    real("lock.u", short((SHARE * emf).max(resistive)), rule)
}

/// A number with three digits.
fn short(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

/// Torque constant in N.m/A.
pub(super) fn torque_constant(data: &Data) -> f64 {
    1.5 * f64::from(*data.machine.n_p.get_ref()) * data.machine.psi_M.get_ref()
}

/// The ratings are positive.
fn ratings(motor: &MotorFile) -> Result<()> {
    let rating = &motor.data.rating;
    for (name, x) in [("speed", &rating.speed), ("torque", &rating.torque), ("current", &rating.current)] {
        if !(x.get_ref().is_finite() && *x.get_ref() > 0.0) {
            bail!("{}: rating.{name} = {} must be greater than 0: correct the value", motor.place(x), x.get_ref());
        }
    }
    Ok(())
}

/// Rules for every estimator.
fn fits(motor: &MotorFile, bandwidths: &Bandwidths, notes: &mut Vec<String>) -> Result<()> {
    let Data { machine, rating, .. } = &motor.data;
    let (w_s, w_o) = (bandwidths.speed.value, bandwidths.observer.value);
    if w_s > w_o / 3.0 * (1.0 + 1e-9) {
        let place = motor.place_at(bandwidths.speed.origin.or(bandwidths.observer.origin).unwrap_or_default());
        bail!(
            "{place}: bandwidth.speed = {w_s} rad/s is more than a third of bandwidth.observer = {w_o} rad/s: lower the former or raise the latter"
        );
    }
    let samples = TAU / (f64::from(*machine.n_p.get_ref()) * rating.speed.get_ref() * bandwidths.T_s.value);
    if samples < 10.0 {
        notes.push(format!(
            "2 pi / (w T_s) = {samples:.1} samples per electrical period at rating.speed; 10 or more were tried: lower \
             control.T_s"
        ));
    }
    if (bandwidths.T_s.value / ControllerParameters::default().T_s - 1.0).abs() > 1e-9 {
        notes.push(format!(
            "T_s is {0:e} s: PmsmPlant and SensorlessController then exchange values in steps of {0:e} s (fmu simulate --step \
             {0:e}); PmsmDrive takes any step",
            bandwidths.T_s.value
        ));
    }
    let hertz = bandwidths.current.value / TAU;
    if !(60.0..=600.0).contains(&hertz) {
        notes.push(format!("bandwidth.current is {hertz:.0} Hz; 60 to 600 Hz were tried"));
    }
    Ok(())
}

/// Field weakening where rated torque at rated speed needs it.
fn weakening(motor: &MotorFile, salient: bool, notes: &mut Vec<String>) -> Result<Vec<Setting>> {
    let Data { rating, dc_link, .. } = &motor.data;
    let machine = electrical(&motor.data);
    let (speed, torque, u_dc) = (*rating.speed.get_ref(), *rating.torque.get_ref(), *dc_link.u_dc.get_ref());
    let (w, highest) = (f64::from(machine.n_p) * speed, u_dc / 3.0_f64.sqrt());
    let envelope = Envelope::new(&machine, *rating.current.get_ref());
    let i = if salient {
        max_torque_per_ampere(&machine, torque)
    } else {
        DqHat::new(0.0, torque / machine.torque_constant())
    };
    let U = WeakeningParameters::default().k_u * highest;
    if i.magnitude() > *rating.current.get_ref() {
        bail!(
            "{}: rating.current = {} A is less than the {:.2} A that rating.torque takes: raise it, or lower the torque",
            motor.place(&rating.current),
            rating.current.get_ref(),
            i.magnitude()
        );
    }
    if envelope.excess(i, w, U) <= 0.0 {
        return Ok(Vec::new());
    }
    let mut warm = Warm::default();
    let most = (0..8).map(|_| envelope.limit(w, 1.0, U, &mut warm).tau).last().unwrap_or_default();
    if most < torque {
        bail!(
            "{}: at rating.speed, even field weakening gives at most {most:.2} N.m of the {torque} N.m of rating.torque: lower \
             the speed or the torque, or raise rating.current or dc_link.u_dc = {u_dc} V",
            motor.place(&rating.speed)
        );
    }
    let diodes = highest / (f64::from(machine.n_p) * machine.psi_M);
    if speed > diodes {
        notes.push(format!(
            "above {diodes:.0} rad/s, the magnet's EMF exceeds dc_link.u_dc = {u_dc} V: gates that switch off there feed the DC \
             link through the diodes; rating.speed is {speed:.0} rad/s"
        ));
    }
    Ok(vec![set(
        "weakening.use",
        Value::Boolean(true),
        "rated torque at rated speed needs more than 0.95 u_dc / sqrt(3)",
    )])
}

/// The machine's electrical data.
pub(super) fn electrical(data: &Data) -> Motor {
    let m = &data.machine;
    Motor {
        n_p: *m.n_p.get_ref(),
        R_s: *m.R_s.get_ref(),
        L_d: *m.L_d.get_ref(),
        L_q: *m.L_q.get_ref(),
        psi_M: *m.psi_M.get_ref(),
    }
}

/// Maximum product of the current loop's gain and T_s / L: half of the value at which the loop oscillates.
const MAX_GAIN: f64 = 0.5;

/// Lowers the bandwidth of the current loop to what the smallest inductance allows, and reports it.
fn cap_current_loop(data: &Data, bandwidths: &Bandwidths, controller: &mut [Setting], notes: &mut Vec<String>) {
    let value = |name: &str| controller.iter().find(|s| s.name == name).map(|s| &s.value);
    let number = |name: &str| if let Some(Value::Real(x)) = value(name) { *x } else { 0.0 };
    let Data { machine, rating, .. } = data;
    // During a start, the current may be on one axis and the same damping on the other.
    let i = if value("start.mode").is_some() { 2.0_f64.sqrt() * number("start.i") } else { *rating.current.get_ref() };
    let least = saturation::least_inductance(data, i);
    let greatest = machine.L_d.get_ref().max(*machine.L_q.get_ref());
    let gain = MAX_GAIN * least / number("T_s");
    let most = match value("current.active_resistance") {
        Some(Value::Boolean(true)) => (gain + number("motor.R_s")) / (2.0 * greatest),
        _ => gain / greatest,
    };
    let wanted = bandwidths.current.value;
    if most < wanted {
        let (asked, given) = (wanted / TAU, most / TAU);
        notes.push(format!(
            "current.bandwidth is {given:.0} Hz, not the {asked:.0} Hz of bandwidth.current: at {i:.1} A the incremental \
             inductance falls to {:.1} mH, and the loop would oscillate in the start, where the frame is not at the rotor yet",
            1e3 * least
        ));
        for setting in controller.iter_mut().filter(|s| s.name == "current.bandwidth") {
            setting.value = Value::Real(most);
            setting.rule = format!("lowered from {asked:.0} Hz: gain T_s / L <= {MAX_GAIN} with the least inductance");
        }
    }
}

fn flux_observer(motor: &MotorFile, bandwidths: &Bandwidths, notes: &mut Vec<String>) -> Result<Vec<Setting>> {
    let data = &motor.data;
    let Data { machine, rating, .. } = data;
    let n_p = f64::from(*machine.n_p.get_ref());
    let (limit, w_n) = (*rating.current.get_ref(), bandwidths.observer.value);
    let i_0 = zero_speed_current(data);
    if i_0 > limit {
        let place = motor.place(&rating.current);
        bail!(
            "{place}: rating.current = {limit} A is less than the {i_0:.2} A that hold rating.torque at standstill (1.35 torque / K): raise it, or lower the torque"
        );
    }
    let i_q = 0.8 * limit;
    let least = least_observer(data);
    if w_n < least {
        let place = motor.place_at(bandwidths.observer.origin.unwrap_or_default());
        bail!(
            "{place}: bandwidth.observer = {w_n} rad/s cannot follow the greatest acceleration: at least {least:.0} rad/s, or a lower rating.current"
        );
    }
    if !(150.0..=800.0).contains(&w_n) {
        notes.push(format!("bandwidth.observer is {w_n:.0} rad/s; 150 to 800 were tried"));
    }
    let w_s = bandwidths.speed.value;
    if !(40.0..=200.0).contains(&w_s) {
        notes.push(format!("bandwidth.speed is {w_s:.0} rad/s; 40 to 200 were tried"));
    }
    let c_1 = (4.0 * 0.1 * machine.R_s.get_ref() * i_0 / machine.psi_M.get_ref()).max(50.0);
    if c_1 > 200.0 {
        notes.push(format!("c_1 psi_M >= 4 |R - R^| i_0 asks for c_1 = {c_1:.0} 1/s; up to 200 were tried"));
    }
    let c_1 = c_1.min(200.0);
    Ok(vec![
        real("speed_loop.b", 0.5, "set-point weight of Rasmussen's drive"),
        real("limit.i_q", i_q, "0.8 of the greatest current"),
        real("rasmussen.w_n", w_n, "bandwidth.observer"),
        real("rasmussen.zeta", 1.0, "aperiodic"),
        real("rasmussen.c_1", c_1, "4 |R - R^| i_0 / psi_M, at least 50, at most 200"),
        real("rasmussen.c_2", c_1 / 50.0, "c_1 / 50"),
        real("zero_speed.i_0", i_0, "1.35 times the rated torque / K"),
        real("zero_speed.w_0", (30.0 / n_p).clamp(5.0, 40.0), "30 rad/s electrical, 5 to 40 mechanical"),
    ])
}

fn extended_emf(data: &Data, bandwidths: &Bandwidths, notes: &mut Vec<String>) -> Vec<Setting> {
    let Data { rating, mechanics, .. } = data;
    let (limit, torque, rho) = (*rating.current.get_ref(), *rating.torque.get_ref(), bandwidths.observer.value);
    if rho < TAU * 15.0 * (1.0 - 1e-9) {
        notes.push(format!(
            "bandwidth.observer is {rho} rad/s; below 94 rad/s a load step of half the torque loses the rotor"
        ));
    }
    // A d-axis current holds the rotor only while magnet torque exceeds reluctance torque: |L_q - L_d| i
    // < psi_M.
    let k = torque_constant(data);
    let saliency = (data.machine.L_q.get_ref() - data.machine.L_d.get_ref()).abs();
    let (wanted, stable) = ((1.4 * torque / k).min(limit), 0.5 * data.machine.psi_M.get_ref() / saliency);
    let lead = wanted.min(stable);
    if stable < wanted {
        notes.push(format!(
            "the saliency leaves {stable:.2} A for the I-f start: it carries up to {:.2} N.m",
            k * stable
        ));
    }
    // Of the swing on the current vector, in 1/s.
    let n_p = f64::from(*data.machine.n_p.get_ref());
    let decay = 0.5 * swing(data, lead) * (1.0 - saliency * lead / data.machine.psi_M.get_ref());
    vec![
        set("current.active_resistance", Value::Boolean(true), "K_i = w_c^2 L"),
        set("current.mtpa", Value::Boolean(true), "salient: least current for a torque"),
        real("speed_loop.b", 1.0, "proportional part on the whole error"),
        real("limit.i_q", limit, "the greatest current"),
        real("limit.tau", 1.6 * torque, "1.6 times the rated torque"),
        real("tracker.bandwidth", rho, "bandwidth.observer"),
        real("emf.bandwidth", 7.5 * rho, "7.5 times the tracker's; 3 times is the least"),
        real("emf.w_sign", 0.01 * n_p * rating.speed.get_ref(), "0.01 of the rated electrical speed"),
        real("zero_speed.i_0", 0.0, "not used"),
        set("start.mode", Value::Item("CurrentFrequency".into()), "no EMF at standstill"),
        real(
            "start.i",
            lead,
            "1.4 times the rated torque / K, at most the greatest current and psi_M / (2 |L_q - L_d|)",
        ),
        real("start.speed", 0.15 * rating.speed.get_ref(), "0.15 of the rated speed"),
        real(
            "start.acceleration",
            (0.3 * k * lead / mechanics.J.get_ref()).min(100.0),
            "0.3 of the start's torque, at most 100 rad/s2",
        ),
        real(
            "start.t_align",
            (3.0 / decay).max(0.25),
            "the rotor settles on the current vector: 3 time constants, at least 0.25 s",
        ),
        real(
            "start.settle",
            (4.0 / decay).max(0.2),
            "its swing has died at the hand-over: 4 time constants, at least 0.2 s",
        ),
    ]
}
