//! The instantiation token: a hash of the interface, computed while compiling.
//!
//! Binaries of one model built separately, for several platforms, have the same token; a changed name, unit, range or
//! version changes it. The token is a 128-bit FNV-1a hash, written as a GUID. Every number enters it with a fixed width, so
//! 32-bit and 64-bit compilers compute the same token.

use crate::clock::Timing;
use crate::integer::IntegerType;
use crate::unit::Quantity;
use crate::variable::{Kind, Meta};

/// A running FNV-1a hash of 128 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hash(u128);

impl Hash {
    /// The empty hash (FNV-1a offset basis).
    pub const START: Self = Self(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d);
    const HALF: u128 = u64::MAX as u128;

    /// Hash of this and `bytes`.
    pub const fn bytes(self, bytes: &[u8]) -> Self {
        // The compiler counts rounds of loops and calls, and stops at some millions: eight bytes in a round, and no call.
        macro_rules! fold {
            ($hash:expr, $byte:expr) => {{
                let hash = $hash ^ $byte as u128;
                // The product modulo 2^128, with the factor 2^88 + 0x13b.
                let low = (hash & Self::HALF) * 0x13b;
                let high = (hash >> 64) * 0x13b + (low >> 64) + ((hash & 0xff_ffff_ffff) << 24);
                (low & Self::HALF) | ((high & Self::HALF) << 64)
            }};
        }
        let (mut hash, mut i) = (self.0, 0);
        while i < bytes.len() {
            hash = fold!(hash, bytes[i]);
            i += 1;
            if i + 7 <= bytes.len() {
                hash = fold!(hash, bytes[i]);
                hash = fold!(hash, bytes[i + 1]);
                hash = fold!(hash, bytes[i + 2]);
                hash = fold!(hash, bytes[i + 3]);
                hash = fold!(hash, bytes[i + 4]);
                hash = fold!(hash, bytes[i + 5]);
                hash = fold!(hash, bytes[i + 6]);
                i += 7;
            }
        }
        Self(hash)
    }

    /// Hash of this and a text with its length.
    pub const fn text(self, text: &str) -> Self {
        self.bytes(text.as_bytes()).count(text.len())
    }

    /// Hash of this and a number of bytes, elements or extents, in 64 bits regardless of the platform's `usize`.
    const fn count(self, n: usize) -> Self {
        self.bytes(&(n as u64).to_le_bytes())
    }

    /// Hash of this and another hash.
    pub const fn join(self, other: &Self) -> Self {
        self.bytes(&other.0.to_le_bytes())
    }

    /// Hash of this and the content of a table row.
    pub(crate) const fn meta(self, meta: &Meta) -> Self {
        let range = &meta.range;
        let dimension = match meta.dimension {
            Some(n) => n,
            None => 0,
        };
        let nominal = match meta.nominal {
            Some(x) => x,
            None => 0.0,
        };
        let hash = self
            .text(meta.name)
            .bytes(&[
                meta.causality as u8,
                meta.variability as u8,
                range.above as u8,
                range.below as u8,
                meta.unbounded as u8,
            ])
            .number(range.min)
            .number(range.max)
            .number(nominal)
            .count(dimension);
        // Features missing in older tables do not enter the hash, so their tokens stay.
        let (mut hash, mut i) = (hash, 0);
        while i < meta.shape.len() {
            hash = hash.count(meta.shape[i]);
            i += 1;
        }
        i = 0;
        while i < meta.sized.len() {
            hash = hash.text("sized").text(meta.sized[i]);
            i += 1;
        }
        if !meta.clocks.is_empty() {
            hash = hash.text("on").text(meta.clocks);
        }
        if meta.exact {
            hash = hash.text("exact");
        }
        if meta.intermediate {
            hash = hash.text("intermediate");
        }
        i = 0;
        while i < meta.aliases.len() {
            hash = hash.text("alias").text(meta.aliases[i].name);
            if let Some(display) = meta.aliases[i].display {
                hash = hash.text(display.name);
            }
            i += 1;
        }
        match meta.kind {
            Kind::Real(quantity) => hash.quantity(quantity),
            Kind::Float32(quantity) => hash.text("Float32").quantity(quantity),
            Kind::Integer(IntegerType::Int32) => hash.text("integer"),
            Kind::Integer(of) => hash.text(of.name()),
            Kind::Text => hash.text("text"),
            Kind::Binary { mime_type, most } => hash.text("binary").text(mime_type).count(most),
            Kind::Boolean => hash.text("boolean"),
            Kind::Clock(timing) => hash.timing(&timing),
            Kind::Enumeration(enumeration) => {
                let (mut hash, mut i) = (hash.text(enumeration.name), 0);
                while i < enumeration.items.len() {
                    hash = hash.text(enumeration.items[i].name).bytes(&enumeration.items[i].value.to_le_bytes());
                    i += 1;
                }
                hash
            }
        }
    }

