//! Plots a recording: one panel per display unit, time on the horizontal axis.

use anyhow::{Result, anyhow};
use fmu_import::cosimulation::{Column, Recording};
use plotters::prelude::*;

/// Width of the curves and height of a panel in pixels; the names are beside the curves, never on them.
const SIZE: (u32, u32) = (820, 240);
const NAMES: u32 = 240;
/// Units of the drawing in a pixel: the library rounds to whole ones, and curves would have corners.
const FINE: u32 = 8;
/// Maximum number of points drawn per curve: the highest and lowest point of as many intervals as the picture resolves.
const STRETCHES: usize = 1000;
/// Colors that remain distinguishable with color blindness (Okabe and Ito).
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];

/// Draws an SVG.
///
/// # Errors
/// There is nothing to draw.
pub fn svg(recording: &Recording) -> Result<String> {
    let (Some(&start), Some(&stop)) = (recording.time.first(), recording.time.last()) else {
        return Err(anyhow!("nothing was recorded, so there is nothing to plot"));
    };
    let mut units: Vec<&str> = Vec::new();
    for column in &recording.columns {
        if !units.contains(&column.shown_unit()) {
            units.push(column.shown_unit());
        }
    }
    if units.is_empty() {
        return Err(anyhow!("nothing was recorded, so there is nothing to plot"));
    }
    let mut text = String::new();
    {
        let height = SIZE.1 * u32::try_from(units.len())?;
        let root = SVGBackend::with_string(&mut text, (FINE * (SIZE.0 + NAMES), FINE * height)).into_drawing_area();
        root.fill(&WHITE).map_err(drawing)?;
        for (area, unit) in root.split_evenly((units.len(), 1)).iter().zip(&units) {
            let shown = |c: &Column| -> Vec<f64> {
                c.values.iter().map(|x| c.display.as_ref().map_or(*x, |display| display.show(*x))).collect()
            };
            let of_unit = recording.columns.iter().filter(|c| c.shown_unit() == *unit);
            let columns: Vec<(&str, Vec<f64>)> = of_unit.map(|c| (c.name.as_str(), shown(c))).collect();
            let finite = || columns.iter().flat_map(|(_, x)| x.iter().copied().filter(|x| x.is_finite()));
            let (low, high) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
            let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
            let margin = (0.06 * (high - low)).max(1e-9 + 1e-3 * high.abs().max(low.abs()));
            let (curves, names) = area.split_horizontally(FINE * SIZE.0);
            let mut chart = ChartBuilder::on(&curves)
                .margin(10 * FINE)
                .x_label_area_size(30 * FINE)
                .y_label_area_size(70 * FINE)
                .build_cartesian_2d(start..stop, low - margin..high + margin)
                .map_err(drawing)?;
            chart
                .configure_mesh()
                .light_line_style(TRANSPARENT)
                .bold_line_style(RGBColor(225, 225, 225).stroke_width(FINE))
                .axis_style(BLACK.stroke_width(FINE))
                .set_all_tick_mark_size(5 * FINE)
                .label_style(("sans-serif", 12 * FINE))
                .x_desc("time in s")
                .y_desc(if unit.is_empty() { "1" } else { unit })
                .draw()
                .map_err(drawing)?;
            for (place, (name, values)) in columns.iter().enumerate() {
                // When the colors are used up, they repeat in a paler tone.
                let color = COLORS[place % COLORS.len()].mix(if place < COLORS.len() { 1.0 } else { 0.45 });
                let line = LineSeries::new(thin(&recording.time, values), color.stroke_width(3 * FINE / 2));
                chart.draw_series(line).map_err(drawing)?;
                let fine = i32::try_from(FINE)?;
                let y = fine * (20 + 17 * i32::try_from(place)?);
                let dash = PathElement::new([(0, y), (18 * fine, y)], color.stroke_width(3 * FINE));
                names.draw(&dash).map_err(drawing)?;
                let name = Text::new(*name, (24 * fine, y - 5 * fine), ("sans-serif", 12 * FINE));
                names.draw(&name).map_err(drawing)?;
            }
        }
        root.present().map_err(drawing)?;
    }
    let size = |fine: u32, height: u32| format!("width=\"{}\" height=\"{}\"", fine * (SIZE.0 + NAMES), fine * height);
    let height = SIZE.1 * u32::try_from(units.len())?;
    Ok(text.replacen(&size(FINE, height), &size(1, height), 1))
}

pub(crate) fn drawing(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("drawing: {error}")
}

/// Drops points that cannot be seen and keeps every peak.
fn thin(time: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let length = values.len().div_ceil(STRETCHES).max(1);
    let stretches = time.chunks(length).zip(values.chunks(length));
    let mut points = Vec::new();
    for (t, x) in stretches {
        let finite = || (0..x.len()).filter(|&i| x[i].is_finite());
        let by_value = |a: &usize, b: &usize| x[*a].total_cmp(&x[*b]);
        let mut ends: Vec<usize> = finite().min_by(by_value).into_iter().chain(finite().max_by(by_value)).collect();
        ends.sort_unstable();
        ends.dedup();
        points.extend(ends.into_iter().map(|i| (t[i], x[i])));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_survive_thinning() {
        let time: Vec<f64> = (0..100_000).map(f64::from).collect();
        let mut values = vec![0.0; time.len()];
        values[77_777] = 5.0;
        let points = thin(&time, &values);
        assert!(points.len() <= 2 * STRETCHES && points.contains(&(77_777.0, 5.0)));
    }

    #[test]
    fn a_panel_for_each_unit() {
        let column = |name: &str, unit: &str| Column {
            name: name.into(),
            unit: unit.into(),
            display: None,
            values: vec![0.0, 1.0, f64::NAN],
        };
        let columns = vec![column("p.i_a", "A"), column("p.speed", "rad/s"), column("p.i_b", "A")];
        let recording = Recording { time: vec![0.0, 0.5, 1.0], columns, ended_by: None };
        let text = svg(&recording).unwrap();
        assert!(text.contains("height=\"480\"") && text.contains("p.i_b") && !text.contains("NaN"));
        assert!(svg(&Recording::default()).is_err());
    }
}
