//! Values that cross the interface, independent of the names of types in the standards.

use crate::number::Number;
use crate::quantity;
use fmu_core::{Bytes, IntegerType};
use model_description::{BaseType, ModelDescription, ModelVariable};
use std::fmt;

/// The elements of a variable: one for a scalar, all in row-major order for an array.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Values of `Real`, `Float32`, `Float64`.
    Reals(Vec<f64>),
    /// Values of every integer type and of enumerations; wide enough for each of them.
    Integers(Vec<i128>),
    /// Values of `Boolean` and `Clock`.
    Booleans(Vec<bool>),
    /// Values of `String`.
    Strings(Vec<String>),
    /// Values of `Binary`.
    Binaries(Vec<Vec<u8>>),
}

impl Values {
    /// Parses user input: numbers, `true` or `false`, names of an enumeration; commas or spaces between elements.
    ///
    /// # Errors
    /// States what was expected.
    pub fn parse(text: &str, variable: &ModelVariable, items: &[(String, i64)]) -> Result<Self, String> {
        Self::parse_with(text, variable, items, |e| Ok(e.parse::<f64>().ok()))
    }

    /// Like [`parse`](Self::parse), where `number` reads an element of a real variable.
    fn parse_with(
        text: &str,
        variable: &ModelVariable,
        items: &[(String, i64)],
        number: impl Fn(&str) -> Result<Option<f64>, String>,
    ) -> Result<Self, String> {
        let is_number = |word: &str| quantity::split(word).is_some();
        let spaced = variable.is_array()
            && !text.contains(',')
            && (!variable.base.is_float() || text.split_whitespace().all(is_number));
        let separator = |c: char| if spaced { c.is_whitespace() } else { c == ',' };
        // One name or truth value may have commas.
        let whole = !variable.is_array() && matches!(variable.base, BaseType::Boolean | BaseType::Enumeration);
        let separator = |c: char| !whole && separator(c);
        let elements = || text.split(separator).map(str::trim).filter(|e| !(spaced && e.is_empty()));
        let wrong = |element: &str, expected: &str| format!("{} = {element} is not {expected}", variable.name);
        match variable.base {
            BaseType::Float32 | BaseType::Float64 => elements()
                .map(|e| number(e)?.ok_or_else(|| wrong(e, "a number")))
                .collect::<Result<_, _>>()
                .map(Self::Reals),
            BaseType::Boolean | BaseType::Clock => elements()
                .map(|e| match (e.to_ascii_lowercase().as_str(), quantity::whole(e)) {
                    ("true", _) | (_, Some(1)) => Ok(true),
                    ("false", _) | (_, Some(0)) => Ok(false),
                    _ => Err(wrong(e, "true or false")),
                })
                .collect::<Result<_, _>>()
                .map(Self::Booleans),
            BaseType::String if variable.is_array() => Ok(Self::Strings(texts(text))),
            BaseType::String => Ok(Self::Strings(vec![text.into()])),
            BaseType::Binary => elements()
                .map(|e| match Bytes::from_hex(e) {
                    Some(bytes) => Ok(bytes.to_vec()),
                    None => Err(wrong(e, "bytes, each of two hexadecimal digits")),
                })
                .collect::<Result<_, _>>()
                .map(Self::Binaries),
            BaseType::Enumeration => elements()
                .map(|e| {
                    let named = items.iter().find(|(name, _)| name == e).map(|(_, value)| i128::from(*value));
                    named.or_else(|| quantity::whole(e)).ok_or_else(|| {
                        let names: Vec<_> = items.iter().map(|(name, _)| name.as_str()).collect();
                        wrong(e, &format!("one of {}", names.join(", ")))
                    })
                })
                .collect::<Result<_, _>>()
                .map(Self::Integers),
            base => elements()
                .map(|e| {
                    let value = quantity::whole(e).ok_or_else(|| wrong(e, "an integer"))?;
                    let (min, max) = bounds(base);
                    let fits = (min..=max).contains(&value);
                    if fits { Ok(value) } else { Err(wrong(e, &format!("of the type {base}: {min} to {max}"))) }
                })
                .collect::<Result<_, _>>()
                .map(Self::Integers),
        }
    }

