//! What an importer can keep of a model: a saved state is a copy ([`Saved`]), a stored state is bytes ([`Stored`]).
//!
//! A model has both unless the line that exports it leaves them out: `export!(M: Unstored)` for a model without serde,
//! `export!(M: Unsaved)` for one without `Clone`, such as one that owns a foreign engine, a thread or a handle.

use crate::Fault;
use crate::model::{Block, Model};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// A model whose state an importer can save and restore: one that is `Clone`, and whose copy shares nothing that changes.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be saved: a saved state is a clone, and `{Self}` is not `Clone`",
    note = "derive `Clone` for it, or export it without saved states: `export!({Self}: Unsaved)`"
)]
pub trait Saved: Model + Clone {}

#[diagnostic::do_not_recommend]
impl<M: Model + Clone> Saved for M {}

/// A model whose saved state an importer can store as bytes: one that serde can write and read.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be stored: a stored state is a clone in bytes, and `{Self}` lacks `Clone`, `Serialize` or `Deserialize`",
    note = "derive `Clone, Serialize, Deserialize` for it, with `use serde::{{Deserialize, Serialize}};`",
    note = "without serde, export it with `export!({Self}: Unstored)`, without `Clone`, with `export!({Self}: Unsaved)`"
)]
pub trait Stored: Saved + Serialize + DeserializeOwned {}

#[diagnostic::do_not_recommend]
impl<M: Saved + Serialize + DeserializeOwned> Stored for M {}

/// What an importer can keep of a model's state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Keeps {
    /// Nothing: neither `canGetAndSetFMUState` nor `canSerializeFMUState`.
    Nothing,
    /// Saved states: `canGetAndSetFMUState`.
    Saved,
    /// Saved states, also as bytes: `canSerializeFMUState`.
    #[default]
    Stored,
}

/// The functions of [`Saved`].
pub struct Saving<M: Model> {
    /// `Clone::clone`.
    copy: fn(&M) -> M,
    /// `Clone::clone_from`.
    copy_from: fn(&mut M, &M),
}

impl<M: Saved> Saving<M> {
    pub(crate) const FUNCTIONS: Self = Self { copy: M::clone, copy_from: M::clone_from };
}

impl<M: Model> Saving<M> {
    /// A copy of a model.
    #[inline]
    pub fn model(&self, model: &M) -> M {
        (self.copy)(model)
    }

    /// Overwrites a model with a copy of another, and reuses its memory.
    #[inline]
    pub fn overwrite(&self, model: &mut M, with: &M) {
        (self.copy_from)(model, with);
    }

    /// A copy of a model with its outputs.
    #[inline]
    pub fn block(&self, block: &Block<M>) -> Block<M> {
        Block { model: self.model(&block.model), out: block.out.clone() }
    }
}

/// Reads a value from the beginning of bytes; returns the rest.
pub type Read<T> = fn(&[u8]) -> Result<(T, &[u8]), Fault>;

/// The functions of [`Stored`]: a model in postcard's encoding.
pub struct Storing<M: Model> {
    /// Number of bytes of a model.
    pub size: fn(&M) -> Result<usize, Fault>,
    /// Writes a model to the beginning of the bytes, which are long enough; returns their number.
    pub write: fn(&M, &mut [u8]) -> Result<usize, Fault>,
    /// Reads a model.
    pub read: Read<M>,
}

impl<M: Stored> Storing<M> {
    pub(crate) const FUNCTIONS: Self = Self { size: size::<M>, write: write::<M>, read: read::<M> };
}

/// Number of bytes of a value that is part of a stored state.
///
/// # Errors
/// It cannot be serialized.
pub fn size<T: Serialize>(value: &T) -> Result<usize, Fault> {
    postcard::experimental::serialized_size(value).map_err(|e| unable(&e))
}

/// Writes a value to the beginning of the bytes; returns their number.
///
/// # Errors
/// It cannot be serialized, or is longer than the bytes.
pub fn write<T: Serialize>(value: &T, bytes: &mut [u8]) -> Result<usize, Fault> {
    postcard::to_slice(value, bytes).map(|written| written.len()).map_err(|e| unable(&e))
}

/// Reads a value from the beginning of the bytes; returns the rest.
///
/// # Errors
/// The bytes are not a value of this type.
pub fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<(T, &[u8]), Fault> {
    postcard::take_from_bytes(bytes).map_err(|e| Fault::new(format!("content: {e}")))
}

fn unable(error: &postcard::Error) -> Fault {
    Fault::new(format!("the state cannot be serialized: {error}"))
}
