//! The efficiency map of `fmu map`: its points, reading between them, the energy of a driving cycle, the files, and refused
//! requests.
#![allow(missing_docs, non_snake_case)]

use drive::plant::losses::Losses;
use drive::steady::{Region, Steady};
use drive_tools::map::cycle::{self, Cycle};
use drive_tools::map::request::{Request, ZERO_CELSIUS};
use drive_tools::map::sheet::{self, Axes, Sheet};
use drive_tools::map::table::Table;
use drive_tools::map::{self, Map, files, page, report, verify};
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

const RPM: f64 = PI / 30.0;
const T_20: f64 = 20.0 + ZERO_CELSIUS;
const KWH: f64 = 1.0 / 3.6e6;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn text(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap()
}

fn motor(name: &str) -> MotorFile {
    MotorFile::read(&root().join(format!("motors/{name}.toml"))).unwrap()
}

/// The traction machine with exact estimates and a controller without a sample period: the figures of an independent
/// calculation.
fn traction() -> Steady {
    let drive = map::drive(&rules::tune(&motor("traction-63kw")).unwrap());
    let mut controller = drive.controller.clone();
    controller.motor.clone_from(&drive.plant.motor);
    Steady::new(drive.plant, controller)
}

fn sheet(drive: &Steady, axes: &Axes, u_dc: f64, T: f64) -> Sheet {
    sheet::all(drive, axes, &[u_dc], &[T]).remove(0)
}

fn five(l: &Losses) -> [f64; 5] {
    [l.cu, l.iron, l.cond, l.sw, l.friction]
}

#[test]
fn the_cycle_is_that_of_the_examples() {
    assert_eq!(cycle::VEHICLE, text("examples/vehicle/vehicle.toml"));
    assert_eq!(cycle::CYCLE, text("examples/vehicle/cycle.csv"));
    for (vehicle, cycle, message) in [
        ("mass = 1", cycle::CYCLE, "the vehicle"),
        (cycle::VEHICLE, "0,0\n10,x", "the driving cycle: line 2: 10,x must be time (s) and speed (km/h)"),
        (cycle::VEHICLE, "0,0\n 5,nan", "line 2: 5,nan must be"),
        (cycle::VEHICLE, "0,0\n5,-3", "line 2: the speed -3 must be at least 0"),
        (cycle::VEHICLE, "0,0\n-5,3", "line 2: the time -5 s does not increase"),
        (cycle::VEHICLE, "0,0\n0,1", "the time 0 s does not increase"),
        (cycle::VEHICLE, "0,0", "no two times"),
        (cycle::VEHICLE, "time,speed [kn]\n0,0\n9,9", "line 1: the unit kn of a speed must be km/h, m/s or mph"),
        (cycle::VEHICLE, "time,speed\n0,0\n900,900", "line 3: vehicles are slower than 250 m/s"),
        (
            cycle::VEHICLE,
            "time,speed\n0,0\n0.1,30",
            "line 3: from 0 s to 0.1 s, vehicles accelerate less than 83.33 m/s2",
        ),
    ] {
        let error = format!("{:#}", Cycle::new(vehicle, cycle).unwrap_err());
        assert!(error.contains(message), "{error}");
    }
    for (from, to, message) in [
        ("mass = 1300.0", "mass = -1.0", "the vehicle: mass = -1 must be greater than 0"),
        ("mass = 1300.0", "mass = 1.3", "1.3 t would fit: write 1300 kg"),
        ("wheel_radius = 0.30", "wheel_radius = 300.0", "300 mm would fit: write 0.3 m"),
        ("wheel_radius = 0.30", "wheel_radius = 30.0", "30 cm would fit: write 0.3 m"),
        ("rolling_resistance = 0.010", "rolling_resistance = 1.0", "1 % would fit: write 0.01"),
        ("rotor_inertia = 0.03883", "rotor_inertia = 388.3", "388.3 kg.cm2 would fit: write 0.03883 kg.m2"),
        ("gear_ratio = 9.0", "gear_ratio = 0.0", "gear_ratio = 0 must be greater than 0"),
    ] {
        let error = format!("{:#}", Cycle::new(&cycle::VEHICLE.replacen(from, to, 1), cycle::CYCLE).unwrap_err());
        assert!(error.contains(message), "{error}");
    }
    let [km_h, m_s, none] = ["speed [km/h]\n0,0\n10,36", "speed [m/s]\n0,0\n10,10", "speed\n0,0\n10,36"]
        .map(|text| Cycle::new(cycle::VEHICLE, &format!("time,{text}")).unwrap().points().collect::<Vec<_>>());
    assert!(m_s == km_h && none == km_h && m_s.len() == 10);
}