    /// Like [`parse`](Self::parse), with the names that the description has for an enumeration, and with its units behind
    /// numbers: `1000 rpm`.
    ///
    /// # Errors
    /// As [`parse`](Self::parse); names the units that the variable has.
    pub fn read(text: &str, variable: &ModelVariable, description: &ModelDescription) -> Result<Self, String> {
        let definition = variable.declared_type.as_ref().and_then(|t| description.type_definition(t));
        let items = definition.map(|d| d.items.iter().map(|i| (i.name.clone(), i.value)).collect::<Vec<_>>());
        if variable.base.is_float()
            && !variable.is_array()
            && text.split_once(',').is_some_and(|(a, b)| a.parse::<f64>().is_ok() && quantity::split(b).is_some())
        {
            return Err(format!("{} = {text} is not a number: write a decimal point", variable.name));
        }
        Self::parse_with(text, variable, &items.unwrap_or_default(), |element| {
            let Some((number, unit)) = quantity::split(element) else { return Ok(None) };
            quantity::convert(number, unit, variable, description).map(Some)
        })
    }

    /// The start value of a variable, all elements of an array.
    ///
    /// # Errors
    /// It has no value, or one of another type.
    pub fn start(variable: &ModelVariable, description: &ModelDescription) -> Result<Self, String> {
        match variable.base {
            BaseType::String if !variable.start_texts.is_empty() => Ok(Self::Strings(variable.start_texts.clone())),
            BaseType::Binary => Self::parse(&variable.start_texts.join(" "), variable, &[]),
            _ => {
                let start = variable.start.as_deref().ok_or_else(|| format!("{} has no start value", variable.name))?;
                Self::read(start, variable, description)
            }
        }
    }

    /// A number as a value of this base type: an integer keeps its digits, a real number is rounded for an integer; what is not 0
    /// is true.
    ///
    /// # Errors
    /// A text or bytes are not a number, or the number is missing.
    pub fn from_number(x: impl Into<Number>, base: BaseType) -> Result<Self, String> {
        match (x.into(), base) {
            (Number::Missing, _) => Err("the number is missing".into()),
            (Number::Integer(i), _) => Self::Integers(vec![i]).into_base(base),
            (Number::Boolean(b), _) => Self::Booleans(vec![b]).into_base(base),
            (Number::Real(x), base) => Self::from_numbers(&[x], base),
        }
    }

    /// Numbers as the elements of an array, each as in [`from_number`](Self::from_number).
    ///
    /// # Errors
    /// A text is not a number.
    pub fn from_numbers(numbers: &[f64], base: BaseType) -> Result<Self, String> {
        match base {
            BaseType::Float32 | BaseType::Float64 => Ok(Self::Reals(numbers.to_vec())),
            BaseType::Boolean | BaseType::Clock => Ok(Self::Booleans(numbers.iter().map(|x| *x != 0.0).collect())),
            BaseType::String | BaseType::Binary => Err(format!("a number cannot become a {base}")),
            _ => {
                // The setter refuses values outside the range of the variable's type; a NaN becomes 0.
                #[expect(clippy::cast_possible_truncation, reason = "saturates")]
                let rounded = numbers.iter().map(|x| x.round() as i128).collect();
                Ok(Self::Integers(rounded))
            }
        }
    }

    /// These values for a variable of another type; integers of every width stay integers.
    ///
    /// # Errors
    /// Texts and numbers cannot be converted into each other.
    pub fn into_base(self, base: BaseType) -> Result<Self, String> {
        let reals = |numbers: Vec<f64>| Self::from_numbers(&numbers, base);
        match (self, base) {
            (all @ Self::Reals(_), BaseType::Float32 | BaseType::Float64)
            | (all @ Self::Booleans(_), BaseType::Boolean | BaseType::Clock)
            | (all @ Self::Strings(_), BaseType::String)
            | (all @ Self::Binaries(_), BaseType::Binary) => Ok(all),
            (_, BaseType::String | BaseType::Binary) => Err(format!("a number cannot become a {base}")),
            (Self::Reals(x), _) => reals(x),
            (Self::Integers(x), BaseType::Float32 | BaseType::Float64) => {
                reals(x.into_iter().map(|i| Number::Integer(i).real()).collect())
            }
            (Self::Integers(x), BaseType::Boolean | BaseType::Clock) => {
                Ok(Self::Booleans(x.into_iter().map(|i| i != 0).collect()))
            }
            (all @ Self::Integers(_), _) => Ok(all),
            (Self::Booleans(x), BaseType::Float32 | BaseType::Float64) => {
                reals(x.into_iter().map(|b| f64::from(u8::from(b))).collect())
            }
            (Self::Booleans(x), _) => Ok(Self::Integers(x.into_iter().map(i128::from).collect())),
            (Self::Strings(_) | Self::Binaries(_), _) => Err(format!("a text cannot become a {base}")),
        }
    }

