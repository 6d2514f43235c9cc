//! Code shared by the groups of this subject.

pub(crate) mod by_name;
pub(crate) mod calls;
pub(crate) mod kept;
pub(crate) mod messages;
pub(crate) mod starts;
pub(crate) mod values;
