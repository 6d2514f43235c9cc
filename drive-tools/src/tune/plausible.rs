//! Refuses implausible values, which are mostly values in another unit: 36 H for 36 mH, rpm for rad/s, g.cm2 for
//! kg.m2.
//!
//! Each check forms a ratio of the value to others in the file, and states the range of this ratio for real machines: L i / psi_M
//! at the maximum current; R_s i against u_dc; the EMF at rated speed against u_dc / sqrt(3); the time in which the rated
//! torque reaches the rated speed; the rated torque against that of the maximum current; friction against the rated torque. The value
//! to correct may be another one of the ratio: the error names the one that, converted from another unit, brings all ratios into
//! their ranges.

use super::motor::{Data, Located, MotorFile};
use crate::error::{Result, bail};
use drive::implausible::{MAGNET, PERIOD, WINDING};
use drive::plant::inverter::LOST;
use fmu_core::digits::rounded;
use std::f64::consts::PI;

/// Other units in which a value may have been written, with their size in the expected unit.
type Units = &'static [(&'static str, f64)];

/// A value, its position, and the ratio that shows whether it is plausible.
struct Check {
    name: &'static str,
    unit: &'static str,
    units: Units,
    /// The value in the data, unless it is one of a list.
    of: fn(&mut Data) -> Option<&mut Located>,
    value: f64,
    /// Position in the file.
    at: usize,
    /// The ratio per unit of the value; it is proportional to the value.
    per_unit: f64,
    what: &'static str,
    range: (f64, f64),
    /// The usual range; a value converted from another unit must lie within it.
    usual: (f64, f64),
    /// Advice if no other unit fits.
    remedy: String,
}

impl Check {
    fn ratio(&self) -> f64 {
        self.value * self.per_unit
    }

    fn passes(&self) -> bool {
        // Without the values it is compared with, there is no ratio; a negative value is refused by the parameter's own range.
        let (ratio, (low, high)) = (self.ratio(), self.range);
        ratio.is_nan() || (low == 0.0 && ratio < 0.0) || (low..=high).contains(&ratio)
    }

    /// Whether the value, in a unit of this `size`, is a usual one.
    fn fits(&self, size: f64) -> bool {
        (self.usual.0..=self.usual.1).contains(&(self.ratio() * size))
    }

    /// Whether all values are plausible once this one is converted from a unit of this `size`.
    fn cures(&self, size: f64, data: &Data) -> bool {
        let mut data = data.clone();
        let Some(value) = (self.of)(&mut data) else { return false };
        *value.get_mut() *= size;
        self.fits(size) && checks(&mut data).iter().all(Self::passes)
    }

    /// The first other unit with this property, and the converted value.
    fn written_in(&self, fits: impl Fn(f64) -> bool) -> Option<String> {
        let &Self { value, unit, .. } = self;
        let (other, size) = self.units.iter().find(|(_, size)| fits(*size))?;
        Some(format!("{value} {other} would fit: write {} {unit}", rounded(value * size, 4)))
    }

    fn usual(self, low: f64, high: f64) -> Self {
        Self { usual: (low, high), ..self }
    }

    fn remedy(self, remedy: impl Into<String>) -> Self {
        Self { remedy: remedy.into(), ..self }
    }
}

/// Checks all values.
///
/// # Errors
/// The first value that is out of its range: the value, the expected range, and a unit that would fit.
pub fn check(motor: &MotorFile) -> Result<()> {
    let data = &motor.data;
    let all = checks(&mut data.clone());
    let Some(failed) = all.iter().find(|check| !check.passes()) else { return Ok(()) };
    let &Check { name, value, unit, what, range: (low, high), ref remedy, .. } = failed;
    let cure = |check: &Check| check.written_in(|size| check.cures(size, data));
    // Another value, if it is the only one.
    let other = || {
        let mut found = all.iter().filter_map(|check| Some((check, cure(check)?)));
        let (check, suggestion) = found.next()?;
        let place = motor.place_at(check.at);
        found.all(|(other, _)| other.name == check.name).then(|| format!("{}: {place}: {suggestion}", check.name))
    };
    let suggestion = cure(failed).or_else(other).or_else(|| failed.written_in(|size| failed.fits(size)));
    bail!(
        "{}: {name} = {} makes {what} {}, expected {low} to {high}: {}",
        motor.place_at(failed.at),
        format!("{value} {unit}").trim_end(),
        rounded(failed.ratio(), 4),
        suggestion.as_ref().unwrap_or(remedy)
    )
}

