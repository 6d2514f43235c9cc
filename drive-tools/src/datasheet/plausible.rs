//! The plausible values of a data sheet, and doubts about its losses.
//!
//! The ratios: the curves of the torque against the axes of the losses; the continuous and the drag torque against the peak torque; the
//! best efficiency; the loss without torque against that at the smallest torque; the time in which the peak torque reaches the
//! highest speed.

use super::file::{DataSheet, LossTable, RPM, SheetData, Torque};
use crate::error::{Result, WithContext};
use crate::plausible::{self, CORRECT, Check, INERTIA, POWER, SPEED, TIME, TORQUE, Units, VOLTAGE};

/// Units of a key `rpm`.
const TURNS: Units = &[("rad/s", 30.0 / std::f64::consts::PI), ("Hz", 60.0), ("krpm", 1e3)];
const NONE: Units = &[];

/// Multiplies a value of the sheet.
type Scale = fn(&mut SheetData, f64);

/// Checks all values; `reach` are the highest speed in rad/s and the peak torque in N.m of a sheet whose torque is that of a map.
///
/// # Errors
/// The first value that is out of its range: the value, the expected range, and a unit that would fit.
pub(super) fn check(sheet: &DataSheet, reach: Option<[f64; 2]>) -> Result<()> {
    plausible::check(&sheet.data, &|data| checks(data, reach), &|_| String::new())
        .with_context(|| sheet.path().display().to_string())
}

fn most(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NAN, f64::max)
}

fn scale(values: Option<&mut Vec<f64>>, size: f64) {
    for x in values.into_iter().flatten() {
        *x *= size;
    }
}

fn one(value: Option<&mut f64>, size: f64) {
    if let Some(x) = value {
        *x *= size;
    }
}

impl Torque {
    fn scale_speeds(&mut self, size: f64) {
        scale(self.rpm.as_mut(), size);
        scale(self.speed.as_mut(), size);
    }

    fn scale_torques(&mut self, size: f64) {
        let Self { peak, continuous, generator, drag, .. } = self;
        for values in [Some(peak), continuous.as_mut(), generator.as_mut(), drag.as_mut()] {
            scale(values, size);
        }
    }
}

impl LossTable {
    fn scale_speeds(&mut self, size: f64) {
        scale(self.rpm.as_mut(), size);
        scale(self.speed.as_mut(), size);
    }
}

