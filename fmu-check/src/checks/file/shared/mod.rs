//! Code shared by the groups of this subject.

pub(crate) mod clock_rules;
pub(crate) mod clocked;
pub(crate) mod date_and_time;
pub(crate) mod layered;
pub(crate) mod libraries;
pub(crate) mod names;
pub(crate) mod paths;
pub(crate) mod schema;
pub(crate) mod schema_rules;
pub(crate) mod type_rules;
pub(crate) mod units;
