//! What the groups of this subject share.

pub(crate) mod copies;
pub(crate) mod surroundings;
