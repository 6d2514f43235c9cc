//! The output of `fmu bode`: the table, the margins, the doubts, CSV and plot.

use super::arguments::Bode;
use super::loops::{Meaning, Probe};
use anyhow::{Context, Result, bail};
use cargo_fmu::message;
use fmu_core::digits;
use fmu_import::csv::Writer;
use fmu_import::printable;
use fmu_pack::{archive, picture};
use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::ink::CURVES;
use fmu_plot::{page, svg};
use fmu_sweep::frequency::{
    Complex64, FrequencyPoint, ResponsePoint, active_ranges, band, decibels, margins, open_loop, phases,
};
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;
use std::rc::Rc;

/// Accuracy of a response, as a share of its magnitude: a real part below it has no sign.
const ACCURACY: f64 = 1e-3;

/// A number with four digits.
pub(super) fn four(x: f64) -> String {
    digits::text(x, 4, 1e6)
}

/// A response with its derived quantities.
pub(super) struct Response {
    pub(super) point: FrequencyPoint,
    pub(super) value: Complex64,
}

impl Response {
    pub(super) fn new(point: FrequencyPoint, probe: &Probe) -> Self {
        let measured = point.values[0];
        let half = std::f64::consts::PI * point.frequency * probe.mean;
        // The mean over a period, then held for one period.
        let mean = if half > 0.0 { Complex64::from_polar(half.sin() / half, -half) } else { Complex64::new(1.0, 0.0) };
        let measured = measured / (mean * mean);
        let value = if probe.meaning == Meaning::Impedance { -1.0 / measured } else { measured };
        Self { point, value }
    }
}

/// Refuses files of other formats.
pub(super) fn check(args: &Bode) -> Result<()> {
    let ends = |path: &Path, endings: &[&str]| {
        path.extension().is_some_and(|ending| endings.iter().any(|known| ending.eq_ignore_ascii_case(known)))
    };
    if let Some(path) = args.plot.as_deref().filter(|path| !ends(path, &["svg", "png"])) {
        bail!("--plot {}: plots are written as .svg or .png; --html FILE.html writes a page", path.display());
    }
    if let Some(path) = args.html.as_deref().filter(|path| !ends(path, &["html", "htm"])) {
        bail!("--html {}: pages are written as .html; --plot FILE.svg or FILE.png writes a picture", path.display());
    }
    Ok(())
}

