//! `fmu map`: the efficiency map of a machine with the values that [`tune`](crate::tune) gives it, and its envelope.
//!
//! - [`request`]: the request of the user. [`sheet`]: the points at one voltage and temperature, from [`drive::steady`].
//! - [`verify`](mod@verify): some of them against the running drive.
//! - [`table`]: reading between the points. [`cycle`]: a vehicle on a driving cycle.
//! - [`linear`]: the cost of the controller's constant inductances if the machine saturates.
//! - [`files`](mod@files): CSV and npz. [`picture`]: the map as a figure. [`page`]: the map as a page. [`report`]: tables of text.
//!
//! The drive runs in torque control with a sensor, and its controller uses the estimates from the tuning rules; the current is
//! the only limit, and the voltage is constant over the sample period, as in `PmsmDrive`.

pub mod cycle;
pub mod files;
pub mod linear;
pub mod page;
pub mod picture;
pub mod report;
pub mod request;
pub mod sheet;
pub mod table;
pub mod verify;

use crate::error::{Result, bail};
use crate::tune::motor::MotorFile;
use crate::tune::rules;
use crate::tune::setting::Tuned;
use cycle::{Cycle, Energy};
use drive::control::start::StartMode;
use drive::estimator::Kind;
use drive::plant::thermal::{Temperatures, ThermalMode};
use drive::steady::{Point, Steady};
use fmu_core::digits::rounded;
use request::{Request, ZERO_CELSIUS};
use sheet::{Axes, Sheet};
use std::f64::consts::TAU;
use table::Table;
use verify::Verified;

/// The map of a machine.
#[derive(Clone, Debug)]
#[expect(non_snake_case, reason = "the symbol of the temperature")]
pub struct Map {
    /// Name of the machine.
    pub name: String,
    /// Source of its data.
    pub source: String,
    /// The drive.
    pub drive: Steady,
    /// Rated mechanical speed in rad/s and torque in N.m.
    pub rated: [f64; 2],
    /// DC-link voltages in V.
    pub u_dc: Vec<f64>,
    /// Temperatures in degC.
    pub T: Vec<f64>,
    /// The grid.
    pub axes: Axes,
    /// The points of each voltage and temperature.
    pub sheets: Vec<Sheet>,
    /// The sheet of the picture: the one at the motor file's voltage, if the map has it.
    pub shown: usize,
    /// The comparison with the running drive.
    pub verified: Verified,
    /// What a reader should know.
    pub notes: Vec<String>,
}

/// Samples per electrical period at the maximum speed of a map if the file does not specify that speed.
const LEAST_SAMPLES: f64 = 10.0;
/// Share of the rated torque available there.
const LEAST_TORQUE: f64 = 0.01;

/// The drive of a map: torque control with a sensor at imposed speed, limited only by the current.
pub fn drive(tuned: &Tuned) -> Steady {
    let pair = tuned.pair();
    let (mut plant, mut controller) = (pair.plant.model.parameters, pair.controller.model.parameters);
    plant.mechanics.imposed = true;
    plant.thermal.mode = ThermalMode::Constant;
    let par = &mut controller;
    (par.estimator, par.speed_loop.torque_mode) = (Kind::Sensored, true);
    (par.start.mode, par.estimators.emf.hold_reversal) = (StartMode::Direct, false);
    let motor = &par.motor;
    let most = 1.5 * f64::from(motor.n_p) * (motor.psi_M + (motor.L_q - motor.L_d).abs() * par.limit.i) * par.limit.i;
    (par.limit.i_q, par.limit.tau) = (par.limit.i, most);
    Steady::new(plant, controller).sampled()
}

