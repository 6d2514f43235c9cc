//! Numbers in the form of xs:double.

/// The shortest text that reads back as the same double, in the form of xs:double.
///
/// Small and large magnitudes get an exponent (`1e-7`, not 0.0000001), and non-finite values are spelled `INF`, `-INF` and
/// `NaN` as in XML Schema.
///
/// ```
/// assert_eq!(model_description::format_number(325.0), "325");
/// assert_eq!(model_description::format_number(1e-7), "1e-7");
/// ```
pub fn format(x: f64) -> String {
    if x.is_nan() {
        return "NaN".into();
    }
    if x.is_infinite() {
        return if x.is_sign_positive() { "INF" } else { "-INF" }.into();
    }
    let text = format!("{x:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// A double in any of the forms that xs:double has.
pub fn parse(text: &str) -> Option<f64> {
    match text.trim() {
        "INF" | "+INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        // Rust also reads "inf", "infinity" and "nan", which XML Schema does not define.
        other => other.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b)).then(|| other.parse().ok())?,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_core::draw::Draw;

    #[test]
    fn awkward_doubles_come_back_bit_for_bit() {
        let awkward = [
            0.0,
            -0.0,
            0.1,
            1.0 / 3.0,
            1e-7,
            1e15,
            1e16,
            1e22,
            9_007_199_254_740_993.0,
            f64::MIN_POSITIVE,
            5e-324,
            2.225_073_858_507_201e-308,
            f64::MAX,
            f64::EPSILON,
            30.0 / std::f64::consts::PI,
            123_456_789.123_456_78,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ];
        for x in awkward.into_iter().flat_map(|x| [x, -x]) {
            let text = format(x);
            assert_eq!(parse(&text).map(f64::to_bits), Some(x.to_bits()), "{text}");
            assert!(text.len() < 26, "{text} is not short");
        }
        assert!(parse(&format(f64::NAN)).is_some_and(f64::is_nan));
    }

    #[test]
    fn pseudo_random_bit_patterns_come_back() {
        let mut draw = Draw(1);
        for _ in 0..20_000 {
            let bits = draw.bits();
            let x = f64::from_bits(bits);
            let back = parse(&format(x));
            assert!(back.is_some_and(|y| y.to_bits() == x.to_bits() || (x.is_nan() && y.is_nan())), "{bits:x}");
        }
    }

    #[test]
    fn only_the_forms_of_xml_schema() {
        assert_eq!(format(1e16), "1e16");
        assert_eq!(format(-2.0), "-2");
        assert_eq!(parse(" +1.5E+3 "), Some(1500.0));
        for text in ["", "inf", "nan", "infinity", "1,5", "0x10", "1_000", "1 2", "e"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