/// Warns of values that a linear, settled system cannot have, and passes on the first warning of the FMUs.
pub(super) fn warn(responses: &[Response], probe: &Probe) {
    let at = |text: &str, of: &Response| format!("{} Hz: {text}", four(of.point.frequency));
    let mut doubts: Vec<(String, String)> = Vec::new();
    for of in responses {
        // One line for each kind, which names the first frequency and counts the others.
        doubts.extend(of.point.doubts().into_iter().map(|text| {
            let kind = text.split(|c: char| c.is_ascii_digit()).next().unwrap_or_default().to_owned();
            (kind, at(&text, of))
        }));
        for (name, most) in probe.watch.iter().zip(&of.point.watched) {
            // `lock_lost` is a number that is 1 or more in a lost drive; the others are Boolean.
            if *most >= 1.0 {
                doubts.push((name.clone(), at(&format!("{name} is {} during the measurement", four(*most)), of)));
            }
        }
    }
    let warned = responses.iter().filter_map(|of| Some(at(of.point.warning.as_ref()?, of)));
    doubts.extend(warned.map(|text| (String::new(), text)));
    let mut kinds: Vec<&str> = doubts.iter().map(|(kind, _)| kind.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    for kind in kinds {
        let all: Vec<&String> = doubts.iter().filter(|(other, _)| other == kind).map(|(_, text)| text).collect();
        let more = match all.len() - 1 {
            0 => String::new(),
            1 => ", and at another frequency".into(),
            count => format!(", and at {count} other frequencies"),
        };
        message::warning(&printable(&format!("{}{more}", all[0])));
    }
}

/// The responses as points, and the open loop, if any.
fn points(responses: &[Response], meaning: Meaning) -> (Vec<ResponsePoint>, Option<Vec<ResponsePoint>>) {
    let own: Vec<ResponsePoint> = responses.iter().map(|of| (of.point.frequency, of.value)).collect();
    let open = match meaning {
        Meaning::Closed => Some(own.iter().map(|(f, x)| (*f, open_loop(*x))).collect()),
        Meaning::Open => Some(own.clone()),
        Meaning::Plain | Meaning::Impedance => None,
    };
    (own, open)
}

/// The name of the response.
fn title(probe: &Probe) -> String {
    let over = probe.over.as_ref().unwrap_or(&probe.from);
    match probe.meaning {
        Meaning::Impedance => format!("-{} / {}", over, probe.to),
        _ => format!("{} / {over}", probe.to),
    }
}

/// Lines on bandwidth, margins or passivity.
fn summary(args: &Bode, probe: &Probe, own: &[ResponsePoint], open: Option<&[ResponsePoint]>) -> Vec<String> {
    let (mut lines, meaning) = (Vec::new(), probe.meaning);
    if meaning != Meaning::Open && meaning != Meaning::Impedance {
        let found = band(own);
        let bandwidth = found.bandwidth.map_or("not reached".into(), |f| format!("{} Hz", four(f)));
        lines.push(format!("bandwidth (-3 dB) {bandwidth}; peak {:.2} dB at {} Hz", found.peak, four(found.peak_at)));
    }
    if let Some(open) = open {
        let found = margins(open);
        let phase = match (found.crossover, found.phase, found.delay) {
            (Some(f), Some(phase), Some(delay)) => {
                format!("crossover {} Hz; phase margin {phase:.1} deg, {} ms of delay", four(f), four(1e3 * delay))
            }
            _ => "no crossover between these frequencies".into(),
        };
        let gain = match (found.phase_crossover, found.gain) {
            (Some(f), Some(gain)) => format!("gain margin {gain:.1} dB at {} Hz", four(f)),
            _ => "no gain margin between these frequencies".into(),
        };
        lines.push(format!("{phase}; {gain}"));
        lines.push(format!("largest sensitivity {:.2} dB at {} Hz", found.sensitivity, four(found.sensitivity_at)));
    }
    if meaning == Meaning::Impedance {
        let ranges = active_ranges(own, ACCURACY);
        let text: Vec<String> = ranges.iter().map(|(a, b)| format!("{} to {} Hz", four(*a), four(*b))).collect();
        lines.push(if text.is_empty() {
            "passive at all these frequencies: stable with any passive drive train".into()
        } else {
            format!("active from {}: the drive feeds a resonance there", text.join(", from "))
        });
        if let (Some(train), Some(rotor)) = (&args.spring, probe.rotor) {
            lines.extend(train.lines(rotor, own));
        }
    }
    lines
}

/// Writes files, and the table with its summary.
pub(super) fn write(args: &Bode, probe: &Probe, responses: &[Response], mut out: Box<dyn Write>) -> Result<()> {
    let (own, open) = points(responses, probe.meaning);
    let open_only = if probe.meaning == Meaning::Open { None } else { open.as_deref() };
    let mut text =
        format!("{}\n{:>12}  {:>12}  {:>9}  {:>10}", title(probe), "frequency Hz", "gain", "gain dB", "phase deg");
    if open_only.is_some() {
        let _ = write!(text, "  {:>12}  {:>14}", "open loop dB", "open phase deg");
    }
    let (own_phases, open_phases) = (phases(&own), open_only.map(phases));
    for (k, (f, x)) in own.iter().enumerate() {
        let _ =
            write!(text, "\n{:>12}  {:>12}  {:>9.3}  {:>10.2}", four(*f), four(x.norm()), decibels(*x), own_phases[k]);
        if let (Some(open), Some(phases)) = (open_only, &open_phases) {
            let _ = write!(text, "  {:>12.3}  {:>14.2}", decibels(open[k].1), phases[k]);
        }
    }
    for line in summary(args, probe, &own, open.as_deref()) {
        let _ = write!(text, "\n{line}");
    }
    let figure = figure(probe, &own, open_only);
    if let Some(path) = &args.plot {
        let svg = svg::draw(&figure)?;
        let png = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
        let bytes = if png { picture::with_text(&svg)? } else { svg.into_bytes() };
        archive::write(path, &bytes)?;
        let _ = write!(text, "\nplot: {}", path.display());
    }
    if let Some(path) = &args.html {
        let drawn = page::figure(&figure, "The plot needs JavaScript; fmu bode --plot FILE.svg draws it without.")?;
        let lines = summary(args, probe, &own, open.as_deref());
        let mut body = String::new();
        for line in lines {
            let _ = writeln!(body, "<p>{}</p>", page::escape(&line));
        }
        archive::write(path, page::page(&title(probe), &(body + &drawn)).as_bytes())?;
        let _ = write!(text, "\npage: {}", path.display());
    }
    match args.csv.as_deref() {
        Some(path) if path == Path::new("-") => {
            out.write_all(&table(responses, open_only)?).context("standard output")?;
            eprintln!("{text}");
        }
        other => {
            if let Some(path) = other {
                archive::write(path, &table(responses, open_only)?)?;
                let _ = write!(text, "\nresponses: {}", path.display());
            }
            writeln!(out, "{text}").context("standard output")?;
        }
    }
    Ok(())
}

/// The responses as CSV.
fn table(responses: &[Response], open: Option<&[ResponsePoint]>) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut out = Writer::new(&mut bytes);
    let names = ["frequency [Hz]", "real", "imaginary", "amplitude", "nonlinear", "unsettled", "stepped"];
    let more: &[&str] = if open.is_some() { &["open_real", "open_imaginary"] } else { &[] };
    out.row(names.iter().chain(more).map(|name| (*name).to_owned()))?;
    for (k, Response { point, value }) in responses.iter().enumerate() {
        let stepped = point.stepped.map(|x| x.to_string()).unwrap_or_default();
        let numbers = [point.frequency, value.re, value.im, point.amplitude, point.nonlinear, point.unsettled];
        let open = open.map(|open| [open[k].1.re, open[k].1.im]);
        let cells = numbers.iter().map(f64::to_string).chain([stepped]);
        out.row(cells.chain(open.iter().flatten().map(f64::to_string)))?;
    }
    out.finish()?;
    Ok(bytes)
}

