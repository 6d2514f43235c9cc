//! The columns of the tables, at every speed that the data sheet or its map has.

use super::column::SpeedColumn;
use super::file::{DataSheet, RPM, Torque};
use super::losses::{LossGrid, between};
use super::remarks::Remarks;
use crate::csv::Columns;
use crate::error::{Error, Result, WithContext, bail, ensure};
use crate::map::request::ZERO_CELSIUS;
use drive::mapped_drive::map::{SHARES, SPEEDS, share};
use fmu_core::digits::rounded;

/// The columns of a map that are read.
const MAP: [&str; 8] = ["speed", "torque", "u_dc", "T_winding", "p_in", "p_mech", "p_iron", "p_friction"];

/// The columns of a data sheet, with increasing speeds from 0 on, and remarks.
///
/// # Errors
/// A value that is wrong, or curves that do not fit the losses.
pub fn of(sheet: &DataSheet) -> Result<(Vec<SpeedColumn>, Remarks)> {
    let named =
        |result: Result<(Vec<SpeedColumn>, Remarks)>| result.with_context(|| sheet.path().display().to_string());
    match &sheet.data.losses.file {
        Some(file) => {
            let file = sheet.beside(file);
            let shown = file.display().to_string();
            let text = std::fs::read_to_string(&file)
                .with_context(|| format!("{}: losses.file = {shown}", sheet.path().display()))?;
            let map = Columns::parse_some(&text, &shown, |name| MAP.contains(&name))?;
            let (columns, said) = of_map(sheet, &map)?;
            match &sheet.data.torque {
                Some(torque) => named(with_torque(torque, &columns, said)),
                None => Ok((columns, said)),
            }
        }
        None => named(of_table(sheet)),
    }
}

/// The columns of torque curves and of a table of losses.
fn of_table(sheet: &DataSheet) -> Result<(Vec<SpeedColumn>, Remarks)> {
    let (grid, mut said) = LossGrid::new(&sheet.data.losses)?;
    let torque = sheet.data.torque.as_ref().context("torque is missing")?;
    let axis = torque.speeds()?;
    let (last, end) = (axis[axis.len() - 1], grid.speed[grid.speed.len() - 1]);
    ensure!(
        last <= end * (1.0 + 1e-9),
        "torque goes up to {:.0} rpm, but losses only up to {:.0} rpm: extend the table",
        last / RPM,
        end / RPM
    );
    if torque.generator.is_none() {
        said.notes.push("the peak torque of a generator is that of a motor: torque.generator is not given".into());
    }
    let [low, high] = grid.range();
    let column = |n: f64| -> Result<SpeedColumn> {
        let at = |values: &[f64]| between(&axis, values, n);
        let peak = [at(&torque.peak), at(torque.generator.as_ref().unwrap_or(&torque.peak))];
        for (limit, (tau, side)) in
            [high, -low].into_iter().zip(peak.into_iter().zip(["torque.peak", "torque.generator"]))
        {
            ensure!(
                tau <= limit * (1.0 + 1e-9),
                "losses.torque ends at {limit} N.m, but {side} is {} N.m at {:.0} rpm: extend the table",
                rounded(tau, 6),
                n / RPM
            );
        }
        let losses = std::array::from_fn(|j| grid.at(n, share(j) * peak[usize::from(share(j) < 0.0)]));
        let idle = if n > 0.0 { grid.at(n, 0.0) / n } else { 0.0 };
        Ok(SpeedColumn {
            speed: n,
            peak,
            continuous: torque.continuous.as_ref().map_or(peak[0], |values| at(values)),
            drag: torque.drag.as_ref().map_or(idle, |values| at(values)),
            losses,
        })
    };
    let mut speeds: Vec<f64> = axis.iter().chain(&grid.speed).copied().filter(|n| *n <= last).chain([0.0]).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    // The losses at a share of the torque are no straight lines between two speeds.
    while speeds.len() < 2 * SPEEDS {
        let middles: Vec<f64> = speeds.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        speeds.extend(middles);
        speeds.sort_by(f64::total_cmp);
    }
    let mut columns = speeds.into_iter().map(column).collect::<Result<Vec<_>>>()?;
    match &torque.drag {
        None => columns[0].drag = columns[1].drag,
        Some(drag) => said.doubts.extend(doubt(axis.iter().copied().zip(drag.iter().copied()), &grid)),
    }
    Ok((columns, said))
}

/// A drag torque with the gates off, over speed, that takes much more power than the drive loses without torque, or almost none of it.
fn doubt(mut drag: impl Iterator<Item = (f64, f64)>, grid: &LossGrid) -> Option<String> {
    let (n, tau, idle) = drag.find_map(|(n, tau)| {
        let (power, idle) = (n * tau, grid.at(n, 0.0));
        (power > 1.5 * idle || (power > 0.0 && power < 0.01 * idle)).then_some((n, tau, idle))
    })?;
    Some(format!(
        "torque.drag = {} N.m at {:.0} rpm takes {} W with the gates off, but the drive loses {} W without torque",
        rounded(tau, 6),
        n / RPM,
        rounded(n * tau, 4),
        rounded(idle, 4)
    ))
}

