//! The map as a picture: efficiency in colors over speed and torque, in both quadrants.

use super::Map;
use super::sheet::{self, Axes, Sheet};
use super::table::{Table, reading};
use drive::steady::Region;
use fmu_plot::chart::{Band, Chart, Line};
use fmu_plot::contour::Field;
use fmu_plot::ink::Ink;
use std::f64::consts::PI;

/// rpm in a rad/s.
const RPM: f64 = 30.0 / PI;

/// Number of efficiencies at which the color changes, from below the first to above the last. Lightness grows with the efficiency:
/// the map can be read in gray too, and with color blindness (viridis).
const COUNT: usize = 9;
/// These efficiencies in % for a machine that reaches at least 95 %.
const LEVELS: [f64; COUNT] = [70.0, 80.0, 85.0, 90.0, 92.0, 94.0, 95.0, 96.0, 97.0];
/// Steps in % between the contours for other machines.
const STEPS: [f64; 6] = [5.0, 2.0, 1.0, 0.5, 0.2, 0.1];
const INKS: [Ink; 10] =
    ["#440154", "#482878", "#3e4a89", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6dcd59", "#b4de2c", "#fde725"];

/// Speeds and torques of the picture: its contours are computed from the drive and do not depend on the map's grid.
const GRID: (usize, usize) = (161, 121);

/// The picture of a sheet.
pub fn chart(map: &Map, sheet: usize) -> Chart {
    let shown = &map.sheets[sheet];
    let highest = map.axes.speed[map.axes.speed.len() - 1];
    let axes = Axes::new(GRID, highest);
    let fine = &sheet::all(&map.drive, &axes, &[shown.u_dc], &[shown.T])[0];
    let (table, top) = (Table::new(&axes, fine, &map.drive.plant), highest * RPM);
    let most = fine.limits.iter().fold([0.0_f64; 2], |m, l| [m[0].min(l[0]), m[1].max(l[1])]);
    let quadrant = |s: usize| {
        let shares: Vec<f64> = axes.x.iter().copied().filter(|x| if s == 0 { *x <= 0.0 } else { *x >= 0.0 }).collect();
        let mut field = Field { columns: shares.len(), ..Field::default() };
        for &speed in &axes.speed {
            let limit = table.limits(speed).map_or(0.0, |limits| limits[s]);
            for &x in &shares {
                let tau = x.abs() * limit;
                let losses = table.losses(speed, x).filter(|_| limit != 0.0);
                field.places.push((speed * RPM, tau));
                field.values.push(losses.map_or(f64::NAN, |l| 100.0 * reading(l, tau * speed).efficiency));
            }
        }
        field
    };
    let power = fine.points.iter().flatten().map(|point| point.powers.p_mech.abs()).fold(0.0, f64::max);
    let mut lines = isopower(top, most, power);
    for s in 0..2 {
        let on = |speed: f64| {
            Some((speed * RPM, table.limits(speed)?[s]))
                .filter(|_| table.losses(speed, if s == 0 { -1.0 } else { 1.0 }).is_some())
        };
        lines.push(Line {
            points: axes.speed.iter().filter_map(|&n| on(n)).collect(),
            thick: true,
            label: String::new(),
        });
    }
    let mut dots = Vec::new();
    if let Some((speed, point)) = map.best(shown) {
        let words = format!("{:.1} %", 100.0 * point.efficiency);
        dots.push(((speed * RPM, point.powers.tau_shaft), words));
    }
    if let Some(point) = map.rated_point(shown) {
        dots.push(((map.rated[0] * RPM, point.powers.tau_shaft), "rated".into()));
    }
    // One scale for all pictures of a map.
    let best =
        map.sheets.iter().filter_map(|sheet| map.best(sheet)).fold(0.0, |most, (_, point)| point.efficiency.max(most));
    let best = 100.0 * best;
    let margin = 0.06 * (most[1] - most[0]);
    Chart {
        title: format!("{}: efficiency from DC link to shaft, {}{}", map.name, map.title(shown), map.uncounted()),
        labels: ["speed in rpm".into(), "torque at the shaft in N.m".into()],
        window: (0.0, 1.03 * top),
        range: (most[0] - margin, most[1] + margin),
        fields: vec![quadrant(0), quadrant(1)],
        legend: "efficiency".into(),
        bands: bands(best),
        lines,
        marks: marks(map, shown),
        dots,
    }
}

/// Efficiencies in % at which the color changes where the best one is `best` (%): up to the last multiple of a step below it.
fn levels(best: f64) -> [f64; COUNT] {
    if best >= LEVELS[6] {
        return LEVELS;
    }
    // Fine steps only near 100 %, and where the efficiency is too low for coarse ones.
    let fits = |step: f64| (best < 90.0 || step <= 2.0) && (best / step).floor() >= 9.0;
    let step = STEPS.into_iter().find(|&step| fits(step)).unwrap_or(STEPS[5]);
    let mut count = (best / step).floor() - 9.0;
    [0.0; COUNT].map(|_| {
        count += 1.0;
        // Without the rounding of a sum.
        (count * step * 10.0).round() / 10.0
    })
}

fn bands(best: f64) -> Vec<Band> {
    let levels = levels(best);
    let first =
        Band { level: f64::NEG_INFINITY, name: String::new(), legend: format!("< {} %", levels[0]), ink: INKS[0] };
    let level = |(k, &level): (usize, &f64)| {
        let legend = levels.get(k + 1).map_or_else(|| format!("≥ {level} %"), |next| format!("{level} … {next} %"));
        Band { level, name: level.to_string(), legend, ink: INKS[k + 1] }
    };
    std::iter::once(first).chain(levels.iter().enumerate().map(level)).collect()
}

/// Lines of constant power at the shaft, up to the edge of the picture; up to five of each sign, within the maximum `power`.
fn isopower(top: f64, [low, high]: [f64; 2], power: f64) -> Vec<Line> {
    let decade = 10_f64.powf((power / 5.0).log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].into_iter().map(|k| k * decade).find(|s| *s >= 0.99 * power / 5.0).unwrap_or(decade);
    let mut lines = Vec::new();
    let end = 0.985 * top;
    for k in (1..=5).take_while(|k| f64::from(*k) * step <= power) {
        for (sign, limit) in [(1.0, high), (-1.0, -low)] {
            let p = f64::from(k) * step;
            // It enters the picture at the torque of the upper edge.
            let from = p * RPM / (1.04 * limit);
            if !(limit > 0.0 && from < 0.9 * end) {
                continue;
            }
            let place = |j: u32| {
                let rpm = end * (from / end).powf(f64::from(j) / 40.0);
                (rpm, sign * p * RPM / rpm)
            };
            let kilo = p >= 1e3;
            let label = format!("{} {}", sign * if kilo { p / 1e3 } else { p }, if kilo { "kW" } else { "W" });
            lines.push(Line { points: (0..=40).map(place).collect(), thick: false, label: label.replace('-', "−") });
        }
    }
    lines
}

/// Base speed, onset of maximum torque per volt, and the speed above which diodes conduct with the gates off.
fn marks(map: &Map, sheet: &Sheet) -> Vec<(f64, String)> {
    let (drive, top) = (&map.drive, map.axes.speed[map.axes.speed.len() - 1]);
    let mut all = vec![
        (drive.base_speed(sheet.u_dc), "base speed"),
        (drive.diode_speed(sheet.u_dc, sheet.T), "diodes conduct, gates off"),
    ];
    let mtpv = |speed: f64| {
        let ends = sheet::ends(&sheet::at(drive, speed, sheet.u_dc, sheet.T));
        ends.iter().flatten().any(|point| point.region == Region::Mtpv)
    };
    if let Some(k) = map.axes.speed.iter().position(|n| mtpv(*n)).filter(|k| *k > 0) {
        let (mut low, mut high) = (map.axes.speed[k - 1], map.axes.speed[k]);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            *(if mtpv(middle) { &mut high } else { &mut low }) = middle;
        }
        all.push((high, "maximum torque per volt"));
    }
    all.retain(|(speed, _)| *speed > 0.0 && *speed <= top);
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(speed, name)| (speed * RPM, format!("{name} {:.0} rpm", speed * RPM))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The best color marks this machine's best points.
    #[test]
    fn the_colors_follow_the_machine() {
        for (best, expected) in [
            (97.2, LEVELS),
            (83.1, [40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0, 75.0, 80.0]),
            (92.9, [76.0, 78.0, 80.0, 82.0, 84.0, 86.0, 88.0, 90.0, 92.0]),
        ] {
            assert_eq!(levels(best).map(f64::to_bits), expected.map(f64::to_bits), "{best}");
        }
        for best in [3.0, 12.0, 31.0, 44.0, 60.0, 89.9, 94.9] {
            let levels = levels(best);
            assert!(levels[0] > 0.0 && levels[8] <= best && levels[8] > 0.85 * best, "{best}: {levels:?}");
            assert!(levels.windows(2).all(|pair| pair[0] < pair[1]), "{levels:?}");
        }
    }
}
