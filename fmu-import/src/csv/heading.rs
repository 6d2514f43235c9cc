//! Headings of columns: names with units, and the unit of a column with time.

/// The heading of a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Heading {
    /// The text, unchanged.
    pub text: String,
    /// `speed` of `speed [rpm]`.
    pub name: String,
    /// `rpm` of `speed [rpm]`; empty if there is no unit. Brackets with numbers name an element of an array.
    pub unit: String,
}

/// Units of time and their size in s.
const UNITS: [(&[&str], f64); 7] = [
    (&["s", "sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden"], 1.0),
    (&["ms", "msec", "msecs", "millis", "millisec", "millisecond", "milliseconds", "millisekunden"], 1e-3),
    (&["us", "\u{b5}s", "\u{3bc}s", "usec", "usecs", "micros", "microsec", "microsecond", "microseconds"], 1e-6),
    (&["ns", "nsec", "nsecs", "nanos", "nanosec", "nanosecond", "nanoseconds"], 1e-9),
    (&["min", "mins", "minute", "minutes", "minuten"], 60.0),
    (&["h", "hr", "hrs", "hour", "hours"], 3600.0),
    (&["d", "day", "days"], 86400.0),
];

/// Words for time itself.
const TIMES: [&str; 9] = ["time", "t", "times", "timestamp", "simtime", "zeit", "temps", "tiempo", "tempo"];

/// Words beside one for time: none of them is a unit.
const BESIDE: [&str; 14] = [
    "in",
    "stamp",
    "value",
    "values",
    "axis",
    "sim",
    "simulation",
    "simulated",
    "elapsed",
    "abs",
    "absolute",
    "rel",
    "relative",
    "since",
];

/// Names of columns that number the rows.
const NUMBERS: [&str; 8] = ["index", "unnamed: 0", "row", "rows", "sample", "samples", "no", "nr"];

impl Heading {
    pub(super) fn new(text: &str) -> Self {
        let (name, unit) = match text.strip_suffix(']').and_then(|name| name.rsplit_once('[')) {
            Some((name, unit)) if unit.trim().parse::<f64>().is_err() && !unit.contains(',') => {
                (name.trim_end(), unit.trim())
            }
            _ => (text, ""),
        };
        Self { text: text.into(), name: name.into(), unit: unit.into() }
    }

    /// The heading, split with the help of the names for which `known` is true. If the whole text is such a name, it has no unit,
    /// even with brackets at its end. A unit may also be in parentheses.
    #[must_use]
    pub fn among(self, known: impl Fn(&str) -> bool) -> Self {
        if known(&self.text) {
            return Self { name: self.text.clone(), unit: String::new(), ..self };
        }
        match self.text.strip_suffix(')').and_then(|name| name.rsplit_once('(')) {
            Some((name, unit)) if known(name.trim_end()) => {
                Self { name: name.trim_end().into(), unit: unit.trim().into(), ..self }
            }
            _ => self,
        }
    }

    /// The unit of a column with time, in s: `time`, `t [ms]`, `time_ms`, `Time (ms)`, `time/min`.
    ///
    /// # Errors
    /// The unit is not one of time, or the column is not time.
    pub fn seconds(&self) -> Result<f64, String> {
        let text = self.text.trim();
        let expected = "the first column is time, in s, ms, us, ns, min, h or d";
        let wrong = || Err(format!("{text}: {expected}, as in time [ms]"));
        if NUMBERS.contains(&text.to_lowercase().as_str()) {
            return Err(format!(
                "{text}: {expected}, and this one numbers the rows (an index): write the file without it"
            ));
        }
        let open = text.find(['[', '(', '{', '<']).filter(|_| text.ends_with([']', ')', '}', '>']));
        if let Some(open) = open {
            let inner = text[open..].trim_matches(|c: char| "[](){}<> ".contains(c));
            return unit(inner).map_or_else(wrong, Ok);
        }
        let words = words(text);
        let is_time = |word: &String| TIMES.contains(&word.to_lowercase().as_str());
        let is_beside = |word: &String| BESIDE.contains(&word.to_lowercase().as_str()) || word.parse::<u32>().is_ok();
        if let [rest @ .., last] = &words[..] {
            // `ms since start`, but `min_time`.
            let inner = rest.iter().filter(|word| word.ends_with('s') && word.len() > 1).find_map(|word| unit(word));
            if let Some(second) = unit(last).or(inner) {
                return Ok(second);
            }
            if !words.iter().all(|word| is_time(word) || is_beside(word)) {
                return wrong();
            }
        }
        Ok(1.0)
    }

