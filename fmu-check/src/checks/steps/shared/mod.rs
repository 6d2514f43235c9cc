//! What the groups of this subject share.

pub(crate) mod derivatives;
