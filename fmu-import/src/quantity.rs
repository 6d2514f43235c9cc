//! User input for a variable: numbers with or without a unit, names with or without a typing error.

use model_description::{Measured, ModelDescription, ModelVariable, Passage};

/// Splits `1000 rpm` or `1000rpm` into the number and the unit, which is empty for a plain number.
pub fn split(text: &str) -> Option<(f64, &str)> {
    let text = text.trim();
    if let Ok(number) = text.parse() {
        return Some((number, ""));
    }
    let digits = text.find(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c))).unwrap_or(text.len());
    (1..=digits).rev().find_map(|end| Some((text.get(..end)?.parse().ok()?, text.get(end..)?.trim())))
}

/// The integer that a text is, to the last digit: tools also write `1.0` and `9.007199254740993000e+15`.
pub fn whole(text: &str) -> Option<i128> {
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (before, after) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let unsigned = before.strip_prefix(['+', '-']).unwrap_or(before);
    let is_number = [unsigned, after].iter().all(|part| part.bytes().all(|c| c.is_ascii_digit()));
    if !is_number || (unsigned.is_empty() && after.is_empty()) {
        return None;
    }
    let digits = format!("{before}{after}");
    let shift = i64::from(exponent) - i64::try_from(after.len()).ok()?;
    if shift >= 0 {
        return digits.parse::<i128>().ok()?.checked_mul(10_i128.checked_pow(u32::try_from(shift).ok()?)?);
    }
    // What stands behind the point must be zeros.
    let cut = usize::try_from(-shift).ok()?.min(digits.len() - (before.len() - unsigned.len()));
    let (kept, zeros) = digits.split_at(digits.len() - cut);
    let kept = if kept.trim_start_matches(['+', '-']).is_empty() { "0" } else { kept };
    if zeros.bytes().all(|c| c == b'0') { kept.parse().ok() } else { None }
}

/// Converts a number from `unit` to the unit of the variable; `unit` is the variable's unit (also if empty), one of its display
/// units, or another unit of the FMU for the same quantity.
///
/// # Errors
/// Names the units that the variable has.
pub fn convert(
    number: f64,
    unit: &str,
    variable: &ModelVariable,
    description: &ModelDescription,
) -> Result<f64, String> {
    let own = variable.unit.as_deref();
    if unit.is_empty() || own == Some(unit) {
        return Ok(number);
    }
    if let Some(shown) = description.display_unit(variable, Some(unit)) {
        return Ok(shown.unshow(number));
    }
    let defined = description.unit(unit).and_then(|defined| defined.base);
    let given = Measured { unit: Some(unit), base: defined, relative: variable.relative };
    match given.into_unit(description.measured(variable)) {
        Ok(Passage::Equal) if defined.is_some() => return Ok(number),
        Ok(Passage::Converted(conversion)) => return Ok(conversion.apply(number)),
        _ => {}
    }
    let definition = own.and_then(|own| description.unit(own));
    let of = format!("{} = {number}{unit}", variable.name);
    if unit.starts_with(',') {
        return Err(format!("{of} is not a number: write a decimal point"));
    }
    let shown = definition.iter().flat_map(|definition| &definition.display_units).map(|shown| shown.name.as_str());
    match own.into_iter().chain(shown).collect::<Vec<_>>() {
        units if units.is_empty() => Err(format!("{of} is not a number, and the variable has no unit")),
        units => Err(format!("{of} is not a number in {}", units.join(" or "))),
    }
}

/// `; did you mean a or b?` with the names that resemble the input, or empty.
pub fn suggest<'a>(written: &str, names: impl Iterator<Item = &'a str>) -> String {
    let names = similar(written, names);
    if names.is_empty() { String::new() } else { format!("; did you mean {}?", names.join(" or ")) }
}

/// At most three names that resemble the input, the nearest first.
pub fn similar<'a>(written: &str, names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let whole = written.to_lowercase();
    let (parent, last) = split_last(&whole);
    let likeness = |name: &str| {
        let lower = name.to_lowercase();
        let (of, part) = split_last(&lower);
        let of_last = strsim::jaro_winkler(last, part);
        // `motor.R` is nearer to `plant.motor.R_s` than to `chopper.R`.
        let of_parts = parent.map_or(of_last, |parent| {
            let of = of.unwrap_or_default();
            let as_deep = of.rmatch_indices('.').nth(parent.matches('.').count()).map_or(of, |(dot, _)| &of[dot + 1..]);
            0.5 * (of_last + strsim::jaro_winkler(parent, as_deep))
        });
        strsim::jaro_winkler(&whole, &lower).max(of_parts)
    };
    let mut near: Vec<(f64, &str)> = names.map(|name| (likeness(name), name)).filter(|(x, _)| *x > 0.78).collect();
    near.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.len().cmp(&b.1.len())));
    // As near as the nearest.
    let best = near.first().map_or(1.0, |(x, _)| *x);
    near.into_iter().take_while(|(x, _)| *x > best - 0.05).take(3).map(|(_, name)| name).collect()
}

/// The parts before the last dot, if there is one, and after it.
fn split_last(name: &str) -> (Option<&str>, &str) {
    name.rsplit_once('.').map_or((None, name), |(parent, last)| (Some(parent), last))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_with_its_unit() {
        assert_eq!(split(" 1000 rpm"), Some((1000.0, "rpm")));
        assert_eq!(split("-1.5e3rad/s"), Some((-1500.0, "rad/s")));
        assert_eq!(split("2e-3"), Some((2e-3, "")));
        assert_eq!(split("36 mH"), Some((36.0, "mH")));
        assert_eq!(split("1,5"), Some((1.0, ",5")));
        assert_eq!(split("rpm"), None);
    }

    #[test]
    fn an_integer_in_any_form_keeps_its_digits() {
        for (text, integer) in [
            ("7", 7),
            ("-7.0", -7),
            ("+0.0", 0),
            ("1e3", 1000),
            ("1.500e1", 15),
            ("9.007199254740993000e+15", 9_007_199_254_740_993),
            ("18446744073709551615.000", u64::MAX.into()),
            ("0.000000000000000000e+00", 0),
            ("-.0", 0),
            ("1200e-2", 12),
            ("0e-9", 0),
        ] {
            assert_eq!(whole(text), Some(integer), "{text}");
        }
        for text in ["", "-", ".", "1.5", "1e-1", "0x10", "1_0", "e3", "1e99", "--1", "1.-0", "NaN", "inf", "1 2", "1e"]
        {
            assert_eq!(whole(text), None, "{text}");
        }
    }

    #[test]
    fn names_that_resemble() {
        let names = ["plant.motor.R_s", "controller.motor.R_s", "plant.motor.psi_M", "speed", "speed_ref"];
        let of = |written| suggest(written, names.into_iter());
        assert_eq!(of("R"), "; did you mean plant.motor.R_s or controller.motor.R_s?");
        let with_chopper = suggest("motor.R", names.into_iter().chain(["chopper.R"]));
        assert_eq!(with_chopper, "; did you mean plant.motor.R_s or controller.motor.R_s?");
        assert_eq!(of("motor.psi_m"), "; did you mean plant.motor.psi_M?");
        assert_eq!(of("sped"), "; did you mean speed?");
        assert_eq!(of("xyz"), "");
    }
}