/// The columns of `map.csv` of `fmu map`, at one voltage and one temperature.
fn of_map(sheet: &DataSheet, map: &Columns) -> Result<(Vec<SpeedColumn>, Remarks)> {
    let [speed, torque, u_dc, T, p_in, p_mech, p_iron, p_friction] = {
        let mut places = [0; 8];
        for (place, name) in places.iter_mut().zip(MAP) {
            *place = map.column(name)?;
        }
        places
    };
    let distinct = |k: usize| {
        let mut all: Vec<f64> = map.rows().iter().map(|(_, row)| row[k]).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    };
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs();
    let shown = |all: &[f64]| all.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
    let (file, wanted) = (map.file(), sheet.data.dc_link.u_dc);
    let voltages = distinct(u_dc);
    let Some(voltage) = voltages.iter().copied().find(|u| close(*u, wanted)) else {
        bail!(
            "{}: dc_link.u_dc = {wanted} V is not in {file}, which has {} V",
            sheet.path().display(),
            shown(&voltages)
        );
    };
    let temperatures: Vec<f64> = distinct(T).iter().map(|T| T - ZERO_CELSIUS).collect();
    let celsius = match (sheet.data.losses.temperature, &temperatures[..]) {
        (None, [one]) => *one,
        (Some(T), all) if all.iter().any(|one| (one - T).abs() < 1e-3) => T,
        (given, all) => {
            let given = given
                .map_or("losses.temperature is missing".into(), |T| format!("losses.temperature = {T} is not there"));
            bail!("{}: {given}: {file} has {} degC", sheet.path().display(), shown(all))
        }
    };
    let mut columns: Vec<SpeedColumn> = Vec::new();
    for n in distinct(speed) {
        let mut points: Vec<[f64; 3]> = Vec::new();
        for (line, row) in map.rows() {
            let here = row[speed].total_cmp(&n).is_eq()
                && row[u_dc].total_cmp(&voltage).is_eq()
                && (row[T] - ZERO_CELSIUS - celsius).abs() < 1e-3;
            if here {
                let loss = row[p_in] - row[p_mech];
                ensure!(
                    loss >= 0.0,
                    "{file}:{line}: p_in - p_mech = {loss} W must be at least 0: the efficiency is above 1"
                );
                points.push([row[torque], loss, row[p_iron] + row[p_friction]]);
            }
        }
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let [.., [high, ..]] = points[..] else { continue };
        let low = points[0][0];
        if points.len() < 2 || low > 0.0 || high < 0.0 {
            continue;
        }
        let (axis, losses): (Vec<f64>, Vec<f64>) = points.iter().map(|[tau, loss, _]| (*tau, *loss)).unzip();
        let drag: Vec<f64> = points.iter().map(|[.., drag]| *drag).collect();
        columns.push(SpeedColumn {
            speed: n,
            peak: [high, -low],
            continuous: high,
            drag: if n > 0.0 { between(&axis, &drag, 0.0) / n } else { 0.0 },
            losses: std::array::from_fn(|j| {
                between(&axis, &losses, if share(j) < 0.0 { -share(j) * low } else { share(j) * high })
            }),
        });
    }
    if columns.len() < 2 || columns[0].speed != 0.0 {
        return Err(Error::new(format!("{file}: needs speeds from 0 on with torques of both signs")));
    }
    columns[0].drag = columns[1].drag;
    Ok((columns, Remarks::default()))
}

/// The columns of a map, within torque curves.
fn with_torque(torque: &Torque, map: &[SpeedColumn], mut said: Remarks) -> Result<(Vec<SpeedColumn>, Remarks)> {
    let (axis, last) = (torque.speeds()?, map[map.len() - 1].speed);
    ensure!(
        axis[axis.len() - 1] <= last * (1.0 + 1e-9),
        "torque goes up to {:.0} rpm, but the map only up to {:.0} rpm",
        axis[axis.len() - 1] / RPM,
        last / RPM
    );
    let mut columns = Vec::new();
    for column in map.iter().filter(|column| column.speed <= axis[axis.len() - 1] * (1.0 + 1e-9)) {
        let at = |values: &[f64]| between(&axis, values, column.speed);
        let wanted = [at(&torque.peak), at(torque.generator.as_ref().unwrap_or(&torque.peak))];
        let of = if torque.generator.is_some() { "torque.generator" } else { "torque.peak" };
        ensure!(
            wanted[0] <= column.peak[0] * (1.0 + 1e-3),
            "torque.peak is {} N.m at {:.0} rpm, but the map ends at {} N.m",
            rounded(wanted[0], 6),
            column.speed / RPM,
            rounded(column.peak[0], 6)
        );
        ensure!(
            wanted[1] <= column.peak[1] * (1.0 + 1e-3) || torque.generator.is_none(),
            "{of} is {} N.m at {:.0} rpm, but the map ends at {} N.m",
            rounded(wanted[1], 6),
            column.speed / RPM,
            rounded(column.peak[1], 6)
        );
        let peak = [wanted[0].min(column.peak[0]), wanted[1].min(column.peak[1])];
        let shares: [f64; SHARES] = std::array::from_fn(share);
        let read = |j: usize| {
            let side = usize::from(share(j) < 0.0);
            let x = if column.peak[side] > 0.0 { share(j) * peak[side] / column.peak[side] } else { 0.0 };
            between(&shares, &column.losses, x)
        };
        columns.push(SpeedColumn {
            speed: column.speed,
            peak,
            continuous: torque.continuous.as_ref().map_or(peak[0], |values| at(values)).min(peak[0]),
            drag: torque.drag.as_ref().map_or(column.drag, |values| at(values)),
            losses: std::array::from_fn(read),
        });
    }
    if torque.generator.is_none() {
        said.notes.push("the peak torque of a generator is that of a motor, or of the map if that is lower".into());
    }
    Ok((columns, said))
}