    const fn timing(self, timing: &Timing) -> Self {
        let Timing { ticks, interval, fraction, shift, priority } = timing;
        let mut hash = self.text("clock").bytes(&[*ticks as u8]).number(*shift);
        if let Some(interval) = interval {
            hash = hash.number(*interval);
        }
        if let Some((counter, resolution)) = fraction {
            hash = hash.bytes(&counter.to_le_bytes()).bytes(&resolution.to_le_bytes());
        }
        if let Some(priority) = priority {
            hash = hash.bytes(&priority.to_le_bytes());
        }
        hash
    }

    pub(crate) const fn quantity(self, quantity: &Quantity) -> Self {
        let hash = self.text(quantity.name).text(quantity.unit.name);
        let hash = match quantity.display {
            Some(display) => hash.text(display.name),
            None => hash,
        };
        if quantity.relative { hash.text("relative") } else { hash }
    }

    const fn number(self, x: f64) -> Self {
        self.bytes(&x.to_bits().to_le_bytes())
    }

    /// The hash as a GUID in braces, `{8-4-4-4-12}` hexadecimal digits.
    pub const fn guid(self) -> Token {
        const DIGITS: &[u8; 16] = b"0123456789abcdef";
        let bytes = self.0.to_be_bytes();
        let mut text = [b'-'; 38];
        text[0] = b'{';
        text[37] = b'}';
        let (mut i, mut at) = (0, 1);
        while i < 16 {
            if i == 4 || i == 6 || i == 8 || i == 10 {
                at += 1;
            }
            text[at] = DIGITS[(bytes[i] >> 4) as usize];
            text[at + 1] = DIGITS[(bytes[i] & 15) as usize];
            at += 2;
            i += 1;
        }
        Token(text)
    }

    /// The 16 bytes of the hash.
    pub const fn to_bytes(self) -> [u8; 16] {
        self.0.to_be_bytes()
    }
}

/// An instantiation token in ASCII.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Token([u8; 38]);

impl Token {
    /// The token as text.
    pub fn as_str(&self) -> &str {
        std::str::from_utf8(&self.0).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::VOLT;
    use crate::{Row, Table, table};

    #[test]
    fn known_fnv_vectors() {
        assert_eq!(Hash::START.bytes(b"").0, Hash::START.0);
        // FNV-1a 128 of "foobar", draft-eastlake-fnv.
        assert_eq!(Hash::START.bytes(b"foobar").0, 0x343e_1662_793c_64bf_6f0d_3597_ba44_6f18);
    }

    struct Probe {
        u: f64,
        map: [f64; 3],
        weights: [f64; 6],
    }

    const TABLE: &Table<Probe> = table![
        Row::input("u", &VOLT, "", |m: &mut Probe| &mut m.u),
        Row::array_parameter("map", &VOLT, "", 3, |m: &mut Probe| &mut m.map),
        Row::array_parameter("weights", &VOLT, "", 6, |m: &mut Probe| &mut m.weights).shape(&[2, 3]),
    ];

    /// The compiler evaluates this for every target: with a `usize` of 32 bits, lengths, dimensions and extents have the same
    /// hash as with 64 bits. The values come from an FNV-1a written in Python over the fields in the order of `meta`.
    const _: () = {
        assert!(Hash::START.text("foobar").0 == 0x3517_208d_a565_faad_4add_dad2_61f9_235e, "the length of a text");
        assert!(TABLE.hash().0 == 0x2cc7_0a10_6bbc_fb72_0707_9a93_1d41_6613, "dimensions and extents");
    };

    #[test]
    fn guid_has_its_form() {
        assert_eq!(
            Hash(0x0123_4567_89ab_cdef_0123_4567_89ab_cdef).guid().as_str(),
            "{01234567-89ab-cdef-0123-456789abcdef}"
        );
    }
}
