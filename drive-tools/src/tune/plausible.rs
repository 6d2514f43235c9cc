//! Refuses implausible values, which are mostly values in another unit: 36 H for 36 mH, rpm for rad/s, g.cm2 for
//! kg.m2.
//!
//! Each check forms a ratio of the value to others in the file, and states the range of this ratio for real machines: L i / psi_M
//! at the maximum current; R_s i against u_dc; the EMF at rated speed against u_dc / sqrt(3); the time in which the rated
//! torque reaches the rated speed; the rated torque against that of the maximum current; the
//! highest speed against the rated speed.

use super::motor::{Data, Located, MotorFile};
use crate::error::{Result, bail};
use fmu_core::digits::rounded;

/// A value, its plausible range, and other units in which it may have been written, with their size in the expected unit.
struct Check<'a> {
    name: &'static str,
    value: &'a Located,
    unit: &'static str,
    /// The judged quantity per unit of the value; it is proportional to the value.
    per_unit: f64,
    what: &'static str,
    range: (f64, f64),
    /// The usual range; a value converted from another unit must lie within it.
    usual: (f64, f64),
    /// Advice if no other unit fits.
    remedy: String,
    units: &'static [(&'static str, f64)],
}

/// Checks all values.
///
/// # Errors
/// The first value that is out of its range: the value, the expected range, and a unit that would fit.
pub fn check(motor: &MotorFile) -> Result<()> {
    checks(&motor.data).iter().try_for_each(|check| one(motor, check))
}

fn one(motor: &MotorFile, check: &Check<'_>) -> Result<()> {
    let &Check { name, value, unit, per_unit, what, range: (low, high), usual, ref remedy, units } = check;
    let x = *value.get_ref();
    if (low..=high).contains(&(x * per_unit)) {
        return Ok(());
    }
    let fits = |x: f64| (usual.0..=usual.1).contains(&(x * per_unit));
    let suggestion = units.iter().find(|(_, size)| fits(x * size)).map_or_else(
        || remedy.clone(),
        |(other, size)| format!("{x} {other} would fit: write {} {unit}", rounded(x * size, 4)),
    );
    bail!(
        "{}: {name} = {x} {unit} makes {what} {}, expected {low} to {high}: {suggestion}",
        motor.place(value),
        rounded(x * per_unit, 4)
    )
}

const SPEED: &[(&str, f64)] = &[("rpm", std::f64::consts::PI / 30.0), ("deg/s", std::f64::consts::PI / 180.0)];

const CORRECT: &str = "correct it, or the values it is compared with";

const INDUCTANCE: &[(&str, f64)] = &[("mH", 1e-3), ("uH", 1e-6)];

