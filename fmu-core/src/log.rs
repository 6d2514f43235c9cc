//! The log categories of every FMU: what the binary logs under and the XML lists (FMI 2.0.5, 2.2.4; FMI 3.0.2, 2.4.5).

/// Name and description of each category; the names are the standards' own.
pub const CATEGORIES: &[(&str, &str)] = &[
    ("logEvents", "Instantiated, initialised, terminated, reset"),
    ("logStatusWarning", "Calls that returned Warning"),
    ("logStatusDiscard", "Calls that returned Discard"),
    ("logStatusError", "Calls that returned Error: what was called, with what, and what was allowed"),
    ("logStatusFatal", "Calls that returned Fatal"),
];

/// A category of FMI 2.0 only: all of [`CATEGORIES`] at once.
pub const FMI2_ALL: (&str, &str) = ("logAll", "All categories");
