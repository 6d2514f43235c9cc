//! The output of a run: its files, and the last lines that the command prints.

use super::overlay::Overlay;
use super::{Simulate, curves, overview, record};
use crate::message;
use anyhow::{Context, Result, anyhow};
use fmu_import::printable;
use fmu_pack::archive;
use fmu_plot::figure::Figure;
use fmu_plot::{page, svg};
use fmu_system::cosimulation::Recording;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// How a run is written.
pub(super) struct Naming<'a> {
    /// The instances.
    pub(super) instances: &'a [&'a str],
    /// Whether variables are written without their instance: there is one, and the user has not named it.
    pub(super) plain: bool,
    /// How many of the last columns are only for the plot.
    pub(super) for_plot: usize,
}

/// The name without the single `instance`, unless it would then read as another variable of it: `d.d.x` of the instance `d` stays, because
/// `d.x` is its variable `x`.
fn plain<'a>(name: &'a str, instance: &str) -> Option<&'a str> {
    let within = |text: &'a str| text.strip_prefix(instance)?.strip_prefix('.');
    within(name).filter(|rest| within(rest).is_none())
}

/// Writes the files that the arguments request. Returns the text for the user: the last values, and the files.
pub(super) fn write(
    mut recording: Recording,
    naming: &Naming<'_>,
    overlays: &[Overlay],
    args: &Simulate,
    mut out: impl Write,
) -> Result<String> {
    if let (true, [instance]) = (naming.plain, naming.instances) {
        let names =
            recording.columns.iter_mut().map(|c| &mut c.name).chain(recording.texts.iter_mut().map(|c| &mut c.name));
        for name in names {
            // A name stays as the user has written it.
            let written = args.record.iter().any(|text| text.contains(name.as_str()));
            if let Some(plain) = plain(name, instance).filter(|_| !written) {
                *name = plain.to_owned();
            }
        }
    }
    let all_outputs = args.record.is_empty() && !args.all;
    let draws = args.plot.is_some() || args.html.is_some();
    let first_plot = draws && all_outputs;
    let plotted = if draws { Some(plotted(&recording, overlays, first_plot)?) } else { None };
    recording.columns.truncate(recording.columns.len() - naming.for_plot);
    let mut lines = Vec::new();
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
        let is_png = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
        let bytes = if is_png { png(&svg).with_context(|| path.display().to_string())? } else { svg.into_bytes() };
        archive::write(path, &bytes)?;
        lines.push(format!("plot: {}", path.display()));
    }
    if let (Some(path), Some(plotted)) = (&args.html, &plotted) {
        let names: Vec<&str> =
            args.system.fmus.iter().map(|file| file.rsplit(['/', '\\']).next().unwrap_or(file)).collect();
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
    let last = match &plotted {
        Some(figure) if first_plot => overview::at_the_end(figure),
        _ => {
            let still = if all_outputs { record::still(&mut recording) } else { None };
            [Some(recording.last_values()), still].into_iter().flatten().collect::<Vec<_>>().join("\n")
        }
    };
    lines.insert(0, last);
    if let Some(name) = &recording.ended_by {
        lines.insert(0, format!("{name} asked to end the simulation"));
    }
    Ok(lines.join("\n"))
}

#[cfg(feature = "full")]
fn png(svg: &str) -> Result<Vec<u8>> {
    Ok(fmu_pack::picture::with_text(svg)?)
}

#[cfg(not(feature = "full"))]
fn png(_: &str) -> Result<Vec<u8>> {
    Err(anyhow!("this build draws no PNG"))
}

/// The figure of a run with its overlays. A warning names a file from which nothing is drawn.
fn plotted(run: &Recording, overlays: &[Overlay], first_plot: bool) -> Result<Figure> {
    let selected = |recording: &Recording| if first_plot { overview::overview(recording) } else { recording.clone() };
    let shown = selected(run);
    let mut others = Vec::new();
    for overlay in overlays {
        let mut other = selected(&overlay.like(&run.columns).map_err(|cause| anyhow!("--overlay {cause}"))?);
        other.columns.retain(|column| shown.column(&column.name).is_some());
        if other.columns.is_empty() {
            let names = |names: Vec<&str>| names.into_iter().take(12).collect::<Vec<_>>().join(", ");
            let drawn = names(shown.columns.iter().map(|c| c.name.as_str()).collect());
            let text = format!(
                "--overlay {}: no column is drawn; it has {}, the plot {drawn}",
                overlay.label,
                names(overlay.names())
            );
            message::warning(&printable(&text));
        }
        others.push(other);
    }
    let labels = overlays.iter().map(|overlay| overlay.label.as_str());
    let runs: Vec<_> = std::iter::once(("", &shown)).chain(labels.zip(&others)).collect();
    Ok(curves::figure(&runs))
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

#[cfg(test)]
mod tests {
    use super::plain;

    /// What a file of a single FMU calls a variable is that variable for `--input` and `--overlay`.
    #[test]
    fn a_name_without_its_instance_is_no_other_variable() {
        assert_eq!(plain("d.speed", "d"), Some("speed"));
        assert_eq!(plain("d.motor.R_s", "d"), Some("motor.R_s"));
        // Without its instance, it would be the variable x of d.
        assert_eq!(plain("d.d.x", "d"), None);
        assert_eq!(plain("d.double.x", "d"), Some("double.x"));
        assert_eq!((plain("other.speed", "d"), plain("dspeed", "d")), (None, None));
    }
}
