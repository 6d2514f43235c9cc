//! Code shared by the groups of this subject.

pub(crate) mod copies;
pub(crate) mod surroundings;