    /// Whether the column is called time.
    pub fn is_time(&self) -> bool {
        words(&self.text).first().is_some_and(|word| TIMES.contains(&word.to_lowercase().as_str()))
    }
}

/// The size of a unit of time in s. Capitals count only in a longer word, because `Ms` is a megasecond.
fn unit(text: &str) -> Option<f64> {
    let of = |text: &str| UNITS.iter().find(|(names, _)| names.contains(&text)).map(|(_, second)| *second);
    of(text).or_else(|| of(&text.to_lowercase()).filter(|_| text.len() > 2 || text.chars().all(char::is_uppercase)))
}

/// The words of a heading: `simTime_ms` has three.
fn words(text: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut small = false;
    for c in text.chars() {
        let separates = c.is_whitespace() || "_/,;:.-|=#".contains(c);
        if separates || (small && c.is_uppercase()) {
            words.push(String::new());
        }
        // `timeMs` has a capital because a word begins.
        let camel = small && c.is_uppercase();
        match words.last_mut() {
            Some(word) if !separates && camel => word.extend(c.to_lowercase()),
            Some(word) if !separates => word.push(c),
            _ => {}
        }
        small = c.is_lowercase();
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_has_its_unit_in_any_spelling() {
        let of = |text: &str| Heading::new(text).seconds();
        for text in [
            "time [ms]",
            "time_ms",
            "Time (ms)",
            "Time(ms)",
            "t/ms",
            "time in ms",
            "Time, ms",
            "time{ms}",
            "timeMs",
            "TIME_MS",
            "t_ms",
            "ms",
            "Milliseconds",
            "Elapsed time (msec)",
            "simTime_ms",
            "time_in_ms",
            "ms since start",
            "Time [MSEC]",
            "time-ms",
            "time.ms",
        ] {
            assert_eq!(of(text), Ok(1e-3), "{text}");
        }
        for (text, second) in [
            ("time", 1.0),
            ("t", 1.0),
            ("Time (s)", 1.0),
            ("seconds", 1.0),
            ("time_s", 1.0),
            ("Timestamp", 1.0),
            ("sim time", 1.0),
            ("TIME [S]", 1.0),
            ("temps", 1.0),
            ("time [\u{b5}s]", 1e-6),
            ("time_us", 1e-6),
            ("Time (\u{3bc}s)", 1e-6),
            ("t [ns]", 1e-9),
            ("time_min", 60.0),
            ("Zeit in min", 60.0),
            ("time [h]", 3600.0),
            ("time_hours", 3600.0),
            ("time [d]", 86400.0),
        ] {
            assert_eq!(of(text), Ok(second), "{text}");
        }
        for text in [
            "time [kg]",
            "time_ticks",
            "time (Ms)",
            "Time/samples",
            "t [m]",
            "time [m]",
            "angle_deg",
            "ticks",
            "angle",
            "x",
            "time_step",
            "time (UTC)",
        ] {
            let error = of(text).unwrap_err();
            assert!(error.starts_with(&format!("{text}: the first column is time, in s, ms")), "{error}");
        }
        assert!(of("Unnamed: 0").unwrap_err().contains("numbers the rows (an index)"));
    }

    #[test]
    fn a_known_name_keeps_its_brackets() {
        let of = |text: &str, known: &[&str]| {
            let heading = Heading::new(text).among(|name| known.contains(&name));
            (heading.name, heading.unit)
        };
        let pair = |name: &str, unit: &str| (name.to_owned(), unit.to_owned());
        assert_eq!(of("pos[mm]", &["pos[mm]", "pos"]), pair("pos[mm]", ""));
        assert_eq!(of("pos[mm] [m]", &["pos[mm]"]), pair("pos[mm]", "m"));
        assert_eq!(of("pos[mm]", &["pos"]), pair("pos", "mm"));
        assert_eq!(of("pos (mm)", &["pos"]), pair("pos", "mm"));
        assert_eq!(of("f(x)", &["f(x)", "f"]), pair("f(x)", ""));
        assert_eq!(of("f(x)", &[]), pair("f(x)", ""));
        assert_eq!(of("m[1,2]", &["m"]), pair("m[1,2]", ""));
    }
}
