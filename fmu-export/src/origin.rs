//! Where a model comes from: what a reset restores.

use crate::blob;
use crate::preset::Made;
use fmu_core::resource::Shelf;
use fmu_core::{Block, Capabilities, Exported, Fault, Model};
use std::path::{Path, PathBuf};

/// A model as it was instantiated.
pub(crate) enum Origin<M: Model> {
    /// The model's `Default`.
    Default,
    /// Another model, which can be copied: it has a preset or resources.
    Kept(Box<Block<M>>),
    /// A model that cannot be copied: it is made again, from the folder of resources and the suffix of the token.
    Again { resources: Option<PathBuf>, suffix: String },
}

impl<M: Model> Origin<M> {
    /// Makes the first model; its resources stand on the shelf.
    ///
    /// # Errors
    /// As [`Made::asked`] and [`Model::load`].
    pub(crate) fn open<E: Exported<Model = M>>(
        resources: Option<PathBuf>,
        suffix: String,
    ) -> Result<(Self, Block<M>, Shelf), Fault> {
        let block = make(&E::CAN, resources.as_deref(), &suffix)?;
        let Some(saving) = &E::CAN.saved else {
            return Ok((Self::Again { resources, suffix }, block, Shelf::default()));
        };
        let shelf = E::CAN.stored.as_ref().map(|storing| blob::shelf(&block.model, storing));
        // Without serde, resources cannot be seen.
        let differs = !suffix.is_empty() || shelf.as_ref().is_none_or(|shelf| !shelf.is_empty());
        let origin = if differs { Self::Kept(Box::new(saving.block(&block))) } else { Self::Default };
        Ok((origin, block, shelf.unwrap_or_default()))
    }

    /// Another model like the first.
    ///
    /// # Errors
    /// As [`open`](Self::open), for a model that is made again.
    pub(crate) fn fresh(&self, can: &Capabilities<M>) -> Result<Block<M>, Fault> {
        match self {
            Self::Again { resources, suffix } => make(can, resources.as_deref(), suffix),
            other => Ok(other.starts(can).unwrap_or_default()),
        }
    }

    /// The start values; `None` if only a new model, with all that it owns, would have them.
    pub(crate) fn starts(&self, can: &Capabilities<M>) -> Option<Block<M>> {
        match (self, &can.saved) {
            (Self::Kept(block), Some(saving)) => Some(saving.block(block)),
            (Self::Default, _) => Some(Block::default()),
            _ => None,
        }
    }
}

/// A model with its preset and its resources.
fn make<M: Model>(can: &Capabilities<M>, resources: Option<&Path>, suffix: &str) -> Result<Block<M>, Fault> {
    let mut block = Made::<M>::asked(can, resources, suffix)?.block;
    block.model.load(resources)?;
    if const { M::TABLE.has_sizes() } {
        // The arrays of its outputs get their lengths.
        block.initialize();
    }
    Ok(block)
}
