//! The rules that derive parameter values from machine data and bandwidths.
//!
//! Without an estimator in the file, they choose Rasmussen's observer ([`rasmussen`]), which works at standstill, for a machine
//! without saliency (L_q within a tenth of L_d), and the extended EMF with an I-f start for a salient one. Values per
//! estimator: [`method`]. T_s and the bandwidths: [`bandwidth`](super::bandwidth); field weakening: [`voltage`].
//!
//! Throughout, K = 1.5 n_p psi_M is the torque constant (torque per ampere of i_q), and currents are peak values.
//!
//! The current loop must be stable with every current in use. Its gain, w_c L or with active resistance 2 w_c L - R,
//! acts on the incremental inductance, which saturation lowers. During a start, while the frame is not yet aligned with
//! the rotor, the gain of one axis acts on the inductance of the other. With one sample of delay, `i[k+2] = i[k+1] -
//! (gain T_s / L) i[k]` is undamped at gain T_s / L = 1. The rules allow half of that (gain margin 6 dB) and lower w_c
//! to meet it.

use super::bandwidth::Bandwidths;
use super::check::check;
use super::motor::{Data, Located, MotorFile, electrical, estimators, swing};
use super::setting::{LEVELS, Setting, Suited, Tuned, Unsuited, Value, given, real, set};
use super::voltage::{self, Voltage};
use super::{adaptation, flux_map, iron, loops, losses, method, native, plausible, rasmussen, saturation};
use crate::error::{Error, Result, bail};
use drive::PmsmPlant;
use drive::control::current::{COLD, CurrentGains, CurrentLoop};
use drive::control::tables::ControllerParameters;
use drive::estimator::{Class, Kind};
use fmu_core::Block;
use fmu_core::digits::rounded;
use std::f64::consts::TAU;

/// Derives the values.
///
/// # Errors
/// Inconsistent values, with their position and a remedy; or the machine does not suit the estimator.
pub fn tune(motor: &MotorFile) -> Result<Tuned> {
    Ok(tried(&motor.data, fixed(motor)?))
}

/// Derives the values of a drive that does not adapt the resistance.
///
/// # Errors
/// Those of [`tune`].
pub fn fixed(motor: &MotorFile) -> Result<Tuned> {
    of(motor, estimator(motor)?)?.map_err(|Unsuited { reason, .. }| Error::new(reason))
}

/// The values for `estimator` instead of the one in the file, or why it does not suit the machine.
///
/// # Errors
/// The file is wrong for every estimator.
pub fn suited(motor: &MotorFile, estimator: Kind) -> Result<Suited> {
    let mut motor = motor.clone();
    motor.choose(estimator.name())?;
    Ok(match of(&motor, estimator)? {
        Ok(fixed) => Suited::Tuned(Box::new(tried(&motor.data, fixed))),
        Err(refusal) => Suited::Refused(refusal),
    })
}

/// The drive with the values decided by trials, and the notes about its start.
fn tried(data: &Data, fixed: Tuned) -> Tuned {
    let mut tuned = adaptation::chosen(data, fixed);
    let waits = tuned.pair().controller.model.parameters.estimators.adaptation.resistance;
    if tuned.rest > REST && !waits {
        tuned.notes.push(format!(
            "keep speed_ref at 0 for the first {:.2} s: the rotor turns to the current that holds standstill",
            tuned.rest
        ));
    }
    tuned
}

/// The values for this estimator; the outer error concerns the file, the inner one the estimator.
fn of(motor: &MotorFile, estimator: Kind) -> Result<Result<Tuned, Unsuited>> {
    let data = &motor.data;
    let plant = plant(data);
    let bandwidths = Bandwidths::of(data, estimator);
    let controller = common(data, &bandwidths, estimator);
    // Check the given values before computing anything from them.
    check(&plant, &controller, motor)?;
    ratings(motor)?;
    plausible::check(motor)?;
    saturation::check(motor)?;
    let refused = |error: Error| Unsuited { estimator, reason: error.to_string() };
    Ok(suits(motor, estimator, &bandwidths, (plant, controller)).map_err(refused))
}

