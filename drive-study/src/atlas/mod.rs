//! The atlas: where a drive with wrong estimates of resistance and magnet flux holds low speeds under load.

pub mod cell;
pub mod drive;
pub mod run;