/// Exact energies within 0.1 %, and the errors of tables of 11 x 11 to 47 x 41 points over 0 to 11 500 rpm.
#[test]
fn the_energy_of_the_cycle_exactly_and_from_tables() {
    let (drive, cycle) = (traction(), Cycle::example().unwrap());
    let exact = cycle
        .energy(|speed, tau| {
            let point = sheet::at(&drive, speed, 400.0, T_20).by_shaft(tau)?;
            Some((point.powers.p_in, point.powers.losses))
        })
        .unwrap();
    let [sum, out, back] = [exact.sum(), exact.link[0], exact.link[1]].map(|x| x * KWH);
    println!("{sum} kWh, {out}, {back}; {:?}", five(&exact.losses).map(|x| x * KWH));
    for (got, figure) in [(sum, 1.322_449), (out, 1.497_219), (back, -0.174_770)] {
        assert!((got / figure - 1.0).abs() < 1e-5, "{got} kWh, not {figure} kWh");
    }
    // 0.014_992 with the machine's voltage in place of the legs' voltage, which includes the drop of 0.9 to 1.4 V: 1e-4 of the
    // conduction loss.
    for (got, figure) in five(&exact.losses).iter().zip([0.015_373, 0.027_246, 0.014_990, 0.013_319, 0.053_891]) {
        assert!((got * KWH / figure - 1.0).abs() < 1e-4, "{} kWh, not {figure} kWh", got * KWH);
    }
    for (grid, percent) in [((11, 11), 0.177), ((21, 21), 0.049), ((31, 31), 0.024), ((47, 41), 0.010)] {
        let axes = Axes::new(grid, 11_500.0 * RPM);
        let sheet = sheet(&drive, &axes, 400.0, T_20);
        let table = Table::new(&axes, &sheet, &drive.plant);
        let read = cycle.energy(|speed, tau| table.read(speed, tau).map(|r| (r.p_in, r.losses))).unwrap();
        let error = 100.0 * (read.sum() / exact.sum() - 1.0);
        println!("{grid:?}: {error:+.4} %");
        assert!((error - percent).abs() < 4e-3, "{grid:?}: {error:+.4} %, not {percent:+} %");
    }
}

/// Without load the table gives the losses of the points, where an interpolated efficiency would be 0/0; it is exact on the
/// grid, and undefined outside the envelope.
#[test]
fn a_table_reads_losses() {
    let (drive, axes) = (traction(), Axes::new((47, 41), 11_500.0 * RPM));
    let sheet = sheet(&drive, &axes, 400.0, T_20);
    let table = Table::new(&axes, &sheet, &drive.plant);
    for (k, point) in sheet.points.iter().enumerate().step_by(13) {
        let (speed, point) = (axes.speed[k / 41], point.unwrap());
        let read = table.read(speed, point.powers.tau_shaft).unwrap();
        assert!((read.p_in - point.powers.p_in).abs() < 1e-9 * (1.0 + point.powers.p_in.abs()), "{speed} rad/s");
        assert!((read.efficiency - point.efficiency).abs() < 1e-9);
        // The mirror image.
        assert!(speed == 0.0 || table.read(-speed, -point.powers.tau_shaft) == Some(read));
    }
    for rpm in [333.0, 4567.0, 9999.0] {
        let idle = table.read(rpm * RPM, 0.0).unwrap();
        let exact = sheet::at(&drive, rpm * RPM, 400.0, T_20).by_shaft(0.0).unwrap();
        let error = idle.losses.sum() / exact.powers.losses.sum() - 1.0;
        assert!(idle.efficiency == 0.0 && (0.0..0.02).contains(&error), "{rpm} rpm: {error}");
        let [low, high] = table.limits(rpm * RPM).unwrap();
        assert!(table.read(rpm * RPM, 1.001 * high).is_none() && table.read(rpm * RPM, 1.001 * low).is_none());
    }
    assert!(table.read(11_501.0 * RPM, 0.0).is_none() && table.read(f64::NAN, 0.0).is_none());
    assert!(table.read(100.0, f64::NAN).is_none());
}

