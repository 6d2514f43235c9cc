//! Values from and to the types of Rust.

use crate::value::Values;
use std::fmt;

/// Why values are not one value of the requested type.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct OtherType {
    /// The values.
    pub values: Values,
    /// What was requested, in words.
    pub expected: &'static str,
}

impl fmt::Display for OtherType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { values, expected } = self;
        write!(f, "{values} is not {expected}")
    }
}

impl std::error::Error for OtherType {}

impl From<&Self> for Values {
    fn from(values: &Self) -> Self {
        values.clone()
    }
}

/// A type of Rust as one value, and a list of it as the elements of an array; back only if no digit is lost.
macro_rules! values {
    ($($type:ty => $variant:ident($of:ty), $expected:literal, $many:literal;)*) => { $(
        impl From<$type> for Values {
            fn from(x: $type) -> Self {
                Self::$variant(vec![<$of>::from(x)])
            }
        }

        impl From<&[$type]> for Values {
            fn from(x: &[$type]) -> Self {
                Self::$variant(x.iter().map(|x| <$of>::from(x.clone())).collect())
            }
        }

        impl<const N: usize> From<[$type; N]> for Values {
            fn from(x: [$type; N]) -> Self {
                x.as_slice().into()
            }
        }

        impl From<Vec<$type>> for Values {
            fn from(x: Vec<$type>) -> Self {
                x.as_slice().into()
            }
        }

        impl TryFrom<Values> for Vec<$type> {
            type Error = OtherType;

            fn try_from(values: Values) -> Result<Self, OtherType> {
                let each: Option<Self> = match &values {
                    Values::$variant(x) => x.iter().map(|x| <$type>::try_from(x.clone()).ok()).collect(),
                    _ => None,
                };
                each.ok_or(OtherType { values, expected: $many })
            }
        }

        impl TryFrom<Values> for $type {
            type Error = OtherType;

            fn try_from(values: Values) -> Result<Self, OtherType> {
                let one = match &values {
                    Values::$variant(x) if x.len() == 1 => <$type>::try_from(x[0].clone()).ok(),
                    _ => None,
                };
                one.ok_or(OtherType { values, expected: $expected })
            }
        }
    )* };
}

values! {
    f64 => Reals(f64), "one real number", "real numbers";
    i8 => Integers(i128), "one integer of 8 bits", "integers of 8 bits";
    i16 => Integers(i128), "one integer of 16 bits", "integers of 16 bits";
    u16 => Integers(i128), "one integer of 16 bits without sign", "integers of 16 bits without sign";
    i32 => Integers(i128), "one integer of 32 bits", "integers of 32 bits";
    u32 => Integers(i128), "one integer of 32 bits without sign", "integers of 32 bits without sign";
    i64 => Integers(i128), "one integer of 64 bits", "integers of 64 bits";
    u64 => Integers(i128), "one integer of 64 bits without sign", "integers of 64 bits without sign";
    bool => Booleans(bool), "one Boolean", "Booleans";
    String => Strings(String), "one text", "texts";
}

impl From<f32> for Values {
    fn from(x: f32) -> Self {
        Self::Reals(vec![x.into()])
    }
}

impl From<&str> for Values {
    fn from(text: &str) -> Self {
        Self::Strings(vec![text.into()])
    }
}

/// The bytes of a binary variable.
impl From<&[u8]> for Values {
    fn from(bytes: &[u8]) -> Self {
        Self::Binaries(vec![bytes.into()])
    }
}

/// The bytes of a binary variable.
impl TryFrom<Values> for Vec<u8> {
    type Error = OtherType;

    fn try_from(values: Values) -> Result<Self, OtherType> {
        match values {
            Values::Binaries(x) if x.len() == 1 => Ok(x.into_iter().next().unwrap_or_default()),
            values => Err(OtherType { values, expected: "the bytes of one variable" }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_rust_go_there_and_back() {
        fn same<T: Into<Values> + TryFrom<Values, Error = OtherType> + Clone + PartialEq + fmt::Debug>(x: T) {
            assert_eq!(T::try_from(x.clone().into()), Ok(x));
        }
        same(1.5);
        same(-1_i8);
        same(u64::MAX);
        same(i64::MIN);
        same(true);
        same("a b".to_owned());
        same(vec![1.0, 2.0]);
        same(vec![true, false]);
        same(vec!["a".to_owned(), String::new()]);
        assert_eq!(Vec::<u8>::try_from(Values::from(&[1_u8, 2][..])), Ok(vec![1, 2]));
        assert_eq!(Values::from([1, 2, 3]), Values::Integers(vec![1, 2, 3]));
        assert_eq!((Values::from("on"), Values::from(0.5_f32)), (Values::Strings(vec!["on".into()]), 0.5.into()));
    }

    #[test]
    fn no_digit_is_lost() {
        let why = |of: Result<u16, OtherType>| of.unwrap_err().to_string();
        assert_eq!(why(u16::try_from(Values::from(65536))), "65536 is not one integer of 16 bits without sign");
        assert_eq!(why(u16::try_from(Values::from(1.0))), "1 is not one integer of 16 bits without sign");
        assert_eq!(why(u16::try_from(Values::from([1, 2]))), "1, 2 is not one integer of 16 bits without sign");
        assert!(f64::try_from(Values::from(1)).is_err() && bool::try_from(Values::from("true")).is_err());
    }
}
