//! Conversion of numbers between units through the SI base units (FMI 2.0.5, 2.2.2; FMI 3.0.2, 2.4.3).

use crate::units::BaseUnit;

/// A linear conversion: `factor * x + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conversion {
    /// Factor.
    pub factor: f64,
    /// Offset in the unit of the result.
    pub offset: f64,
}

impl Conversion {
    /// The number in the other unit.
    pub fn apply(&self, x: f64) -> f64 {
        self.factor * x + self.offset
    }

    /// One conversion after the other; `None` is none.
    pub fn then(first: Option<Self>, second: Option<Self>) -> Option<Self> {
        match (first, second) {
            (Some(a), Some(b)) => Some(Self { factor: b.factor * a.factor, offset: b.apply(a.offset) }),
            (one, other) => one.or(other),
        }
    }
}

/// The known part of the unit of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured<'a> {
    /// Name of the unit.
    pub unit: Option<&'a str>,
    /// Its relation to the SI base units.
    pub base: Option<BaseUnit>,
    /// The number is a difference, so no offset applies (`relativeQuantity`).
    pub relative: bool,
}

/// The path of a number from one side of a connection to the other.
#[derive(Clone, Debug, PartialEq)]
pub enum Passage {
    /// Unchanged: the units are equal.
    Equal,
    /// Converted.
    Converted(Conversion),
    /// Unchanged, for this reason: a unit is not known.
    Unknown(String),
}

impl Measured<'_> {
    /// The conversion of a number of this unit to the other.
    ///
    /// # Errors
    /// The units belong to different quantities, or one number is a difference and the other is not.
    pub fn into_unit(self, other: Measured) -> Result<Passage, String> {
        let (a, b) = match (self.unit, other.unit) {
            (None, None) => return Ok(Passage::Equal),
            (Some(a), Some(b)) => (a, b),
            (Some(a), None) => return Ok(Passage::Unknown(format!("the source is in {a}, the target has no unit"))),
            (None, Some(b)) => return Ok(Passage::Unknown(format!("the source has no unit, the target is in {b}"))),
        };
        if self.relative != other.relative {
            let one = |relative| if relative { "a difference (relativeQuantity)" } else { "an absolute value" };
            let (one, another) = (one(self.relative), one(other.relative));
            return Err(format!("the source is {one} in {a}, the target {another} in {b}"));
        }
        let (from, to) = match (self.base, other.base) {
            (Some(from), Some(to)) => (from, to),
            _ if a == b => return Ok(Passage::Equal),
            (from, _) => {
                let unknown = if from.is_none() { a } else { b };
                let cause = format!("the source is in {a}, the target in {b}, and {unknown} has no BaseUnit");
                return Ok(Passage::Unknown(cause));
            }
        };
        if from.exponents != to.exponents {
            let mut cause = format!("the source is in {a} = {}, the target in {b} = {}", formula(&from), formula(&to));
            if from.exponents[..7] == to.exponents[..7] {
                cause += "; FMI counts the radian as a base unit";
            }
            return Err(cause);
        }
        let offset = if self.relative { 0.0 } else { (from.offset - to.offset) / to.factor };
        let conversion = Conversion { factor: from.factor / to.factor, offset };
        let same = conversion == Conversion { factor: 1.0, offset: 0.0 };
        Ok(if same { Passage::Equal } else { Passage::Converted(conversion) })
    }
}

