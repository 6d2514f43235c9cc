//! The plausible values of a motor file.
//!
//! The ratios: L i / psi_M at the maximum current; R_s i against u_dc; the EMF at rated speed against u_dc / sqrt(3); the time in
//! which the rated torque reaches the rated speed; the rated torque against that of the maximum current; friction against the
//! rated torque; drops and switching losses against the link.

use super::motor::{Data, Located, MotorFile};
use crate::error::Result;
use crate::plausible::{
    self, CORRECT, CURRENT, Check, ENERGY, FLUX_LINKAGE, FREQUENCY, FRICTION, INDUCTANCE, INERTIA, PER_KELVIN, POWER,
    RESISTANCE, SPEED, TIME, TORQUE, VOLTAGE,
};
use drive::implausible::{MAGNET, PERIOD, WINDING};
use drive::plant::inverter::LOST;
use fmu_core::digits::rounded;

/// Checks all values.
///
/// # Errors
/// The first value that is out of its range: its place, the value, the expected range, and a unit that would fit.
pub fn check(motor: &MotorFile) -> Result<()> {
    plausible::check(&motor.data, &|data| checks(&mut data.clone()), &|at| motor.place_at(at))
}

const WEAKENS: &str = "a magnet weakens as it warms: NdFeB has -1.1e-3, SmCo -0.4e-3, ferrite -2e-3";

/// Switching frequency in Hz where the file has none, to check an energy.
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

/// The pairs of the drag test with the highest speed, and with the greatest torque; the rise of the torque with speed.
fn drag_test(data: &Data) -> Vec<Check<Data>> {
    let Some(iron) = &data.iron else { return Vec::new() };
    let most = |of: fn(&[f64; 2]) -> f64| iron.p.get_ref().iter().copied().max_by(|a, b| of(a).total_cmp(&of(b)));
    let (Some([fastest, p_of_fastest]), Some([speed, p])) = (most(|[speed, _]| *speed), most(|[speed, p]| p / speed))
    else {
        return Vec::new();
    };
    let check = |place: usize, name, unit, units, value, per_unit, what, range, usual| Check {
        name,
        unit,
        units,
        convert: Box::new(move |data: &mut Data, size| {
            data.iron.iter_mut().flat_map(|iron| iron.p.get_mut()).for_each(|pair| pair[place] *= size);
        }),
        value,
        at: Some(iron.p.span().start),
        per_unit,
        what,
        range,
        usual,
        remedy: CORRECT.into(),
    };
    let (multiple, of_top) = ("its multiple of the highest speed of [rating]", 1.0 / data.rating.top());
    let slowest = iron.p.get_ref().iter().copied().min_by(|a, b| a[0].total_cmp(&b[0]));
    let rise = slowest.map_or(f64::NAN, |[speed, p]| speed / p);
    let (share, of_torque) = ("its torque over rating.torque", 1.0 / (speed * data.rating.torque.get_ref()));
    vec![
        check(0, "a speed of iron.p", "rad/s", SPEED, fastest, of_top, multiple, (0.05, 4.0), (0.1, 2.0)),
        check(1, "a power of iron.p", "W", POWER, p, of_torque, share, (1e-4, 0.3), (1e-3, 0.2)),
        check(
            1,
            "the power of iron.p at the highest speed",
            "W",
            &[],
            p_of_fastest,
            rise / fastest,
            "the drag torque over that at the lowest speed",
            (0.8, 1e3),
            (1.0, 1e2),
        )
        .remedy("friction and iron losses do not fall with speed: each pair of iron.p is [speed, power]"),
    ]
}

fn checks(data: &mut Data) -> Vec<Check<Data>> {
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
        let (value, at) = of(data).map(|x| (*x.get_ref(), Some(x.span().start)))?;
        let convert = Box::new(move |data: &mut Data, size| {
            if let Some(value) = of(data) {
                *value.get_mut() *= size;
            }
        });
        Some(Check {
            name,
            unit,
            units,
            convert,
            value,
            at,
            per_unit,
            what,
            range,
            usual: range,
            remedy: CORRECT.into(),
        })
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
            (
                "[iron]\np = [[11.8, 22.4], [53.4, 57.1]]",
                "drag torque over that at the lowest speed 0.5633, expected 0.8 to 1000: friction and iron losses do not fall",
            ),
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
