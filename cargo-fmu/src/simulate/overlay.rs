//! Curves from CSV files in the plot of a run: a measurement, or the recording of an earlier run.

use anyhow::{Context, Result, anyhow, bail};
use fmu_import::csv::{Heading, Table};
use fmu_system::cosimulation::{Column, Recording};
use std::path::Path;

/// A file, before the variables of the run are known.
pub(super) struct Overlay {
    /// Label of its curves.
    pub(super) label: String,
    time: Vec<f64>,
    /// The columns; one with a cell that is not a number has the error.
    columns: Vec<(Heading, Result<Vec<f64>, String>)>,
}

/// Reads the files of `--overlay`.
pub(super) fn read(texts: &[String]) -> Result<Vec<Overlay>> {
    let mut all: Vec<Overlay> = Vec::new();
    for text in texts {
        let named = text.split_once('=').filter(|_| !Path::new(text).exists());
        let (label, file) = named.map_or((None, text.as_str()), |(label, file)| (Some(label.trim()), file));
        let stem = Path::new(file).file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let label = label.map(str::to_owned).or(stem).unwrap_or_default();
        if label.is_empty() {
            bail!("--overlay {text}: expected FILE.csv or LABEL=FILE.csv");
        }
        if all.iter().any(|other| other.label == label) {
            bail!("--overlay {text}: another file has the label {label}: write LABEL=FILE.csv");
        }
        let bytes = std::fs::read(file).with_context(|| format!("--overlay {file}"))?;
        let overlay = Overlay::parse(label, &String::from_utf8_lossy(&bytes));
        all.push(overlay.map_err(|cause| anyhow!("--overlay {file}: {cause}"))?);
    }
    Ok(all)
}

impl Overlay {
    fn parse(label: String, text: &str) -> Result<Self, String> {
        let (Table { headings, rows }, separator) = Table::of_instrument(text)?;
        let number = |cell: &str| match cell {
            "" => Some(f64::NAN),
            "true" => Some(1.0),
            "false" => Some(0.0),
            cell if separator == ',' => cell.parse().ok(),
            cell => cell.replace(',', ".").parse().ok(),
        };
        let column = |k: usize| {
            let cell = |(line, cells): &(u64, Vec<String>)| {
                number(&cells[k])
                    .ok_or_else(|| format!("line {line}: {} = {:?} is not a number", headings[k].name, cells[k]))
            };
            rows.iter().map(cell).collect::<Result<Vec<_>, _>>()
        };
        if headings.len() < 2 || rows.is_empty() {
            return Err("expected a column with time, columns with values, and a row".into());
        }
        let second = headings[0].seconds()?;
        let time: Vec<f64> = column(0)?.into_iter().map(|t| t * second).collect();
        if let Some(k) = (0..time.len()).find(|&k| !time[k].is_finite() || (k > 0 && time[k] < time[k - 1])) {
            return Err(format!("line {}: the time {} s does not follow the one before it", rows[k].0, time[k]));
        }
        let columns = (1..headings.len()).map(|k| (headings[k].clone(), column(k))).collect();
        Ok(Self { label, time, columns })
    }

    /// The columns that are variables of a run, under the names and in the units there.
    ///
    /// # Errors
    /// A cell of such a column is not a number, or its unit is neither that of the variable nor its display unit.
    pub(super) fn like(&self, run: &[Column]) -> Result<Recording, String> {
        let mut recording = Recording { time: self.time.clone(), ..Recording::default() };
        for (heading, values) in &self.columns {
            let heading = heading.clone().among(|name| variable(run, name).is_some());
            let Some(of) = variable(run, &heading.name) else { continue };
            let mut values = values.clone().map_err(|cause| format!("{}: {cause}", self.label))?;
            match &of.display {
                _ if heading.unit.is_empty() || heading.unit == of.unit => {}
                Some(display) if heading.unit == display.name => {
                    for x in &mut values {
                        *x = display.unshow(*x);
                    }
                }
                display => {
                    let shown = display.as_ref().map(|d| format!(" or {}", d.name)).unwrap_or_default();
                    return Err(format!("{}: {}: expected the unit {}{shown}", self.label, heading.text, of.unit));
                }
            }
            let (name, quantity, unit) = (of.name.clone(), of.quantity.clone(), of.unit.clone());
            let (display, items) = (of.display.clone(), of.items.clone());
            recording.columns.push(Column { name, quantity, unit, display, items, values, ..Column::default() });
        }
        Ok(recording)
    }

