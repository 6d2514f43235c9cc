//! Lists: arrays of every type other than real numbers in double precision.

use crate::enumeration::Enumerated;
use crate::integer::IntegerType;
use crate::row::Slot;
use crate::unit::ONE;
use crate::variable::Kind;

/// A type that the elements of a list can have: an integer, `bool`, `f32` (without a unit), `String`, or an
/// [enumeration](crate::enumeration!).
pub trait Element: 'static {
    /// Base type of the variable.
    const KIND: Kind;

    /// The element as a table slot.
    fn slot(&mut self) -> Slot<'_>;
}

/// The types, one per line: type in Rust, kind, and slot.
macro_rules! elements {
    ($($type:ty: $kind:expr, $slot:ident;)*) => { $(
        impl Element for $type {
            const KIND: Kind = $kind;

            fn slot(&mut self) -> Slot<'_> {
                Slot::$slot(self)
            }
        }
    )* };
}

elements! {
    i8: Kind::Integer(IntegerType::Int8), Integer;
    u8: Kind::Integer(IntegerType::UInt8), Integer;
    i16: Kind::Integer(IntegerType::Int16), Integer;
    u16: Kind::Integer(IntegerType::UInt16), Integer;
    i32: Kind::Integer(IntegerType::Int32), Integer;
    u32: Kind::Integer(IntegerType::UInt32), Integer;
    i64: Kind::Integer(IntegerType::Int64), Integer;
    u64: Kind::Integer(IntegerType::UInt64), Integer;
    bool: Kind::Boolean, Boolean;
    f32: Kind::Float32(&ONE), Float32;
    String: Kind::Text, Text;
}

impl<E: Enumerated> Element for E {
    const KIND: Kind = Kind::Enumeration(E::ENUMERATION);

    fn slot(&mut self) -> Slot<'_> {
        Slot::Enumeration(self)
    }
}

/// Location of a list of elements of the type `T` in a `W`.
pub struct Items<W: 'static, T: 'static>(pub fn(&mut W) -> &mut [T]);

/// The type-erased interface of [`Items`] for a table.
pub(crate) trait List<W>: Sync {
    fn find<'a>(&self, whole: &'a mut W, index: usize) -> Option<Slot<'a>>;
    fn count(&self, whole: &mut W) -> usize;
}

impl<W, T: Element> List<W> for Items<W, T> {
    fn find<'a>(&self, whole: &'a mut W, index: usize) -> Option<Slot<'a>> {
        (self.0)(whole).get_mut(index).map(T::slot)
    }

    fn count(&self, whole: &mut W) -> usize {
        (self.0)(whole).len()
    }
}
