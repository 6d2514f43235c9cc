//! The start values of a new instance: from the model's `Default`, or from the [preset](fmu_core::preset) that the importer's
//! token requires.

use crate::lifecycle::State;
use crate::message;
use fmu_core::preset::{self, FILE, FORMER_FILE, MOST, PresetValue};
use fmu_core::{Block, Bytes, Capabilities, Fault, Kind, Meta, Model, Slot};
use std::fmt::Display;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A WebAssembly module has no files, even if its importer passes a path.
const READS_FILES: bool = !cfg!(target_family = "wasm");

/// A model before it loads its resources.
pub(crate) struct Made<M: Model> {
    pub(crate) block: Block<M>,
    /// Suffix of the model's token; empty without a preset.
    pub(crate) suffix: String,
}

impl<M: Model> Made<M> {
    /// The model for an importer whose token has this suffix.
    ///
    /// # Errors
    /// The token requires a preset that is missing from the folder, differs, or contains a name or a value that is not allowed.
    pub(crate) fn asked(can: &Capabilities<M>, resources: Option<&Path>, suffix: &str) -> Result<Self, Fault> {
        if suffix.is_empty() {
            return Ok(Self { block: Block::default(), suffix: String::new() });
        }
        if !READS_FILES {
            return Err(Fault::new(format!(
                "the token requires the preset in resources/{FILE}, but a WebAssembly module reads no files: use the \
                 FMU without its preset, and set the start values"
            )));
        }
        let Some(folder) = resources else {
            return Err(Fault::new(format!(
                "the token requires the preset in resources/{FILE}, the start values of this FMU, and the importer names no \
                 folder of resources (NULL, empty, or the URI of no file): it must pass that of the unpacked archive"
            )));
        };
        let path = folder.join(FILE);
        if !path.exists() && folder.join(FORMER_FILE).exists() {
            return Err(of(folder, preset::former()));
        }
        let bytes = content(&path).map_err(|e| {
            of(
                &path,
                format!(
                    "{e}; this file of the archive has the FMU's preset, its start values, which the token requires"
                ),
            )
        })?;
        let found = preset::suffix(&bytes);
        if found != suffix {
            return Err(of(
                &path,
                format!(
                    "its hash is {}, and the token requires the preset {}: the file was changed, or is of another archive; \
                     unpack the archive anew, or write it with `fmu preset`",
                    &found[1..],
                    &suffix[1..]
                ),
            ));
        }
        Self::of(can, &path, &bytes, found)
    }

    /// The model for its description, with the preset in the folder, if any.
    ///
    /// # Errors
    /// The preset cannot be read, or has a name or a value that is not allowed.
    pub(crate) fn described(can: &Capabilities<M>, resources: Option<&Path>) -> Result<Self, Fault> {
        let path: Option<PathBuf> = resources.filter(|_| READS_FILES).map(|folder| folder.join(FILE));
        let Some(path) = path.filter(|path| path.exists()) else { return Self::asked(can, None, "") };
        let bytes = content(&path).map_err(|e| of(&path, e))?;
        let suffix = preset::suffix(&bytes);
        Self::of(can, &path, &bytes, suffix)
    }

    fn of(can: &Capabilities<M>, path: &Path, bytes: &[u8], suffix: String) -> Result<Self, Fault> {
        let mut block = Block::default();
        preset::read(bytes).and_then(|entries| apply(can, &mut block, &entries)).map_err(|fault| of(path, fault))?;
        Ok(Self { block, suffix })
    }
}

fn of(path: &Path, why: impl Display) -> Fault {
    Fault::new(format!("{}: {why}", path.display()))
}

/// The bytes of the file; for a file that is too large, one byte more than allowed.
fn content(path: &Path) -> io::Result<Vec<u8>> {
    // Opening a pipe would wait for its writer.
    if !path.metadata()?.is_file() {
        return Err(io::Error::other("is not a file"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(MOST + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Sets the start values as an importer would after instantiation.
fn apply<M: Model>(can: &Capabilities<M>, block: &mut Block<M>, entries: &[PresetValue]) -> Result<(), Fault> {
    let rows = can.rows()?;
    let indices: Vec<usize> = M::TABLE.indices().collect();
    let (mut set, mut next) = (vec![false; indices.len()], 0);
    for PresetValue { name, value } in entries {
        // `fmu preset` writes the variables in the order of the table.
        let mut places = (next..indices.len()).chain(0..next);
        let found = places.find(|&place| message::sized_name(block, indices[place]) == *name);
        let place = found.ok_or_else(|| Fault::new(format!("{} has no variable {name}", M::INFO.name)))?;
        let index = indices[place];
        if std::mem::replace(&mut set[place], true) {
            return Err(Fault::new(format!("{name} already has a value")));
        }
        let Some((meta, slot)) = can.place(block, &rows, index) else { continue };
        if !meta.takes_start() {
            return Err(message::fixed::<M>(index, meta, State::Instantiated));
        }
        write(meta, slot, value).map_err(|allowed| Fault::value(name, value, allowed))?;
        next = place + 1;
    }
    Ok(())
}

/// Writes a value of the preset.
///
/// # Errors
/// What is allowed instead.
fn write(meta: &Meta, mut slot: Slot<'_>, text: &str) -> Result<(), String> {
    let allowed = || meta.allowed();
    match &mut slot {
        Slot::Real(x) => **x = parsed(text, "a number")?,
        Slot::Float32(x) => **x = parsed(text, "a number")?,
        Slot::Integer(x) => {
            if !x.set(parsed(text, "an integer")?) {
                let Kind::Integer(of) = meta.kind else { return Err(allowed()) };
                let (min, max) = of.within(&meta.range);
                return Err(format!("{min} to {max}"));
            }
        }
        Slot::Boolean(x) => **x = parsed(text, "true or false")?,
        Slot::Enumeration(x) => {
            if !text.parse().is_ok_and(|value| x.set(value)) {
                return Err(allowed());
            }
        }
        Slot::Text(x) => text.clone_into(x),
        Slot::Said(_) | Slot::Constant(_) => return Err("a value that the model gives".into()),
        Slot::Clock(_) => return Err("a clock".into()),
        Slot::Binary(x) => x.set(&Bytes::from_hex(text).ok_or("pairs of hexadecimal digits")?),
    }
    if slot.is_allowed(meta) { Ok(()) } else { Err(allowed()) }
}

fn parsed<T: FromStr>(text: &str, expected: &str) -> Result<T, String> {
    text.parse().map_err(|_| expected.into())
}
