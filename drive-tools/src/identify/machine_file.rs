//! The machine file of a record or of a commissioning, as `fmu tune` reads it.

use super::verdict::Quantity;
use super::{Identified, Ratings};
use fmu_core::digits::rounded;
use std::fmt::{Arguments, Write};

/// Contents of a machine file.
#[derive(Clone, Debug)]
pub struct Content<'a> {
    /// Origin of the values.
    pub from: &'static str,
    /// Notes for the reader.
    pub notes: &'a [String],
    /// Pole pairs.
    pub n_p: i32,
    /// The quantities.
    pub values: &'a [Quantity],
    /// Ratings.
    pub ratings: Ratings,
    /// Lines at the end that `fmu tune` does not read.
    pub remarks: Vec<String>,
}

/// Text of the file of a record.
pub fn text(found: &Identified, name: &str, source: &str) -> String {
    let mut remarks = vec![];
    if let Some(values) = found.fit.saturation() {
        remarks.push("[saturation] # as fitted, without intervals; L_d and L_q apply at zero current".to_owned());
        let line = |(name, value): (&&str, f64)| format!("{name} = {}", number(value));
        remarks.extend(["s_2", "s_3", "s_dq"].iter().zip(values).map(line));
    }
    let Identified { notes, n_p, values, ratings, .. } = found;
    Content { from: "a record", notes, n_p: *n_p, values, ratings: *ratings, remarks }.text(name, source)
}

impl Content<'_> {
    /// Text of the file: a value followed by its half-width, or a comment with the reason if there is no value.
    pub fn text(&self, name: &str, source: &str) -> String {
        let Ratings { current, speed, torque, u_dc } = self.ratings;
        let mut out = String::new();
        let mut line = |text: Arguments<'_>| {
            let _ = out.write_fmt(text);
            out.push('\n');
        };
        line(format_args!("# A machine identified from {}. SI units, peak values; intervals of 95 %.", self.from));
        for note in self.notes {
            line(format_args!("# {note}"));
        }
        line(format_args!("name = {name:?}\nsource = {source:?}\n\n[machine]\nn_p = {}", self.n_p));
        self.write(&mut line, &["R_s", "L_d", "L_q", "psi_M"]);
        line(format_args!("\n[mechanics]"));
        self.write(&mut line, &["J", "B", "tau_coulomb"]);
        line(format_args!("\n[rating]"));
        let mut rating = |name: &str, unit: &str, (x, given): (f64, bool)| {
            if x > 0.0 {
                let origin = if given { "given" } else { "the maximum in the record" };
                line(format_args!("{name} = {}  # {unit}: {origin}", number(x)));
            } else {
                line(format_args!("# {name} = ...  # {unit}: {} does not tell it; give --{name}", self.from));
            }
        };
        rating("speed", "rad/s, mechanical", speed);
        rating("torque", "N.m", torque);
        rating("current", "A, maximum", current);
        line(format_args!("\n[dc_link]"));
        match u_dc {
            Some(u_dc) => line(format_args!("u_dc = {}  # V", number(u_dc))),
            None => line(format_args!("# u_dc = ...  # V: not in the record; give --u-dc")),
        }
        line(format_args!("\n[inverter]"));
        self.write(&mut line, &["u_dead", "i_zero"]);
        for (k, remark) in self.remarks.iter().enumerate() {
            line(format_args!("{}# {remark}", if k == 0 { "\n" } else { "" }));
        }
        out
    }

    fn write(&self, line: &mut dyn FnMut(Arguments<'_>), names: &[&str]) {
        for value in self.values.iter().filter(|v| names.contains(&v.name)) {
            let Quantity { name, unit, half_width, .. } = value;
            let number = number(value.value);
            match &value.refused {
                None if half_width.is_nan() => line(format_args!("{name} = {number}  # {unit}, given")),
                None => line(format_args!("{name} = {number}  # {unit}, +-{:.2} %", 100.0 * half_width)),
                Some(why) if value.value == 0.0 => line(format_args!("# {name} = ...  # refused: {why}")),
                Some(why) => line(format_args!("# {name} = {number}  # refused: {why}")),
            }
        }
    }
}

/// A number with six digits, as TOML writes a float.
pub(super) fn number(x: f64) -> String {
    format!("{:?}", rounded(x, 6))
}
