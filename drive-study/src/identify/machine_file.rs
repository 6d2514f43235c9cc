//! The machine file of a record, as `fmu tune` reads it.

use super::{Identified, Ratings};
use std::fmt::Write;

/// Text of the file: a value with its half-width behind it, or a comment with the reason where there is none.
pub fn text(found: &Identified, name: &str, source: &str) -> String {
    let Ratings { current, speed, torque, u_dc } = found.ratings;
    let mut out = String::new();
    let mut line = |text: std::fmt::Arguments<'_>| {
        let _ = out.write_fmt(text);
        out.push('\n');
    };
    line(format_args!("# A machine identified from a record. SI units, peak values; intervals of 95 %."));
    for note in &found.notes {
        line(format_args!("# {note}"));
    }
    line(format_args!("name = {name:?}\nsource = {source:?}\n\n[machine]\nn_p = {}", found.n_p));
    let write = |line: &mut dyn FnMut(std::fmt::Arguments<'_>), names: &[&str]| {
        for value in found.values.iter().filter(|v| names.contains(&v.name)) {
            let number = number(value.value);
            match &value.refused {
                None => line(format_args!(
                    "{} = {number}  # {}, +-{:.2} %",
                    value.name,
                    value.unit,
                    100.0 * value.half_width
                )),
                Some(why) => line(format_args!("# {} = {number}  # refused: {why}", value.name)),
            }
        }
    };
    write(&mut line, &["R_s", "L_d", "L_q", "psi_M"]);
    line(format_args!("\n[mechanics]"));
    write(&mut line, &["J", "B", "tau_coulomb"]);
    line(format_args!("\n[rating]"));
    let origin = |given: bool| if given { "given" } else { "the greatest of the record" };
    if speed.0 > 0.0 {
        line(format_args!("speed = {}  # rad/s, mechanical: {}", number(speed.0), origin(speed.1)));
    } else {
        line(format_args!("# speed = ...  # rad/s: the rotor stood still; give --speed"));
    }
    line(format_args!("torque = {}  # N.m: {}", number(torque.0), origin(torque.1)));
    line(format_args!("current = {}  # A, maximum: {}", number(current.0), origin(current.1)));
    line(format_args!("\n[dc_link]"));
    match u_dc {
        Some(u_dc) => line(format_args!("u_dc = {}  # V", number(u_dc))),
        None => line(format_args!("# u_dc = ...  # V: not in the record; give --u-dc")),
    }
    line(format_args!("\n[inverter]"));
    write(&mut line, &["u_dead", "i_zero"]);
    if let Some(values) = found.fit.saturation() {
        line(format_args!(
            "\n# [saturation]  # as the fit has it, without intervals; L_d and L_q are those of no current"
        ));
        for (name, value) in ["s_2", "s_3", "s_dq"].iter().zip(values) {
            line(format_args!("# {name} = {}", number(value)));
        }
    }
    out
}

/// A number with six digits, as TOML writes a float.
fn number(x: f64) -> String {
    let text = format!("{x:.5e}");
    let short: f64 = text.parse().unwrap_or(x);
    format!("{short:?}")
}
