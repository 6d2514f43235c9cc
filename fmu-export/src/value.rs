//! Values at the C interface: the base type in the table for each C type.

use crate::lifecycle::Standard;
use fmu_core::{Block, Constant, IntegerType, Kind, Kinds, Meta, Model, RealInputs, Slot};
use std::ffi::c_int;
use std::fmt::{self, Display};
use std::mem::MaybeUninit;

/// The reference of a table's first variable, which follows `time`.
const FIRST: u32 = 1;

/// Maximum number of inputs that are set quickly: the size of the buffer for their previous values.
const SHORT: usize = 8;

/// A C type of one of the standards, in the layout of C.
pub trait CValue: Copy + Display + PartialEq {
    /// Name of the type in messages.
    const CARRIES: &'static str;

    /// The kinds of variables it can transfer: a model without any has no code for this type.
    const KINDS: Kinds;

    /// It transfers integers of every type, if they fit.
    const NARROW: bool = false;

    /// The value in `slot`, `None` if the variable has another base type, or a value that this type lacks.
    fn read(meta: &Meta, slot: &Slot<'_>, standard: Standard) -> Option<Self>;

    /// Writes a value that has been [checked](CValue::judge).
    fn write(self, slot: Slot<'_>);

    /// Whether the variable may take this value, `None` if it has another base type.
    fn judge(self, meta: &Meta, standard: Standard) -> Option<bool>;

    /// Whether the variable in `slot` has this value, as far as its type can represent it.
    fn is_held(self, meta: &Meta, slot: &Slot<'_>, standard: Standard) -> bool {
        Self::read(meta, slot, standard) == Some(self)
    }

    /// Quickly reads scalars of exactly this type, up to the first reference of another kind; returns their number.
    #[inline]
    fn read_reals<M: Model>(_block: &mut Block<M>, _references: &[u32], _out: &mut [MaybeUninit<Self>]) -> usize {
        0
    }

    /// Quickly sets inputs of exactly this type: all of them or, if one cannot be set in this way, none.
    #[inline]
    fn write_inputs<M: Model>(_block: &mut Block<M>, _references: &[u32], _values: &[Self], _continuous: bool) -> bool {
        false
    }

    /// A real number as a value, for the only type that can represent it.
    fn from_real(_x: f64) -> Option<Self> {
        None
    }

    /// Its value as a real number, for the only type that can represent it.
    fn real(self) -> Option<f64> {
        None
    }
}

/// `fmi2Integer`, also for enumerations (FMI 2.0.5, 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Fmi2Integer(pub c_int);

impl Display for Fmi2Integer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl CValue for f64 {
    const CARRIES: &'static str = "a real number";
    // Time and derivatives have no row.
    const KINDS: Kinds = Kinds::ALL;

    #[inline]
    fn read(meta: &Meta, slot: &Slot<'_>, standard: Standard) -> Option<Self> {
        match slot {
            Slot::Real(x) => Some(**x),
            Slot::Constant(Constant::Real(x)) => Some(*x),
            Slot::Float32(_) | Slot::Constant(Constant::Float32(_)) if standard == Standard::Fmi2 => {
                f32::read(meta, slot, standard).map(Self::from)
            }
            _ => None,
        }
    }

    #[inline]
    fn write(self, slot: Slot<'_>) {
        match slot {
            Slot::Real(x) => *x = self,
            #[expect(clippy::cast_possible_truncation, reason = "rounds")]
            Slot::Float32(_) => (self as f32).write(slot),
            _ => {}
        }
    }

    fn is_held(self, meta: &Meta, slot: &Slot<'_>, standard: Standard) -> bool {
        match slot {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::float_cmp,
                reason = "the same value, rounded as by `write`"
            )]
            Slot::Float32(x) if standard == Standard::Fmi2 => **x == self as f32,
            _ => Self::read(meta, slot, standard) == Some(self),
        }
    }

    #[inline]
    fn judge(self, meta: &Meta, standard: Standard) -> Option<bool> {
        match meta.kind {
            Kind::Real(_) => Some(meta.range.contains(self)),
            #[expect(clippy::cast_possible_truncation, reason = "rounds")]
            Kind::Float32(_) if standard == Standard::Fmi2 => (self as f32).judge(meta, standard),
            _ => None,
        }
    }

    #[inline]
    fn read_reals<M: Model>(block: &mut Block<M>, list: &[u32], out: &mut [MaybeUninit<Self>]) -> usize {
        M::TABLE.read(block, list, FIRST, out)
    }

    #[inline(always)]
    #[expect(clippy::inline_always, reason = "the way of every communication point, in both standards")]
    fn write_inputs<M: Model>(block: &mut Block<M>, list: &[u32], values: &[Self], continuous: bool) -> bool {
        let mut before = [0.0; SHORT];
        if list.len() > SHORT {
            return false;
        }
        let done = M::TABLE.write(block, list, FIRST, RealInputs { values, before: &mut before, continuous });
        if done == list.len() {
            return true;
        }
        take_back(block, &list[..done], &before);
        false
    }

    fn from_real(x: f64) -> Option<Self> {
        Some(x)
    }

    fn real(self) -> Option<f64> {
        Some(self)
    }
}

/// Undoes a partial set, the last value first: a reference may occur twice.
#[cold]
fn take_back<M: Model>(block: &mut Block<M>, list: &[u32], before: &[f64]) {
    for (&reference, &value) in list.iter().zip(before).rev() {
        if let Some((_, Slot::Real(x))) = M::TABLE.entry(block, (reference - FIRST) as usize) {
            *x = value;
        }
    }
}

impl CValue for f32 {
    const CARRIES: &'static str = "a Float32";
    const KINDS: Kinds = Kinds::FLOAT32;

