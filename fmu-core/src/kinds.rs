//! The kinds of variables in a table, known at compile time: code for other kinds is left out of the binary.

use crate::integer::IntegerType;
use crate::variable::Kind;

/// A set of kinds of variables; each integer type is a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kinds(u16);

impl Kinds {
    /// No kind.
    pub const NONE: Self = Self(0);
    /// Every kind.
    pub const ALL: Self = Self(!0);
    /// Real numbers in double precision.
    pub const REAL: Self = Self(1);
    /// Real numbers in single precision.
    pub const FLOAT32: Self = Self(1 << 1);
    /// Truth values.
    pub const BOOLEAN: Self = Self(1 << 2);
    /// Enumerations.
    pub const ENUMERATION: Self = Self(1 << 3);
    /// Texts.
    pub const TEXT: Self = Self(1 << 4);
    /// Clocks.
    pub const CLOCK: Self = Self(1 << 5);
    /// Bytes.
    pub const BINARY: Self = Self(1 << 6);
    /// Integers of every type.
    pub const INTEGERS: Self = Self(0xff << INTEGER);

    /// Integers of one type.
    pub const fn integer(of: IntegerType) -> Self {
        Self(1 << (INTEGER + of as u16))
    }

    /// This kind.
    pub const fn of(kind: &Kind) -> Self {
        match kind {
            Kind::Real(_) => Self::REAL,
            Kind::Float32(_) => Self::FLOAT32,
            Kind::Integer(of) => Self::integer(*of),
            Kind::Boolean => Self::BOOLEAN,
            Kind::Enumeration(_) => Self::ENUMERATION,
            Kind::Text => Self::TEXT,
            Kind::Clock(_) => Self::CLOCK,
            Kind::Binary { .. } => Self::BINARY,
        }
    }

    /// The kinds of both.
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether the two have a kind in common.
    pub const fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}

/// The bit of the first integer type.
const INTEGER: u16 = 8;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_counts_once() {
        let both = Kinds::REAL.and(Kinds::TEXT);
        assert_eq!((both.and(Kinds::TEXT), both.and(both), both.and(Kinds::NONE)), (both, both, both));
        assert!(both.meets(Kinds::TEXT) && !both.meets(Kinds::BOOLEAN) && !both.meets(Kinds::NONE));
    }
}
