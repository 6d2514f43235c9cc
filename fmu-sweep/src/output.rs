//! The folder of a sweep: its identity (`sweep.json`), its parts, and all results (`results.csv`).
//!
//! A part receives its name once it is complete and on the disk. So a sweep killed at any time resumes with the missing parts,
//! several processes may work on one folder, and a part that two of them write has the same bytes.

use crate::sweep::hash;
use crate::{Error, Sweep, files};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Version of the format of `sweep.json`.
const VERSION: u64 = 2;
/// Approximate duration of a part in s: the maximum loss of a kill.
const PART_SECONDS: f64 = 5.0;
const MOST_ROWS: u64 = 100_000;

/// The folder of a sweep that has begun.
pub(crate) struct Output {
    folder: PathBuf,
    /// Number of rows.
    rows: u64,
    cut: Cut,
}

/// Values that the first process determines and all others use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub(crate) struct Cut {
    /// Rows of a part.
    pub(crate) rows_per_part: u64,
    /// Whether instances are reset from run to run, or created anew.
    pub(crate) reuse: bool,
}

impl Cut {
    /// Parts of about 5 s, for runs of `seconds`.
    pub(crate) fn new(fixed: Option<u64>, seconds: f64, reuse: bool) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, and is limited below")]
        let timed = (PART_SECONDS / seconds.max(1e-9)) as u64;
        Self { rows_per_part: fixed.unwrap_or(timed.clamp(1, MOST_ROWS)), reuse }
    }
}

/// Number of failed rows of the results, and the first of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Failures {
    /// Number of failed rows.
    pub count: u64,
    /// The first three: row and error.
    pub first: Vec<(u64, String)>,
}

impl Failures {
    pub(crate) fn add(&mut self, line: &str) {
        if let Some(error) = Sweep::error_of(line) {
            self.count += 1;
            if self.first.len() < 3 {
                let row = line.split(',').next().and_then(|row| row.parse().ok()).unwrap_or_default();
                self.first.push((row, error));
            }
        }
    }
}

/// The identity of a sweep, in the order of `sweep.json`.
fn identity(sweep: &Sweep) -> Result<Value, Error> {
    let definition = serde_json::to_value(sweep.definition()).map_err(|e| Error::Invalid(e.to_string()))?;
    let files: Vec<Value> = sweep.files()?.iter().map(|(file, hash)| json!({ "file": file, "sha256": hash })).collect();
    let columns: Vec<Value> =
        sweep.columns().iter().map(|column| json!({ "name": column.name, "unit": column.unit })).collect();
    Ok(json!({
        "version": VERSION,
        "sha256": hash(&definition.to_string()),
        "definition": definition,
        "files": files,
        "columns": columns,
        "rows": sweep.rows().count(),
    }))
}

impl Output {
    /// Opens the folder, or creates it with the parts that a function determines.
    pub(crate) fn open(sweep: &Sweep, folder: &Path, cut: impl FnOnce() -> Result<Cut, Error>) -> Result<Self, Error> {
        let path = folder.join("sweep.json");
        let mine = identity(sweep)?;
        if !path.exists() {
            let cut = cut()?;
            let mut whole = mine.clone();
            whole["rows_per_part"] = cut.rows_per_part.into();
            whole["reuse"] = cut.reuse.into();
            let text = serde_json::to_string_pretty(&whole).map_err(|e| Error::file(&path, e))?;
            // If another process was faster, its division into parts applies.
            files::create(&path, (text + "\n").as_bytes())?;
        }
        let text = fs::read_to_string(&path).map_err(|e| Error::file(&path, e))?;
        let there: Value = serde_json::from_str(&text).map_err(|e| Error::file(&path, e))?;
        if let Some(difference) = difference("", &there, &mine) {
            let remedy = "use another folder, or --restart to remove these results";
            return Err(Error::file(&path, format!("is of another sweep: {difference}; {remedy}")));
        }
        let cut: Cut = serde_json::from_value(there).map_err(|e| Error::file(&path, e))?;
        if cut.rows_per_part == 0 {
            return Err(Error::file(&path, "rows_per_part is 0, expected at least 1"));
        }
        Ok(Self { folder: folder.to_owned(), rows: sweep.rows().count(), cut })
    }

    pub(crate) fn cut(&self) -> Cut {
        self.cut
    }

    pub(crate) fn parts(&self) -> u64 {
        self.rows.div_ceil(self.cut.rows_per_part)
    }

    /// The rows of a part.
    pub(crate) fn rows_of(&self, part: u64) -> Range<u64> {
        let first = part * self.cut.rows_per_part;
        first..(first + self.cut.rows_per_part).min(self.rows)
    }

    pub(crate) fn part(&self, part: u64) -> PathBuf {
        self.folder.join(format!("part-{part:08}.csv"))
    }

    pub(crate) fn missing(&self) -> Vec<u64> {
        (0..self.parts()).filter(|part| !self.part(*part).exists()).collect()
    }