const SPEED: Units = &[("rpm", PI / 30.0), ("deg/s", PI / 180.0)];
const VOLTAGE: Units = &[("kV", 1e3), ("mV", 1e-3)];
const CURRENT: Units = &[("mA", 1e-3), ("kA", 1e3)];
const RESISTANCE: Units = &[("mOhm", 1e-3), ("uOhm", 1e-6)];
const INDUCTANCE: Units = &[("mH", 1e-3), ("uH", 1e-6)];
const FLUX_LINKAGE: Units = &[("mWb", 1e-3), ("uWb", 1e-6)];
const TORQUE: Units = &[("mN.m", 1e-3), ("N.cm", 1e-2), ("kN.m", 1e3)];
const INERTIA: Units = &[("kg.cm2", 1e-4), ("g.cm2", 1e-7), ("g.m2", 1e-3)];
const ENERGY: Units = &[("mJ", 1e-3), ("uJ", 1e-6)];
const FRICTION: Units = &[("mN.m.s/rad", 1e-3), ("N.m.s/deg", 180.0 / PI), ("N.m/rpm", 30.0 / PI)];
const POWER: Units = &[("kW", 1e3), ("mW", 1e-3)];
const FREQUENCY: Units = &[("kHz", 1e3), ("MHz", 1e6)];
const TIME: Units = &[("ms", 1e-3), ("us", 1e-6)];
const PER_KELVIN: Units = &[("%/K", 1e-2), ("ppm/K", 1e-6)];

const CORRECT: &str = "correct it, or the values it is compared with";
const WEAKENS: &str = "a magnet weakens as it warms: NdFeB has -1.1e-3, SmCo -0.4e-3, ferrite -2e-3";

/// Switching frequency in Hz where the file has none, for the judgment of an energy.
const USUAL_FREQUENCY: f64 = 1e4;

/// Advice on psi_M.
fn of_kv(data: &Data) -> String {
    let n_p = f64::from(*data.machine.n_p.get_ref());
    format!(
        "it is the peak value of a phase: from KV in rpm/V, 60 / (2 pi sqrt(3) n_p KV) with n_p = {n_p} pole pairs; for the EMF \
         to reach u_dc / sqrt(3) at rating.speed, psi_M is {} Wb",
        rounded(data.dc_link.u_dc.get_ref() / (3.0_f64.sqrt() * n_p * data.rating.speed.get_ref()), 4)
    )
}

/// Advice on R_s.
#[expect(non_snake_case, reason = "the symbols of the models")]
fn of_current(data: &Data) -> String {
    let (R_s, i, u_dc) = (data.machine.R_s.get_ref(), data.rating.current.get_ref(), data.dc_link.u_dc.get_ref());
    let highest = u_dc / 3.0_f64.sqrt();
    if i * R_s <= highest {
        return CORRECT.into();
    }
    format!(
        "rating.current = {i} A drops {} V across R_s, and a phase has at most u_dc / sqrt(3) = {} V: lower rating.current, a peak \
         value, below {} A, or correct R_s, the resistance of one phase",
        rounded(i * R_s, 4),
        rounded(highest, 4),
        rounded(0.6 * u_dc / R_s, 4)
    )
}

/// The pairs of the drag test with the highest speed, and with the greatest torque.
fn drag_test(data: &Data) -> Vec<Check> {
    let Some(iron) = &data.iron else { return Vec::new() };
    let most = |of: fn(&[f64; 2]) -> f64| iron.p.get_ref().iter().copied().max_by(|a, b| of(a).total_cmp(&of(b)));
    let (Some([fastest, _]), Some([speed, p])) = (most(|[speed, _]| *speed), most(|[speed, p]| p / speed)) else {
        return Vec::new();
    };
    let check = |name, unit, units, value, per_unit, what, range, usual| Check {
        name,
        unit,
        units,
        of: |_| None,
        value,
        at: iron.p.span().start,
        per_unit,
        what,
        range,
        usual,
        remedy: CORRECT.into(),
    };
    let (multiple, of_top) = ("its multiple of the highest speed of [rating]", 1.0 / data.rating.top());
    let (share, of_torque) = ("its torque over rating.torque", 1.0 / (speed * data.rating.torque.get_ref()));
    vec![
        check("a speed of iron.p", "rad/s", SPEED, fastest, of_top, multiple, (0.05, 4.0), (0.1, 2.0)),
        check("a power of iron.p", "W", POWER, p, of_torque, share, (1e-4, 0.3), (1e-3, 0.2)),
    ]
}

