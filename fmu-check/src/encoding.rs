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
    bits.iter().map(|x| one(*x)).collect::<Vec<_>>().join(" ")
}

/// Equal as values of the type: the low bits, and zeros of both signs.
pub(super) fn same(v: &ModelVariable, version: FmiVersion, a: &[u64], b: &[u64]) -> bool {
    let shift = 64 - 8 * fmu_import::raw::width(v.base, version);
    let zero = |x: u64| v.base.is_float() && x << (64 - (64 - shift) + 1) == 0;
    a.len() == b.len() && a.iter().zip(b).all(|(x, y)| x << shift == y << shift || (zero(*x) && zero(*y)))
}