/// At voltages and temperatures between the table's: the losses at the cycle's points, compared with the exact ones.
#[test]
fn a_table_is_read_at_another_voltage_and_temperature() {
    let (drive, axes) = (traction(), Axes::new((47, 41), 16_000.0 * RPM));
    let sheet = sheet(&drive, &axes, 400.0, T_20);
    let table = Table::new(&axes, &sheet, &drive.plant);
    for rpm in [2000.0, 5000.0, 8000.0, 10_500.0] {
        for share in [-0.7, -0.3, 0.3, 0.7] {
            let speed = rpm * RPM;
            let at = sheet::at(&drive, speed, 320.0, T_20);
            let tau = share * sheet::ends(&at)[1].unwrap().powers.tau_shaft;
            let exact = five(&at.by_shaft(tau).unwrap().powers.losses);
            let read = five(&table.read_at(speed, tau, 320.0, T_20).unwrap().losses);
            let errors: Vec<f64> = read.iter().zip(exact).map(|(read, exact)| 100.0 * (read / exact - 1.0)).collect();
            println!("{rpm} rpm, {tau:.1} N.m: {errors:+.2?} %");
            assert!(errors.iter().all(|error| error.abs() < 1.0), "{rpm} rpm, {tau} N.m: {errors:+.2?} %");
        }
    }
    // Over the cycle: copper within +0.1 to +1.1 %, and without the scaling of the speed far off.
    let cycle = Cycle::example().unwrap();
    let exact = |speed, tau| Some((0.0, sheet::at(&drive, speed, 320.0, T_20).by_shaft(tau)?.powers.losses));
    let scaled = |speed, tau| Some((0.0, table.read_at(speed, tau, 320.0, T_20)?.losses));
    let plain = |speed, tau| Some((0.0, table.read(speed, tau)?.losses));
    let [exact, scaled, plain] = [cycle.energy(exact), cycle.energy(scaled), cycle.energy(plain)].map(Result::unwrap);
    let off = |energy: cycle::Energy| 100.0 * (energy.losses.cu / exact.losses.cu - 1.0);
    println!("copper over the cycle: {:+.3} %, at 400 V {:+.3} %", off(scaled), off(plain));
    assert!((0.1..1.1).contains(&off(scaled)) && off(plain) < -10.0);
    let plain = table.read(3000.0 * RPM, 80.0).unwrap();
    assert!(same(&table.read_at(3000.0 * RPM, 80.0, 400.0, T_20).unwrap().losses, &plain.losses, 2e-3));
    let hot = table.read_at(3000.0 * RPM, 80.0, 400.0, T_20 + 100.0).unwrap();
    assert!((hot.losses.cu / plain.losses.cu - 1.393).abs() < 1e-9, "copper grows with its resistance");
    assert_eq!(hot.losses.sw.to_bits(), plain.losses.sw.to_bits());
}

fn same(a: &Losses, b: &Losses, within: f64) -> bool {
    five(a).iter().zip(five(b)).all(|(a, b)| (a / b - 1.0).abs() < within)
}

fn small(name: &str, request: Request) -> Map {
    map::make(&motor(name), &Request { grid: (9, 7), ..request }).unwrap()
}

