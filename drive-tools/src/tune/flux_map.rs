//! A flux map from a table that a finite-element program or a test bench gives: the energy whose gradient comes closest to the
//! currents.
//!
//! The table has the columns `i_d,i_q,psi_d,psi_q` and may have `torque`; peak values, in any order, scattered or on a grid. The
//! current of [`FluxMap`] is linear in its coefficients, so the fit is linear least squares of the currents at the flux
//! linkages of the table; no inversion of the table is needed. Where the table has no point, a penalty on third differences
//! continues the energy with constant curvature. The map is shifted so that the current is zero at the flux linkage of the
//! magnet, which becomes `motor.psi_M` of the plant.
//!
//! A table that is not reciprocal (d psi_d/d i_q = d psi_q/d i_d) has no energy: the fit leaves a residue. Swapped axes, a wrong
//! sign of i_d, and rms values instead of peak values show in this residue, in the torque or in psi_M.

mod judge;
mod squares;

use super::motor::{FluxMap as Given, MotorFile};
use super::setting::{Setting, Value};
use crate::csv::Columns;
use crate::error::{Result, WithContext, bail, ensure};
use drive::frame::Dq;
use drive::plant::flux_map::FluxMap;
use judge::{Errors, check, coverage, judge_magnet, reciprocity, torque};
use squares::{Point, solve};
use std::f64::consts::SQRT_2;

/// Minimum number of points: two for three coefficients.
const LEAST_POINTS: usize = 72;

/// A fitted map.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The map.
    pub map: FluxMap,
    /// Flux linkage of the magnet in Wb, at the temperature of the table.
    pub psi_M: f64,
    /// Settings of the plant.
    pub settings: Vec<Setting>,
    /// Deviation of the map from the table, and the range that it does not cover.
    pub notes: Vec<String>,
}

/// The map of a machine's file; `None` without `[flux_map]`.
///
/// # Errors
/// File and line, and the problem: the table cannot be read, has too few points, or belongs to another machine, with the usual
/// causes.
pub fn fit(motor: &MotorFile) -> Result<Option<Fitted>> {
    let Some(given) = &motor.data.flux_map else { return Ok(None) };
    let place = motor.place(&given.file);
    if let Some(saturation) = &motor.data.saturation {
        let first = [&saturation.s_2, &saturation.s_3, &saturation.s_dq].into_iter().flatten().next();
        let place = first.map_or_else(|| place.clone(), |x| motor.place(x));
        bail!("{place}: [saturation] and [flux_map] both define saturation: remove one of them");
    }
    let table = Columns::read(&motor.beside(given.file.get_ref())).with_context(|| place.clone())?;
    let (points, torques) = read(&table, given, motor)?;
    ensure!(
        points.len() >= LEAST_POINTS,
        "{}: has {} points; a map needs {LEAST_POINTS}, best a grid of 11 by 11 or more",
        table.file(),
        points.len()
    );
    let reciprocal = reciprocity(&points, table.file())?;
    let psi_M = *motor.data.machine.psi_M.get_ref();
    let mut map = grid(&points, psi_M);
    solve(&mut map, &points, psi_M).with_context(|| format!("{}: the points do not determine a map", table.file()))?;
    let errors = Errors::of(&map, &points, psi_M);
    check(&map, &errors, &points, table.file(), psi_M)?;
    let moved = without_current(&map);
    let found = psi_M + moved;
    (map.d_min, map.d_max) = (map.d_min - moved, map.d_max - moved);
    judge_magnet(found, motor)?;
    let mut notes = vec![errors.text(&points)];
    notes.extend(reciprocal);
    notes.extend(torque(&points, &torques, motor, table.file())?);
    notes.extend(coverage(&points, motor));
    let settings = settings(&map, found, motor, given, &table)?;
    Ok(Some(Fitted { map, psi_M: found, settings, notes }))
}