fn checks(data: &mut Data) -> Vec<Check> {
    let (machine, rating) = (&data.machine, &data.rating);
    let of = |x: &Located| *x.get_ref();
    let (n_p, psi_M, i, u_dc) =
        (f64::from(*machine.n_p.get_ref()), of(&machine.psi_M), of(&rating.current), of(&data.dc_link.u_dc));
    let (speed, torque) = (of(&rating.speed), of(&rating.torque));
    let (of_kv, of_current) = (of_kv(data), of_current(data));
    let saliency = (of(&machine.L_q) - of(&machine.L_d)).abs();
    let emf = n_p * 3.0_f64.sqrt() / u_dc;
    let part = |x: Option<&Located>| x.map_or(f64::NAN, of);
    let inverter = data.inverter.as_ref();
    let switched = part(inverter.and_then(|x| x.i_sw.as_ref())) * part(inverter.and_then(|x| x.u_sw.as_ref()));
    let frequency = inverter.and_then(|x| x.f_sw.as_ref()).map_or(USUAL_FREQUENCY, of);
    let friction = "its torque at rating.speed, over rating.torque,";
    let mut check = |name, unit, units, of: fn(&mut Data) -> Option<&mut Located>, per_unit, what, range| {
        let (value, at) = of(data).map(|x| (*x.get_ref(), x.span().start))?;
        Some(Check { name, unit, units, of, value, at, per_unit, what, range, usual: range, remedy: CORRECT.into() })
    };
    #[rustfmt::skip]
    let found = [
        check("dc_link.u_dc", "V", VOLTAGE, |d| Some(&mut d.dc_link.u_dc),
            1.0, "a DC link, in V,", (1.0, 1e4)),
        check("rating.current", "A", CURRENT, |d| Some(&mut d.rating.current),
            1.0, "a current, in A,", (0.01, 1e5)),
        check("machine.psi_M", "Wb", FLUX_LINKAGE, |d| Some(&mut d.machine.psi_M),
            emf * speed, "the EMF at rating.speed over u_dc / sqrt(3)", (0.02, 50.0)).map(|x| x.usual(0.1, 3.0)).map(|x| x.remedy(of_kv)),
        check("rating.speed", "rad/s", SPEED, |d| Some(&mut d.rating.speed),
            emf * psi_M, "the EMF over dc_link.u_dc / sqrt(3)", (0.02, 5.0)),
        check("machine.L_d", "H", INDUCTANCE, |d| Some(&mut d.machine.L_d),
            i / psi_M, "L i / psi_M at rating.current", (0.003, 30.0)),
        check("machine.L_q", "H", INDUCTANCE, |d| Some(&mut d.machine.L_q),
            i / psi_M, "L i / psi_M at rating.current", (0.003, 30.0)),
        check("machine.R_s", "Ohm", RESISTANCE, |d| Some(&mut d.machine.R_s),
            i / u_dc, "R_s i over u_dc at rating.current", (1e-4, 0.6)).map(|x| x.usual(2e-3, 0.3)).map(|x| x.remedy(of_current)),
        check("rating.torque", "N.m", TORQUE, |d| Some(&mut d.rating.torque),
            1.0 / (1.5 * n_p * (psi_M + saliency * i) * i), "its share of the torque that rating.current can give", (0.005, 1.5)),
        check("mechanics.J", "kg.m2", INERTIA, |d| Some(&mut d.mechanics.J),
            speed / torque, "the time in s to rating.speed with rating.torque", (1e-4, 1e3)),
        check("rating.speed_max", "rad/s", SPEED, |d| d.rating.speed_max.as_mut(),
            1.0 / speed, "its multiple of rating.speed", (1.0, 10.0)),
        check("mechanics.B", "N.m.s/rad", FRICTION, |d| d.mechanics.B.as_mut(),
            speed / torque, friction, (0.0, 1.0)).map(|x| x.usual(1e-6, 0.5)),
        check("mechanics.tau_coulomb", "N.m", TORQUE, |d| d.mechanics.tau_coulomb.as_mut(),
            1.0 / torque, friction, (0.0, 1.0)).map(|x| x.usual(1e-6, 0.5)),
        check("mechanics.k_w", "N.m.s2/rad2", &[], |d| d.mechanics.k_w.as_mut(),
            speed * speed / torque, friction, (0.0, 1.0)),
        check("mechanics.w_coulomb", "rad/s", SPEED, |d| d.mechanics.w_coulomb.as_mut(),
            1.0 / speed, "its share of rating.speed", (0.0, 0.3)).map(|x| x.usual(1e-6, 0.05)),
        check("inverter.u_transistor", "V", VOLTAGE, |d| d.inverter.as_mut()?.u_transistor.as_mut(),
            1.0 / u_dc, "its share of dc_link.u_dc", (0.0, 0.3)).map(|x| x.usual(1e-5, 0.1)),
        check("inverter.u_diode", "V", VOLTAGE, |d| d.inverter.as_mut()?.u_diode.as_mut(),
            1.0 / u_dc, "its share of dc_link.u_dc", (0.0, 0.3)).map(|x| x.usual(1e-5, 0.1)),
        check("inverter.r_transistor", "Ohm", RESISTANCE, |d| d.inverter.as_mut()?.r_transistor.as_mut(),
            i / u_dc, "the drop at rating.current over dc_link.u_dc", (0.0, 0.3)).map(|x| x.usual(1e-5, 0.1)),
        check("inverter.r_diode", "Ohm", RESISTANCE, |d| d.inverter.as_mut()?.r_diode.as_mut(),
            i / u_dc, "the drop at rating.current over dc_link.u_dc", (0.0, 0.3)).map(|x| x.usual(1e-5, 0.1)),
        check("inverter.i_sw", "A", CURRENT, |d| d.inverter.as_mut()?.i_sw.as_mut(),
            1.0 / i, "its multiple of rating.current", (0.01, 200.0)).map(|x| x.usual(0.1, 20.0)),
        check("inverter.u_sw", "V", VOLTAGE, |d| d.inverter.as_mut()?.u_sw.as_mut(),
            1.0 / u_dc, "its multiple of dc_link.u_dc", (0.03, 100.0)).map(|x| x.usual(0.3, 30.0)),
        check("inverter.k_sw", "", &[], |d| d.inverter.as_mut()?.k_sw.as_mut(),
            1.0, "an exponent of", (0.0, 3.0)),
        check("inverter.f_sw", "Hz", FREQUENCY, |d| d.inverter.as_mut()?.f_sw.as_mut(),
            1.0, "a switching frequency, in Hz,", (1.0 / PERIOD.1, 1.0 / PERIOD.0)),
        check("inverter.E_sw", "J", ENERGY, |d| d.inverter.as_mut()?.E_sw.as_mut(),
            frequency / switched, "the switching loss at f_sw over i_sw u_sw", (0.0, LOST)).map(|x| x.usual(1e-6, 0.1)),
        check("inverter.u_dead", "V", VOLTAGE, |d| d.inverter.as_mut()?.u_dead.as_mut(),
            1.0 / u_dc, "its share of dc_link.u_dc", (0.0, 0.3)).map(|x| x.usual(1e-5, 0.1)),
        check("inverter.i_zero", "A", CURRENT, |d| d.inverter.as_mut()?.i_zero.as_mut(),
            1.0 / i, "its share of rating.current", (0.0, 1.0)).map(|x| x.usual(1e-4, 0.2)),
        check("temperature.winding", "1/K", PER_KELVIN, |d| d.temperature.as_mut()?.winding.as_mut(),
            1.0, "the growth of the resistance per kelvin", WINDING).map(|x| x.usual(5e-4, 0.01)).map(|x| x.remedy("copper has 3.93e-3")),
        check("temperature.magnet", "1/K", PER_KELVIN, |d| d.temperature.as_mut()?.magnet.as_mut(),
            1.0, "the growth of psi_M per kelvin", MAGNET).map(|x| x.usual(-5e-3, -1e-4)).map(|x| x.remedy(WEAKENS)),
        check("flux_map.alpha", "1/K", PER_KELVIN, |d| d.flux_map.as_mut()?.alpha.as_mut(),
            1.0, "the growth of psi_M per kelvin", MAGNET).map(|x| x.usual(-5e-3, -1e-4)).map(|x| x.remedy(WEAKENS)),
        check("flux_map.temperature", "degC", &[], |d| d.flux_map.as_mut()?.temperature.as_mut(),
            1.0, "the temperature of a magnet, in degC,", (-100.0, 250.0)).map(|x| x.remedy("from K, subtract 273.15")),
        check("control.T_s", "s", TIME, |d| d.control.T_s.as_mut(),
            1.0, "a sample period, in s,", (1e-6, 0.01)),
    ];
    found.into_iter().flatten().chain(drag_test(data)).collect()
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
            (
                "J = 15e-3",
                "J = 15e-3\nB = 5.0",
                "B = 5 N.m.s/rad makes its torque at rating.speed, over rating.torque, 56.1, expected 0 to 1: 5 mN.m.s/rad would fit: write 0.005",
            ),
            ("torque = 14.0", "torque = 14000.0", "14000 mN.m would fit: write 14 N.m"),
            ("u_dc = 540.0", "u_dc = 0.54", "0.54 kV would fit: write 540 V"),
            (
                "u_dc = 540.0",
                "u_dc = 1e9",
                "dc_link.u_dc = 1000000000 V makes a DC link, in V, 1000000000, expected 1 to 10000: correct it",
            ),
        ] {
            let error = refused(from, to);
            assert!(error.contains(message) && error.lines().count() == 1, "{error}");
        }
    }

    /// The value that differs from all others is named, not the first one of its ratio.
    #[test]
    fn another_value_may_be_the_wrong_one() {
        for (to, message) in [
            (
                "current = 0.015",
                ": machine.L_d = 0.036 H makes L i / psi_M at rating.current 0.0009908, expected 0.003 to 30: ",
            ),
            ("current = 0.015", ": rating.current: m.toml:18:11: 0.015 kA would fit: write 15 A"),
            ("current = 15000.0", ": rating.current: m.toml:18:11: 15000 mA would fit: write 15 A"),
        ] {
            let error = refused("current = 15.0", to);
            assert!(error.contains(message) && error.lines().count() == 1, "{error}");
        }
        // If two values are wrong, no single conversion makes the file plausible, and the error suggests a unit for the first one.
        let both = TEXT.replacen("L_q = 51e-3", "L_q = 51.0", 1);
        let motor = MotorFile::parse(&both.replacen("L_d = 36e-3", "L_d = 36.0", 1), Path::new("m.toml")).unwrap();
        let error = check(&motor).unwrap_err().to_string();
        assert!(error.contains("machine.L_d = 36 H") && error.ends_with("36 mH would fit: write 0.036 H"), "{error}");
    }

    #[test]
    fn every_section_is_checked() {
        for (section, message) in [
            (
                "[iron]\np = [[500.0, 11.8], [1500.0, 53.4]]",
                "a speed of iron.p = 1500 rad/s makes its multiple of the highest speed of \
              [rating] 9.549, expected 0.05 to 4: 1500 rpm would fit: write 157.1 rad/s",
            ),
            ("[iron]\np = [[52.4, 0.0118], [157.1, 0.0534]]", "0.0534 kW would fit: write 53.4 W"),
            (
                "[inverter]\nu_transistor = 800.0",
                "inverter.u_transistor = 800 V makes its share of dc_link.u_dc 1.481, expected 0 to 0.3: \
              800 mV would fit: write 0.8 V",
            ),
            ("[inverter]\nr_diode = 60.0", "60 mOhm would fit: write 0.06 Ohm"),
            ("[inverter]\nE_sw = 2.5\ni_sw = 15.0\nu_sw = 600.0", "2.5 mJ would fit: write 0.0025 J"),
            ("[inverter]\nE_sw = 2.5e-3\ni_sw = 15000.0\nu_sw = 600.0", "15000 mA would fit: write 15 A"),
            ("[inverter]\nE_sw = 2.5e-3\ni_sw = 15.0\nu_sw = 0.6", "0.6 kV would fit: write 600 V"),
            ("[inverter]\nk_sw = 13.0", "inverter.k_sw = 13 makes an exponent of 13, expected 0 to 3"),
            ("[inverter]\nf_sw = 10.0", "10 kHz would fit: write 10000 Hz"),
            ("[inverter]\nu_dead = 5400.0", "5400 mV would fit: write 5.4 V"),
            ("[inverter]\ni_zero = 300.0", "300 mA would fit: write 0.3 A"),
            ("[temperature]\nwinding = 0.393", "0.393 %/K would fit: write 0.00393 1/K"),
            ("[temperature]\nwinding = 3930.0", "3930 ppm/K would fit: write 0.00393 1/K"),
            ("[temperature]\nmagnet = -0.11", "-0.11 %/K would fit: write -0.0011 1/K"),
            ("[temperature]\nmagnet = 1.1e-3", "a magnet weakens as it warms: NdFeB has -1.1e-3"),
            ("[control]\nT_s = 100.0", "100 us would fit: write 0.0001 s"),
        ] {
            let motor = MotorFile::parse(&format!("{TEXT}\n{section}\n"), Path::new("m.toml")).unwrap();
            let error = check(&motor).unwrap_err().to_string();
            assert!(error.contains(message) && error.lines().count() == 1, "{error}");
        }
        // An energy without its current and voltage is refused elsewhere, with its remedy.
        let alone = MotorFile::parse(&format!("{TEXT}\n[inverter]\nE_sw = 2.5e-3\n"), Path::new("m.toml")).unwrap();
        assert!(check(&alone).is_ok());
    }
}