/// Every point has the torque of its grid position, and its powers balance; the sheets are ordered by voltage and temperature.
#[test]
fn the_points_of_a_map() {
    let request = Request { u_dc: vec![300.0, 400.0], T: vec![20.0, 120.0], verify: 1, ..Request::default() };
    let map = small("traction-63kw", request);
    let conditions: Vec<(f64, f64)> = map.sheets.iter().map(|s| (s.u_dc, s.T - ZERO_CELSIUS)).collect();
    assert_eq!(conditions, [(300.0, 20.0), (300.0, 120.0), (400.0, 20.0), (400.0, 120.0)]);
    assert_eq!((map.shown, map.verified.points), (2, 4));
    assert!((map.axes.speed[8] - 12_000.0 * RPM).abs() < 1e-6, "twice the rated speed: {}", map.axes.speed[8]);
    for sheet in &map.sheets {
        for (k, point) in sheet.points.iter().enumerate() {
            let (x, speed) = (map.axes.x[k % 7], map.axes.speed[k / 7]);
            let point = point.unwrap();
            let limit = sheet.limits[k / 7][usize::from(x > 0.0)].abs();
            assert!((point.powers.tau_shaft - x * limit).abs() < 1e-8 * limit, "{speed} rad/s, {x}: {point:?}");
            let missing = point.powers.p_in - point.powers.tau_shaft * speed - point.powers.losses.sum();
            assert!(missing.abs() < 1e-9 * (1.0 + point.powers.p_in.abs()), "{missing} W");
            assert!((0.0..1.0).contains(&point.efficiency));
        }
    }
    // Temperature costs copper, voltage leaves torque at speed.
    let at = |sheet: usize| map.sheets[sheet].limits[6][1];
    assert!(at(0) < at(2) && at(2) > at(3), "{} {} {}", at(0), at(2), at(3));
    assert!(map.notes.is_empty(), "{:?}", map.notes);
    let bare = small("reference", Request { T: vec![80.0], ..Request::default() });
    let notes = bare.notes.join("\n");
    for part in ["no [iron]: the map omits the losses of the iron", "no [inverter]", "no [temperature]"] {
        assert!(notes.contains(part), "{notes}");
    }
    let regions: Vec<&str> =
        map.sheets.iter().flat_map(|s| s.points.iter().flatten()).map(|p| p.region.name()).collect();
    for region in [Region::Mtpa, Region::Weakening, Region::Limit] {
        assert!(regions.contains(&region.name()), "{region:?}");
    }
}

/// Machines of every class agree with the running drive.
#[test]
fn maps_agree_with_the_running_drive() {
    for name in ["reference", "ipmsm-2.2kw", "spindle-40krpm", "pump-12v", "traction-63kw"] {
        let verified = map::make(&motor(name), &Request { grid: (21, 21), ..Request::default() }).unwrap().verified;
        println!("{name}: {verified:?}");
        assert!(verified.points == 5 && verified.power < 1e-3 && verified.loss < 1e-2, "{name}: {verified:?}");
    }
}

/// If a map differs from the running drive, a message names the point and both numbers, and how to skip the comparison.
#[test]
fn a_map_that_is_wrong_says_so() {
    let map = small("traction-63kw", Request { verify: 0, ..Request::default() });
    let refused = |change: &dyn Fn(&mut drive::steady::Point)| {
        let mut sheet = map.sheets[0].clone();
        sheet.points.iter_mut().flatten().for_each(change);
        let found = verify::verify(&map.drive, &map.axes, &[sheet], 3).unwrap();
        assert_eq!(found.apart.len(), 3);
        let report = report::of(&Map { verified: found, ..map.clone() }, &Cycle::example().unwrap(), true);
        let [.., count, one, _, _] = &report.notes[..] else { panic!("{:?}", report.notes) };
        assert!(count.contains("3 of 3 points differ") && count.contains("--verify 0"), "{count}");
        one.clone()
    };
    let power = refused(&|point| point.powers.p_in *= 1.005);
    for part in ["the map differs from PmsmDrive at", " % of ", " W apart, allowed 0.1 %"] {
        assert!(power.contains(part), "{power}");
    }
    let loss = refused(&|point| point.powers.losses.sw *= 1.02);
    for part in ["rpm", "N.m, 400 V, 20.0 degC: p_sw is ", " W, not ", "apart, allowed 1 %"] {
        assert!(loss.contains(part) && loss.lines().count() == 1, "{loss}");
    }
    assert_eq!(verify::verify(&map.drive, &map.axes, &map.sheets, 0).unwrap().points, 0);
}

