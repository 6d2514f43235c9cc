//! Code shared by the groups of this subject.

pub(crate) mod derivatives;
pub(crate) mod plain_runs;
pub(crate) mod step_sizes;
