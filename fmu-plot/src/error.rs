//! Errors of drawing.

/// The reason why a drawing is impossible.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A figure without a point.
    #[error("nothing was recorded, so there is nothing to plot")]
    Empty,
    /// The numbers of a page cannot be compressed.
    #[error(transparent)]
    Deflate(#[from] std::io::Error),
}
