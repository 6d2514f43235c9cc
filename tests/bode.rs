//! `fmu bode` against theory: the sampled loops of a small servo motor, its mechanical impedance and the admittance of its DC link.
//!
//! The machine has 4 pole pairs, 0.36 Ohm, 0.2 mH and 0.0064 Wb; a sensor supplies the angle. At standstill, the q axis with the shaft is
//! the continuous system x' = A x + B u + E tau, x = (i_q, w), with the voltage u held over T_s and one sample late. Derived here:
//!
//! ```text
//! at the samples                  z x = Phi x + Gamma u / z + G tau,     z = e^(j w T_s)
//! a sine tau between them         G = (j w - A)^-1 (z - Phi) E
//! controller                      u = C (i_ref - i) + n_p psi_M w,       C = K_p + T_s K_i / (z - 1)
//!                                 i_ref = (K_P b + D) w_ref - (K_P + D) w,  D = T_s K_I / (z - 1)
//! the sine of x between samples   X = (j w - A)^-1 (B H u / z + E tau),  H = (1 - 1/z) / (j w T_s)
//! ```
#![allow(missing_docs)]

mod common;

use drive::PmsmDrive;
use fmu_core::{Block, Elapsed, Model, Step};
use fmu_sweep::frequency::Complex64 as C;
use std::f64::consts::TAU;
use std::process::{Command, Output};

const T_S: f64 = 1e-4;
const N_P: f64 = 4.0;
const R: f64 = 0.36;
const L: f64 = 0.2e-3;
const PSI: f64 = 0.0064;
const J: f64 = 4e-6;
/// Bandwidths in rad/s.
const CURRENT: f64 = TAU * 400.0;
const SPEED: f64 = TAU * 40.0;
/// Frequencies up to a tenth of 1/T_s.
const FREQUENCIES: &str = "4:1000:13";

const VALUES: &str = "controller.estimator=Sensored u_dc=24 plant.motor.n_p=4 plant.motor.R_s=0.36 plant.motor.L_d=0.2e-3 \
    plant.motor.L_q=0.2e-3 plant.motor.psi_M=0.0064 plant.mechanics.J=4e-6 plant.mechanics.B=0 plant.mechanics.tau_coulomb=0 \
    controller.motor.n_p=4 controller.motor.R_s=0.36 controller.motor.L_d=0.2e-3 controller.motor.L_q=0.2e-3 \
    controller.motor.psi_M=0.0064 controller.mechanics.J=4e-6 controller.current.bandwidth=2513.274122871834 \
    controller.speed_loop.bandwidth=251.32741228718345 controller.zero_speed.i_0=0";

fn bode(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fmu")).arg("bode").args(arguments).output().unwrap()
}

fn drive(standard: &str) -> String {
    common::archives().join(standard).join("PmsmDrive.fmu").display().to_string()
}

/// A line of the CSV: frequency, response, open loop.
type Line = (f64, C, Option<C>);

/// The responses of the servo, which print no warning but that of parameters without effect.
fn servo(standard: &str, options: &str) -> Vec<Line> {
    let (drive, set) = (drive(standard), VALUES.split_whitespace().flat_map(|value| ["--set", value]));
    let mut arguments = vec![drive.as_str(), "--csv", "-"];
    if !options.contains("--settle") {
        arguments.extend(["--settle", "0.1"]);
    }
    arguments.extend(set);
    if !options.contains("--frequencies") {
        arguments.extend(["--frequencies", FREQUENCIES]);
    }
    arguments.extend(options.split_whitespace());
    let output = bode(&arguments);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    let warns = error.lines().any(|line| line.starts_with("warning") && !line.contains("no effect"));
    assert!(output.status.success() && !warns, "{options}: {error}");
    let text = String::from_utf8(output.stdout).unwrap();
    let line = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        (cells[0], C::new(cells[1], cells[2]), cells.get(7).map(|re| C::new(*re, cells[8])))
    };
    text.lines().skip(1).map(line).collect()
}

/// The response agrees with theory within a twentieth of a decibel and 0.3 degrees.
fn agree(what: &str, lines: &[Line], theory: impl Fn(f64) -> C) {
    assert_eq!(lines.len(), 13, "{what}");
    agree_within(what, lines, (0.05, 0.3), theory);
}

