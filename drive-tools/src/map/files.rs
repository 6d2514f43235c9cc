//! The files of a map; those that programs read are here: CSV in long form, and NumPy's npz.

use super::report::Report;
use super::request::ZERO_CELSIUS;
use super::{Map, page, picture};
use crate::error::Result;
use drive::steady::Point;
use fmu_core::digits;
use fmu_plot::chart;
use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// A column of `map.csv` and an array of `map.npz`: the name and the value at a point.
type Column = (&'static str, fn(&Point) -> f64);

/// Columns of a point other than its grid coordinates and its region.
const COLUMNS: [Column; 11] = [
    ("i_d", |p| p.i.d()),
    ("i_q", |p| p.i.q()),
    ("u_share", |p| p.u_share),
    ("p_in", |p| p.powers.p_in),
    ("p_mech", |p| p.powers.p_mech),
    ("p_cu", |p| p.powers.losses.cu),
    ("p_iron", |p| p.powers.losses.iron),
    ("p_cond", |p| p.powers.losses.cond),
    ("p_sw", |p| p.powers.losses.sw),
    ("p_friction", |p| p.powers.losses.friction),
    ("efficiency", |p| p.efficiency),
];

/// Names and contents of the files of a map.
///
/// # Errors
/// A sheet has no point.
pub fn all(map: &Map, report: &Report) -> Result<Vec<(&'static str, Vec<u8>)>> {
    let mut files = vec![
        ("map.csv", map_csv(map).into()),
        ("envelope.csv", envelope_csv(map).into()),
        ("map.npz", npz(map)?),
        ("map.svg", chart::draw(&picture::chart(map, map.shown))?.into()),
        ("map.html", page::page(map, report)?.into()),
    ];
    if map.drive.plant.flux_map.used {
        files.push(("flux_map.csv", flux_map_csv(map).into()));
    }
    Ok(files)
}

/// A number with nine digits, as short as they allow.
fn number(x: f64) -> String {
    // No -0.
    digits::text(x + 0.0, 9, 1e9)
}

/// `map.csv`: a line for each point within reach, in SI units.
pub fn map_csv(map: &Map) -> String {
    let names = COLUMNS.map(|(name, _)| name).join(",");
    let mut csv = format!("speed,torque,u_dc,T_winding,T_magnet,{names},region\n");
    for sheet in &map.sheets {
        for (points, speed) in sheet.points.chunks(map.axes.x.len()).zip(&map.axes.speed) {
            for point in points.iter().flatten() {
                let place = [*speed, point.powers.tau_shaft, sheet.u_dc, sheet.T, sheet.T];
                let values = place.into_iter().chain(COLUMNS.iter().map(|(_, of)| of(point)));
                let cells: Vec<String> = values.map(number).collect();
                let _ = writeln!(csv, "{},{}", cells.join(","), point.region.name());
            }
        }
    }
    csv
}

/// `envelope.csv`: minimum and maximum torque at the shaft over the speed; 0 if that sign is out of reach.
pub fn envelope_csv(map: &Map) -> String {
    let mut csv = String::from("speed,u_dc,T_winding,T_magnet,tau_min,tau_max,region_min,region_max\n");
    for sheet in &map.sheets {
        for ((speed, [low, high]), [below, above]) in map.axes.speed.iter().zip(&sheet.limits).zip(&sheet.regions) {
            let cells = [*speed, sheet.u_dc, sheet.T, sheet.T, *low, *high].map(number).join(",");
            let name = |x: f64, region: &drive::steady::Region| if x == 0.0 { "" } else { region.name() };
            let _ = writeln!(csv, "{cells},{},{}", name(*low, below), name(*high, above));
        }
    }
    csv
}

/// `flux_map.csv`: the current of the fitted flux map on its knots, at 20 degC, psi_q >= 0; it is odd in psi_q.
pub fn flux_map_csv(map: &Map) -> String {
    let plant = &map.drive.plant;
    let mut csv = String::from("psi_d,psi_q,i_d,i_q\n");
    for x in plant.flux_map.knots() {
        let i = plant.flux_map.current(x);
        let _ = writeln!(csv, "{}", [x.d() + plant.motor.psi_M, x.q(), i.d(), i.q()].map(number).join(","));
    }
    csv
}

/// An array as a file of NumPy's format, version 1.0; `descr` is the type of the bytes.
fn npy(descr: &str, shape: &[usize], data: &[u8]) -> Vec<u8> {
    let extents: Vec<String> = shape.iter().map(usize::to_string).collect();
    // A tuple with one element keeps its comma.
    let head = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({},), }}", extents.join(", "));
    // Magic, version and length of the header take ten bytes; the data start at a multiple of 64.
    let length = (head.len() + 11).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes());
    bytes.extend(format!("{head:<width$}\n", width = length - 1).bytes());
    bytes.extend(data);
    bytes
}