fn checks(data: &Data) -> Vec<Check<'_>> {
    let (machine, rating) = (&data.machine, &data.rating);
    let of = |x: &Located| *x.get_ref();
    let (n_p, psi_M, i, u_dc) =
        (f64::from(*machine.n_p.get_ref()), of(&machine.psi_M), of(&rating.current), of(&data.dc_link.u_dc));
    let (speed, torque) = (of(&rating.speed), of(&rating.torque));
    let of_kv = format!(
        "it is the peak value of a phase: from KV in rpm/V, 60 / (2 pi sqrt(3) n_p KV) with n_p = {n_p} pole pairs; for the EMF \
         to reach u_dc / sqrt(3) at rating.speed, psi_M is {} Wb",
        rounded(u_dc / (3.0_f64.sqrt() * n_p * speed), 4)
    );
    let (R_s, highest) = (of(&machine.R_s), u_dc / 3.0_f64.sqrt());
    let of_current = if i * R_s > highest {
        format!(
            "rating.current = {i} A drops {} V across R_s, and a phase has at most u_dc / sqrt(3) = {} V: lower rating.current, a peak \
             value, below {} A, or correct R_s, the resistance of one phase",
            rounded(i * R_s, 4),
            rounded(highest, 4),
            rounded(0.6 * u_dc / R_s, 4)
        )
    } else {
        CORRECT.into()
    };
    let saliency = (of(&machine.L_q) - of(&machine.L_d)).abs();
    let inductance = |name, value| Check {
        name,
        value,
        unit: "H",
        per_unit: i / psi_M,
        what: "L i / psi_M at rating.current",
        range: (0.003, 30.0),
        usual: (0.003, 30.0),
        remedy: CORRECT.into(),
        units: INDUCTANCE,
    };
    let top = rating.speed_max.as_ref().map(|value| Check {
        name: "rating.speed_max",
        value,
        unit: "rad/s",
        per_unit: 1.0 / speed,
        what: "its multiple of rating.speed",
        range: (1.0, 10.0),
        usual: (1.0, 10.0),
        remedy: CORRECT.into(),
        units: SPEED,
    });
    #[rustfmt::skip]
    let mut all = vec![
        Check { name: "dc_link.u_dc", value: &data.dc_link.u_dc, unit: "V", per_unit: 1.0,
            what: "a DC link, in V,", range: (1.0, 1e4), usual: (1.0, 1e4),
            remedy: CORRECT.into(), units: &[("kV", 1e3)] },
        Check { name: "machine.psi_M", value: &machine.psi_M, unit: "Wb", per_unit: n_p * speed * 3.0_f64.sqrt() / u_dc,
            what: "the EMF at rating.speed over u_dc / sqrt(3)", range: (0.02, 50.0), usual: (0.1, 3.0),
            remedy: of_kv, units: &[("mWb", 1e-3), ("uWb", 1e-6)] },
        Check { name: "rating.speed", value: &rating.speed, unit: "rad/s", per_unit: n_p * psi_M * 3.0_f64.sqrt() / u_dc,
            what: "the EMF over dc_link.u_dc / sqrt(3)", range: (0.02, 5.0), usual: (0.02, 5.0),
            remedy: CORRECT.into(), units: SPEED },
        inductance("machine.L_d", &machine.L_d),
        inductance("machine.L_q", &machine.L_q),
        Check { name: "machine.R_s", value: &machine.R_s, unit: "Ohm", per_unit: i / u_dc,
            what: "R_s i over u_dc at rating.current", range: (1e-4, 0.6), usual: (2e-3, 0.3),
            remedy: of_current, units: &[("mOhm", 1e-3), ("uOhm", 1e-6)] },
        Check { name: "rating.torque", value: &rating.torque, unit: "N.m", per_unit: 1.0 / (1.5 * n_p * (psi_M + saliency * i) * i),
            what: "its share of the torque that rating.current can give", range: (0.005, 1.5), usual: (0.005, 1.5),
            remedy: CORRECT.into(), units: &[("mN.m", 1e-3), ("N.cm", 1e-2), ("kN.m", 1e3)] },
        Check { name: "mechanics.J", value: &data.mechanics.J, unit: "kg.m2", per_unit: speed / torque,
            what: "the time in s to rating.speed with rating.torque", range: (1e-4, 1e3), usual: (1e-4, 1e3),
            remedy: CORRECT.into(), units: &[("kg.cm2", 1e-4), ("g.cm2", 1e-7), ("g.m2", 1e-3)] },
    ];
    all.extend(top);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const TEXT: &str = include_str!("../../../motors/ipmsm-2.2kw.toml");

    fn refused(from: &str, to: &str) -> String {
        assert!(TEXT.contains(from), "{from}");
        let motor = MotorFile::parse(&TEXT.replacen(from, to, 1), Path::new("m.toml")).unwrap();
        check(&motor).unwrap_err().to_string()
    }

    /// Data of public reports: the flux from a rule other than KV, and a current that the voltage cannot drive.
    #[test]
    fn a_unit_that_is_far_off_is_not_named() {
        let flux = refused("psi_M = 0.545", "psi_M = 12000.0");
        assert!(flux.contains("60 / (2 pi sqrt(3) n_p KV) with n_p = 3") && !flux.contains("would fit"), "{flux}");
        assert!(flux.contains("psi_M is 0.6616 Wb"), "{flux}");
        let current = refused("R_s = 3.6", "R_s = 22.0");
        for part in
            ["rating.current = 15 A drops 330 V across R_s", "at most u_dc / sqrt(3) = 311.8 V", "below 14.73 A"]
        {
            assert!(current.contains(part) && !current.contains("would fit"), "{current}");
        }
    }

    #[test]
    fn another_unit_is_named() {
        for (from, to, message) in [
            (
                "L_d = 36e-3",
                "L_d = 36.0",
                "machine.L_d = 36 H makes L i / psi_M at rating.current 990.8, expected 0.003 to 30: 36 mH would fit: write 0.036 H",
            ),
            ("L_q = 51e-3", "L_q = 51000.0", "51000 uH would fit: write 0.051 H"),
            ("R_s = 3.6", "R_s = 3600.0", "3600 mOhm would fit: write 3.6 Ohm"),
            ("psi_M = 0.545", "psi_M = 545.0", "545 mWb would fit: write 0.545 Wb"),
            ("speed = 157.079633", "speed = 1500.0", "1500 rpm would fit: write 157.1 rad/s"),
            ("J = 15e-3", "J = 150.0", "150 kg.cm2 would fit: write 0.015 kg.m2"),
            ("torque = 14.0", "torque = 14000.0", "14000 mN.m would fit: write 14 N.m"),
            ("u_dc = 540.0", "u_dc = 0.54", "0.54 kV would fit: write 540 V"),
            (
                "u_dc = 540.0",
                "u_dc = 1e6",
                "dc_link.u_dc = 1000000 V makes a DC link, in V, 1000000, expected 1 to 10000: correct it",
            ),
        ] {
            let error = refused(from, to);
            assert!(error.contains(message) && error.lines().count() == 1, "{error}");
        }
    }
}
