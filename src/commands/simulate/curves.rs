//! The figure of a run: a panel for each display unit, time on the horizontal axis.

use super::overview;
use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::ink::{CURVES, Ink, REFERENCE};
use fmu_system::cosimulation::Recording;
use std::rc::Rc;

/// Colors, repeated in a paler tone if needed; gray is for references without a curve.
const COLORS: usize = CURVES.len() - 1;

/// All columns of a recording. The reference of a variable is dashed, in the color of the variable.
pub(super) fn figure(recording: &Recording) -> Figure {
    let time: Rc<[f64]> = recording.time.as_slice().into();
    let window = (time.first().copied().unwrap_or_default(), time.last().copied().unwrap_or_default());
    let mut panels: Vec<Panel> = Vec::new();
    for column in &recording.columns {
        let unit = if column.shown_unit().is_empty() { "no unit" } else { column.shown_unit() };
        let at = panels.iter().position(|panel| panel.unit == unit).unwrap_or_else(|| {
            panels.push(Panel { unit: unit.into(), window, ..Panel::default() });
            panels.len() - 1
        });
        let shown = |x: &f64| column.display.as_ref().map_or(*x, |display| display.show(*x));
        let y = column.values.iter().map(shown).collect();
        panels[at].curves.push(Curve::new(column.name.as_str(), REFERENCE, &time, y));
    }
    for panel in &mut panels {
        color(&mut panel.curves);
    }
    Figure { title: String::new(), x: "time in s", columns: 1, panels }
}

fn color(curves: &mut [Curve]) {
    let names: Vec<String> = curves.iter().map(|curve| curve.name.clone()).collect();
    let (mut colors, mut place) = (Vec::<(Ink, f64)>::new(), 0);
    // The reference may be a variable of another instance.
    let base = |name: &str| {
        let base = name.strip_suffix("_ref")?;
        let same = names.iter().position(|other| other == base);
        same.or_else(|| names.iter().position(|other| overview::last(other) == overview::last(base)))
    };
    for name in &names {
        colors.push((CURVES[place % COLORS], if place < COLORS { 1.0 } else { 0.5 }));
        place += usize::from(base(name).is_none());
    }
    for (k, curve) in curves.iter_mut().enumerate() {
        let of = base(&names[k]);
        (curve.ink, curve.opacity) = colors[of.unwrap_or(k)];
        curve.dashed = of.is_some();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_system::cosimulation::Column;

    #[test]
    fn a_panel_for_each_unit_and_a_reference_in_the_color_of_its_curve() {
        let column = |name: &str, unit: &str| Column {
            name: name.into(),
            unit: unit.into(),
            display: None,
            items: Vec::new(),
            exact: Vec::new(),
            values: vec![0.0, 1.0, f64::NAN],
        };
        let columns = vec![column("c.i_a_ref", "A"), column("p.speed", ""), column("p.i_q", "A"), column("p.i_a", "A")];
        let figure = figure(&Recording { time: vec![0.0, 0.5, 1.0], columns, ..Recording::default() });
        let [currents, speed] = &figure.panels[..] else { panic!("{figure:?}") };
        assert_eq!((currents.unit.as_str(), speed.unit.as_str(), speed.window), ("A", "no unit", (0.0, 1.0)));
        let shown: Vec<_> = currents.curves.iter().map(|c| (c.ink, c.dashed)).collect();
        assert_eq!(shown, [(CURVES[1], true), (CURVES[0], false), (CURVES[1], false)]);
    }
}
