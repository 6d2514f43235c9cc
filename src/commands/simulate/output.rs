//! The output of a run: its files, and the last lines that the command prints.

use super::{Simulate, curves, overview};
use anyhow::{Context, Result};
use fmu_pack::{archive, picture};
use fmu_plot::{page, svg};
use fmu_system::cosimulation::Recording;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes the files that the arguments request. Returns the text for the user: the last values, and the files. `alone` is the
/// name of the only instance.
pub(super) fn write(
    mut recording: Recording,
    for_plot: usize,
    alone: Option<&str>,
    args: &Simulate,
    mut out: impl Write,
) -> Result<String> {
    let first_plot = (args.plot.is_some() || args.html.is_some()) && args.record.is_empty() && !args.all;
    let plotted = (args.plot.is_some() || args.html.is_some())
        .then(|| if first_plot { curves::figure(&overview::overview(&recording)) } else { curves::figure(&recording) });
    recording.columns.truncate(recording.columns.len() - for_plot);
    let mut lines = vec![match &plotted {
        Some(figure) if first_plot => overview::at_the_end(figure, alone),
        _ => recording.last_values(),
    }];
    match args.csv.as_deref() {
        Some(path) if path == Path::new("-") => {
            match recording.write_csv(&mut BufWriter::new(&mut out)) {
                // A reader such as `head` closes the pipe early.
                Err(e) if e.kind() == io::ErrorKind::BrokenPipe => {}
                other => other.context("standard output")?,
            }
        }
        Some(path) => {
            let mut bytes = Vec::new();
            recording.write_csv(&mut bytes)?;
            archive::write(path, &bytes)?;
            lines.push(format!("recording: {}", path.display()));
        }
        None => {}
    }
    if let (Some(path), Some(plotted)) = (&args.plot, &plotted) {
        let svg = svg::draw(plotted)?;
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
            let png = picture::with_text(&svg).with_context(|| path.display().to_string())?;
            archive::write(path, &png)?;
        } else {
            archive::write(path, svg.as_bytes())?;
        }
        lines.push(format!("plot: {}", path.display()));
    }
    if let (Some(path), Some(plotted)) = (&args.html, &plotted) {
        let names: Vec<&str> = args.fmus.iter().map(|file| file.rsplit(['/', '\\']).next().unwrap_or(file)).collect();
        let figure =
            page::figure(plotted, "The plot needs JavaScript; fmu simulate --plot FILE.svg draws it without.")?;
        let ended = recording
            .ended_by
            .as_ref()
            .map(|name| format!("<p>{} asked to end the simulation.</p>\n", page::escape(name)));
        let body = format!("{}{figure}", ended.unwrap_or_default());
        archive::write(path, page::page(&names.join(", "), &body).as_bytes())?;
        lines.push(format!("page: {}\n{}", path.display(), how_to_open(&std::path::absolute(path)?)));
    }
    if let Some(name) = &recording.ended_by {
        lines.insert(0, format!("{name} asked to end the simulation"));
    }
    Ok(lines.join("\n"))
}

/// Instructions to open a page: with the command of this system, and in any browser.
fn how_to_open(page: &Path) -> String {
    let path = page.display().to_string();
    let command = if cfg!(windows) {
        "start"
    } else if cfg!(target_os = "macos") {
        "open"
    } else {
        "xdg-open"
    };
    let quoted = if path.contains(char::is_whitespace) { format!("\"{path}\"") } else { path.clone() };
    let escaped = |c: char| if " \"#%?".contains(c) { format!("%{:02X}", u32::from(c)) } else { c.to_string() };
    let address: String = path.replace('\\', "/").chars().map(escaped).collect();
    format!("open it with: {command} {quoted}\nor in a browser: file:///{}", address.trim_start_matches('/'))
}