fn agree_within(what: &str, lines: &[Line], (decibels, degrees): (f64, f64), theory: impl Fn(f64) -> C) {
    let mut worst = (0.0_f64, 0.0_f64);
    for (f, found, _) in lines {
        let ratio = found / theory(*f);
        let off = (20.0 * ratio.norm().log10(), ratio.arg().to_degrees());
        assert!(off.0.abs() < decibels && off.1.abs() < degrees, "{what} at {f} Hz: {found} is {off:?} off");
        worst = (worst.0.max(off.0.abs()), worst.1.max(off.1.abs()));
    }
    println!("{what}: within {:.3} dB and {:.2} deg of theory, up to {} Hz", worst.0, worst.1, lines.last().unwrap().0);
}

fn one() -> C {
    C::new(1.0, 0.0)
}

/// `z`, and the gain of a voltage held over a sample.
fn sampling(f: f64) -> (C, C) {
    let jw = C::new(0.0, TAU * f);
    let z = (jw * T_S).exp();
    (z, (one() - one() / z) / (jw * T_S))
}

/// PI controller of the current with its error and integral.
fn pi(z: C) -> C {
    CURRENT * L + T_S * CURRENT * R / (z - 1.0)
}

/// Open current loop at the samples, with a locked shaft.
fn current_loop(f: f64) -> C {
    let (z, _) = sampling(f);
    let a = (-R * T_S / L).exp();
    pi(z) * ((1.0 - a) / R) / z / (z - a)
}

/// Torque over its reference, with a locked shaft.
fn torque(f: f64) -> C {
    let (z, held) = sampling(f);
    let u = pi(z) / (one() + current_loop(f)) / z;
    u * held / (C::new(0.0, TAU * f) * L + R)
}

type Matrix = [[C; 2]; 2];
type Column = [C; 2];

fn real(m: [[f64; 2]; 2]) -> Matrix {
    m.map(|row| row.map(|x| C::new(x, 0.0)))
}

fn times(m: &Matrix, x: &Column) -> Column {
    [m[0][0] * x[0] + m[0][1] * x[1], m[1][0] * x[0] + m[1][1] * x[1]]
}

fn sum(a: Column, b: Column) -> Column {
    [a[0] + b[0], a[1] + b[1]]
}

fn scaled(x: &Column, by: C) -> Column {
    [x[0] * by, x[1] * by]
}

/// `(s - m)^-1 b`.
fn solve(s: C, m: &Matrix, b: &Column) -> Column {
    let ([[p, q], [r, t]], [x, y]) = ([[s - m[0][0], -m[0][1]], [-m[1][0], s - m[1][1]]], *b);
    let determinant = p * t - q * r;
    [(t * x - q * y) / determinant, (p * y - r * x) / determinant]
}

/// `exp(a h)` and its integral over `h`, by series.
fn exponential(a: &Matrix, h: f64) -> (Matrix, Matrix) {
    let mut term = real([[1.0, 0.0], [0.0, 1.0]]);
    let (mut whole, mut integral) = (term, term.map(|row| row.map(|x| x * h)));
    for k in 1..30 {
        let product = |i: usize, j: usize| (term[i][0] * a[0][j] + term[i][1] * a[1][j]) * h / f64::from(k);
        term = [[product(0, 0), product(0, 1)], [product(1, 0), product(1, 1)]];
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            whole[i][j] += term[i][j];
            integral[i][j] += term[i][j] * h / f64::from(k + 1);
        }
    }
    (whole, integral)
}

