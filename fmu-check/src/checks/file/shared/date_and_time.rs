//! `xs:dateTime` (XML Schema 1.0, part 2: dateTime), the type of generationDateAndTime in both standards.
//!
//! ```text
//! [-]YYYY-MM-DDThh:mm:ss[.fraction][Z | +hh:mm | -hh:mm]
//! ```
//!
//! Years have at least four digits, and there is no year 0; 24:00:00 is the end of a day, and an offset is at most 14:00. Years before 1
//! count leap years like those after.

/// Whether this is `xs:dateTime`: a date of the calendar and a time, with a fraction and an offset if any.
pub(crate) fn is_date_and_time(text: &str) -> bool {
    let Some((date, time)) = text.split_once('T') else { return false };
    let number = |text: &str, digits: usize| {
        (text.len() == digits && text.bytes().all(|c| c.is_ascii_digit())).then(|| text.parse::<u32>().ok()).flatten()
    };
    let parts: Vec<&str> = date.trim_start_matches('-').split('-').collect();
    let &[year, month, day] = parts.as_slice() else { return false };
    let long = year.len() > 4 && !year.starts_with('0');
    let (Some(y), Some(month), Some(day)) =
        (number(year, if long { year.len() } else { 4 }), number(month, 2), number(day, 2))
    else {
        return false;
    };
    let leap = y.is_multiple_of(4) && (!y.is_multiple_of(100) || y.is_multiple_of(400));
    let days = match month {
        2 => 28 + u32::from(leap),
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    };
    let (time, offset) = match time.find(['Z', '+', '-']) {
        Some(at) => time.split_at(at),
        None => (time, "Z"),
    };
    let clock = |text: &str| {
        let (hours, minutes) = text.split_once(':')?;
        Some((number(hours, 2)?, number(minutes, 2).filter(|m| *m < 60)?))
    };
    let offset = offset == "Z" || clock(&offset[1..]).is_some_and(|(h, m)| h < 14 || (h, m) == (14, 0));
    let Some((clocked, seconds)) = time.rsplit_once(':') else { return false };
    let (whole, fraction) = seconds.split_once('.').unwrap_or((seconds, "0"));
    let Some(((h, m), s)) = clock(clocked).zip(number(whole, 2)) else { return false };
    let ends = (h, m, s) == (24, 0, 0) && fraction.bytes().all(|c| c == b'0');
    let in_day = h < 24 && s < 60 && !fraction.is_empty() && fraction.bytes().all(|c| c.is_ascii_digit());
    y > 0 && (1..=days).contains(&day) && offset && (in_day || ends)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for good in [
            "2026-02-28T23:59:59Z",
            "2024-02-29T00:00:00",
            "2026-01-01T24:00:00Z",
            "-0001-03-31T00:00:00.5+14:00",
            "12026-12-01T00:00:00-01:30",
        ] {
            assert!(is_date_and_time(good), "{good}");
        }
        let bad = "2026-02-30T00:00:00Z 2023-02-29T00:00:00Z 2026-2-28T00:00:00Z 02026-02-28T00:00:00Z 0000-01-01T00:00:00Z \
            2026-02-28T00:00:60Z 2026-02-28T24:00:01Z 2026-02-28T00:00:00z 2026-02-28T00:00:00+14:01 2026-02-28T00:00:00.Z \
            2026-02-28 00:00:00 2026-02-28T00:00Z 2026-13-01T00:00:00Z 2026-01-01T00:60:00Z +2026-01-01T00:00:00Z";
        for bad in bad.split(' ').chain(["", "T", "2026-02-28T00:00:00+", "2026-02-28T:"]) {
            assert!(!is_date_and_time(bad), "{bad}");
        }
    }
}
