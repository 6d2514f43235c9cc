//! The definition of a model, for exporters and authors: the trait [`Model`], its variable [`Table`], quantities and units,
//! time on an integer grid, and the neutral [`Description`].
//!
//! Layers, from below: [`mod@unit`], [`variable`], [`token`], [`row`], [`table`], [`terminal`], [`model`],
//! [`continuous`], [`events`], [`capability`], [`description`]. No motor, no XML, no C, no `unsafe`.

#![forbid(unsafe_code)]

pub mod capability;
pub mod continuous;
pub mod description;
pub mod dual;
pub mod enumeration;
pub mod events;
pub mod fault;
pub mod integer;
pub mod integrate;
pub mod log;
pub mod model;
mod probe;
pub mod resource;
pub mod row;
pub mod table;
pub mod terminal;
pub mod time;
pub mod token;
pub mod unit;
pub mod variable;

pub use capability::{Capabilities, Exported, Plain, Warns};
pub use continuous::{ContinuousTime, Differentiable, State};
pub use description::Description;
pub use dual::{Dual, Scalar};
pub use enumeration::{Choice, Enumerated, Field};
pub use events::{Events, Indicator, Next, Outcome, Sampled};
pub use fault::Fault;
pub use integer::{IntegerType, Whole};
pub use model::{Block, Experiment, Info, Interface, Model};
pub use resource::Resource;
pub use row::{Row, Slot};
pub use table::{Part, Table};
pub use terminal::{Icon, Member, Terminal};
pub use time::{Elapsed, SampleGrid, Step};
pub use token::{Hash, Token};
pub use variable::{Causality, Enumeration, Item, Kind, Meta, Range, Variability};