#[test]
fn what_has_no_map_is_refused() {
    let request = Request::default();
    let error = |from: &str, to: &str, request: &Request| {
        let text = text("motors/traction-63kw.toml");
        assert!(text.contains(from), "{from}");
        let motor = MotorFile::parse(&text.replacen(from, to, 1), Path::new("m.toml")).unwrap();
        map::make(&motor, request).unwrap_err().to_string()
    };
    // The friction leaves 104.9 of the 105.9 N.m.
    let message = error("torque = 100.0 ", "torque = 105.5 ", &request);
    assert!(message.starts_with("m.toml:21:10: at rating.speed, the shaft has at most 10"), "{message}");
    assert!(message.contains("not the 105.5 N.m of rating.torque: lower the speed or the torque"), "{message}");
    let message = error("torque = 100.0 ", "torque = 500.0 ", &request);
    assert!(message.starts_with("m.toml:") && message.contains("rating"), "{message}");
    let cold = Request { T: vec![-250.0], ..Request::default() };
    let message = error("winding = 3.93e-3", "winding = 3.93e-3", &cold);
    assert!(message.contains("--T -250: with the coefficients of [temperature], R_s = -"), "{message}");
    let negative = Request { u_dc: vec![400.0, -1.0], ..Request::default() };
    assert!(error("torque = 100.0 ", "torque = 100.0 ", &negative).contains("--u-dc -1: must be greater than 0 V"));
}

/// The columns of the CSV files and the arrays of the npz file, with the values of the points.
#[test]
fn the_files() {
    let request = Request { u_dc: vec![400.0, 350.0], T: vec![20.0], verify: 0, ..Request::default() };
    let map = small("traction-63kw", request);
    let csv = files::map_csv(&map);
    let mut lines = csv.lines();
    assert_eq!(
        lines.next().unwrap(),
        "speed,torque,u_dc,T_winding,T_magnet,i_d,i_q,u_share,p_in,p_mech,p_cu,p_iron,p_cond,p_sw,p_friction,efficiency,region"
    );
    assert_eq!(lines.clone().count(), 2 * 9 * 7);
    for (line, point) in lines.zip(map.sheets.iter().flat_map(|sheet| sheet.points.iter().flatten())) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |k: usize| cells[k].parse::<f64>().unwrap();
        assert_eq!((cells.len(), cells[16]), (17, point.region.name()));
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-8 * b.abs();
        assert!(near(number(8), point.powers.p_in) && near(number(15), point.efficiency), "{line}");
    }
    let envelope = files::envelope_csv(&map);
    assert!(envelope.starts_with("speed,u_dc,T_winding,T_magnet,tau_min,tau_max,region_min,region_max\n0,400,293.15,"));
    assert_eq!(envelope.lines().count(), 1 + 2 * 9);

    let mut zip = zip::ZipArchive::new(Cursor::new(files::npz(&map).unwrap())).unwrap();
    let mut array = |name: &str| {
        let mut bytes = Vec::new();
        zip.by_name(&format!("{name}.npy")).unwrap().read_to_end(&mut bytes).unwrap();
        let head = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let data = bytes.split_off(10 + head);
        (String::from_utf8_lossy(&bytes[10..]).into_owned(), data)
    };
    let reals = |data: &[u8]| data.chunks(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect::<Vec<f64>>();
    let (head, data) = array("p_in");
    assert!(head.contains("'<f8'") && head.contains("(2, 1, 9, 7,)"), "{head}");
    let all = map.sheets.iter().flat_map(|sheet| &sheet.points).map(|p| p.unwrap().powers.p_in);
    assert_eq!(reals(&data), all.collect::<Vec<f64>>());
    assert_eq!(reals(&array("T").1), [293.15]);
    assert_eq!(reals(&array("u_dc").1), [400.0, 350.0]);
    assert_eq!(reals(&array("x").1).len(), 7);
    let (head, data) = array("tau_max");
    assert!(head.contains("(2, 1, 9,)") && reals(&data)[0].to_bits() == map.sheets[0].limits[0][1].to_bits(), "{head}");
    let (head, data) = array("region");
    assert!(head.contains("'<U5'") && data.len() == 2 * 9 * 7 * 20, "{head}");
    assert_eq!(files::npz(&map).unwrap(), files::npz(&map).unwrap());
}