/// Computes the map of a machine, and verifies it.
///
/// # Errors
/// A value of the request or of the file is wrong, or the rated point is out of reach.
pub fn make(motor: &MotorFile, request: &Request) -> Result<Map> {
    request.check()?;
    // With a sensor, nothing adapts.
    let tuned = rules::fixed(motor)?;
    let drive = drive(&tuned);
    let nominal = *motor.data.dc_link.u_dc.get_ref();
    let u_dc = if request.u_dc.is_empty() { vec![nominal] } else { request.u_dc.clone() };
    let T = if request.T.is_empty() { vec![20.0] } else { request.T.clone() };
    for &T in &T {
        warm_enough(&drive, T)?;
    }
    rated(motor, &drive, nominal)?;
    let axes = Axes::new(request.grid, top(motor, &drive, &u_dc, &T));
    let kelvin: Vec<f64> = T.iter().map(|T| T + ZERO_CELSIUS).collect();
    let sheets = sheet::all(&drive, &axes, &u_dc, &kelvin);
    let verified = verify::verify(&drive, &axes, &sheets, request.verify)?;
    let voltage = u_dc.iter().position(|u| u.to_bits() == nominal.to_bits()).unwrap_or(u_dc.len() - 1);
    let (shown, notes) = (voltage * T.len(), notes(&drive, &T));
    let rated = [tuned.speed, tuned.torque];
    let Tuned { name, source, .. } = tuned;
    Ok(Map { name, source, drive, rated, u_dc, T, axes, sheets, shown, verified, notes })
}

/// The map of a drive given by its values: one voltage (V), 20 degC, speeds up to `top` (rad/s), without verification.
pub fn of_drive(name: &str, drive: Steady, u_dc: f64, top: f64, rated: [f64; 2]) -> Map {
    let (axes, T) = (Axes::new(Request::default().grid, top), vec![20.0]);
    let sheets = sheet::all(&drive, &axes, &[u_dc], &[20.0 + ZERO_CELSIUS]);
    let (name, u_dc) = (name.into(), vec![u_dc]);
    let (source, notes, verified) = (String::new(), Vec::new(), Verified::default());
    Map { name, source, drive, rated, u_dc, T, axes, sheets, shown: 0, verified, notes }
}

/// Refuses a temperature at which the machine has no resistance or no magnet.
fn warm_enough(drive: &Steady, T: f64) -> Result<()> {
    let motor = drive.plant.thermal.motor(&drive.plant.motor, &Temperatures::all(T + ZERO_CELSIUS));
    if !(motor.R_s > 0.0 && motor.psi_M > 0.0) {
        bail!(
            "--T {T}: with the coefficients of [temperature], R_s = {:.3e} Ohm and psi_M = {:.3e} Wb there, which must be greater \
             than 0; choose a temperature nearer to 20 degC",
            motor.R_s,
            motor.psi_M
        );
    }
    Ok(())
}

/// Refuses a machine whose rated point lies outside its envelope.
fn rated(motor: &MotorFile, drive: &Steady, u_dc: f64) -> Result<()> {
    let rating = &motor.data.rating;
    let (speed, torque) = (*rating.speed.get_ref(), *rating.torque.get_ref());
    let [_, most] = sheet::ends(&sheet::at(drive, speed, u_dc, drive.plant.thermal.T_ref));
    let most = most.map_or(0.0, |point| point.powers.tau_shaft);
    if most < torque {
        bail!(
            "{}: at rating.speed, the shaft has at most {most:.3} N.m after the losses, not the {torque} N.m of rating.torque: lower \
             the speed or the torque, or raise rating.current or dc_link.u_dc = {u_dc} V",
            motor.place(&rating.torque)
        );
    }
    Ok(())
}

/// The maximum speed (rad/s) of the map: from the file or twice the rated speed, limited to speeds with available torque and
/// enough samples per period.
fn top(motor: &MotorFile, drive: &Steady, u_dc: &[f64], T: &[f64]) -> f64 {
    let rating = &motor.data.rating;
    if let Some(top) = &rating.speed_max {
        return *top.get_ref();
    }
    let speed = *rating.speed.get_ref();
    let par = &drive.controller;
    let sampled = TAU / (LEAST_SAMPLES * f64::from(par.motor.n_p) * par.T_s);
    let most = (2.0 * speed).min(sampled.max(speed));
    let least = LEAST_TORQUE * rating.torque.get_ref();
    let reached = |speed: f64| {
        let most = |u_dc, T| sheet::ends(&sheet::at(drive, speed, u_dc, T + ZERO_CELSIUS))[1];
        u_dc.iter().any(|&u_dc| T.iter().any(|&T| most(u_dc, T).is_some_and(|p| p.powers.tau_shaft >= least)))
    };
    if reached(most) {
        return most;
    }
    let (mut low, mut high) = (0.0, most);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if reached(middle) { &mut low } else { &mut high }) = middle;
    }
    low
}

