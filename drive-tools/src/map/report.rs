//! Output of `fmu map`: the best point, the losses at the rated point, the energy of the driving cycle.

use super::cycle::{Cycle, Energy};
use super::linear::{self, Cost};
use super::verify::Verified;
use super::{Map, short};
use crate::text_table::markdown;
use drive::plant::losses::Losses;
use std::f64::consts::PI;

/// A joule in kWh, and rpm in a rad/s.
const KWH: f64 = 1.0 / 3.6e6;
const RPM: f64 = 30.0 / PI;

/// Tables of a map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Title, headings and rows of each table.
    pub tables: Vec<(&'static str, Vec<Vec<String>>)>,
    /// Results that do not fit into a table.
    pub notes: Vec<String>,
}

const LOSSES: [&str; 5] = ["p_cu", "p_iron", "p_cond", "p_sw", "p_friction"];

fn parts(l: &Losses) -> [f64; 5] {
    let Losses { cu, iron, cond, sw, friction } = *l;
    [cu, iron, cond, sw, friction]
}

fn row(cells: impl IntoIterator<Item = impl ToString>) -> Vec<String> {
    cells.into_iter().map(|cell| cell.to_string()).collect()
}

/// The tables of a map and of its cycle: the requested one (`asked`), or the example if the drive can follow it.
pub fn of(map: &Map, cycle: &Cycle, asked: bool) -> Report {
    let heads = |first: &[&str]| row(first.iter().chain(&LOSSES.map(|name| name)).copied());
    let mut best = vec![row(["condition", "speed in rpm", "torque in N.m", "p_mech in W", "efficiency in %"])];
    let mut rated = vec![heads(&["losses in W", "p_in in W", "efficiency in %"])];
    let mut energy = vec![heads(&["energy in kWh", "sum", "out", "back"])];
    energy[0].push("error of the map in %".into());
    let mut notes = map.notes.clone();
    for (k, sheet) in map.sheets.iter().enumerate() {
        let title = map.title(sheet);
        if let Some((speed, point)) = map.best(sheet) {
            best.push(row([
                title.clone(),
                format!("{:.0}", speed * RPM),
                short(point.powers.tau_shaft).to_string(),
                format!("{:.1}", point.powers.p_mech),
                format!("{:.2}", 100.0 * point.efficiency),
            ]));
        }
        match map.rated_point(sheet) {
            Some(point) => {
                let losses = parts(&point.powers.losses).map(|p| format!("{p:.2}"));
                let head =
                    [title.clone(), format!("{:.1}", point.powers.p_in), format!("{:.2}", 100.0 * point.efficiency)];
                rated.push(head.into_iter().chain(losses).collect());
            }
            None => notes.push(format!("{title}: the rated point is out of reach")),
        }
        notes.extend(
            linear::cost(&map.drive, map.rated, sheet.u_dc, sheet.T).map(|cost| sentence(&title, map.rated[1], &cost)),
        );
        match map.energy(k, cycle) {
            Ok([exact, read]) => {
                let Energy { link: [out, back], losses } = exact;
                let values = [exact.sum(), out, back].into_iter().chain(parts(&losses));
                let values = values.map(|joule| format!("{:.5}", joule * KWH));
                let error = format!("{:+.3}", 100.0 * (read.sum() / exact.sum() - 1.0));
                energy.push(std::iter::once(title).chain(values).chain([error]).collect());
            }
            Err([speed, tau]) if asked => notes.push(format!(
                "{title}: the drive cannot follow the driving cycle, which requires {tau:.2} N.m at {:.0} rpm",
                speed * RPM
            )),
            // The example's vehicle is not this drive's.
            Err(_) => (),
        }
    }
    let [speed, torque] = map.rated;
    let mut tables = vec![("Best point of the motor", best)];
    if rated.len() > 1 {
        rated[0][0] = format!("losses in W at {:.0} rpm, {} N.m", speed * RPM, short(torque));
        tables.push(("Rated point", rated));
    }
    if energy.len() > 1 {
        tables.push(("Driving cycle", energy));
    }
    let Verified { points, power, loss, apart } = &map.verified;
    notes.push(match (*points, apart.len()) {
        (0, _) => "no point was compared with PmsmDrive".into(),
        (_, 0) => format!(
            "{points} points agree with PmsmDrive within {:.3} % of the power (allowed 0.1 %) and {:.2} % of a loss (allowed 1 %)",
            100.0 * power,
            100.0 * loss
        ),
        (_, count) => format!(
            "{count} of {points} points differ from PmsmDrive by more than allowed; --verify 0 leaves the comparison out"
        ),
    });
    notes.extend(apart.iter().cloned());
    Report { tables, notes }
}

/// A sentence about the controller's constant inductances.
fn sentence(title: &str, rated: f64, cost: &Cost) -> String {
    let Cost { torque, now, best } = cost;
    let [lost, least] = [now, best].map(|point| point.powers.losses.sum());
    format!(
        "{title}: the controller computes with constant inductances: a reference of {} N.m gives {:.4} N.m ({:+.2} %); at the rated \
         point it takes i_d = {:.3} A, i_q = {:.3} A and loses {lost:.2} W, {:.2} W ({:.2} %) more than with the best currents, {:.3} A \
         and {:.3} A",
        short(rated),
        torque,
        100.0 * (torque / rated - 1.0),
        now.i.d(),
        now.i.q(),
        lost - least,
        100.0 * (lost / least - 1.0),
        best.i.d(),
        best.i.q()
    )
}

impl Report {
    /// The tables in Markdown, then the notes.
    pub fn text(&self) -> String {
        let tables = self.tables.iter().map(|(title, rows)| format!("{title}\n\n{}\n", markdown(rows)));
        tables.chain(self.notes.iter().map(|note| format!("note: {note}\n"))).collect()
    }
}
