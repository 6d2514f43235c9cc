//! The integer types of FMI 3.0, and a row of constructors for each. In FMI 2.0 all are Integer, of 32 bits: a value that does
//! not fit is an error of the call.

use crate::row::{Access, Constant, Row};
use crate::variable::{Causality, Kind, Range, Variability};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// A field of a model with an integer of some type.
pub trait IntegerField: Debug {
    /// The value.
    fn get(&self) -> i128;

    /// Stores the value; returns false without changes if it does not fit the type.
    fn set(&mut self, value: i128) -> bool;
}

/// The types, one per line: name in FMI 3.0, type in Rust, and constructors.
macro_rules! integers {
    ($($name:ident $type:ident $input:ident $output:ident $local:ident $parameter:ident $constant:ident;)*) => {
        /// An integer type of FMI 3.0.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum IntegerType {
            $(#[doc = concat!("`", stringify!($type), "`.")] $name),*
        }

        impl IntegerType {
            /// Its name in FMI 3.0.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$name => stringify!($name)),* }
            }

            /// Its smallest and its largest value.
            pub const fn bounds(self) -> (i128, i128) {
                match self { $(Self::$name => ($type::MIN as i128, $type::MAX as i128)),* }
            }
        }

        /// Location of an integer in a `W`.
        pub(crate) enum Getter<W: 'static> {
            $($name(fn(&mut W) -> &mut $type)),*
        }

        impl<W> Getter<W> {
            pub(crate) fn find<'a>(&self, whole: &'a mut W) -> &'a mut dyn IntegerField {
                match self { $(Self::$name(get) => get(whole)),* }
            }
        }

        $(
            impl IntegerField for $type {
                fn get(&self) -> i128 {
                    i128::from(*self)
                }

                fn set(&mut self, value: i128) -> bool {
                    let fits = Self::try_from(value);
                    *self = fits.unwrap_or(*self);
                    fits.is_ok()
                }
            }

            #[doc = concat!("Integers of the type ", stringify!($name), ": `", stringify!($type), "`.")]
            impl<W: 'static> Row<W> {
                integers!($name $type $input Input Discrete "An input");
                integers!($name $type $output Output Discrete "An output");
                integers!($name $type $local Local Discrete "A local variable");
                integers!($name $type $parameter Parameter Fixed "A parameter");

                #[doc = concat!("A constant of the type ", stringify!($name), ": `", stringify!($type), "`.")]
                #[track_caller]
                pub const fn $constant(name: &'static str, description: &'static str, value: $type) -> Self {
                    let access = Access::Constant(Constant::Integer(value as i128));
                    Self::new(name, description, Kind::Integer(IntegerType::$name), access).constant_local()
                }
            }
        )*
    };
    ($name:ident $type:ident $constructor:ident $causality:ident $variability:ident $what:literal) => {
        #[doc = concat!($what, " of the type ", stringify!($name), ": `", stringify!($type), "`.")]
        #[track_caller]
        pub const fn $constructor(
            name: &'static str,
            description: &'static str,
            get: fn(&mut W) -> &mut $type,
        ) -> Self {
            let (kind, access) = (Kind::Integer(IntegerType::$name), Access::Integer(Getter::$name(get)));
            Self::new(name, description, kind, access).with(Causality::$causality, Variability::$variability)
        }
    };
}

integers! {
    Int32 i32 integer_input integer_output integer_local integer_parameter integer_constant;
    Int8 i8 int8_input int8_output int8_local int8_parameter int8_constant;
    UInt8 u8 uint8_input uint8_output uint8_local uint8_parameter uint8_constant;
    Int16 i16 int16_input int16_output int16_local int16_parameter int16_constant;
    UInt16 u16 uint16_input uint16_output uint16_local uint16_parameter uint16_constant;
    UInt32 u32 uint32_input uint32_output uint32_local uint32_parameter uint32_constant;
    Int64 i64 int64_input int64_output int64_local int64_parameter int64_constant;
    UInt64 u64 uint64_input uint64_output uint64_local uint64_parameter uint64_constant;
}

impl IntegerType {
    /// The smallest and the largest value of this type inside a range.
    pub fn within(self, range: &Range) -> (i128, i128) {
        let (min, max) = self.bounds();
        // A bound that is not an integer is rounded inwards; a strict bound is excluded. Conversion saturates.
        #[expect(clippy::cast_possible_truncation, reason = "bounds are whole here, or infinite")]
        let (mut low, mut high) = (range.min.ceil() as i128, range.max.floor() as i128);
        low = low.saturating_add(i128::from(range.above && range.min.fract() == 0.0));
        high = high.saturating_sub(i128::from(range.below && range.max.fract() == 0.0));
        (min.max(low), max.min(high))
    }

    /// Whether a variable of this type and range can have the value.
    pub fn allows(self, value: i128, range: &Range) -> bool {
        let (min, max) = self.within(range);
        (min..=max).contains(&value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_cuts_the_type() {
        let of = |min, max, above, below| Range { min, max, above, below };
        assert_eq!(IntegerType::UInt8.within(&Range::ALL), (0, 255));
        assert_eq!(IntegerType::UInt64.within(&Range::ALL), (0, u64::MAX.into()));
        assert_eq!(IntegerType::Int8.within(&of(0.0, 9.5, true, true)), (1, 9));
        assert_eq!(IntegerType::Int8.within(&of(-0.5, 9.0, true, true)), (0, 8));
        assert!(IntegerType::Int64.allows(i64::MIN.into(), &Range::ALL));
        assert!(!IntegerType::Int64.allows(i128::from(i64::MAX) + 1, &Range::ALL));
    }

    #[test]
    fn a_place_takes_what_its_type_has() {
        let mut x = 7_u8;
        let place: &mut dyn IntegerField = &mut x;
        assert!(!place.set(256) && !place.set(-1) && place.get() == 7 && place.set(255));
        assert_eq!(x, 255);
    }
}
