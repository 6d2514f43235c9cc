//! Values found by a table.

use crate::bytes::Bytes;
use crate::enumeration::Choice;
use crate::integer::IntegerField;
use crate::variable::{Kind, Meta};
use std::hash::{DefaultHasher, Hasher as _};

/// A read-only value that is not a text: a constant, or computed from the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constant {
    /// A real number.
    Real(f64),
    /// A real number in single precision.
    Float32(f32),
    /// An integer.
    Integer(i128),
    /// A truth value.
    Boolean(bool),
    /// An item of an enumeration.
    Enumeration(i32),
}

/// A value found by a table, ready to read or to write.
#[derive(Debug)]
pub enum Slot<'a> {
    /// A real number.
    Real(&'a mut f64),
    /// A real number in single precision.
    Float32(&'a mut f32),
    /// An integer.
    Integer(&'a mut dyn IntegerField),
    /// A truth value.
    Boolean(&'a mut bool),
    /// An item of an enumeration.
    Enumeration(&'a mut dyn Choice),
    /// A text that can be set.
    Text(&'a mut String),
    /// A text computed by the model, or a constant one.
    Said(&'a str),
    /// A clock, and its interval in s if the importer may set it.
    Clock(Option<&'a mut f64>),
    /// A constant, or a computed value.
    Constant(Constant),
    /// Bytes.
    Binary(&'a mut Bytes),
}

impl Slot<'_> {
    /// Whether the variable can be set to the value.
    pub fn is_allowed(&self, meta: &Meta) -> bool {
        match (self, meta.kind) {
            (Self::Real(x), _) => meta.range.contains(**x),
            (Self::Float32(x), _) => meta.range.contains_single(**x),
            (Self::Clock(Some(x)), _) => x.is_finite() && **x > 0.0,
            (Self::Integer(x), Kind::Integer(of)) => of.allows(x.get(), &meta.range),
            (Self::Constant(Constant::Real(x)), _) => meta.range.contains(*x),
            (Self::Constant(Constant::Float32(x)), _) => meta.range.contains_single(*x),
            (Self::Constant(Constant::Integer(x)), Kind::Integer(of)) => of.allows(*x, &meta.range),
            (Self::Binary(x), Kind::Binary { most, .. }) => x.len() <= most,
            _ => true,
        }
    }

    /// The bits of the value, for comparisons; a hash of a text or of bytes.
    pub(crate) fn bits(&self) -> u64 {
        fn hash<T: std::hash::Hash + ?Sized>(content: &T) -> u64 {
            let mut hasher = DefaultHasher::new();
            content.hash(&mut hasher);
            hasher.finish()
        }
        match self {
            Self::Real(x) => x.to_bits(),
            Self::Float32(x) => x.to_bits().into(),
            Self::Integer(x) => u64::try_from(x.get() & i128::from(u64::MAX)).unwrap_or_default(),
            Self::Boolean(x) => u64::from(**x),
            Self::Enumeration(x) => x.get().cast_unsigned().into(),
            Self::Text(x) => hash(x.as_str()),
            Self::Said(x) => hash(*x),
            Self::Binary(x) => hash::<[u8]>(x),
            Self::Clock(x) => x.as_ref().map_or(0, |x| x.to_bits()),
            Self::Constant(Constant::Real(x)) => x.to_bits(),
            Self::Constant(_) => 0,
        }
    }
}

/// The value as a message shows it; an enumeration as its number, a text in quotes, bytes in hexadecimal digits.
impl std::fmt::Display for Slot<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Real(x) => x.fmt(f),
            Self::Float32(x) => x.fmt(f),
            Self::Integer(x) => x.get().fmt(f),
            Self::Boolean(x) => x.fmt(f),
            Self::Enumeration(x) => x.get().fmt(f),
            Self::Text(x) => write!(f, "{x:?}"),
            Self::Said(x) => write!(f, "{x:?}"),
            Self::Clock(Some(x)) => write!(f, "{x} s"),
            Self::Clock(None) => f.write_str("a clock"),
            Self::Constant(Constant::Real(x)) => x.fmt(f),
            Self::Constant(Constant::Float32(x)) => x.fmt(f),
            Self::Constant(Constant::Integer(x)) => x.fmt(f),
            Self::Constant(Constant::Boolean(x)) => x.fmt(f),
            Self::Constant(Constant::Enumeration(x)) => x.fmt(f),
            Self::Binary(x) => x.fmt(f),
        }
    }
}
