//! The time of generation, as xs:dateTime in UTC.

const DAY: i64 = 86_400;

/// `YYYY-MM-DDThh:mm:ssZ` of a number of seconds since 1970-01-01T00:00:00Z, for example of `SOURCE_DATE_EPOCH`.
///
/// FMI 2.0.5, 2.2.1 and FMI 3.0.2, 2.4.1 require the character `Z`, not an offset of zero. The year has four digits, so
/// seconds outside the years 0001 to 9999 give the first or the last second of that range.
///
/// ```
/// assert_eq!(model_description::date_from_epoch(1_700_000_000), "2023-11-14T22:13:20Z");
/// ```
pub fn date_from_epoch(seconds: i64) -> String {
    let seconds = seconds.clamp(-62_135_596_800, 253_402_300_799);
    let (year, month, day) = civil(seconds.div_euclid(DAY));
    let of_day = seconds.rem_euclid(DAY);
    let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// Year, month and day of a day counted from 1970-01-01, in the proleptic Gregorian calendar.
///
/// Years are counted from March, so that the leap day is the last day of the year and the months' lengths (31, 30, 31,
/// 30, 31, repeating) follow a straight line of slope 153/5. An era is 400 years of 146097 days.
fn civil(day: i64) -> (i64, i64, i64) {
    let shifted = day + 719_468; // days since 0000-03-01
    let (era, of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let (month, carry) = if from_march < 10 { (from_march + 3, 0) } else { (from_march - 9, 1) };
    (era * 400 + year_of_era + carry, month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_dates() {
        for (seconds, date) in [
            (0, "1970-01-01T00:00:00Z"),
            (-1, "1969-12-31T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (951_868_799, "2000-02-29T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"), // 2100 has no leap day
            (1_709_164_800, "2024-02-29T00:00:00Z"),
            (i64::MIN, "0001-01-01T00:00:00Z"),
            (i64::MAX, "9999-12-31T23:59:59Z"),
        ] {
            assert_eq!(date_from_epoch(seconds), date);
        }
    }

    #[test]
    fn every_day_follows_the_day_before() {
        let mut today = civil(-719_162);
        assert_eq!(today, (1, 1, 1));
        for day in -719_161..110_000 {
            let (year, month, date) = today;
            let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
            let length = match month {
                2 if leap => 29,
                2 => 28,
                4 | 6 | 9 | 11 => 30,
                _ => 31,
            };
            today = match (month, date) {
                (12, 31) => (year + 1, 1, 1),
                (_, d) if d == length => (year, month + 1, 1),
                _ => (year, month, date + 1),
            };
            assert_eq!(civil(day), today);
        }
    }
}