/// The values for this estimator, given the values of the plant and those shared by all estimators.
fn suits(
    motor: &MotorFile,
    estimator: Kind,
    bandwidths: &Bandwidths,
    (mut plant, mut controller): (Vec<Setting>, Vec<Setting>),
) -> Result<Tuned> {
    let (data, mut notes) = (&motor.data, Vec::new());
    fits(motor, estimator, bandwidths, &mut notes)?;
    let fitted = complete(&mut plant, motor, bandwidths.T_s.value)?;
    controller.extend(losses::compensation(motor, estimator));
    notes.extend(fitted.iter().flat_map(|fitted| fitted.notes.iter().cloned()));
    controller.extend(method::settings(motor, estimator, bandwidths, &mut notes)?);
    let class = estimator.class();
    if class != Class::FluxObserver {
        controller.push(real("zero_speed.i_0", 0.0, "not used"));
        controller.push(set("adaptation.resistance", Value::Boolean(false), "this estimator does not adapt it"));
    }
    let Voltage { settings, top_torque } =
        voltage::of(motor, estimator != Kind::Rasmussen, method::voltage_share(estimator), &mut notes)?;
    if class != Class::Injection && !settings.is_empty() {
        controller.extend(settings);
        method::weaken(motor, estimator, &mut controller, &mut notes)?;
    }
    keep_resistance(data, bandwidths, &mut controller);
    let least = |i| saturation::least_inductance(data, fitted.as_ref(), i);
    cap_current_loop(data, bandwidths, least, &mut controller, &mut notes);
    check(&plant, &controller, motor)?;
    // 5 / w_0: five periods of the swing, which the observer damps, over 2 pi.
    let rest = match class {
        Class::FluxObserver => (5.0 / swing(data, rasmussen::zero_speed_current(data))).max(REST),
        _ => 0.0,
    };
    let (speed, torque) = (*data.rating.speed.get_ref(), *data.rating.torque.get_ref());
    let (levels, top) = match method::highest(motor, estimator, bandwidths)? {
        Some(highest) => (vec![highest], highest * speed),
        None => (LEVELS.to_vec(), data.rating.top()),
    };
    let tuned = Tuned {
        name: data.name.clone(),
        estimator,
        source: data.source.clone(),
        plant,
        controller,
        notes,
        speed,
        torque,
        top,
        top_torque,
        levels,
        observer: bandwidths.observer.value,
        rest,
    };
    tuned
        .pair()
        .start()
        .map_err(|e| Error::new(format!("{}: these values do not fit together: {e}", motor.place_at(0))))?;
    Ok(tuned)
}

/// Adds the losses and the flux map to the settings of the `plant`.
fn complete(plant: &mut Vec<Setting>, motor: &MotorFile, T_s: f64) -> Result<Option<flux_map::Fitted>> {
    plant.extend(iron::fit(motor)?);
    plant.extend(losses::settings(motor, T_s)?);
    let fitted = flux_map::fit(motor)?;
    if let Some(fitted) = &fitted {
        plant.retain(|setting| setting.name != "motor.psi_M");
        plant.extend(fitted.settings.iter().cloned());
    }
    Ok(fitted)
}

/// The plant with the values of the file: those of [`tune`], for a controller of any kind.
///
/// # Errors
/// States the value of the file that is wrong, and its position.
pub fn plant_of(motor: &MotorFile) -> Result<Block<PmsmPlant>> {
    let (data, T_s) = (&motor.data, Bandwidths::of(&motor.data, estimator(motor)?).T_s.value);
    let mut settings = plant(data);
    check(&settings, &[], motor)?;
    ratings(motor)?;
    plausible::check(motor)?;
    saturation::check(motor)?;
    complete(&mut settings, motor, T_s)?;
    check(&settings, &[], motor)?;
    Ok(native::block(&settings))
}

/// Time in s at rest that every drive needs before the first speed reference.
const REST: f64 = 0.2;

fn estimator(motor: &MotorFile) -> Result<Kind> {
    let machine = &motor.data.machine;
    let salient = (machine.L_q.get_ref() / machine.L_d.get_ref() - 1.0).abs() > 0.1;
    let Some(given) = &motor.data.control.estimator else {
        return Ok(if salient { Kind::ExtendedEmf } else { Kind::Rasmussen });
    };
    let known = Kind::ALL.iter().copied().find(|kind| kind.name() == given.get_ref());
    known.ok_or_else(|| {
        let (place, name) = (motor.place(given), given.get_ref());
        Error::new(format!("{place}: unknown estimator {name}: choose one of {}, or omit it", estimators()))
    })
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
        |name, x: &Option<Located>| x.as_ref().map_or_else(|| real(name, 0.0, "none given"), |x| given(name, x));
    all.push(optional("mechanics.B", &mechanics.B));
    all.push(optional("mechanics.tau_coulomb", &mechanics.tau_coulomb));
    all.extend(mechanics.w_coulomb.as_ref().map(|x| given("mechanics.w_coulomb", x)));
    all.extend(mechanics.k_w.as_ref().map(|x| given("mechanics.k_w", x)));
    if let Some(s) = saturation {
        all.push(optional("saturation.s_2", &s.s_2));
        all.push(optional("saturation.s_3", &s.s_3));
        all.push(optional("saturation.s_dq", &s.s_dq));
    }
    all.push(given("u_dc", &data.dc_link.u_dc));
    all
}