/// The page and the picture are self-contained, and have a picture and a choice for each condition.
#[test]
fn the_page() {
    let request = Request { u_dc: vec![350.0, 400.0], verify: 0, ..Request::default() };
    let map = small("traction-63kw", request);
    let report = report::of(&map, &Cycle::example().unwrap(), true);
    let html = page::page(&map, &report).unwrap();
    for part in ["Efficiency map of traction-63kw", "<option value=\"1\" selected>400 V, 20 °C</option>", "map.npz"] {
        assert!(html.contains(part), "{part}");
    }
    assert_eq!(html.matches("<svg class=\"plot chart\"").count(), 2);
    assert_eq!(html.matches("NaN").count() + html.matches("inf\"").count(), 0);
    let text = report.text();
    for part in
        ["Best point of the motor", "losses in W at 6000 rpm, 100 N.m", "energy in kWh", "no point was compared"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(text.contains("350 V, 20 °C: the rated point is out of reach"), "{text}");
}

/// A table of a machine that saturates: the map agrees with the running drive, and reports the cost of constant inductances.
#[test]
fn a_machine_with_a_flux_map() {
    let dir = std::env::temp_dir().join(format!("fmu-map-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let (L_d, L_q, psi_M, s_q) = (0.37e-3, 1.2e-3, 66e-3, 9e3);
    let mut table = String::from("i_d,i_q,psi_d,psi_q\n");
    for m in 0..17 {
        for n in 0..17 {
            let (x, q) = (-0.15 + 0.25 / 16.0 * f64::from(m), -0.28 + 0.56 / 16.0 * f64::from(n));
            let (i_d, i_q) = (x / L_d, q / L_q + s_q * q * q * q);
            writeln!(table, "{i_d},{i_q},{},{q}", x + psi_M).unwrap();
        }
    }
    std::fs::write(dir.join("table.csv"), table).unwrap();
    let path = dir.join("m.toml");
    std::fs::write(
        &path,
        text("motors/traction-63kw.toml").replace("torque = 100.0 ", "torque = 80.0 ")
            + "\n[flux_map]\nfile = \"table.csv\"\n",
    )
    .unwrap();
    let file = MotorFile::read(&path);
    let map = file.and_then(|file| map::make(&file, &Request { grid: (21, 21), ..Request::default() }));
    std::fs::remove_dir_all(&dir).unwrap();
    let map = map.unwrap_or_else(|error| panic!("{error:#}"));
    assert!(map.drive.plant.flux_map.used && map.verified.points == 5, "{:?}", map.verified);
    let cost = map::linear::cost(&map.drive, map.rated, 400.0, T_20).unwrap();
    println!("{:?}: {cost:?}", map.verified);
    assert!(cost.torque < 0.99 * map.rated[1], "saturation of the q-axis takes torque: {} N.m", cost.torque);
    assert!((cost.now.powers.tau_shaft - cost.best.powers.tau_shaft).abs() < 1e-6);
    assert!(cost.best.powers.losses.sum() <= cost.now.powers.losses.sum());
    let csv = files::flux_map_csv(&map);
    assert!(csv.starts_with("psi_d,psi_q,i_d,i_q\n") && csv.lines().count() == 1 + 10 * 8, "{csv}");
    let rows = csv.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>());
    for row in rows.filter(|row| row[1] < 0.27 && row[0] > -0.08 && row[0] < 0.16) {
        let wanted = [(row[0] - psi_M) / L_d, row[1] / L_q + s_q * row[1].powi(3)];
        assert!((row[2] - wanted[0]).abs() < 3.0 && (row[3] - wanted[1]).abs() < 3.0, "{row:?}, not {wanted:?}");
    }
    let report = report::of(&map, &Cycle::example().unwrap(), true).text();
    assert!(
        report.contains("the controller computes with constant inductances: a reference of 80 N.m gives"),
        "{report}"
    );
    assert!(
        files::all(&map, &report::of(&map, &Cycle::example().unwrap(), true))
            .unwrap()
            .iter()
            .any(|f| f.0 == "flux_map.csv")
    );
    assert!(map::linear::cost(&traction(), map.rated, 400.0, T_20).is_none());
}