/// Torque, speed, and the speed at the samples, for a sine of the reference and of the load.
fn speed_loop(f: f64, reference: f64, load: f64) -> (C, C, C) {
    let (k, (z, held), jw) = (1.5 * N_P * PSI, sampling(f), C::new(0.0, TAU * f));
    let a = real([[-R / L, -N_P * PSI / L], [k / J, 0.0]]);
    let (b, e) = ([C::new(1.0 / L, 0.0), C::ZERO], [C::ZERO, C::new(-load / J, 0.0)]);
    let (phi, integral) = exponential(&a, T_S);
    let gamma = times(&integral, &b);
    let late = times(&phi, &e);
    let sine = solve(jw, &a, &sum(scaled(&e, z), scaled(&late, -one())));
    let k_p = J * SPEED / k;
    let (c, d) = (pi(z), T_S * k_p * SPEED / 4.0 / (z - 1.0));
    // u = gains x + own, with the set-point weight 0.5.
    let (gains, own) = ([-c, -c * (k_p + d) + N_P * PSI], c * (0.5 * k_p + d) * reference);
    let mut closed = phi;
    for (row, gamma) in closed.iter_mut().zip(&gamma) {
        row.iter_mut().zip(&gains).for_each(|(x, gain)| *x += gamma * gain / z);
    }
    let x = solve(z, &closed, &sum(scaled(&gamma, own / z), sine));
    let u = (gains[0] * x[0] + gains[1] * x[1] + own) / z;
    let between = solve(jw, &a, &sum(scaled(&b, u * held), e));
    (between[0] * k, between[1], x[1])
}

#[test]
fn the_current_loop_is_the_sampled_one() {
    let locked = "--set controller.speed_loop.torque_mode=true --set plant.mechanics.imposed=true --step 1e-4";
    agree("tau_e / tau_ref", &servo("fmi3", &format!("--from tau_ref --to tau_e {locked}")), torque);
    // When turning, the axes are decoupled except for the delay.
    let lines = servo("fmi2", &format!("--loop current {locked}"));
    let closed = |f: f64| current_loop(f) / (one() + current_loop(f));
    agree("--loop current", &lines, closed);
    let open: Vec<Line> = lines.iter().map(|(f, _, open)| (*f, open.unwrap(), None)).collect();
    agree("its open loop", &open, current_loop);
}

#[test]
fn the_speed_loop_its_margins_and_the_impedance_of_the_shaft() {
    let lines = servo("fmi3", "--loop speed");
    agree("--loop speed", &lines, |f| speed_loop(f, 0.0, 1.0).0);
    let open: Vec<Line> = lines.iter().map(|(f, _, open)| (*f, open.unwrap(), None)).collect();
    let torque = |f: f64| speed_loop(f, 0.0, 1.0).0;
    agree("its open loop", &open, |f| torque(f) / (one() - torque(f)));
    agree("--loop reference", &servo("fmi2", "--loop reference"), |f| speed_loop(f, 1.0, 0.0).1);
    agree("--loop impedance", &servo("fmi3", "--loop impedance"), |f| -one() / speed_loop(f, 0.0, 1.0).1);
    agree("--loop disturbance in Model Exchange", &servo("fmi3", "--loop disturbance --me"), |f| {
        speed_loop(f, 0.0, 1.0).1
    });
    // A sensor is read at the samples; the estimate appears a sample later and is held.
    let sensor = |f: f64| {
        let (_, w, sampled) = speed_loop(f, 0.0, 1.0);
        sampled / w / sampling(f).0 * sampling(f).1
    };
    agree("--loop observer", &servo("fmi2", "--loop observer"), sensor);
}

#[test]
fn both_standards_measure_the_same_bits() {
    let of = |standard: &str| servo(standard, "--loop disturbance --frequencies 20,700");
    assert_eq!(of("fmi2"), of("fmi3"));
}

#[test]
fn the_dc_link_sees_a_constant_power() {
    // A drive at constant speed and torque draws constant power: Y = -P / u_dc^2, a negative resistance at the DC link.
    let (load, w) = (0.05, 100.0);
    let point = format!("--input speed_ref=0:{w} --input tau_load=0:{load} --settle 0.3");
    let lines = servo("fmi3", &format!("--loop admittance {point}"));
    let i_q = load / (1.5 * N_P * PSI);
    let power = load * w + 1.5 * R * i_q * i_q;
    agree("--loop admittance", &lines, |_| C::new(-power / (24.0 * 24.0), 0.0));
}

