//! Code shared by the groups of this subject.

pub(crate) mod both;
pub(crate) mod dependencies;
pub(crate) mod evaluation;