fn notes(drive: &Steady, T: &[f64]) -> Vec<String> {
    let mut notes = Vec::new();
    for (table, loss) in missing(drive) {
        notes.push(format!("the motor file has no {table}: the map omits the losses of the {loss}"));
    }
    let thermal = &drive.plant.thermal;
    if thermal.alpha_R == 0.0 && thermal.alpha_psi == 0.0 && T.iter().any(|T| T.to_bits() != 20.0_f64.to_bits()) {
        notes.push("the motor file has no [temperature]: the map is the same at every temperature".into());
    }
    notes
}

/// Tables missing in the motor file, and the losses that therefore are not counted.
fn missing(drive: &Steady) -> impl Iterator<Item = (&'static str, &'static str)> {
    let plant = &drive.plant;
    let tables =
        [("[iron]", "iron", plant.iron.is_none()), ("[inverter]", "inverter", plant.inverter.devices.is_none())];
    tables.into_iter().filter(|(.., none)| *none).map(|(table, loss, _)| (table, loss))
}

impl Map {
    /// A sheet that can be read between its points.
    pub fn table(&self, sheet: usize) -> Table<'_> {
        Table::new(&self.axes, &self.sheets[sheet], &self.drive.plant)
    }

    /// A sheet's name: voltage and temperature.
    pub fn title(&self, sheet: &Sheet) -> String {
        format!("{} V, {} °C", sheet.u_dc, short(sheet.T - ZERO_CELSIUS))
    }

    /// Words for a title: the losses that are not counted.
    fn uncounted(&self) -> String {
        let all: Vec<&str> = missing(&self.drive).map(|(_, loss)| loss).collect();
        if all.is_empty() { String::new() } else { format!(", without losses of the {}", all.join(" and the ")) }
    }

    /// The point with the best efficiency of a sheet, with its speed in rad/s.
    pub fn best(&self, sheet: &Sheet) -> Option<(f64, Point)> {
        let rows = sheet.points.chunks(self.axes.x.len()).zip(&self.axes.speed);
        let all = rows.flat_map(|(points, speed)| points.iter().flatten().map(|point| (*speed, *point)));
        all.filter(|(_, point)| point.powers.p_mech > 0.0).max_by(|a, b| a.1.efficiency.total_cmp(&b.1.efficiency))
    }

    /// The rated point under the condition of a sheet, if the drive reaches it there.
    pub fn rated_point(&self, sheet: &Sheet) -> Option<Point> {
        let [speed, torque] = self.rated;
        let at = sheet::at(&self.drive, speed, sheet.u_dc, sheet.T);
        sheet::ends(&at)[1]?;
        at.by_shaft(torque)
    }

    /// The energy of a cycle under the condition of a sheet: computed with the drive itself, and read from the map. If the
    /// drive cannot brake hard enough, the wheel brakes supply the rest.
    ///
    /// # Errors
    /// The first speed (rad/s) and torque (N.m) that are out of reach.
    pub fn energy(&self, sheet: usize, cycle: &Cycle) -> Result<[Energy; 2], [f64; 2]> {
        let Sheet { u_dc, T, .. } = self.sheets[sheet];
        let exact = cycle.energy(|speed, tau| {
            let at = sheet::at(&self.drive, speed, u_dc, T);
            let least = sheet::ends(&at)[0].map_or(0.0, |point| point.powers.tau_shaft);
            let point = at.by_shaft(tau.max(least)).filter(|point| at.fits(point))?;
            Some((point.powers.p_in, point.powers.losses))
        })?;
        let table = self.table(sheet);
        let read = cycle.energy(|speed, tau| {
            let reading = table.read(speed, tau.max(table.limits(speed)?[0]))?;
            Some((reading.p_in, reading.losses))
        })?;
        Ok([exact, read])
    }
}

/// A number with at most six digits.
pub(crate) fn short(x: f64) -> f64 {
    rounded(x, 6)
}
