//! What the groups of this subject share.

pub(crate) mod derivatives;
pub(crate) mod plain_runs;
pub(crate) mod step_sizes;