/// The points of the table, and their torques (N.m) if it has a column `torque`.
fn read(table: &Columns, given: &Given, motor: &MotorFile) -> Result<(Vec<Point>, Vec<f64>)> {
    let [i_d, i_q, psi_d, psi_q] = ["i_d", "i_q", "psi_d", "psi_q"].map(|name| table.column(name));
    let columns = [i_d?, i_q?, psi_d?, psi_q?];
    let scale = match &given.scale {
        None => 1.0,
        Some(name) => match name.get_ref().as_str() {
            "peak" => 1.0,
            "rms" => SQRT_2,
            other => bail!("{}: scale = \"{other}\" must be \"peak\" or \"rms\"", motor.place(name)),
        },
    };
    let turned = match &given.convention {
        None => false,
        Some(name) => match name.get_ref().as_str() {
            "pm" => false,
            "syr" => true,
            other => bail!(
                "{}: convention = \"{other}\" must be \"pm\" (d-axis on the magnet) or \"syr\" (magnet on the negative q-axis)",
                motor.place(name)
            ),
        },
    };
    let point = |row: &[f64]| {
        let [i_d, i_q, psi_d, psi_q] = columns.map(|column| scale * row[column]);
        let axes = |d: f64, q: f64| if turned { Dq::new(-q, d) } else { Dq::new(d, q) };
        Point { i: axes(i_d, i_q), psi: axes(psi_d, psi_q) }
    };
    let points = table.rows().iter().map(|(_, row)| point(row)).collect();
    let torques = table.find("torque").map_or_else(Vec::new, |c| table.rows().iter().map(|(_, row)| row[c]).collect());
    Ok((points, torques))
}

/// A map without coefficients whose grid reaches the points and psi = 0.
fn grid(points: &[Point], psi_M: f64) -> FluxMap {
    let x = |p: &Point| p.psi.d() - psi_M;
    let (least, greatest) = points.iter().fold((-psi_M, 0.0_f64), |(a, b), p| (a.min(x(p)), b.max(x(p))));
    let q_max = points.iter().fold(0.0_f64, |most, p| most.max(p.psi.q().abs()));
    let margin = 0.01 * (greatest - least);
    // A grid that does not end at 0, also with points at psi_d <= psi_M only.
    let d_max = (greatest + margin).max(0.1 * (0.0 - least));
    FluxMap { used: true, d_min: least - margin, d_max, q_max: 1.01 * q_max, ..FluxMap::default() }
}

/// The flux linkage (Wb) on the d-axis, in excess of the machine file's, at which the map's current is zero: i_d rises along
/// the axis.
fn without_current(map: &FluxMap) -> f64 {
    let (mut low, mut high) = (map.d_min, map.d_max);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        *(if map.current(Dq::new(middle, 0.0)).d() < 0.0 { &mut low } else { &mut high }) = middle;
    }
    // The last bit: with Newton's method, once.
    let x = 0.5 * (low + high);
    x - map.current(Dq::new(x, 0.0)).d() / map.hessian(Dq::new(x, 0.0))[0]
}

