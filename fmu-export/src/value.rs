//! Values as they cross the C interface: which base type of the table each C type carries.

use fmu_core::{Kind, Meta, Slot, Table};
use std::ffi::c_int;
use std::fmt::{self, Display};

/// A C type of one of the standards, in the layout of C.
pub trait Value: Copy + Display + PartialEq {
    /// Name of the type in messages.
    const CARRIES: &'static str;

    /// The value in `slot`, `None` if the variable has another base type.
    fn read(meta: &Meta, slot: &Slot<'_>) -> Option<Self>;

    /// Writes a value that was [judged](Value::judge) before.
    fn write(self, slot: Slot<'_>);

    /// Whether the variable may take this value, `None` if it has another base type.
    fn judge(self, meta: &Meta) -> Option<bool>;

    /// The place of a scalar that holds this very type, quickly; `None` if there is none, or no quick way to it.
    fn find<'a, W>(_table: &Table<W>, _whole: &'a mut W, _index: usize) -> Option<(&'static Meta, &'a mut Self)> {
        None
    }

    /// A real number as a value, for the one type that carries it.
    fn from_real(_x: f64) -> Option<Self> {
        None
    }

    /// The real number that it is, for the one type that carries it.
    fn real(self) -> Option<f64> {
        None
    }
}

/// `fmi2Integer`: carries enumerations too (FMI 2.0.5, 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Fmi2Integer(pub c_int);

/// `fmi2Boolean`: everything but 0 is true.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Fmi2Boolean(pub c_int);

/// `fmi3Boolean`, a C `bool`: received as a byte, because an importer may pass any value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Fmi3Boolean(pub u8);

impl From<bool> for Fmi2Boolean {
    fn from(value: bool) -> Self {
        Self(c_int::from(value))
    }
}

impl From<bool> for Fmi3Boolean {
    fn from(value: bool) -> Self {
        Self(u8::from(value))
    }
}

impl Display for Fmi2Integer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Display for Fmi2Boolean {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (self.0 != 0).fmt(f)
    }
}

impl Display for Fmi3Boolean {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (self.0 != 0).fmt(f)
    }
}

impl Value for f64 {
    const CARRIES: &'static str = "a real number";

    #[inline]
    fn read(_: &Meta, slot: &Slot<'_>) -> Option<Self> {
        if let Slot::Real(x) = slot { Some(**x) } else { None }
    }

    #[inline]
    fn write(self, slot: Slot<'_>) {
        if let Slot::Real(x) = slot {
            *x = self;
        }
    }

    #[inline]
    fn judge(self, meta: &Meta) -> Option<bool> {
        matches!(meta.kind, Kind::Real(_)).then(|| meta.range.contains(self))
    }

    #[inline]
    fn find<'a, W>(table: &Table<W>, whole: &'a mut W, index: usize) -> Option<(&'static Meta, &'a mut Self)> {
        table.real(whole, index)
    }

    fn from_real(x: f64) -> Option<Self> {
        Some(x)
    }

    fn real(self) -> Option<f64> {
        Some(self)
    }
}

/// `fmi3Int32`.
impl Value for i32 {
    const CARRIES: &'static str = "a 32-bit integer";

    fn read(_: &Meta, slot: &Slot<'_>) -> Option<Self> {
        if let Slot::Integer(x) = slot { Some(**x) } else { None }
    }

    fn write(self, slot: Slot<'_>) {
        if let Slot::Integer(x) = slot {
            *x = self;
        }
    }

    fn judge(self, meta: &Meta) -> Option<bool> {
        matches!(meta.kind, Kind::Integer).then(|| meta.range.contains(f64::from(self)))
    }
}

/// `fmi3Int64`, the type of an enumeration (FMI 3.0.2, 2.2.7.2).
impl Value for i64 {
    const CARRIES: &'static str = "an enumeration";

    fn read(_: &Meta, slot: &Slot<'_>) -> Option<Self> {
        if let Slot::Enumeration(x) = slot { Some(Self::from(x.get())) } else { None }
    }

    fn write(self, slot: Slot<'_>) {
        if let (Slot::Enumeration(x), Ok(value)) = (slot, i32::try_from(self)) {
            x.set(value);
        }
    }

    fn judge(self, meta: &Meta) -> Option<bool> {
        let Kind::Enumeration(enumeration) = meta.kind else { return None };
        Some(enumeration.items.iter().any(|item| Self::from(item.value) == self))
    }
}

impl Value for Fmi2Integer {
    const CARRIES: &'static str = "an integer or an enumeration";

    fn read(_: &Meta, slot: &Slot<'_>) -> Option<Self> {
        match slot {
            Slot::Integer(x) => Some(Self(**x)),
            Slot::Enumeration(x) => Some(Self(x.get())),
            _ => None,
        }
    }

    fn write(self, slot: Slot<'_>) {
        match slot {
            Slot::Enumeration(_) => i64::from(self.0).write(slot),
            _ => self.0.write(slot),
        }
    }

    fn judge(self, meta: &Meta) -> Option<bool> {
        self.0.judge(meta).or_else(|| i64::from(self.0).judge(meta))
    }
}

impl Value for Fmi2Boolean {
    const CARRIES: &'static str = "a truth value";

    fn read(_: &Meta, slot: &Slot<'_>) -> Option<Self> {
        if let Slot::Boolean(x) = slot { Some(Self(c_int::from(**x))) } else { None }
    }

    fn write(self, slot: Slot<'_>) {
        if let Slot::Boolean(x) = slot {
            *x = self.0 != 0;
        }
    }

    fn judge(self, meta: &Meta) -> Option<bool> {
        matches!(meta.kind, Kind::Boolean).then_some(true)
    }
}

impl Value for Fmi3Boolean {
    const CARRIES: &'static str = Fmi2Boolean::CARRIES;

    fn read(_: &Meta, slot: &Slot<'_>) -> Option<Self> {
        if let Slot::Boolean(x) = slot { Some(Self(u8::from(**x))) } else { None }
    }

    fn write(self, slot: Slot<'_>) {
        Fmi2Boolean(c_int::from(self.0)).write(slot);
    }

    fn judge(self, meta: &Meta) -> Option<bool> {
        matches!(meta.kind, Kind::Boolean).then_some(true)
    }
}