/// Letters of the longest name of a region.
const LETTERS: usize = 5;

/// `map.npz`: the axes `u_dc`, `T`, `speed` and `x`; the envelope over the first three; all else over the four, NaN out of
/// reach.
///
/// # Errors
/// The archive becomes too large.
pub fn npz(map: &Map) -> Result<Vec<u8>> {
    let kelvin = |T: &f64| T + ZERO_CELSIUS;
    let reals = |shape: &[usize], all: &mut dyn Iterator<Item = f64>| {
        npy("<f8", shape, &all.flat_map(f64::to_le_bytes).collect::<Vec<u8>>())
    };
    let (u_dc, T) = (&map.u_dc, &map.T);
    let (speed, x) = (&map.axes.speed, &map.axes.x);
    let shape = [u_dc.len(), T.len(), speed.len(), x.len()];
    let mut arrays = vec![
        ("u_dc", reals(&shape[..1], &mut u_dc.iter().copied())),
        ("T", reals(&shape[1..2], &mut T.iter().map(kelvin))),
        ("speed", reals(&shape[2..3], &mut speed.iter().copied())),
        ("x", reals(&shape[3..], &mut x.iter().copied())),
    ];
    for (k, name) in ["tau_min", "tau_max"].into_iter().enumerate() {
        let mut all = map.sheets.iter().flat_map(|sheet| sheet.limits.iter().map(move |limits| limits[k]));
        arrays.push((name, reals(&shape[..3], &mut all)));
    }
    let points = || map.sheets.iter().flat_map(|sheet| &sheet.points);
    let torque: Column = ("torque", |p| p.powers.tau_shaft);
    for (name, of) in std::iter::once(torque).chain(COLUMNS) {
        let mut all = points().map(|point| point.as_ref().map_or(f64::NAN, of));
        arrays.push((name, reals(&shape, &mut all)));
    }
    let letters = points().flat_map(|point| {
        let name = point.as_ref().map_or("", |p| p.region.name()).chars().chain(std::iter::repeat('\0'));
        name.take(LETTERS).flat_map(|c| u32::from(c).to_le_bytes())
    });
    arrays.push(("region", npy(&format!("<U{LETTERS}"), &shape, &letters.collect::<Vec<u8>>())));
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // A fixed time: equal maps give equal bytes.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default());
    for (name, bytes) in arrays {
        zip.start_file(format!("{name}.npy"), options)?;
        zip.write_all(&bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_is_that_of_numpy() {
        let bytes = npy("<f8", &[2, 3], &[7; 48]);
        assert_eq!(bytes.len(), 128 + 48);
        assert_eq!(&bytes[..10], b"\x93NUMPY\x01\x00\x76\x00");
        let head = std::str::from_utf8(&bytes[10..128]).unwrap();
        assert!(
            head.starts_with("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3,), }  ") && head.ends_with(" \n")
        );
        assert!(
            npy("<f8", &[4], &[])
                .starts_with(b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': (4,), }")
        );
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.1 + 0.2, -0.0, 1e-12, 400.0, 1.0 / 3.0].map(number), ["0.3", "0", "1e-12", "400", "0.333333333"]);
    }
}