/// Nonlinear, unsettled or ineffective responses are reported.
#[test]
fn a_doubtful_response_is_announced() {
    let drive = drive("fmi3");
    let warnings = |options: &str| {
        let mut arguments = vec![drive.as_str()];
        arguments.extend(VALUES.split_whitespace().flat_map(|value| ["--set", value]));
        arguments.extend(options.split_whitespace());
        let output = bode(&arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stderr).unwrap()
    };
    // 0.12 N.m is the limit of the torque: half the amplitude stays within it.
    let said = warnings(
        "--loop disturbance --settle 0.1 --frequencies 20 --amplitude 0.2 --set controller.limit.i=3 --set controller.limit.i_q=3",
    );
    assert!(said.contains("half the amplitude") && said.contains("current_limited is 1"), "{said}");
    // Stiction resists a small torque; a reduction of the amplitude into it is reported.
    let said = warnings(
        "--loop disturbance --settle 0.1 --frequencies 20 --amplitude 0.02 --set plant.mechanics.tau_coulomb=0.01",
    );
    assert!(said.contains("20 Hz: changes by") && said.contains("half the amplitude"), "{said}");
    // The noise of the current sensors is larger than the response.
    let said = warnings(
        "--loop disturbance --settle 0.1 --frequencies 300 --amplitude 1e-4 --set controller.sensor.noise=0.05",
    );
    assert!(said.contains("300 Hz: not settled"), "{said}");
    // A drive that accelerates drifts, and its response is found.
    let drifting = "--loop disturbance --settle 0.1 --frequencies 50 --input speed_ref=0:0~10:300";
    assert_eq!(warnings(drifting).matches("warning").count(), 0);
}

#[test]
fn bad_input_is_one_line_that_names_it() {
    let drive = drive("fmi3");
    let plant = common::archives().join("fmi3/PmsmPlant.fmu").display().to_string();
    let one = ["--frequencies", "10"];
    for (file, arguments, parts) in [
        (&drive, &["--from", "speed", "--to", "speed"][..], &["speed", "not a real input or tunable parameter"][..]),
        (&drive, &["--from", "sped_ref", "--to", "speed"], &["has no variable sped_ref"]),
        (&drive, &["--from", "enable", "--to", "speed"], &["enable", "cannot follow a sine"]),
        (&drive, &["--from", "tau_load", "--to", "sped"], &["has no variable sped"]),
        (
            &drive,
            &["--from", "tau_load", "--to", "speed", "--amplitude", "-1"],
            &["amplitude -1: expected a number above 0"],
        ),
        (&drive, &["--from", "tau_load", "--to", "speed", "--settle", "-1"], &["settling time -1 s"]),
        (
            &drive,
            &["--from", "tau_load", "--to", "speed", "--step", "0.1"],
            &["frequency 10 Hz", "at most 4.5 Hz", "steps of 0.1 s"],
        ),
        (
            &drive,
            &["--loop", "speed", "--set", "controller.speed_loop.torque_mode=true"],
            &["--loop speed", "no speed loop"],
        ),
        (
            &drive,
            &["--loop", "impedance", "--set", "plant.mechanics.imposed=true"],
            &["--loop impedance: tau_load has no effect"],
        ),
        (&drive, &["--loop", "speed", "--plot", "a.pdf"], &["--plot a.pdf", ".svg or .png"]),
        (&plant, &["--loop", "speed", "--set", "x"], &["x: is not --set VARIABLE=VALUE"]),
        (&plant, &["--loop", "reference"], &["--loop reference: PmsmPlant has no variable speed_ref"]),
    ] {
        let output = bode(&[&[file.as_str()], arguments, &one].concat());
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(parts.iter().all(|part| error.contains(part)), "{arguments:?}: {parts:?} is not in {error}");
    }
}

/// Controller and plant as two connected FMUs have the same response as the whole drive.
#[test]
fn the_pair_has_the_response_of_the_drive() {
    let of = |name: &str| common::archives().join("fmi3").join(name).display().to_string();
    let (plant, controller) = (format!("p={}", of("PmsmPlant.fmu")), format!("c={}", of("SensorlessController.fmu")));
    let mut arguments = vec![plant, controller];
    for value in VALUES.split_whitespace() {
        let own = value.replace("plant.", "p.").replace("controller.", "c.");
        let both = if own.starts_with("u_dc") { vec![format!("p.{own}"), format!("c.{own}")] } else { vec![own] };
        arguments.extend(both.into_iter().flat_map(|value| ["--set".to_owned(), value]));
    }
    let rest = "--from p.tau_load --to p.speed --settle 0.1 --step 1e-4 --frequencies 20,250,1000 --csv - \
        --connect p.theta_e=c.theta_meas --connect p.speed=c.speed_meas";
    arguments.extend(rest.split_whitespace().map(str::to_owned));
    for wiring in ["--auto-connect", "--terminal p.phases=c.phases"] {
        let all: Vec<&str> = arguments.iter().map(String::as_str).chain(wiring.split(' ')).collect();
        let output = bode(&all);
        let text = String::from_utf8(output.stdout).unwrap();
        let line = |line: &str| {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
            (cells[0], C::new(cells[1], cells[2]), None)
        };
        let pair: Vec<Line> = text.lines().skip(1).map(line).collect();
        assert_eq!(pair.len(), 3, "{}", String::from_utf8_lossy(&output.stderr));
        agree_within("the pair", &pair, (0.05, 0.3), |f| speed_loop(f, 0.0, 1.0).1);
    }
}

