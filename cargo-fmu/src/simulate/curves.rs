//! The figure of a run: a panel for each display unit, time on the horizontal axis.

use super::overview;
use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::ink::{CURVES, Ink, REFERENCE};
use fmu_system::cosimulation::Recording;
use std::rc::Rc;

/// Colors, repeated in a paler tone if needed; gray is for references without a curve.
const COLORS: usize = CURVES.len() - 1;

/// All columns of recordings, each with a label that follows the names of its curves; the first has none and sets the range of time.
/// The reference of a variable is dashed, in the color of the variable.
pub(super) fn figure(runs: &[(&str, &Recording)]) -> Figure {
    let time = runs.first().map_or(&[][..], |(_, run)| run.time.as_slice());
    let window = (time.first().copied().unwrap_or_default(), time.last().copied().unwrap_or_default());
    let mut panels: Vec<(Panel, Vec<Key<'_>>)> = Vec::new();
    for (run, (label, recording)) in runs.iter().enumerate() {
        let time: Rc<[f64]> = recording.time.as_slice().into();
        for column in &recording.columns {
            let unit = if column.shown_unit().is_empty() { "no unit" } else { column.shown_unit() };
            let at = panels.iter().position(|(panel, _)| panel.unit == unit).unwrap_or_else(|| {
                let (unit, title) = (unit.into(), column.quantity.clone());
                panels.push((Panel { title, unit, window, ..Panel::default() }, Vec::new()));
                panels.len() - 1
            });
            let (panel, keys) = &mut panels[at];
            // A title is true of all its curves.
            if panel.title != column.quantity {
                panel.title.clear();
            }
            let shown = |x: &f64| column.display.as_ref().map_or(*x, |display| display.show(*x));
            let y = column.values.iter().map(shown).collect();
            let name = if label.is_empty() { column.name.clone() } else { format!("{} ({label})", column.name) };
            panel.curves.push(Curve::new(name, REFERENCE, &time, y));
            keys.push((run, column.name.as_str()));
        }
    }
    for (panel, keys) in &mut panels {
        color(&mut panel.curves, keys);
    }
    let panels = panels.into_iter().map(|(panel, _)| panel).collect();
    Figure { title: String::new(), x: "time in s", columns: 1, panels }
}

/// Number of the run, and name of the variable.
type Key<'a> = (usize, &'a str);

fn color(curves: &mut [Curve], keys: &[Key<'_>]) {
    let (mut colors, mut place) = (Vec::<(Ink, f64)>::new(), 0);
    // The reference may be a variable of another instance.
    let base = |(run, name): &Key<'_>| {
        let base = name.strip_suffix("_ref")?;
        let same = keys.iter().position(|(other, key)| other == run && *key == base);
        let alike = |(other, key): &Key<'_>| other == run && overview::last(key) == overview::last(base);
        same.or_else(|| keys.iter().position(alike))
    };
    for key in keys {
        colors.push((CURVES[place % COLORS], if place < COLORS { 1.0 } else { 0.5 }));
        place += usize::from(base(key).is_none());
    }
    for (k, curve) in curves.iter_mut().enumerate() {
        let of = base(&keys[k]);
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
            quantity: if unit == "A" { "Current".into() } else { String::new() },
            unit: unit.into(),
            values: vec![0.0, 1.0, f64::NAN],
            ..Column::default()
        };
        let columns = vec![column("c.i_a_ref", "A"), column("p.speed", ""), column("p.i_q", "A"), column("p.i_a", "A")];
        let run = Recording { time: vec![0.0, 0.5, 1.0], columns, ..Recording::default() };
        let other = Recording { time: vec![0.0, 7.0], columns: vec![run.columns[2].clone()], ..Recording::default() };
        let figure = figure(&[("", &run), ("bench", &other)]);
        let [currents, speed] = &figure.panels[..] else { panic!("{figure:?}") };
        assert_eq!((currents.unit.as_str(), speed.unit.as_str(), speed.window), ("A", "no unit", (0.0, 1.0)));
        assert_eq!((currents.title.as_str(), speed.title.as_str()), ("Current", ""));
        assert_eq!(currents.curves[3].name, "p.i_q (bench)");
        assert_eq!(&*currents.curves[3].x, [0.0, 7.0]);
        let shown: Vec<_> = currents.curves.iter().map(|c| (c.ink, c.dashed)).collect();
        assert_eq!(shown, [(CURVES[1], true), (CURVES[0], false), (CURVES[1], false), (CURVES[2], false)]);
    }
}