    /// The first element as a double; `None` for a text.
    pub fn number(&self) -> Option<f64> {
        match self.one(0) {
            Number::Missing => None,
            number => Some(number.real()),
        }
    }

    /// An element as a number; missing for a text, or without this element.
    pub fn one(&self, element: usize) -> Number {
        let number = match self {
            Self::Reals(x) => x.get(element).map(|&x| Number::Real(x)),
            Self::Integers(x) => x.get(element).map(|&i| Number::Integer(i)),
            Self::Booleans(x) => x.get(element).map(|&b| Number::Boolean(b)),
            Self::Strings(_) | Self::Binaries(_) => None,
        };
        number.unwrap_or_default()
    }

    /// An element alone.
    #[must_use]
    pub fn element(self, element: usize) -> Option<Self> {
        fn at<T>(all: Vec<T>, element: usize) -> Option<Vec<T>> {
            all.into_iter().nth(element).map(|x| vec![x])
        }
        Some(match self {
            Self::Reals(x) => Self::Reals(at(x, element)?),
            Self::Integers(x) => Self::Integers(at(x, element)?),
            Self::Booleans(x) => Self::Booleans(at(x, element)?),
            Self::Strings(x) => Self::Strings(at(x, element)?),
            Self::Binaries(x) => Self::Binaries(at(x, element)?),
        })
    }

    /// Replaces an element by the one of `value`; returns whether both exist and have the same type.
    #[must_use]
    pub fn replace(&mut self, element: usize, value: &Self) -> bool {
        fn put<T: Clone>(all: &mut [T], element: usize, value: &[T]) -> bool {
            let ([value], Some(place)) = (value, all.get_mut(element)) else { return false };
            place.clone_from(value);
            true
        }
        match (self, value) {
            (Self::Reals(all), Self::Reals(value)) => put(all, element, value),
            (Self::Integers(all), Self::Integers(value)) => put(all, element, value),
            (Self::Booleans(all), Self::Booleans(value)) => put(all, element, value),
            (Self::Strings(all), Self::Strings(value)) => put(all, element, value),
            (Self::Binaries(all), Self::Binaries(value)) => put(all, element, value),
            _ => false,
        }
    }

    /// The elements as in a CSV cell: separated by spaces, bytes in hexadecimal digits.
    pub fn cell(&self) -> String {
        self.words().join(" ")
    }

    /// Each element as text.
    fn words(&self) -> Vec<String> {
        fn each<T: ToString>(x: &[T]) -> Vec<String> {
            x.iter().map(T::to_string).collect()
        }
        match self {
            Self::Reals(x) => each(x),
            Self::Integers(x) => each(x),
            Self::Booleans(x) => each(x),
            Self::Strings(x) => each(x),
            Self::Binaries(x) => x.iter().map(|bytes| Bytes::from(bytes).to_string()).collect(),
        }
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        match self {
            Self::Reals(x) => x.len(),
            Self::Integers(x) => x.len(),
            Self::Booleans(x) => x.len(),
            Self::Strings(x) => x.len(),
            Self::Binaries(x) => x.len(),
        }
    }

    /// Whether it has no elements.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Texts separated by commas; a text that contains a comma is in quotation marks.
fn texts(text: &str) -> Vec<String> {
    let (mut texts, mut quoted) = (vec![String::new()], false);
    for c in text.chars() {
        match (c, texts.last_mut()) {
            ('"', _) => quoted = !quoted,
            (',', _) if !quoted => texts.push(String::new()),
            (c, Some(last)) => last.push(c),
            (_, None) => {}
        }
    }
    texts.iter().map(|text| text.trim().to_owned()).collect()
}

/// The minimum and the maximum of an integer type.
fn bounds(base: BaseType) -> (i128, i128) {
    match base {
        BaseType::Int8 => IntegerType::Int8,
        BaseType::UInt8 => IntegerType::UInt8,
        BaseType::Int16 => IntegerType::Int16,
        BaseType::UInt16 => IntegerType::UInt16,
        BaseType::Int32 => IntegerType::Int32,
        BaseType::UInt32 => IntegerType::UInt32,
        BaseType::UInt64 => IntegerType::UInt64,
        _ => IntegerType::Int64,
    }
    .bounds()
}

impl fmt::Display for Values {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words().join(", "))
    }
}