/// The point of the table with the least loss per power at the shaft: that share, and the loss in W; or the efficiency.
fn best(data: &SheetData) -> Option<(f64, f64)> {
    let losses = &data.losses;
    let (rows, torque) = (losses.efficiency.as_ref().or(losses.loss.as_ref())?, losses.torque.as_ref()?);
    let cells = losses.speeds().ok()?.into_iter().zip(rows).flat_map(|(n, row)| {
        torque
            .iter()
            .zip(row)
            .filter(move |(tau, x)| n * **tau > 0.0 && !x.is_nan())
            .map(move |(tau, x)| (x / (n * tau), *x))
    });
    if losses.efficiency.is_some() {
        cells.filter(|(_, x)| *x <= 1.0).map(|(_, x)| (x, x)).max_by(|a, b| a.1.total_cmp(&b.1))
    } else {
        cells.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// The greatest share of a loss without torque in the loss at the smallest torque of its row, and that loss in W.
fn idle(data: &SheetData) -> Option<(f64, f64)> {
    let losses = &data.losses;
    let (speeds, torque) = (losses.speeds().ok()?, losses.torque.as_ref()?);
    let shares = losses.no_load.as_ref()?.iter().enumerate().filter_map(|(k, no_load)| {
        let row = losses.efficiency.as_ref().or(losses.loss.as_ref())?.get(k)?;
        let (tau, x) = torque.iter().zip(row).find(|(tau, x)| **tau > 0.0 && !x.is_nan())?;
        let loss = if losses.loss.is_some() { *x } else { speeds.get(k)? * tau * (1.0 / x - 1.0) };
        Some((no_load / loss, *no_load))
    });
    shares.filter(|(share, _)| share.is_finite()).max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(share, _)| *share > 0.0)
}

/// The name of an axis of speeds, its unit, other units, and the size of its unit in rad/s.
fn axis(rpm: bool, [turns, speed]: [&'static str; 2]) -> (&'static str, &'static str, Units, f64) {
    if rpm { (turns, "rpm", TURNS, RPM) } else { (speed, "rad/s", SPEED, 1.0) }
}

fn checks(data: &SheetData, reach: Option<[f64; 2]>) -> Vec<Check<SheetData>> {
    let (losses, torque, u_dc) = (&data.losses, data.torque.as_ref(), data.dc_link.u_dc);
    let last = |speeds: Result<Vec<f64>>| speeds.ok().and_then(|all| all.last().copied()).unwrap_or(f64::NAN);
    let [top, peak] =
        torque.map(|torque| [last(torque.speeds()), most(&torque.peak)]).or(reach).unwrap_or([f64::NAN; 2]);
    let (end, largest) = (last(losses.speeds()), losses.torque.as_deref().map(most));
    let part = |of: fn(&Torque) -> Option<&Vec<f64>>| torque.and_then(of).map(|values| most(values));
    let (best, idle) = (best(data), idle(data));
    let per_unit = |found: Option<(f64, f64)>| found.map_or(f64::NAN, |(share, value)| share / value);
    let value = |found: Option<(f64, f64)>| found.map(|(_, value)| value);
    let of_torque = axis(torque.is_some_and(|torque| torque.rpm.is_some()), ["torque.rpm", "torque.speed"]);
    let of_losses = axis(losses.rpm.is_some(), ["losses.rpm", "losses.speed"]);
    let least = if losses.loss.is_some() {
        ("losses.loss", "W", POWER, "the least loss over the power at the shaft", (2e-3, 2.5), (0.01, 1.0), CORRECT)
    } else {
        let remedy = "an efficiency is the share that is delivered, not the share that is lost";
        ("losses.efficiency", "", NONE, "the best efficiency", (0.3, 0.998), (0.5, 0.99), remedy)
    };
    let check = |name, unit, units, value: Option<f64>, convert: Scale, per_unit, what, range, usual| {
        let (convert, remedy) = (Box::new(convert), CORRECT.into());
        value.map(|value| Check { name, unit, units, convert, value, at: None, per_unit, what, range, usual, remedy })
    };
    #[rustfmt::skip]
    let found = [
        check("dc_link.u_dc", "V", VOLTAGE, Some(u_dc), |d, x| d.dc_link.u_dc *= x,
            1.0, "a DC link, in V,", (1.0, 1e4), (10.0, 2e3)),
        check("dc_link.u_min", "V", VOLTAGE, data.dc_link.u_min.filter(|u| *u > 0.0), |d, x| one(d.dc_link.u_min.as_mut(), x),
            1.0 / u_dc, "its share of dc_link.u_dc", (0.05, 1.0), (0.3, 1.0)).map(|x| x.remedy("without it, any voltage is allowed")),
        check("dc_link.u_max", "V", VOLTAGE, data.dc_link.u_max, |d, x| one(d.dc_link.u_max.as_mut(), x),
            1.0 / u_dc, "its multiple of dc_link.u_dc", (1.0, 10.0), (1.0, 2.0)).map(|x| x.remedy("without it, any voltage is allowed")),
        check(of_torque.0, of_torque.1, of_torque.2, torque.map(|_| top / of_torque.3), |d, x| d.torque.iter_mut().for_each(|t| t.scale_speeds(x)),
            of_torque.3 / end, "its multiple of the highest speed of [losses]", (0.15, 6.7), (0.3, 1.05)),
        check(of_losses.0, of_losses.1, of_losses.2, largest.map(|_| end / of_losses.3), |d, x| d.losses.scale_speeds(x),
            of_losses.3 / top, "its multiple of the highest speed of [torque]", (0.15, 6.7), (0.95, 3.3)),
        check("torque.peak", "N.m", TORQUE, part(|t| Some(&t.peak)), |d, x| d.torque.iter_mut().for_each(|t| scale(Some(&mut t.peak), x)),
            1.0 / largest.unwrap_or(f64::NAN), "its multiple of the greatest torque of [losses]", (0.15, 6.7), (0.3, 1.05)),
        check("losses.torque", "N.m", TORQUE, largest, |d, x| scale(d.losses.torque.as_mut(), x),
            1.0 / peak, "its multiple of torque.peak", (0.15, 6.7), (0.95, 3.3)),
        check("torque.continuous", "N.m", TORQUE, part(|t| t.continuous.as_ref()),
            |d, x| d.torque.iter_mut().for_each(|t| scale(t.continuous.as_mut(), x)),
            1.0 / peak, "its share of torque.peak", (0.02, 1.0), (0.1, 1.0)),
        check("torque.generator", "N.m", TORQUE, part(|t| t.generator.as_ref()),
            |d, x| d.torque.iter_mut().for_each(|t| scale(t.generator.as_mut(), x)),
            1.0 / peak, "its multiple of torque.peak", (0.02, 5.0), (0.1, 1.5)),
        check("torque.drag", "N.m", TORQUE, part(|t| t.drag.as_ref()), |d, x| d.torque.iter_mut().for_each(|t| scale(t.drag.as_mut(), x)),
            1.0 / peak, "its share of torque.peak", (0.0, 0.3), (1e-4, 0.1)),
        check("the torques of [torque]", "N.m", TORQUE, part(|t| Some(&t.peak)), |d, x| d.torque.iter_mut().for_each(|t| t.scale_torques(x)),
            1.0 / largest.unwrap_or(f64::NAN), "their multiple of the greatest torque of [losses]", (0.15, 6.7), (0.3, 1.05)),
        check("torque.peak_time", "s", TIME, torque.and_then(|t| t.peak_time).filter(|t| *t > 0.0),
            |d, x| d.torque.iter_mut().for_each(|t| one(t.peak_time.as_mut(), x)),
            1.0, "a time of the peak torque, in s,", (0.05, 7200.0), (0.5, 600.0)),
        check(least.0, least.1, least.2, value(best), |d, x| d.losses.loss.iter_mut().flatten().for_each(|row| scale(Some(row), x)),
            per_unit(best), least.3, least.4, least.5).map(|x| x.remedy(least.6)),
        check("losses.no_load", "W", POWER, value(idle), |d, x| scale(d.losses.no_load.as_mut(), x),
            per_unit(idle), "its greatest share of the loss at the smallest torque", (0.01, 2.0), (0.05, 1.2))
            .map(|x| x.remedy("it is the loss at zero torque, a power")),
        check("mechanics.J", "kg.m2", INERTIA, Some(data.mechanics.J), |d, x| d.mechanics.J *= x,
            top / peak, "the time in s to the highest speed with the peak torque", (1e-4, 1e3), (1e-3, 10.0)),
        check("bandwidth.torque", "rad/s", NONE, Some(data.bandwidth.torque), |d, x| d.bandwidth.torque *= x,
            1.0, "a bandwidth of the torque, in rad/s,", (5.0, 1e5), (50.0, 2e4)).map(|x| x.remedy("a time constant of 1.67 ms is 600 rad/s")),
    ];
    found.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const EXAMPLE: &str = include_str!("../../../src/commands/datasheet.toml");

    fn refused(from: &str, to: &str) -> String {
        assert!(EXAMPLE.contains(from), "{from}");
        let sheet = DataSheet::parse(&EXAMPLE.replacen(from, to, 1), Path::new("sheet.toml")).unwrap();
        let error = format!("{:#}", check(&sheet, None).expect_err(to));
        assert!(error.starts_with("sheet.toml: ") && error.lines().count() == 1, "{error}");
        error
    }

    /// A line of the example.
    fn line(key: &str) -> &str {
        EXAMPLE.lines().find(|line| line.starts_with(&format!("{key} = "))).unwrap()
    }

    #[test]
    fn another_unit_is_named() {
        let table = &EXAMPLE[EXAMPLE.find("[losses]").unwrap()..];
        let rpm = table.lines().find(|line| line.starts_with("rpm = ")).unwrap();
        let link = &EXAMPLE[EXAMPLE.find("[dc_link]").unwrap()..EXAMPLE.find("[bandwidth]").unwrap()];
        for (from, to, message) in [
            (
                line("rpm"),
                "rpm = [0, 314, 471, 628, 838]",
                "torque.rpm = 838 rpm makes its multiple of the highest speed of [losses] 0.1047, expected 0.15 to 6.7: \
                 838 rad/s would fit: write 8002 rpm",
            ),
            (line("rpm"), "rpm = [0, 50, 75, 100, 133]", "133 Hz would fit: write 7980 rpm"),
            (line("rpm"), "speed = [0, 3000, 4500, 6000, 8000]", "8000 rpm would fit: write 837.8 rad/s"),
            (rpm, "rpm = [52, 209, 419, 628, 838]", ": losses.rpm: 838 rad/s would fit: write 8002 rpm"),
            (line("continuous"), "continuous = [0.05, 0.05, 0.05, 0.04, 0.03]", "0.05 kN.m would fit: write 50 N.m"),
            (line("drag"), "drag = [400, 600, 750, 900, 1200]", "1200 mN.m would fit: write 1.2 N.m"),
            (
                line("torque"),
                "torque = [500, 2000, 4000, 6000, 8000, 10000]",
                ": losses.torque: 10000 N.cm would fit: write 100 N.m",
            ),
            (line("peak_time"), "peak_time = 30000", "30000 ms would fit: write 30 s"),
            (line("no_load"), "no_load = [0.05, 0.14, 0.32, 0.61, 1.13]", " kW would fit: write "),
            (line("no_load"), "no_load = [0.5, 0.45, 0.4, 0.4, 0.45]", "it is the loss at zero torque, a power"),
            (line("J"), "J = 2e5", "200000 g.cm2 would fit: write 0.02 kg.m2"),
            (link, "[dc_link]\nu_dc = 4e5\nu_min = 28e4\nu_max = 45e4\n", "400000 mV would fit: write 400 V"),
            (line("u_min"), "u_min = 0.28", "0.28 kV would fit: write 280 V"),
            (line("u_max"), "u_max = 450e3", "450000 mV would fit: write 450 V"),
            ("torque = 600", "torque = 1.67", "a time constant of 1.67 ms is 600 rad/s"),
            ("efficiency = [", "loss = [", "the least loss over the power at the shaft"),
        ] {
            let error = refused(from, &format!("{to} "));
            assert!(error.contains(message), "{error}");
        }
        // Each curve in another unit.
        let curves = [("peak", 1e3), ("continuous", 1e3), ("drag", 1e3)];
        let mut text = EXAMPLE.to_owned();
        for (key, size) in curves {
            let values = line(key).split(['[', ']']).nth(1).unwrap();
            let scaled: Vec<String> =
                values.split(',').map(|x| (x.trim().parse::<f64>().unwrap() * size).to_string()).collect();
            text = text.replacen(line(key), &format!("{key} = [{}]", scaled.join(", ")), 1);
        }
        let error =
            format!("{:#}", check(&DataSheet::parse(&text, Path::new("sheet.toml")).unwrap(), None).unwrap_err());
        assert!(error.ends_with(": the torques of [torque]: 100000 mN.m would fit: write 100 N.m"), "{error}");
        // Shares that are lost.
        let lost = ["0.9", "0.8", "0.7"].iter().fold(EXAMPLE.to_owned(), |text, digits| {
            let (head, table) = text.split_at(text.find("efficiency = [").unwrap());
            format!("{head}{}", table.replacen("no_load", "# no_load", 1).replace(digits, "0.1"))
        });
        let error =
            format!("{:#}", check(&DataSheet::parse(&lost, Path::new("sheet.toml")).unwrap(), None).unwrap_err());
        assert!(error.contains("not the share that is lost"), "{error}");
    }

    #[test]
    fn the_example_passes() {
        let sheet = DataSheet::parse(EXAMPLE, Path::new("sheet.toml")).unwrap();
        check(&sheet, None).unwrap();
    }
}