/// A load behind a spring, integrated between the communication points while the rotor is extrapolated at its speed.
#[derive(Clone, Default)]
struct Train {
    c: f64,
    d: f64,
    load: f64,
    /// Angle and speed of rotor and load.
    rotor: [f64; 2],
    end: [f64; 2],
}

impl Train {
    fn torque(&self) -> f64 {
        self.c * (self.rotor[0] - self.end[0]) + self.d * (self.rotor[1] - self.end[1])
    }

    fn advance(&mut self, h: f64) {
        const PARTS: u32 = 400;
        let h = h / f64::from(PARTS);
        for _ in 0..PARTS {
            let tau = self.torque();
            self.end[1] += h * tau / self.load;
            self.rotor[0] += h * self.rotor[1];
            self.end[0] += h * self.end[1];
        }
    }
}

/// Whether a load behind a spring stays at 1000 rpm with steps of `h` (s), after a push.
fn is_stable((c, d, load): (f64, f64, f64), longest: f64) -> bool {
    let mut drive = Block::<PmsmDrive>::default();
    drive.model.derive();
    drive.initialize();
    let mut train = Train { c, d, load, ..Train::default() };
    let mut now = Elapsed::ZERO;
    let (mut middle, mut late) = (0.0_f64, 0.0_f64);
    while now.seconds() < 6.0 {
        let h = if now.seconds() < 2.0 { T_S } else { longest };
        train.rotor = [drive.out.plant.angle, drive.out.plant.speed];
        let push = if (2.0..2.02).contains(&now.seconds()) { 0.02 } else { 0.0 };
        drive.model.inputs.speed_ref = 104.72 * (now.seconds() / 0.3).min(1.0);
        drive.model.inputs.tau_load = train.torque() + push;
        let step = Step { start: now, h };
        if drive.step(&step).is_err() {
            return false;
        }
        train.advance(h);
        now = step.end();
        let off = (train.end[1] - 104.72).abs();
        if (2.5..3.5).contains(&now.seconds()) {
            middle = middle.max(off);
        } else if now.seconds() > 5.0 {
            late = late.max(off);
        }
    }
    late < middle.max(0.02)
}

/// The longest step for a spring at the shaft, read from the impedance: a fifth below it the load stays, a quarter above it leaves. Both
/// are tried with the drive, whose importer integrates the load.
#[test]
fn the_impedance_tells_which_step_a_spring_allows() {
    let drive = drive("fmi3");
    for train in [(50.0, 0.05, 1.5e-3), (500.0, 0.2, 2e-3), (5000.0, 2.0, 5e-3)] {
        let spring = format!("{},{},{}", train.0, train.1, train.2);
        let options = "--loop impedance --input speed_ref=0:0~0.3:104.72 --settle 1.2 --frequencies 5:2000:22 --spring";
        let output = bode(
            &[drive.as_str()]
                .into_iter()
                .chain(options.split_whitespace())
                .chain([spring.as_str()])
                .collect::<Vec<_>>(),
        );
        let text = String::from_utf8(output.stdout).unwrap();
        let longest = text.lines().last().and_then(|line| line.split("steps below ").nth(1));
        let longest: f64 = longest.and_then(|rest| rest.split(' ').next()).unwrap().parse().unwrap();
        let [shorter, longer] = [0.8, 1.25].map(|share| is_stable(train, 1e-3 * share * longest));
        assert!(shorter && !longer, "{spring}: below {longest} ms: {shorter}, {longer}");
        println!("{spring}: steps below {longest} ms");
    }
}
