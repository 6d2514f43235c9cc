//! Values as the bytes that cross the interface.

use model_description::{BaseType, FmiVersion};

/// The values of a call, as the bytes that cross the interface; extra bytes follow, which show whether the FMU writes past the values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Buffer {
    pub(in crate::abi) words: Vec<u64>,
    /// C name of the type.
    kind: &'static str,
    width: usize,
    count: usize,
}

/// Pattern of the bytes after the values.
pub(super) const CANARY: u64 = 0xc5c5_c5c5_c5c5_c5c5;
const CANARIES: usize = 32;

impl Buffer {
    /// Room for `count` values of a type, filled with a pattern.
    pub fn room(base: BaseType, version: FmiVersion, count: usize) -> Self {
        let (kind, width) = (type_name(base, version), width(base, version));
        Self { words: vec![CANARY; (count * width).div_ceil(8) + CANARIES], kind, width, count }
    }

    /// Values from the low bits of each word.
    ///
    /// # Panics
    /// A text that is not NULL: only [`Raw::set_strings`](super::Raw::set_strings) passes pointers.
    pub fn of(base: BaseType, version: FmiVersion, bits: &[u64]) -> Self {
        let pointers = matches!(base, BaseType::String | BaseType::Binary) && bits.iter().any(|b| *b != 0);
        assert!(!pointers, "a pointer cannot be made from a number");
        Self::with_bits(base, version, bits)
    }

    /// Like [`of`](Self::of), also for pointers.
    pub(in crate::abi) fn with_bits(base: BaseType, version: FmiVersion, bits: &[u64]) -> Self {
        let mut buffer = Self::room(base, version, bits.len());
        for (i, value) in bits.iter().enumerate() {
            let at = i * buffer.width;
            for (k, byte) in value.to_le_bytes()[..buffer.width].iter().enumerate() {
                let (word, shift) = ((at + k) / 8, 8 * ((at + k) % 8));
                buffer.words[word] = buffer.words[word] & !(0xff << shift) | u64::from(*byte) << shift;
            }
        }
        buffer
    }

    /// The bits of the values.
    pub fn bits(&self) -> Vec<u64> {
        (0..self.count).map(|i| self.value(i)).collect()
    }

    /// The bits of a value. Its width divides that of a word.
    fn value(&self, i: usize) -> u64 {
        let at = i * self.width;
        self.words[at / 8] >> (8 * (at % 8)) & u64::MAX >> (64 - 8 * self.width)
    }

    /// Whether a value was not written. Bytes and 16-bit numbers may have the bits of the pattern: of these, none was.
    pub fn is_unwritten(&self) -> bool {
        let mut untouched = (0..self.count).map(|i| self.value(i) == CANARY >> (64 - 8 * self.width));
        if self.width < 4 { self.count > 0 && untouched.all(|u| u) } else { untouched.any(|u| u) }
    }

    /// Whether the memory behind the values is intact.
    pub fn intact(&self) -> bool {
        self.words[(self.count * self.width).div_ceil(8)..].iter().all(|w| *w == CANARY)
    }

    /// Number of values.
    pub(in crate::abi) fn count(&self) -> usize {
        self.count
    }

    /// Number of values that fit, including the bytes after them.
    pub(super) fn capacity(&self) -> usize {
        8 * self.words.len() / self.width
    }

    /// Whether the values have the C type of this name.
    pub(super) fn holds(&self, kind: &str) -> bool {
        self.kind == kind
    }
}

/// Bytes of a value of a type.
pub fn width(base: BaseType, version: FmiVersion) -> usize {
    match (version, base) {
        (_, BaseType::Float64 | BaseType::String | BaseType::Binary) => 8,
        (FmiVersion::V2, _) | (_, BaseType::Float32 | BaseType::Int32 | BaseType::UInt32) => 4,
        (_, BaseType::Int8 | BaseType::UInt8 | BaseType::Boolean | BaseType::Clock) => 1,
        (_, BaseType::Int16 | BaseType::UInt16) => 2,
        _ => 8,
    }
}

/// The C name of a type.
pub fn type_name(base: BaseType, version: FmiVersion) -> &'static str {
    match (version, base) {
        (FmiVersion::V2, BaseType::Float32 | BaseType::Float64) => "Real",
        (_, BaseType::Boolean) => "Boolean",
        (_, BaseType::String) => "String",
        (FmiVersion::V2, _) => "Integer",
        (_, BaseType::Enumeration) => "Int64",
        (_, other) => other.as_str(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffer_keep_their_bits() {
        for (base, bits) in [
            (BaseType::Float64, vec![1.5_f64.to_bits(), u64::MAX, 0]),
            (BaseType::Int16, vec![1, 0xffff, 7]),
            (BaseType::Boolean, vec![1, 0, 1, 1, 0, 0, 0, 0, 1]),
        ] {
            let buffer = Buffer::of(base, FmiVersion::V3, &bits);
            assert_eq!(buffer.bits(), bits);
            assert!(buffer.intact() && !buffer.is_unwritten());
        }
    }

    #[test]
    fn values_that_were_not_written_are_known() {
        let pattern = CANARY & 0xffff_ffff;
        for (base, bits, unwritten) in [
            (BaseType::Float64, &[1, CANARY][..], true),
            (BaseType::Int32, &[pattern, 3], true),
            (BaseType::UInt8, &[0xc5, 3], false),
            (BaseType::UInt8, &[0xc5, 0xc5], true),
            (BaseType::Float64, &[], false),
        ] {
            assert_eq!(Buffer::of(base, FmiVersion::V3, bits).is_unwritten(), unwritten, "{base} {bits:?}");
        }
    }
}
