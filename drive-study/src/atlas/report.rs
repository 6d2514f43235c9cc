//! The atlas as CSV, as Markdown and as one self-contained page.

use super::cell::{Cell, Course};
use super::drive::Approach;
use super::map::{self, percent};
use super::run::{Atlas, Loss, Verdict};
use crate::ink;
use fmu_plot::page::{self, escape};
use std::fmt::Write as _;

/// A row per run.
pub fn csv(atlases: &[Atlas]) -> String {
    let mut text = String::from(
        "estimator,machine,scenario,R^/R,psi^/psi,load,speed,angle in deg,lost,lost at in s,lock_lost,lock_lost is true,\
         speed error,angle error in deg\n",
    );
    for Atlas { drive, runs } in atlases {
        for (cell, verdict) in runs {
            let Cell { scenario, R, psi, load, speed, theta } = cell;
            let (class, at) =
                verdict.lost.map_or(("", String::new()), |(class, at)| (class.name(), format!("{at:.4}")));
            let _ = writeln!(
                text,
                "{},\"{}\",{},{R},{psi},{load},{speed},{theta},{class},{at},{:.3},{},{:.5},{:.2}",
                drive.name,
                drive.machine,
                scenario.name(),
                verdict.lock_lost,
                verdict.lock_lost_is_right(),
                verdict.speed_error,
                verdict.angle_error
            );
        }
    }
    text
}

/// A table: its headings and rows.
struct Table {
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn new<const N: usize>(heads: [&str; N]) -> Self {
        Self { heads: heads.map(Into::into).to_vec(), rows: Vec::new() }
    }

    fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = format!("|{}\n", "---|".repeat(self.heads.len()));
        line(&self.heads) + &rule + &self.rows.iter().map(|row| line(row)).collect::<String>()
    }

    fn html(&self) -> String {
        let line = |tag: &str, cells: &[String]| {
            let cells: String =
                cells.iter().map(|c| format!("<{tag}>{}</{tag}>", escape(c))).collect::<Vec<_>>().concat();
            format!("<tr>{cells}</tr>\n")
        };
        let rows: String = self.rows.iter().map(|row| line("td", row)).collect();
        format!(
            "<div class=\"scroll\" tabindex=\"0\"><table>\n<thead>{}</thead>\n<tbody>\n{rows}</tbody></table></div>\n",
            line("th", &self.heads)
        )
    }
}

/// Number of lost runs: among all, and among those with R^ within 20 % of R and psi^ within 5 % of psi.
fn lost<'a>(runs: impl Iterator<Item = &'a (Cell, Verdict)>) -> [String; 2] {
    let (mut all, mut near) = ([0_u32; 2], [0_u32; 2]);
    for (cell, verdict) in runs {
        let is = u32::from(verdict.lost.is_some());
        all = [all[0] + is, all[1] + 1];
        if (cell.R - 1.0).abs() < 0.2001 && (cell.psi - 1.0).abs() < 0.0501 {
            near = [near[0] + is, near[1] + 1];
        }
    }
    [all, near].map(|[lost, of]| {
        let share = if of > 0 { format!(" ({})", percent(f64::from(lost) / f64::from(of))) } else { String::new() };
        format!("{lost} of {of}{share}")
    })
}

/// Lost cells by drive and scenario.
fn by_scenario(atlases: &[Atlas]) -> Table {
    let mut table = Table::new(["Estimator", "Machine", "Scenario", "Lost", "R^ within 20 %, psi^ within 5 %"]);
    for Atlas { drive, runs } in atlases {
        for &scenario in Course::ALL {
            let of = || runs.iter().filter(|(cell, _)| cell.scenario == scenario);
            if of().next().is_some() {
                let [all, near] = lost(of());
                table.rows.push(vec![
                    drive.name.clone(),
                    drive.machine.clone(),
                    format!("{}: {}", scenario.name(), scenario.title()),
                    all,
                    near,
                ]);
            }
        }
    }
    table
}