/// Values for every estimator.
fn common(data: &Data, bandwidths: &Bandwidths, estimator: Kind) -> Vec<Setting> {
    let Data { machine, mechanics, .. } = data;
    let rule = if data.control.estimator.is_some() { "as given" } else { "by the saliency" };
    let mut all = vec![set("estimator", Value::Item(estimator.name().into()), rule), lock(data)];
    all.push(bandwidths.T_s.setting("T_s"));
    all.extend([
        set("motor.n_p", Value::Integer(*machine.n_p.get_ref()), "as given"),
        if estimator == Kind::Rasmussen {
            rasmussen::resistance(data)
        } else {
            real("motor.R_s", 0.9 * machine.R_s.get_ref(), "0.9 R_s: the safe side at standstill")
        },
        given("motor.L_d", &machine.L_d),
        given("motor.L_q", &machine.L_q),
        given("motor.psi_M", &machine.psi_M),
        given("mechanics.J", &mechanics.J),
        given("u_dc", &data.dc_link.u_dc),
        bandwidths.current.setting("current.bandwidth"),
        bandwidths.speed.setting("speed_loop.bandwidth"),
        real("speed_loop.t_is", 4.0, "K_i = K_p w_s / 4"),
        Setting {
            rule: "rating.current: the maximum current, peak value, not the rated one".into(),
            ..given("limit.i", &data.rating.current)
        },
    ]);
    all
}

/// The voltage error that `lock_lost` tolerates, scaled to the machine: a share of the EMF at rated speed, 5 V for the
/// reference motor, and at least twice the error of R^ = 0.9 R at the maximum current.
fn lock(data: &Data) -> Setting {
    const SHARE: f64 = 5.0 / 141.4;
    let Data { machine, rating, .. } = data;
    let emf = f64::from(*machine.n_p.get_ref()) * rating.speed.get_ref() * machine.psi_M.get_ref();
    let resistive = 0.2 * machine.R_s.get_ref() * rating.current.get_ref();
    let rule = "0.035 of the EMF at rated speed, at least 0.2 R_s times the maximum current";
    real("lock.u", rounded((SHARE * emf).max(resistive), 3), rule)
}

/// Checks that the ratings are positive.
fn ratings(motor: &MotorFile) -> Result<()> {
    let rating = &motor.data.rating;
    for (name, x) in [("speed", &rating.speed), ("torque", &rating.torque), ("current", &rating.current)] {
        if !(x.get_ref().is_finite() && *x.get_ref() > 0.0) {
            bail!("{}: rating.{name} = {} must be greater than 0: correct the value", motor.place(x), x.get_ref());
        }
    }
    Ok(())
}

/// Minimum number of samples per electrical period.
const LEAST_SAMPLES: f64 = 10.0;

/// Share of the maximum current above which a ripple is noted.
const RIPPLED: f64 = 0.5;

/// Notes a current ripple above [`RIPPLED`]: u_dc T / (6 L) from peak to peak at the full voltage, measured with the switched plant. The
/// average inverter does not show it. Without `inverter.f_sw`, the sample period `T_s` (s) is the switching period.
fn ripple(motor: &MotorFile, T_s: f64) -> Option<String> {
    let Data { machine, rating, dc_link, inverter, .. } = &motor.data;
    let f_sw = inverter.as_ref().and_then(|inverter| inverter.f_sw.as_ref()).map(|f| *f.get_ref());
    let T = f_sw.map_or(T_s, |f| 1.0 / f);
    let L = machine.L_d.get_ref().min(*machine.L_q.get_ref());
    let (ripple, most) = (dc_link.u_dc.get_ref() * T / (6.0 * L), rating.current.get_ref());
    (ripple > RIPPLED * most).then(|| {
        format!(
            "with a switching period of {T:e} s, currents ripple by up to u_dc T / (6 L) = {ripple:.3} A peak to peak, {:.1} times \
             rating.current; the average inverter does not show it: raise inverter.f_sw and lower control.T_s, or see it with \
             plant.inverter.mode = Switched",
            ripple / most
        )
    })
}

