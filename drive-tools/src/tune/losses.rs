//! Losses of the inverter and temperature coefficients: values from the file, only for the plant, and the dead time, which the
//! controller compensates.

use super::motor::{Inverter, Located, MotorFile, electrical};
use super::setting::{LEVELS, Setting, Value, given, real};
use crate::error::{Result, bail};
use drive::estimator::Kind;

/// Current below which the dead-time voltage falls to zero where the file gives none, over the maximum current: about the middle of
/// the 0.5 % to 4 % from which the machines of `tests/population` are drawn; there is no external source.
const ZERO: f64 = 0.02;

/// Share of the EMF at the lowest speed of the trials above which every method compensates the thresholds.
const THRESHOLD: f64 = 0.1;

/// The settings of `[inverter]` and `[temperature]`, if the file has any. `T_s` is the sample period in s.
///
/// # Errors
/// A switching energy without its current or voltage, or a frequency that is not positive.
#[expect(non_snake_case, reason = "the symbols of the model")]
pub fn settings(motor: &MotorFile, T_s: f64) -> Result<Vec<Setting>> {
    let mut all = Vec::new();
    let mut add = |name, x: &Option<Located>| all.extend(x.as_ref().map(|x| given(name, x)));
    if let Some(temperature) = &motor.data.temperature {
        add("winding.alpha", &temperature.winding);
        add("magnet.alpha", &temperature.magnet);
    }
    let Some(inverter) = &motor.data.inverter else { return Ok(all) };
    let Inverter { u_transistor, r_transistor, u_diode, r_diode, E_sw, i_sw, u_sw, k_sw, f_sw, u_dead, .. } = inverter;
    for (name, x) in [
        ("inverter.u_transistor", u_transistor),
        ("inverter.r_transistor", r_transistor),
        ("inverter.u_diode", u_diode),
        ("inverter.r_diode", r_diode),
        ("inverter.E_sw", E_sw),
        ("inverter.i_sw", i_sw),
        ("inverter.u_sw", u_sw),
        ("inverter.k_sw", k_sw),
    ] {
        add(name, x);
    }
    all.extend(zero("inverter.i_zero", motor));
    for (key, x) in [("i_sw", i_sw), ("u_sw", u_sw)] {
        if let (Some(energy), None) = (E_sw, x) {
            bail!(
                "{}: inverter.E_sw needs inverter.{key}: give the value at which it was measured",
                motor.place(energy)
            );
        }
    }
    let period = match f_sw {
        None => real("inverter.T_pwm", T_s, "one PWM period per sample"),
        Some(f) if *f.get_ref() > 0.0 && f.get_ref().is_finite() => {
            Setting { origin: Some(f.span().start), ..real("inverter.T_pwm", 1.0 / f.get_ref(), "1 / f_sw") }
        }
        Some(f) => {
            bail!("{}: inverter.f_sw = {} Hz must be greater than 0: correct the value", motor.place(f), f.get_ref())
        }
    };
    if let (Some(u_dead), Value::Real(T_pwm)) = (u_dead, &period.value) {
        let time = u_dead.get_ref() * T_pwm / motor.data.dc_link.u_dc.get_ref();
        all.push(Setting {
            origin: Some(u_dead.span().start),
            ..real("inverter.dead_time", time, "u_dead T_pwm / u_dc")
        });
    }
    all.push(period);
    Ok(all)
}

/// The settings of the controller's dead-time compensation; none where the file has no voltage that a leg loses. Near standstill, a leg
/// conducts for half of the time through a transistor and for half through a diode, and loses the mean of their thresholds in
/// addition: Rasmussen's observer would take it for R i, swing with it at higher speeds, and adapt R^ to it. The other methods take it
/// for EMF, which matters where it is more than a tenth of the EMF at the lowest speed of the trials.
pub fn compensation(motor: &MotorFile, estimator: Kind) -> Vec<Setting> {
    let Some(Inverter { u_dead, u_transistor, u_diode, .. }) = &motor.data.inverter else { return Vec::new() };
    let part = |x: &Option<Located>| x.as_ref().map_or(0.0, |x| *x.get_ref());
    let mean = 0.5 * (part(u_transistor) + part(u_diode));
    let threshold = if estimator == Kind::Rasmussen || mean > THRESHOLD * slow_emf(motor) { mean } else { 0.0 };
    let lost = match u_dead {
        Some(u_dead) if threshold == 0.0 => given("compensation.u_dead", u_dead),
        None if threshold == 0.0 => return Vec::new(),
        _ => real("compensation.u_dead", part(u_dead) + threshold, "u_dead, and the mean of u_transistor and u_diode"),
    };
    std::iter::once(lost).chain(zero("compensation.i_zero", motor)).collect()
}