/// `kg.m2.s-2`, and `1` for a pure number.
fn formula(base: &BaseUnit) -> String {
    let power = |(name, exponent): (&&str, &i32)| match exponent {
        0 => None,
        1 => Some((*name).to_owned()),
        _ => Some(format!("{name}{exponent}")),
    };
    let factors: Vec<String> = BaseUnit::NAMES.iter().zip(&base.exponents).filter_map(power).collect();
    if factors.is_empty() { "1".into() } else { factors.join(".") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn base(exponents: [i32; 8], factor: f64, offset: f64) -> BaseUnit {
        BaseUnit { exponents, factor, offset }
    }

    const K: [i32; 8] = [0, 0, 0, 0, 1, 0, 0, 0];
    const KELVIN: Measured = Measured { unit: Some("K"), base: Some(base(K, 1.0, 0.0)), relative: false };
    const CELSIUS: Measured = Measured { unit: Some("degC"), base: Some(base(K, 1.0, 273.15)), relative: false };
    const FAHRENHEIT: Measured =
        Measured { unit: Some("degF"), base: Some(base(K, 5.0 / 9.0, 273.15 - 160.0 / 9.0)), relative: false };
    const RADIANS: Measured =
        Measured { unit: Some("rad/s"), base: Some(base([0, 0, -1, 0, 0, 0, 0, 1], 1.0, 0.0)), relative: false };
    const HERTZ: Measured =
        Measured { unit: Some("1/s"), base: Some(base([0, 0, -1, 0, 0, 0, 0, 0], 1.0, 0.0)), relative: false };
    const NEWTON: Measured =
        Measured { unit: Some("N"), base: Some(base([1, 1, -2, 0, 0, 0, 0, 0], 1.0, 0.0)), relative: false };
    const NOTHING: Measured = Measured { unit: None, base: None, relative: false };

    fn converted(from: Measured, to: Measured, x: f64) -> f64 {
        match from.into_unit(to).unwrap() {
            Passage::Converted(conversion) => conversion.apply(x),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn temperatures_and_their_differences() {
        assert!((converted(KELVIN, CELSIUS, 300.0) - 26.85).abs() < 1e-12);
        assert!((converted(CELSIUS, FAHRENHEIT, 100.0) - 212.0).abs() < 1e-10);
        assert!((converted(FAHRENHEIT, KELVIN, -40.0) - 233.15).abs() < 1e-10);
        let difference = |unit: Measured<'static>| Measured { relative: true, ..unit };
        assert_eq!(KELVIN.into_unit(KELVIN), Ok(Passage::Equal));
        // A band of 10 K is one of 10 degrees Celsius and of 18 degrees Fahrenheit.
        assert_eq!(difference(KELVIN).into_unit(difference(CELSIUS)), Ok(Passage::Equal));
        assert!((converted(difference(KELVIN), difference(FAHRENHEIT), 10.0) - 18.0).abs() < 1e-12);
        let mixed = difference(KELVIN).into_unit(CELSIUS).unwrap_err();
        assert!(
            mixed.contains("a difference (relativeQuantity) in K, the target an absolute value in degC"),
            "{mixed}"
        );
    }

    #[test]
    fn two_conversions_are_one_after_the_other() {
        let [first, second] = [(2.0, 3.0), (5.0, 7.0)].map(|(factor, offset)| Conversion { factor, offset });
        let both = Conversion::then(Some(first), Some(second)).unwrap();
        assert!((both.apply(11.0) - second.apply(first.apply(11.0))).abs() < 1e-12);
        assert_eq!(
            (Conversion::then(Some(first), None), Conversion::then(None, Some(second))),
            (Some(first), Some(second))
        );
    }

    #[test]
    fn other_quantities_are_refused() {
        let cause = RADIANS.into_unit(NEWTON).unwrap_err();
        assert_eq!(cause, "the source is in rad/s = s-1.rad, the target in N = kg.m.s-2");
        assert!(HERTZ.into_unit(RADIANS).unwrap_err().ends_with("FMI counts the radian as a base unit"));
    }

    #[test]
    fn what_is_not_known_is_said() {
        assert_eq!(NOTHING.into_unit(NOTHING), Ok(Passage::Equal));
        assert!(matches!(NOTHING.into_unit(KELVIN), Ok(Passage::Unknown(why)) if why.contains("no unit")));
        let bare = Measured { base: None, ..CELSIUS };
        assert!(
            matches!(KELVIN.into_unit(bare), Ok(Passage::Unknown(why)) if why.ends_with("and degC has no BaseUnit"))
        );
        assert_eq!(bare.into_unit(CELSIUS), Ok(Passage::Equal));
    }
}
