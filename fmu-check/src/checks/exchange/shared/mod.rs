//! What the groups of this subject share.

pub(crate) mod dependencies;
pub(crate) mod evaluation;