/// Checks bandwidths and sample period, for every estimator.
fn fits(motor: &MotorFile, estimator: Kind, bandwidths: &Bandwidths, notes: &mut Vec<String>) -> Result<()> {
    let Data { machine, rating, .. } = &motor.data;
    let (w_s, w_o) = (bandwidths.speed.value, bandwidths.observer.value);
    if estimator != Kind::Sensored && w_s > w_o / 3.0 * (1.0 + 1e-9) {
        let place = motor.place_at(bandwidths.speed.origin.or(bandwidths.observer.origin).unwrap_or_default());
        bail!(
            "{place}: bandwidth.speed = {w_s} rad/s is more than a third of bandwidth.observer = {w_o} rad/s: lower the former or raise the latter"
        );
    }
    let (n_p, T_s) = (f64::from(*machine.n_p.get_ref()), bandwidths.T_s.value);
    let samples = TAU / (n_p * rating.top() * T_s);
    if samples < LEAST_SAMPLES {
        let few = |key: &str| format!("2 pi / (w T_s) = {samples:.1} samples per electrical period at {key}");
        if let Some(top) = &rating.speed_max {
            let most = TAU / (LEAST_SAMPLES * n_p * T_s);
            let remedy = if bandwidths.T_s.origin.is_some() { "or control.T_s" } else { "or give control.T_s, in s" };
            bail!(
                "{}: T_s = {T_s:e} s gives {}, expected {LEAST_SAMPLES} or more: lower it to {most:.0} rad/s, {remedy}",
                motor.place(top),
                few("rating.speed_max")
            );
        }
        notes.push(format!("{}; {LEAST_SAMPLES} or more were tried: lower control.T_s", few("rating.speed")));
    }
    if (bandwidths.T_s.value / ControllerParameters::default().T_s - 1.0).abs() > 1e-9 {
        notes.push(format!(
            "T_s is {0:e} s: PmsmPlant and SensorlessController then exchange values in steps of {0:e} s (fmu simulate --step \
             {0:e}); PmsmDrive takes any step",
            bandwidths.T_s.value
        ));
    }
    notes.extend(ripple(motor, T_s));
    let hertz = bandwidths.current.value / TAU;
    let most = if estimator == Kind::VoltageFeedback { 4300.0 } else { 600.0 };
    if !(60.0..=most).contains(&hertz) {
        let why = if hertz < 60.0 && bandwidths.current.origin.is_none() {
            ": with the estimate 90 deg off, the gain for the larger inductance acts on the smaller one; a lower control.T_s raises it in \
             proportion"
        } else {
            ""
        };
        notes.push(format!("bandwidth.current is {hertz:.0} Hz; 60 to {most} Hz were tried{why}"));
    }
    Ok(())
}

/// Leaves out the active resistance where a cold winding would make the current loop oscillate.
fn keep_resistance(data: &Data, bandwidths: &Bandwidths, controller: &mut [Setting]) {
    let par = CurrentLoop { bandwidth: bandwidths.current.value, active_resistance: true, ..CurrentLoop::default() };
    if CurrentGains::tolerates(&par, &electrical(data)) < COLD {
        for setting in controller.iter_mut().filter(|setting| setting.name == "current.active_resistance") {
            setting.value = Value::Boolean(false);
            setting.rule = "R_s is above 6.7 w_c L: with it, the loop would oscillate on a cold winding".into();
        }
    }
}

/// Maximum product of the current loop's gain and T_s / L: half of the value at which the loop oscillates.
const MAX_GAIN: f64 = 0.5;

/// Lowers the bandwidth of the current loop to the limit set by the smallest inductance, and reports it.
fn cap_current_loop(
    data: &Data,
    bandwidths: &Bandwidths,
    least_inductance: impl Fn(f64) -> f64,
    controller: &mut [Setting],
    notes: &mut Vec<String>,
) {
    let value = |name: &str| controller.iter().find(|s| s.name == name).map(|s| &s.value);
    let number = |name: &str| if let Some(Value::Real(x)) = value(name) { *x } else { 0.0 };
    let Data { machine, rating, .. } = data;
    // During a start, the current may be on one axis and the same damping on the other; a higher one acts after the alignment alone.
    let aligned = || number("start.i").min(loops::most_on_axis(data));
    let i = if value("start.mode").is_some() { 2.0_f64.sqrt() * aligned() } else { *rating.current.get_ref() };
    let least = least_inductance(i);
    let greatest = machine.L_d.get_ref().max(*machine.L_q.get_ref());
    let gain = MAX_GAIN * least / number("T_s");
    let most = match value("current.active_resistance") {
        Some(Value::Boolean(true)) => (gain + number("motor.R_s")) / (2.0 * greatest),
        _ => gain / greatest,
    };
    let wanted = bandwidths.current.value;
    if most < wanted * (1.0 - 1e-9) {
        let (asked, given) = (wanted / TAU, most / TAU);
        notes.push(format!(
            "current.bandwidth is {given:.0} Hz, not the {asked:.0} Hz of bandwidth.current: at {i:.1} A the incremental \
             inductance falls to {:.1} mH, and the loop would oscillate during the start, while the frame is not yet aligned with the rotor",
            1e3 * least
        ));
        for setting in controller.iter_mut().filter(|s| s.name == "current.bandwidth") {
            setting.value = Value::Real(most);
            setting.rule = format!("lowered from {asked:.0} Hz: gain T_s / L <= {MAX_GAIN} with the least inductance");
        }
    }
}
