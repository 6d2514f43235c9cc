//! modelDescription.xml and terminalsAndIcons.xml of FMI 2.0 and FMI 3.0, written and read.
//!
//! [`write()`] turns the neutral description of a model (`fmu_core::Description`) into XML of either standard; [`read()`]
//! opens the XML of any FMU of either standard; [`write_terminals()`] and [`read_terminals()`] do the same for its terminals and
//! icons. Writer and reader share only the element tree of `xml`, so that the reader detects
//! errors of the writer. The crate uses no pointers, and no FMU links it.
//!
//! Clauses are cited as FMI 2.0.5 and FMI 3.0.2.

#![forbid(unsafe_code)]

mod conversion;
mod date;
mod description;
mod error;
pub mod limits;
mod number;
mod read;
mod terminals;
mod units;
mod variable;
mod version;
mod write;
mod xml;

pub use conversion::{Conversion, Measured, Passage};
pub use date::date_from_epoch;
pub use description::{CoSimulation, Experiment, Interface, LogCategory, ModelDescription, Unknown};
pub use error::Error;
pub use number::{format as format_number, parse as parse_number};
pub use read::{decode, read, read_element, read_terminals};
pub use terminals::{Area, CoordinateSystem, Member, StreamMember, Terminal, TerminalPicture, TerminalsAndIcons};
pub use units::{BaseUnit, DisplayUnit, Item, TypeDefinition, Unit};
pub use variable::{
    Alias, BaseType, Causality, ClockTiming, Dimension, Initial, IntervalVariability, ModelVariable, Variability,
};
pub use version::{FmiVersion, UnknownVersion};
pub use write::{Generation, fits, write, write_terminals};
pub use xml::{Element, TextContent};