    /// The names of the columns.
    pub(super) fn names(&self) -> Vec<&str> {
        self.columns.iter().map(|(heading, _)| heading.name.as_str()).collect()
    }
}

/// The column of this name, which may lack the name of the instance or have one more, if there is only one.
fn variable<'a>(columns: &'a [Column], name: &str) -> Option<&'a Column> {
    let ends = |long: &str, short: &str| long.strip_suffix(short).is_some_and(|rest| rest.ends_with('.'));
    let mut alike = columns.iter().filter(|c| ends(&c.name, name) || ends(name, &c.name));
    let only = alike.next().filter(|_| alike.next().is_none());
    columns.iter().find(|c| c.name == name).or(only)
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_description::DisplayUnit;

    fn run(names: &[&str]) -> Vec<Column> {
        let display = Some(DisplayUnit { name: "rpm".into(), factor: 10.0, offset: 0.0, inverse: false });
        let column = |name: &&str| Column {
            name: (*name).into(),
            unit: "rad/s".into(),
            display: display.clone(),
            ..Column::default()
        };
        names.iter().map(column).collect()
    }

    fn parse(text: &str) -> Overlay {
        Overlay::parse("bench".into(), text).unwrap()
    }

    #[test]
    fn a_measurement_has_its_own_units_and_separators() {
        let measured = parse("# bench\nt [ms];speed [rpm];other\n0;10,5;a\n20;;b\n").like(&run(&["speed"])).unwrap();
        assert_eq!(measured.time, [0.0, 0.02]);
        let [speed] = &measured.columns[..] else { panic!("{measured:?}") };
        assert!((speed.values[0] - 1.05).abs() < 1e-12 && speed.values[1].is_nan(), "{speed:?}");
        let wrong = parse("t,speed [krpm]\n0,1\n").like(&run(&["speed"])).unwrap_err();
        assert_eq!(wrong, "bench: speed [krpm]: expected the unit rad/s or rpm");
        let text = parse("t,speed\n0,fast\n").like(&run(&["speed"])).unwrap_err();
        assert_eq!(text, "bench: line 2: speed = \"fast\" is not a number");
        for wrong in ["t\n0\n", "t,x\n", "t [kg],x\n0,1\n", "t,x\n1,0\n0,1\n", "t,x\na,1\n"] {
            assert!(Overlay::parse(String::new(), wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn a_name_with_brackets_is_a_name() {
        let of = |heading: &str, names: &[&str]| {
            let recording = parse(&format!("time_ms,{heading}\n1,3\n")).like(&run(names)).unwrap();
            (recording.time[0], recording.columns[0].name.clone(), recording.columns[0].values[0])
        };
        assert_eq!(of("pos[rpm]", &["pos[rpm]", "pos"]), (1e-3, "pos[rpm]".into(), 3.0));
        let (_, name, value) = of("pos[rpm]", &["pos"]);
        assert!(name == "pos" && (value - 0.3).abs() < 1e-12, "{name} {value}");
    }

    #[test]
    fn names_match_with_and_without_an_instance() {
        let found = |names: &[&str], heading: &str| {
            let text = format!("time,{heading}\n0,1\n");
            parse(&text).like(&run(names)).unwrap().columns.first().map(|c| c.name.clone())
        };
        assert_eq!(found(&["speed"], "PmsmDrive.speed").as_deref(), Some("speed"));
        assert_eq!(found(&["p.speed", "c.speed_est"], "speed").as_deref(), Some("p.speed"));
        assert_eq!(found(&["p.speed", "q.speed"], "q.speed").as_deref(), Some("q.speed"));
        assert_eq!(found(&["p.speed", "q.speed"], "speed"), None, "which of the two?");
        assert_eq!(found(&["speed_est"], "est"), None);
    }
}
