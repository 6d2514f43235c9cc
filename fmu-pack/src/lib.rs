//! From Rust packages to `.fmu` files.
//!
//! - [`workspace`], [`target`], [`compile`]: Cargo's packages, this machine's tools, and the libraries and modules built with them.
//! - [`documentation`], [`icons`], [`picture`], [`licenses`], [`mod@reference`]: the contents of an archive other than its
//!   binaries and its description.
//! - [`archive`]: all files of an FMU, and a writer that gives equal bytes for equal files; [`merge`]: one archive from several;
//!   [`release`]: checksums and bill of materials.
//! - [`preset`]: an FMU with other start values, from its archive; [`page`]: a page that runs an FMU in a browser.
//!
//! Without the feature `full`, which is on by default, there are no pages, no files of a release, and no pictures in archives.

#![forbid(unsafe_code)]

pub mod archive;
pub mod compile;
pub mod documentation;
mod error;
pub mod icons;
pub mod licenses;
pub mod merge;
#[cfg(feature = "full")]
pub mod page;
#[cfg(feature = "full")]
pub mod picture;
pub mod preset;
pub mod reference;
#[cfg(feature = "full")]
pub mod release;
pub mod target;
pub mod workspace;

pub use error::{Error, Result};

/// The name of the tool in `generationTool`.
pub const TOOL: &str = concat!("fmu ", env!("CARGO_PKG_VERSION"));
