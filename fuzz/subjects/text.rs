//! Files that a user writes: tables as CSV, motors, data sheets, sweeps as TOML, presets, values over time.

use drive_tools::{csv::Columns, datasheet::file::DataSheet, tune::motor::MotorFile};
use fmu_core::preset;
use fmu_import::csv::{self, Table};
use fmu_sweep::Definition;
use fmu_system::cosimulation::{Schedule, Sequence};
use std::path::Path;

pub(crate) fn run(bytes: &[u8]) {
    if let Ok(values) = preset::read(bytes) {
        std::hint::black_box(values);
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let path = Path::new("x.toml");
    let _ = Table::of_instrument(text);
    let _ = Columns::parse(text, "x.csv");
    let _ = (MotorFile::parse(text, path), DataSheet::parse(text, path), Definition::parse(text));
    if let Ok(table) = Table::parse(text) {
        // A row that is written is read again.
        for (_, row) in &table.rows {
            assert_eq!(csv::cells(csv::line(row).trim_end_matches('\n')), *row);
        }
    }
    let _ = Sequence::parse(text);
    if let Ok(schedule) = Schedule::parse(text) {
        std::hint::black_box((schedule.at(f64::MIN), schedule.at(0.5), schedule.at(f64::MAX)));
    }
}