    fn read(_: &Meta, slot: &Slot<'_>, _: Standard) -> Option<Self> {
        match slot {
            Slot::Float32(x) => Some(**x),
            Slot::Constant(Constant::Float32(x)) => Some(*x),
            _ => None,
        }
    }

    fn write(self, slot: Slot<'_>) {
        if let Slot::Float32(x) = slot {
            *x = self;
        }
    }

    fn judge(self, meta: &Meta, _: Standard) -> Option<bool> {
        matches!(meta.kind, Kind::Float32(_)).then(|| meta.range.contains_single(self))
    }
}

/// The integers of FMI 3.0; each for the variables of its type.
macro_rules! integers {
    ($($type:ident $name:ident $carries:literal;)*) => { $(
        impl CValue for $type {
            const CARRIES: &'static str = $carries;
            const KINDS: Kinds = {
                let own = Kinds::integer(IntegerType::$name);
                if matches!(IntegerType::$name, ENUMERATIONS) { own.and(Kinds::ENUMERATION) } else { own }
            };

            fn read(meta: &Meta, slot: &Slot<'_>, _: Standard) -> Option<Self> {
                match (meta.kind, slot) {
                    (Kind::Integer(IntegerType::$name), Slot::Integer(x)) => x.get().try_into().ok(),
                    (Kind::Integer(IntegerType::$name), Slot::Constant(Constant::Integer(x))) => (*x).try_into().ok(),
                    (Kind::Enumeration(_), Slot::Enumeration(x)) if IntegerType::$name == ENUMERATIONS => {
                        x.get().try_into().ok()
                    }
                    (Kind::Enumeration(_), Slot::Constant(Constant::Enumeration(x)))
                        if IntegerType::$name == ENUMERATIONS =>
                    {
                        (*x).try_into().ok()
                    }
                    _ => None,
                }
            }

            fn write(self, slot: Slot<'_>) {
                match slot {
                    Slot::Integer(x) => {
                        x.set(self.into());
                    }
                    Slot::Enumeration(x) => {
                        x.set(i32::try_from(self).unwrap_or(x.get()));
                    }
                    _ => {}
                }
            }

            fn judge(self, meta: &Meta, _: Standard) -> Option<bool> {
                let value = i128::from(self);
                match meta.kind {
                    Kind::Integer(of @ IntegerType::$name) => Some(of.allows(value, &meta.range)),
                    Kind::Enumeration(enumeration) if IntegerType::$name == ENUMERATIONS => {
                        Some(enumeration.items.iter().any(|item| i128::from(item.value) == value))
                    }
                    _ => None,
                }
            }
        }
    )* };
}

/// FMI 3.0.2, 2.2.7.2.
const ENUMERATIONS: IntegerType = IntegerType::Int64;

integers! {
    i8 Int8 "an Int8";
    u8 UInt8 "a UInt8";
    i16 Int16 "an Int16";
    u16 UInt16 "a UInt16";
    i32 Int32 "a 32-bit integer";
    u32 UInt32 "a UInt32";
    i64 Int64 "an Int64 or an enumeration";
    u64 UInt64 "a UInt64";
}

impl CValue for Fmi2Integer {
    const CARRIES: &'static str = "an integer or an enumeration";
    const KINDS: Kinds = Kinds::INTEGERS.and(Kinds::ENUMERATION);
    const NARROW: bool = true;

    fn read(_: &Meta, slot: &Slot<'_>, _: Standard) -> Option<Self> {
        match slot {
            Slot::Integer(x) => x.get().try_into().ok().map(Self),
            Slot::Enumeration(x) => Some(Self(x.get())),
            Slot::Constant(Constant::Integer(x)) => (*x).try_into().ok().map(Self),
            Slot::Constant(Constant::Enumeration(x)) => Some(Self(*x)),
            _ => None,
        }
    }

    fn write(self, slot: Slot<'_>) {
        self.0.write(slot);
    }

    fn judge(self, meta: &Meta, standard: Standard) -> Option<bool> {
        match meta.kind {
            Kind::Integer(of) => Some(of.allows(self.0.into(), &meta.range)),
            _ => i64::from(self.0).judge(meta, standard),
        }
    }
}

/// The truth values of the standards: the C type, and its number. Everything except 0 is true.
macro_rules! truth_values {
    ($($(#[$doc:meta])* $name:ident $number:ident;)*) => { $(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $name(pub $number);

        impl PartialEq for $name {
            fn eq(&self, other: &Self) -> bool {
                (self.0 != 0) == (other.0 != 0)
            }
        }

        impl Eq for $name {}

        impl From<bool> for $name {
            fn from(value: bool) -> Self {
                Self($number::from(value))
            }
        }

        impl Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                (self.0 != 0).fmt(f)
            }
        }

        impl CValue for $name {
            const CARRIES: &'static str = "a truth value";
            const KINDS: Kinds = Kinds::BOOLEAN;

            fn read(_: &Meta, slot: &Slot<'_>, _: Standard) -> Option<Self> {
                match slot {
                    Slot::Boolean(x) => Some((**x).into()),
                    Slot::Constant(Constant::Boolean(x)) => Some((*x).into()),
                    _ => None,
                }
            }

            fn write(self, slot: Slot<'_>) {
                if let Slot::Boolean(x) = slot {
                    *x = self.0 != 0;
                }
            }

            fn judge(self, meta: &Meta, _: Standard) -> Option<bool> {
                matches!(meta.kind, Kind::Boolean).then_some(true)
            }
        }
    )* };
}

truth_values! {
    /// `fmi2Boolean`.
    Fmi2Boolean c_int;
    /// `fmi3Boolean`, a C `bool`: received as a byte, because an importer may pass any value.
    Fmi3Boolean u8;
}