/// Gain and phase over the frequency.
fn figure(probe: &Probe, own: &[ResponsePoint], open: Option<&[ResponsePoint]>) -> Figure {
    let x: Rc<[f64]> = own.iter().map(|(f, _)| f.log10()).collect();
    let window = (x.first().copied().unwrap_or_default(), x.last().copied().unwrap_or_default());
    let name = match probe.meaning {
        Meaning::Plain | Meaning::Impedance => title(probe),
        Meaning::Closed => format!("closed loop {}", title(probe)),
        Meaning::Open => format!("open loop {}", title(probe)),
    };
    let all = [Some((name, own)), open.map(|open| ("open loop T / (1 - T)".to_owned(), open))];
    let curves = |of: &dyn Fn(&[ResponsePoint]) -> Vec<f64>| {
        let curve = |(k, (name, points)): (usize, &(String, &[ResponsePoint]))| {
            Curve::new(name.as_str(), CURVES[k], &x, of(points))
        };
        all.iter().flatten().enumerate().map(curve).collect::<Vec<_>>()
    };
    let marks = open.or((probe.meaning == Meaning::Open).then_some(own)).map(|points| {
        let found = margins(points);
        let phase = found.crossover.zip(found.phase).map(|(f, x)| (f.log10(), format!("phase margin {x:.0}°")));
        let gain = found.phase_crossover.zip(found.gain).map(|(f, x)| (f.log10(), format!("gain margin {x:.1} dB")));
        phase.into_iter().chain(gain).collect::<Vec<_>>()
    });
    let gain = |points: &[ResponsePoint]| points.iter().map(|(_, x)| decibels(*x)).collect();
    let panel = |title: &str, unit: &str, curves| Panel {
        title: title.into(),
        unit: unit.into(),
        window,
        log: true,
        curves,
        ..Panel::default()
    };
    let gains = Panel { marks: marks.unwrap_or_default(), ..panel("Gain", "dB", curves(&gain)) };
    let panels = vec![gains, panel("Phase", "deg", curves(&phases))];
    Figure { title: title(probe), x: "frequency in Hz", columns: 1, panels }
}