/// EMF in V at the lowest speed of the trials.
fn slow_emf(motor: &MotorFile) -> f64 {
    let machine = electrical(&motor.data);
    LEVELS[0] * f64::from(machine.n_p) * motor.data.rating.speed.get_ref() * machine.psi_M
}

/// The setting `name` of the current below which the dead-time voltage falls to zero: as given, or by rule where the file has a
/// dead-time voltage alone.
fn zero(name: &'static str, motor: &MotorFile) -> Option<Setting> {
    let Inverter { u_dead, i_zero, .. } = motor.data.inverter.as_ref()?;
    let by_rule = || real(name, ZERO * motor.data.rating.current.get_ref(), "0.02 rating.current");
    i_zero.as_ref().map(|x| given(name, x)).or_else(|| u_dead.as_ref().map(|_| by_rule()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn of(text: &str) -> Result<Vec<(&'static str, super::super::setting::Value)>> {
        let motor = include_str!("../../../motors/ipmsm-2.2kw.toml");
        let motor = MotorFile::parse(&format!("{motor}\n{text}\n"), Path::new("m.toml"))?;
        Ok(settings(&motor, 5e-5)?.into_iter().map(|s| (s.name, s.value)).collect())
    }

    /// The mean of the thresholds joins the dead time, for Rasmussen's observer alone where the EMF at 0.1 pu, here 25.7 V, is large
    /// beside it.
    #[test]
    fn the_thresholds_are_compensated() {
        let of = |text: &str, kind| {
            let motor = include_str!("../../../motors/ipmsm-2.2kw.toml");
            let motor = MotorFile::parse(&format!("{motor}\n[inverter]\n{text}\n"), Path::new("m.toml")).unwrap();
            compensation(&motor, kind).into_iter().map(|s| (s.name, s.value)).collect::<Vec<_>>()
        };
        let u_dead = |x| ("compensation.u_dead", super::super::setting::Value::Real(x));
        let both = "u_transistor = 0.5\nu_diode = 0.7";
        assert_eq!(of(both, Kind::Rasmussen), [u_dead(0.6)]);
        assert_eq!(of(&format!("{both}\nu_dead = 5.4"), Kind::Rasmussen)[0], u_dead(6.0));
        assert!(of(both, Kind::ExtendedEmf).is_empty() && of("r_diode = 0.1", Kind::Rasmussen).is_empty());
        assert!(of("u_diode = 5.0", Kind::ExtendedEmf).is_empty());
        assert_eq!(of("u_diode = 5.4", Kind::ExtendedEmf), [u_dead(2.7)]);
    }

    #[test]
    fn what_the_file_gives_and_no_more() {
        use super::super::setting::Value::Real;
        assert!(of("").unwrap().is_empty());
        assert_eq!(of("[temperature]\nmagnet = -1.1e-3").unwrap(), [("magnet.alpha", Real(-1.1e-3))]);
        let period = ("inverter.T_pwm", Real(5e-5));
        assert_eq!(of("[inverter]\nr_diode = 0.1").unwrap(), [("inverter.r_diode", Real(0.1)), period.clone()]);
        let dead = of("[inverter]\nu_dead = 5.4").unwrap();
        assert_eq!(dead[0], ("inverter.i_zero", Real(0.02 * 15.0)));
        let dead = of("[inverter]\nu_dead = 5.4\ni_zero = 0.2").unwrap();
        assert_eq!(dead, [("inverter.i_zero", Real(0.2)), ("inverter.dead_time", Real(5.4 * 5e-5 / 540.0)), period]);
        assert_eq!(of("[inverter]\nf_sw = 8000.0").unwrap(), [("inverter.T_pwm", Real(1.25e-4))]);
        for (text, message) in [
            ("E_sw = 1e-3\nu_sw = 300.0", "inverter.E_sw needs inverter.i_sw"),
            ("f_sw = 0.0", "inverter.f_sw = 0 Hz must be greater than 0"),
        ] {
            let error = of(&format!("[inverter]\n{text}")).unwrap_err().to_string();
            assert!(error.contains(message) && error.starts_with("m.toml:"), "{error}");
        }
    }
}