/// The settings of the plant.
#[expect(non_snake_case, reason = "the symbols of the model")]
fn settings(map: &FluxMap, psi_M: f64, motor: &MotorFile, given: &Given, table: &Columns) -> Result<Vec<Setting>> {
    let origin = Some(given.file.span().start);
    let setting = |name, value, rule: &str| Setting { name, value, rule: rule.into(), origin };
    let (mut psi_M, mut all) = (psi_M, Vec::new());
    let warmer = given.temperature.as_ref().map_or(0.0, |t| t.get_ref() - 20.0);
    if let (Some(temperature), true) = (&given.temperature, warmer != 0.0) {
        let Some(alpha) = &given.alpha else {
            bail!(
                "{}: a table of {} degC needs the temperature coefficient of the magnet too: alpha = -1.1e-3 in [flux_map] for NdFeB",
                motor.place(temperature),
                temperature.get_ref()
            );
        };
        psi_M /= 1.0 + alpha.get_ref() * warmer;
        all.push(setting("magnet.alpha", Value::Real(*alpha.get_ref()), "as given"));
    }
    all.extend([
        setting("motor.psi_M", Value::Real(psi_M), "where the map has no current, at 20 degC"),
        setting("flux_map.use", Value::Boolean(true), "a table is given"),
        setting("flux_map.d_min", Value::Real(map.d_min), "the table's flux linkages, and psi = 0"),
        setting("flux_map.d_max", Value::Real(map.d_max), "the table's flux linkages"),
        setting("flux_map.q_max", Value::Real(map.q_max), "the table's flux linkages"),
        setting(
            "flux_map.w",
            Value::Reals(map.w.as_flattened().to_vec()),
            &format!("least squares of {}", table.file()),
        ),
    ]);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive::plant::machine::{self, Magnetics};
    use std::fmt::Write as _;
    use std::path::Path;

    const MOTOR: &str = include_str!("../../../motors/traction-63kw.toml");

    /// The currents (A) of a machine that saturates, at a flux linkage (Wb) in excess of the magnet's: reciprocal.
    fn current(x: Dq, [L_d, L_q]: [f64; 2]) -> Dq {
        let (d, q) = (x.d(), x.q());
        Dq::new(d / L_d + 2e4 * (d * d * d + d * q * q), q / L_q + 2e4 * (q * q * q + d * d * q))
    }

    /// The motor file with a table beside it, whose lines follow from current (A) and flux linkage (Wb).
    struct Bench {
        folder: tempfile::TempDir,
        motor: String,
    }

    impl Bench {
        fn new(keys: &str) -> Self {
            let motor = format!("{MOTOR}\n[flux_map]\nfile = \"map.csv\"\n{keys}\n");
            Self { folder: tempfile::tempdir().unwrap(), motor }
        }

        fn machine(&self) -> (f64, [f64; 2], f64) {
            let machine = MotorFile::parse(&self.motor, Path::new("m.toml")).unwrap().data.machine;
            let n_p = f64::from(*machine.n_p.get_ref());
            (*machine.psi_M.get_ref(), [*machine.L_d.get_ref(), *machine.L_q.get_ref()], n_p)
        }

        fn fit_text(&self, text: &str) -> Result<Fitted> {
            std::fs::write(self.folder.path().join("map.csv"), text).unwrap();
            let motor = MotorFile::parse(&self.motor, &self.folder.path().join("m.toml"))?;
            fit(&motor).map(|found| found.unwrap())
        }

        fn fit(&self, header: &str, line: impl Fn(Dq, Dq) -> Vec<f64>) -> Result<Fitted> {
            let (psi_M, inductances, _) = self.machine();
            let mut text = format!("# made for a test\n{header}\n");
            for m in 0..15_u32 {
                for n in 0..15_u32 {
                    let x = Dq::new(0.015 * f64::from(m) - 0.13, 0.02 * (f64::from(n) - 7.0));
                    let cells = line(current(x, inductances), x + Dq::new(psi_M, 0.0));
                    let cells: Vec<_> = cells.iter().map(f64::to_string).collect();
                    writeln!(text, "{}", cells.join(",")).unwrap();
                }
            }
            self.fit_text(&text)
        }
    }

    const HEADER: &str = "i_d,i_q,psi_d,psi_q";

    fn line(i: Dq, psi: Dq) -> Vec<f64> {
        vec![i.d(), i.q(), psi.d(), psi.q()]
    }

    #[test]
    fn the_map_has_the_currents_of_its_table() {
        let bench = Bench::new("");
        let (psi_M, inductances, n_p) = bench.machine();
        let torque = |i: Dq, psi: Dq| [line(i, psi), vec![1.5 * n_p * psi.cross(i)]].concat();
        let fitted = bench.fit("i_d,i_q,psi_d,psi_q,torque", torque).unwrap();
        assert!((fitted.psi_M / psi_M - 1.0).abs() < 1e-4, "{} Wb", fitted.psi_M);
        assert!(fitted.map.current(Dq::ZERO).magnitude() < 1e-9);
        // Also between the points of the table.
        for (d, q) in [(-0.1, 0.05), (0.03, -0.11), (0.0, 0.07)] {
            let (got, wanted) = (fitted.map.current(Dq::new(d, q)), current(Dq::new(d, q), inductances));
            assert!((got - wanted).magnitude() < 0.01 * wanted.magnitude(), "{got:?}, {wanted:?}");
        }
        let notes = fitted.notes.join("\n");
        assert!(notes.contains("225 points") && notes.contains("1.0000 times 1.5 n_p psi x i"), "{notes}");
    }

    #[test]
    fn the_values_of_the_table_may_be_rms_or_turned() {
        let plain = Bench::new("").fit(HEADER, line).unwrap();
        let same = |fitted: Fitted| {
            let error = fitted.map.current(Dq::new(-0.05, 0.06)) - plain.map.current(Dq::new(-0.05, 0.06));
            assert!(error.magnitude() < 1e-6 && (fitted.psi_M - plain.psi_M).abs() < 1e-9, "{error:?}");
        };
        same(
            Bench::new("scale = \"rms\"")
                .fit(HEADER, |i, psi| line(i, psi).iter().map(|x| x / SQRT_2).collect())
                .unwrap(),
        );
        let turned = |i: Dq, psi: Dq| vec![i.q(), -i.d(), psi.q(), -psi.d()];
        same(Bench::new("convention = \"syr\"").fit(HEADER, turned).unwrap());
        // Another order of the columns.
        same(Bench::new("").fit("psi_q,i_d,psi_d,i_q", |i, psi| vec![psi.q(), i.d(), psi.d(), i.q()]).unwrap());
    }

    #[test]
    fn a_table_on_a_grid_of_currents_says_whether_it_is_reciprocal() {
        let bench = Bench::new("");
        let (psi_M, inductances, _) = bench.machine();
        let table = |shift: f64| {
            let mut text = format!("{HEADER}\n");
            for m in 0..13_u32 {
                for n in 0..13_u32 {
                    let i = Dq::new(30.0 * f64::from(m) - 300.0, 50.0 * (f64::from(n) - 6.0));
                    let mut x = Dq::ZERO;
                    for _ in 0..60 {
                        let rest = i - current(x, inductances);
                        x += Dq::new(rest.d() * inductances[0], rest.q() * inductances[1]) * 0.2;
                    }
                    let psi = x + Dq::new(psi_M, 0.0);
                    writeln!(text, "{},{},{},{}", i.d(), i.q(), psi.d() + shift * i.q(), psi.q()).unwrap();
                }
            }
            text
        };
        let notes = bench.fit_text(&table(0.0)).unwrap().notes.join("\n");
        assert!(notes.contains("which reciprocity makes equal, differ by 0.0"), "{notes}");
        let error = bench.fit_text(&table(3e-5)).unwrap_err().to_string();
        assert!(error.contains("d psi_d/d i_q and d psi_q/d i_d differ by 0.03"), "{error}");
    }

    #[test]
    fn a_table_of_another_machine_is_refused() {
        let bench = Bench::new("");
        let n_p = bench.machine().2;
        let refused = |bench: &Bench, header: &str, f: &dyn Fn(Dq, Dq) -> Vec<f64>| {
            format!("{:#}", bench.fit(header, f).unwrap_err())
        };
        let swapped = refused(&bench, HEADER, &|i, psi| vec![i.d(), i.q(), psi.q(), psi.d()]);
        assert!(swapped.contains("no energy has these currents") && swapped.contains("swapped axes"), "{swapped}");
        let mirrored = refused(&bench, HEADER, &|i, psi| vec![-i.d(), i.q(), psi.d(), psi.q()]);
        assert!(mirrored.contains("the other sign of i_d"), "{mirrored}");
        let rms = refused(&bench, HEADER, &|i, psi| line(i, psi).iter().map(|x| x / SQRT_2).collect());
        assert!(rms.contains("one of them is an rms value"), "{rms}");
        let torque = |i: Dq, psi: Dq| [line(i, psi), vec![3.0 * n_p * psi.cross(i)]].concat();
        let torque = refused(&bench, "i_d,i_q,psi_d,psi_q,torque", &torque);
        assert!(torque.contains("are 2.000 times 1.5 n_p psi x i"), "{torque}");
        let missing = refused(&bench, "i_d,i_q,psi_d,psi", &line);
        assert!(missing.contains("map.csv: has no column psi_q; it has i_d, i_q, psi_d, psi"), "{missing}");
        let few = format!("{:#}", bench.fit_text("i_d,i_q,psi_d,psi_q\n0,0,0.1,0\n").unwrap_err());
        assert!(few.contains("has 1 points; a map needs 72"), "{few}");
        let warm = refused(&Bench::new("temperature = 80.0"), HEADER, &line);
        assert!(warm.contains("needs the temperature coefficient of the magnet"), "{warm}");
        for (keys, message) in [
            ("scale = \"RMS\"", "scale = \"RMS\" must be \"peak\" or \"rms\""),
            ("convention = \"x\"", "convention = \"x\" must be \"pm\""),
        ] {
            let error = refused(&Bench::new(keys), HEADER, &line);
            assert!(error.contains(message) && error.contains("m.toml:"), "{error}");
        }
        let both = Bench { motor: format!("{}\n[saturation]\ns_2 = 40.0\n", bench.motor), ..Bench::new("") };
        assert!(refused(&both, HEADER, &line).contains("remove one of them"));
    }

    #[test]
    fn the_drive_is_tuned_with_its_map() {
        let bench = Bench::new("");
        let fitted = bench.fit(HEADER, line).unwrap();
        let motor = MotorFile::parse(&bench.motor, &bench.folder.path().join("m.toml")).unwrap();
        let tuned = super::super::rules::tune(&motor).unwrap();
        let pair = tuned.pair();
        let parameters = &pair.plant.model.parameters;
        assert_eq!(parameters.flux_map, fitted.map);
        assert!((parameters.motor.psi_M - fitted.psi_M).abs() < 1e-15);
        assert!(matches!(parameters.magnetics(), Magnetics::Map(_)));
        let i = machine::current(&parameters.motor, parameters.magnetics(), Dq::new(fitted.psi_M, 0.0));
        assert!(i.magnitude() < 1e-9);
    }
}
