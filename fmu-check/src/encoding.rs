//! Values of variables as bits.

use fmu_import::raw::width;
use model_description::{BaseType, FmiVersion, ModelVariable};

/// The bits of a number as a value of a type; integers are truncated.
pub(super) fn bits(base: BaseType, x: f64) -> u64 {
    match base {
        BaseType::Float64 => x.to_bits(),
        #[expect(clippy::cast_possible_truncation, reason = "single precision is what crosses the interface")]
        BaseType::Float32 => u64::from((x as f32).to_bits()),
        #[expect(clippy::cast_possible_truncation, reason = "saturates; small numbers")]
        _ => (x as i64).cast_unsigned(),
    }
}

/// Bits as a number, for evidence.
pub(super) fn show(v: &ModelVariable, version: FmiVersion, bits: &[u64]) -> String {
    let one = |x: u64| match v.base {
        BaseType::Float64 => format!("{:?}", f64::from_bits(x)),
        BaseType::Float32 => format!("{:?}", f32::from_bits(u32::try_from(x & 0xffff_ffff).unwrap_or(0))),
        BaseType::UInt8 | BaseType::UInt16 | BaseType::UInt32 | BaseType::UInt64 | BaseType::Boolean => x.to_string(),
        _ => {
            let shift = 64 - 8 * width(v.base, version);
            ((x << shift).cast_signed() >> shift).to_string()
        }
    };
    if bits.is_empty() {
        return "no value".into();
    }
    bits.iter().map(|x| one(*x)).collect::<Vec<_>>().join(" ")
}

/// Equal as values of the type: the low bits, and zeros of both signs.
pub(super) fn same(v: &ModelVariable, version: FmiVersion, a: &[u64], b: &[u64]) -> bool {
    let shift = 64 - 8 * fmu_import::raw::width(v.base, version);
    let zero = |x: u64| v.base.is_float() && x << (64 - (64 - shift) + 1) == 0;
    a.len() == b.len() && a.iter().zip(b).all(|(x, y)| x << shift == y << shift || (zero(*x) && zero(*y)))
}

/// A text in quotes; a long one that repeats a letter as `"x" * 1000`.
pub(super) fn quoted(text: &str) -> String {
    let first = text.chars().next().unwrap_or_default();
    if text.len() > 60 && text.chars().all(|c| c == first) {
        return format!("\"{first}\" * {}", text.chars().count());
    }
    format!("{text:?}")
}

/// A text of the FMU in quotes, or NULL.
#[expect(clippy::ref_option, reason = "callers have a field of this type")]
pub(super) fn or_null(text: &Option<String>) -> String {
    text.as_deref().map_or_else(|| "NULL".into(), quoted)
}

/// The value of an attribute in quotes.
pub(super) fn attribute(text: Option<&str>) -> String {
    text.map_or_else(|| "(missing)".into(), quoted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_shown_and_compared_as_their_type() {
        let xml = br#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t"><ModelVariables>
            <Float32 name="f" valueReference="1"/><Int16 name="i" valueReference="2"/><UInt8 name="u" valueReference="3"/>
            </ModelVariables><ModelStructure/></fmiModelDescription>"#;
        let description = model_description::read(xml).unwrap();
        let [f, i, u] = &description.variables[..] else { panic!() };
        let v3 = FmiVersion::V3;
        assert_eq!((bits(f.base, 1.5), bits(i.base, -2.0) & 0xffff, bits(u.base, 7.0)), (0x3fc0_0000, 0xfffe, 7));
        assert_eq!((show(f, v3, &[0x3fc0_0000]), show(i, v3, &[0xfffe, 5])), ("1.5".into(), "-2 5".into()));
        assert_eq!(show(u, v3, &[255]), "255");
        assert!(same(i, v3, &[0xfffe], &[0xffff_fffe]) && !same(i, v3, &[0xfffe], &[0xfffd]), "the low bits count");
        assert!(same(f, v3, &[0], &[0x8000_0000]), "zeros of both signs");
        assert!(!same(i, v3, &[0], &[0x8000]) && !same(i, v3, &[0], &[0, 0]));
    }
}
