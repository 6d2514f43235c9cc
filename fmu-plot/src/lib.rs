//! Figures, and pages that need no network. The crate contains nothing about motors or FMUs.
//!
//! - [`figure`]: the content of a figure; its author chooses the colors of the curves.
//! - [`svg`]: draws a figure as SVG.
//! - [`chart`]: a map in colors over a plane, as SVG: filled contours ([`contour`]), lines and marks.
//! - [`page`]: a page, and a figure in it with zoom, legend switches and readings at the cursor.
//! - [`ink`]: default colors for curves.

#![forbid(unsafe_code)]

pub mod chart;
pub mod contour;
mod error;
pub mod figure;
pub mod ink;
pub mod page;
pub mod svg;

pub use error::Error;