/// Name and value of an axis.
type Axis = (&'static str, fn(&Cell) -> f64);

/// Lost cells by the value on an axis.
fn by_axis(atlases: &[Atlas]) -> Table {
    let mut table = Table::new(["Estimator", "Axis", "Lost at each value"]);
    let axes: [Axis; 5] = [
        ("R^/R", |c| c.R),
        ("psi^/psi", |c| c.psi),
        ("load", |c| c.load),
        ("speed", |c| c.speed),
        ("angle", |c| c.theta),
    ];
    for Atlas { drive, runs } in atlases {
        for (name, of) in axes {
            let mut values: Vec<f64> = runs.iter().map(|(cell, _)| of(cell)).collect();
            values.sort_by(f64::total_cmp);
            values.dedup();
            if values.len() < 2 {
                continue;
            }
            let share = |x: &f64| {
                let here = || runs.iter().filter(|(cell, _)| of(cell).to_bits() == x.to_bits());
                let count = |n: usize| u32::try_from(n).map_or(0.0, f64::from);
                let lost = here().filter(|(_, verdict)| verdict.lost.is_some()).count();
                format!("{x}: {}", percent(count(lost) / count(here().count())))
            };
            let shares = values.iter().map(share).collect::<Vec<_>>().join(", ");
            table.rows.push(vec![drive.name.clone(), name.into(), shares]);
        }
    }
    table
}

/// The values of `lock_lost`, by class.
fn by_class(atlases: &[Atlas]) -> Table {
    let mut table = Table::new(["Estimator", "Class", "Cells", "lock_lost >= 1 within 1 s"]);
    for atlas in atlases {
        let mut row = |class: &str, runs: &[&Verdict], seen: usize| {
            table.rows.push(vec![atlas.drive.name.clone(), class.into(), runs.len().to_string(), seen.to_string()]);
        };
        let of = |class: Option<Loss>| -> Vec<&Verdict> {
            let is = |v: &&Verdict| v.lost.is_some_and(|(of, _)| class.is_none_or(|class| class == of));
            atlas.runs.iter().map(|(_, verdict)| verdict).filter(is).collect()
        };
        let seen = |runs: &[&Verdict]| runs.iter().filter(|v| v.lock_lost >= 1.0).count();
        for &class in Loss::ALL {
            let runs = of(Some(class));
            if !runs.is_empty() {
                row(&format!("{}: {}", class.name(), class.title()), &runs, seen(&runs));
            }
        }
        row("all lost", &of(None), seen(&of(None)));
        let held: Vec<&Verdict> = atlas.that_are(false).map(|(_, verdict)| verdict).collect();
        row("held (1 or more at any time)", &held, seen(&held));
        let alarms = held.iter().filter(|v| !v.lock_lost_is_right()).count();
        row("held (1 or more while it has held for 1 s: a false alarm)", &held, alarms);
    }
    table
}

/// The course of the runs, and the criteria for loss.
fn definitions(atlases: &[Atlas]) -> Vec<&'static str> {
    let has = |approach| atlases.iter().any(|a| a.drive.approach == approach);
    let mut all = Vec::new();
    if has(Approach::Rest) {
        all.push(
            "Flux observers start from rest: speed as a step at 0.2 s, load as a step at 1 s (scenario speed: load at 0.5 s, \
             speed at 1.5 s). Lost: the speed is off by more than 1/600 of the rated speed + 5 % of the reference at any time \
             in the last 2 of 6 s.",
        );
    }
    if has(Approach::Turning) {
        all.push(
            "The others start from 0.2 of the rated speed with a ramp 0.2..1 s; the load is a ramp 1.5..1.8 s (scenario \
             speed: load 0.2..0.5 s, ramp 1..1.8 s). Lost: the speed is off by more than 0.02 of the rated speed, or the angle \
             by more than 30 deg, at any time in the last 2 of 6 s.",
        );
    }
    all.push(
        "Scenario heating lasts 14 s: R rises between 2 and 12 s. lock_lost is true if it is 1 or more within 1 s of the \
         loss, and below 1 in a held cell wherever the drive has been within its tolerance for 1 s.",
    );
    all
}

/// The tables.
pub fn markdown(atlases: &[Atlas]) -> String {
    let notes: String = definitions(atlases).join("\n\n") + "\n\n";
    format!(
        "{notes}{}\n{}\n{}",
        by_scenario(atlases).markdown(),
        by_axis(atlases).markdown(),
        by_class(atlases).markdown()
    )
}

/// The page with the maps.
pub fn page(atlases: &[Atlas]) -> String {
    let mut html = String::from("<p>Every run: <a href=\"atlas.csv\">atlas.csv</a>.</p>\n");
    for note in definitions(atlases) {
        let _ = writeln!(html, "<p>{}</p>", escape(note));
    }
    let tables = [by_scenario(atlases), by_axis(atlases), by_class(atlases)];
    for (title, table) in ["Lost", "By axis", "What lock_lost says"].iter().zip(tables) {
        let _ = write!(html, "<h2>{title}</h2>\n{}", table.html());
    }
    for atlas in atlases {
        let drive = &atlas.drive;
        let swatch = page::swatch(ink::of(drive.bench.pair.controller.model.parameters.estimator));
        let (name, machine) = (escape(&drive.name), escape(&drive.machine));
        let _ = write!(
            html,
            "<h2>{swatch}{name} ({machine})</h2>\n<p>Red: lost. A white dot: lost, and lock_lost does not report it within \
            1 s. A red dot on a held cell marks a false alarm. Speed n and load are shares of the rated values.</p>\n<div \
            class=\"scroll\" tabindex=\"0\">{}</div>\n",
            map::svg(atlas)
        );
    }
    page::page("Atlas of lost drives", &html)
}
