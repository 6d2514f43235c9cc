//! Enumerations: one declaration gives the Rust enum, its type definition and the data of its row.
//!
//! The importer reads and writes an integer; the model stores the enum, so an invalid value cannot be stored.

use crate::variable::Enumeration;
use std::fmt::Debug;

/// A Rust enum that crosses the interface as an integer; [`enumeration!`](crate::enumeration!) implements it.
pub trait Enumerated: Copy + Debug + 'static {
    /// Its type definition.
    const ENUMERATION: &'static Enumeration;

    /// The item with this value.
    fn of(value: i32) -> Option<Self>;

    /// The value of this item.
    fn value(self) -> i32;
}

/// A field of a model with an enum of some type.
pub trait Choice: Debug {
    /// The value of the current item.
    fn get(&self) -> i32;

    /// Selects the item with this value; returns false without changes if no item has it.
    fn set(&mut self, value: i32) -> bool;
}

impl<E: Enumerated> Choice for E {
    fn get(&self) -> i32 {
        self.value()
    }

    fn set(&mut self, value: i32) -> bool {
        let item = E::of(value);
        *self = item.unwrap_or(*self);
        item.is_some()
    }
}

/// Location of an enum `E` in a `W`.
pub struct Field<W: 'static, E: 'static>(pub fn(&mut W) -> &mut E);

/// The type-erased interface of a [`Field`] for a table.
pub(crate) trait Place<W>: Sync {
    fn find<'a>(&self, whole: &'a mut W) -> &'a mut dyn Choice;
}

impl<W, E: Enumerated> Place<W> for Field<W, E> {
    fn find<'a>(&self, whole: &'a mut W) -> &'a mut dyn Choice {
        (self.0)(whole)
    }
}

/// Declares an enumeration: the Rust enum, `ALL`, `name`, and its type definition by [`Enumerated`](crate::Enumerated).
///
/// ```
/// # use fmu_core::Enumerated;
/// fmu_core::enumeration! {
///     /// Rust documentation.
///     pub enum Fan("FanMode", "What the fan does") {
///         1 Off "Stands still";
///         2 On "Turns";
///     }
/// }
/// assert_eq!((Fan::of(2), Fan::of(3), Fan::On.value(), Fan::On.name()), (Some(Fan::On), None, 2, "On"));
/// ```
///
/// The enum is `Clone`, `Copy`, `Debug`, `PartialEq` and `Eq`. A model with such a field adds `#[derive(serde::Serialize,
/// serde::Deserialize)]` to it, like its own.
///
/// With `#[derive(Default)]`, one item is marked as the default. A model whose `Default` names an item does not need this.
///
/// ```
/// fmu_core::enumeration! {
///     #[derive(Default)]
///     enum Fan("FanMode", "What the fan does") {
///         #[default]
///         1 Off "Stands still";
///         2 On "Turns";
///     }
/// }
/// assert_eq!(Fan::default(), Fan::Off);
/// ```
#[macro_export]
macro_rules! enumeration {
    ($(#[$attribute:meta])* $visibility:vis enum $type:ident($name:literal, $description:literal) {
        $($(#[$mark:meta])* $value:literal $item:ident $about:literal;)*
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $visibility enum $type {
            // The compiler's advice about a missing `#[default]` shows this line.
            $($(#[$mark])* #[doc = $about] $item = $value,)* // not here: `#[default] 1 Off "...";` in your enumeration
        }

        impl $type {
            /// All items, in the order of the interface.
            $visibility const ALL: &'static [Self] = &[$(Self::$item),*];

            /// Name of the item.
            $visibility fn name(self) -> &'static str {
                match self {
                    $(Self::$item => stringify!($item),)*
                }
            }
        }

        impl $crate::Enumerated for $type {
            const ENUMERATION: &'static $crate::Enumeration = &$crate::Enumeration {
                name: $name,
                description: $description,
                items: &[$($crate::Item { value: $value, name: stringify!($item), description: $about }),*],
            };

            fn of(value: i32) -> Option<Self> {
                match value {
                    $($value => Some(Self::$item),)*
                    _ => None,
                }
            }

            fn value(self) -> i32 {
                self as i32
            }
        }
    };
}
