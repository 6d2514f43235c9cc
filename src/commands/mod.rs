//! The commands of the command line.

pub mod atlas;
pub mod build;
pub mod compare;
pub mod info;
pub mod merge;
pub mod new;
pub mod preset;
pub mod prove;
pub mod reproduce;
pub mod simulate;
pub mod ssp;
pub mod sweep;
pub mod tune;
