//! The definition of a model, for exporters and authors: the trait [`Model`], its variable [`Table`], quantities and units,
//! time on an integer grid, and the neutral [`Description`].
//!
//! Layers, from below: [`mod@unit`], [`variable`], [`token`], [`row`], [`table`], [`terminal`], [`model`], [`description`]. No motor, no XML, no C, no `unsafe`.

#![forbid(unsafe_code)]

pub mod description;
pub mod enumeration;
pub mod fault;
pub mod log;
pub mod model;
mod probe;
pub mod row;
pub mod table;
pub mod terminal;
pub mod time;
pub mod token;
pub mod unit;
pub mod variable;

pub use description::Description;
pub use enumeration::{Choice, Enumerated, Field};
pub use fault::Fault;
pub use model::{Block, Experiment, Info, Model};
pub use row::{Row, Slot};
pub use table::{Part, Table};
pub use terminal::{Icon, Member, Terminal};
pub use time::{Elapsed, SampleGrid, Step};
pub use token::{Hash, Token};
pub use variable::{Causality, Enumeration, Item, Kind, Meta, Range, Variability};