    /// Writes all parts into one file.
    pub(crate) fn join(&self, sweep: &Sweep) -> Result<Failures, Error> {
        let path = self.folder.join("results.csv");
        let mut failures = Failures::default();
        let mut broken = None;
        let joined = files::write_with(&path, |file| {
            let mut out = io::BufWriter::new(file);
            out.write_all(sweep.header().as_bytes())?;
            for part in 0..self.parts() {
                self.copy(sweep, part, &mut out, &mut failures)
                    .inspect_err(|e| broken = Some((part, e.to_string())))?;
            }
            out.flush()
        });
        match broken {
            Some((part, cause)) => Err(Error::file(&self.part(part), cause)),
            None => joined.map(|()| failures),
        }
    }

    fn copy(&self, sweep: &Sweep, part: u64, out: &mut impl Write, failures: &mut Failures) -> io::Result<()> {
        let mut lines = BufReader::new(File::open(self.part(part))?).lines();
        let header = lines.next().transpose()?;
        if header.as_deref() != Some(sweep.header().trim_end()) {
            return Err(io::Error::other("has another header than the sweep: remove this part"));
        }
        let mut rows = self.rows_of(part);
        for line in lines {
            let line = line?;
            let expected = rows.next().map(|row| row.to_string());
            if expected.as_deref() != line.split(',').next() {
                return Err(io::Error::other("has rows of another part: remove this part"));
            }
            failures.add(&line);
            writeln!(out, "{line}")?;
        }
        if rows.is_empty() { Ok(()) } else { Err(io::Error::other("has too few rows: remove this part")) }
    }
}

/// Removes only the results of a sweep; in a folder without `sweep.json` it removes nothing.
pub(crate) fn restart(folder: &Path) -> Result<(), Error> {
    if !folder.join("sweep.json").exists() {
        return Ok(());
    }
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    for path in entries.flatten().map(|entry| entry.path()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let ours = ["sweep.json", "results.csv", "log.txt"].contains(&name.as_str())
            || name.starts_with("part-")
            || [".part-", ".sweep.json-", ".results.csv-", ".running-"].iter().any(|start| name.starts_with(start));
        let traces = name == "traces" && path.is_dir();
        let removed = if traces {
            fs::remove_dir_all(&path)
        } else if ours {
            fs::remove_file(&path)
        } else {
            Ok(())
        };
        removed.map_err(|e| Error::file(&path, e))?;
    }
    Ok(())
}

/// The first difference of two descriptions; entries that only the first has do not count.
fn difference(place: &str, there: &Value, here: &Value) -> Option<String> {
    if there == here {
        return None;
    }
    let inner = |key: &str| if place.is_empty() { key.to_owned() } else { format!("{place}.{key}") };
    match (there, here) {
        (Value::Object(a), Value::Object(b)) => {
            // The definition is more informative than its hash.
            let first = b.iter().filter(|(key, _)| *key != "sha256");
            let found = first
                .chain(b.iter().filter(|(key, _)| *key == "sha256"))
                .find_map(|(key, value)| difference(&inner(key), a.get(key).unwrap_or(&Value::Null), value));
            let gone = || a.keys().find(|key| !b.contains_key(*key) && !place.is_empty());
            found.or_else(|| gone().map(|key| format!("{} is {} there and not here", inner(key), a[key])))
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let names = |v: &Value| v.get("file").or(v.get("name")).and_then(Value::as_str).map(str::to_owned);
            let at = |k: usize, v: &Value| inner(&names(v).unwrap_or_else(|| k.to_string()));
            a.iter().zip(b).enumerate().find_map(|(k, (x, y))| difference(&at(k, y), x, y))
        }
        _ => Some(format!("{place} is {there} there and {here} here")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_named() {
        let a = json!({ "version": 1, "sha256": "a", "definition": { "design": { "seed": 7 }, "stop": 1.0 },
            "files": [{ "file": "p.fmu", "sha256": "x" }], "rows_per_part": 5 });
        let with = |change: &dyn Fn(&mut Value)| {
            let mut b = a.clone();
            b.as_object_mut().unwrap().remove("rows_per_part");
            change(&mut b);
            difference("", &a, &b)
        };
        assert_eq!(with(&|_| ()), None);
        let seed = with(&|b| {
            b["definition"]["design"]["seed"] = 8.into();
            b["sha256"] = "b".into();
        });
        assert_eq!(seed.unwrap(), "definition.design.seed is 7 there and 8 here");
        let file = with(&|b| b["files"][0]["sha256"] = "y".into());
        assert_eq!(file.unwrap(), "files.p.fmu.sha256 is \"x\" there and \"y\" here");
        let gone = with(&|b| drop(b["definition"].as_object_mut().unwrap().remove("stop")));
        assert_eq!(gone.unwrap(), "definition.stop is 1.0 there and not here");
    }

    #[test]
    fn a_part_takes_about_five_seconds() {
        let rows = |fixed, seconds| Cut::new(fixed, seconds, true).rows_per_part;
        assert_eq!([rows(None, 1e-3), rows(None, 60.0), rows(None, 0.0), rows(Some(7), 1.0)], [5000, 1, 100_000, 7]);
    }
}
