//! Figures, and pages that need no network. Knows neither motors nor FMUs.
//!
//! - [`figure`]: what a figure shows; whoever makes one chooses the colors of its curves.
//! - [`svg`]: draws a figure as SVG.
//! - [`chart`]: a map in colors over a plane, as SVG: filled contours ([`contour`]), lines and marks.
//! - [`page`]: a page, and a figure in it with zoom, legend switches and readings at the cursor.
//! - [`ink`]: colors for curves that have none of their own.

#![forbid(unsafe_code)]

pub mod chart;
pub mod contour;
mod error;
pub mod figure;
pub mod ink;
pub mod page;
pub mod svg;

pub use error::Error;
