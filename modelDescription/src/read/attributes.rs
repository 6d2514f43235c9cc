//! Attributes by type; an error states the element, the attribute, its value and the expected one.

use crate::error::Error;
use crate::number::parse;
use crate::xml::Element;
use std::str::FromStr;

/// A value of the wrong form.
pub(super) fn wrong(element: &Element, attribute: &str, expected: impl Into<String>) -> Error {
    Error::Value {
        line: element.line,
        element: element.name.clone(),
        attribute: attribute.into(),
        found: element.get(attribute).unwrap_or_default().into(),
        expected: expected.into(),
    }
}

/// A required text.
pub(super) fn required<'a>(element: &'a Element, attribute: &str) -> Result<&'a str, Error> {
    element.get(attribute).ok_or_else(|| Error::MissingAttribute {
        line: element.line,
        element: element.name.clone(),
        attribute: attribute.into(),
    })
}

/// A text.
pub(super) fn owned(element: &Element, attribute: &str) -> Option<String> {
    element.get(attribute).map(str::to_owned)
}

/// A double.
pub(super) fn number(element: &Element, attribute: &str) -> Result<Option<f64>, Error> {
    let read = |text| parse(text).ok_or_else(|| wrong(element, attribute, "a number"));
    element.get(attribute).map(read).transpose()
}

/// An integer that fits into `T`.
pub(super) fn integer<T: FromStr>(element: &Element, attribute: &str) -> Result<Option<T>, Error> {
    let read = |text: &str| text.trim().parse().map_err(|_| wrong(element, attribute, an_integer::<T>()));
    element.get(attribute).map(read).transpose()
}

/// A required integer.
pub(super) fn required_integer<T: FromStr>(element: &Element, attribute: &str) -> Result<T, Error> {
    required(element, attribute)?.trim().parse().map_err(|_| wrong(element, attribute, an_integer::<T>()))
}

/// A list of integers.
pub(super) fn integers(element: &Element, attribute: &str) -> Result<Option<Vec<u32>>, Error> {
    let read = |text: &str| {
        let list: Result<_, _> = text.split_ascii_whitespace().map(str::parse).collect();
        list.map_err(|_| wrong(element, attribute, "a list of unsigned integers"))
    };
    element.get(attribute).map(read).transpose()
}

/// A truth value: `true`, `false`, `1` or `0`.
pub(super) fn boolean(element: &Element, attribute: &str) -> Result<Option<bool>, Error> {
    let read = |text: &str| match text.trim() {
        "true" | "1" => Ok(true),
        "false" | "0" => Ok(false),
        _ => Err(wrong(element, attribute, "true or false")),
    };
    element.get(attribute).map(read).transpose()
}

/// A word of an enumeration, selected from all its words.
pub(super) fn word<T: Copy>(
    element: &Element,
    attribute: &str,
    all: &[T],
    text: fn(T) -> &'static str,
) -> Result<Option<T>, Error> {
    let Some(found) = element.get(attribute) else { return Ok(None) };
    let known = all.iter().copied().find(|&x| text(x) == found);
    let words = || all.iter().map(|&x| text(x)).collect::<Vec<_>>().join(", ");
    known.map(Some).ok_or_else(|| wrong(element, attribute, format!("one of {}", words())))
}

fn an_integer<T>() -> String {
    format!("an integer of type {}", std::any::type_name::<T>())
}
