//! The archive of an SSP: its files, and the values of its bindings.

use super::component::{Binding, Contents};
use super::error::{Error, invalid};
use super::path::Hop;
use super::ssv::{self, Parameter};
use super::{known, ssm};
use fmu_import::{document, limits};
use model_description::{Element, decode};
use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;
use zip::ZipArchive;

/// The archive, with its path for errors.
pub(super) struct Package<'a> {
    pub(super) path: &'a Path,
    /// Name of the description that is read.
    pub(super) description: &'a str,
    pub(super) zip: ZipArchive<File>,
    /// Unused content of files of values.
    pub(super) notes: Vec<String>,
}

impl Package<'_> {
    pub(super) fn bytes(&mut self, name: &str) -> Result<Vec<u8>, Error> {
        let of = || self.path.display();
        let mut bytes = Vec::new();
        // The sizes in the headers are within the limits: see `check_entries`.
        match self.zip.by_name(name) {
            Ok(entry) => {
                let read = entry.take(limits::UNPACKED.most).read_to_end(&mut bytes);
                read.map_err(|e| Error::Invalid(format!("{}: {e}", of())))?
            }
            Err(zip::result::ZipError::FileNotFound) => return invalid(format!("{}: has no {name}", of())),
            Err(e) => return invalid(format!("{}: {name}: {e}", of())),
        };
        Ok(bytes)
    }

    pub(super) fn text(&mut self, name: &str) -> Result<String, Error> {
        let of = |cause: String| Error::Invalid(format!("{}: {cause}", self.path.display()));
        let bytes = document(&mut self.zip, name).map_err(|e| of(e.to_string()))?;
        let bytes = bytes.ok_or_else(|| of(format!("has no {name}")))?;
        let text = decode(&bytes).map_err(|e| of(format!("{name}: {e}")))?;
        Ok(text.to_owned())
    }

    /// Text of a file in an FMU of the archive.
    fn text_in(&mut self, fmu: &str, name: &str) -> Result<String, Error> {
        let bytes = self.bytes(fmu)?;
        let of = |cause: String| Error::Invalid(format!("{}: {fmu}: {cause}", self.path.display()));
        let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(|e| of(e.to_string()))?;
        let bytes = document(&mut zip, name).map_err(|e| of(e.to_string()))?;
        let bytes = bytes.ok_or_else(|| of(format!("has no {name}")))?;
        Ok(decode(&bytes).map_err(|e| of(format!("{name}: {e}")))?.to_owned())
    }

    /// The values of a binding and the transformation of each, with a name for their file. `fmu` is the archive of the component
    /// that has the binding.
    pub(super) fn parameters(
        &mut self,
        binding: &Binding,
        fmu: &str,
    ) -> Result<(String, Vec<(Parameter, Hop)>), Error> {
        let (file, parameters) = self.content(&binding.values, fmu, ssv::parameters)?;
        let named = |p: Parameter| Parameter { name: format!("{}{}", binding.prefix, p.name), ..p };
        let parameters: Vec<Parameter> = parameters.into_iter().map(named).collect();
        let Some(mapping) = &binding.mapping else {
            return Ok((file, parameters.into_iter().map(|p| (p, Hop::default())).collect()));
        };
        let (of_mapping, entries) = self.content(mapping, fmu, ssm::read)?;
        let mapped = ssm::apply(&entries, &parameters);
        Ok((file, mapped.map_err(|cause| Error::Invalid(format!("{of_mapping}: {cause}")))?))
    }

    /// The content, and a name for its file.
    fn content<T: Clone>(
        &mut self,
        located: &Contents<T>,
        fmu: &str,
        read: impl Fn(&Element) -> Result<T, String>,
    ) -> Result<(String, T), Error> {
        let path = self.path.display().to_string();
        let (file, text) = match located {
            Contents::Inline(content) => return Ok((format!("{path}: {}", self.description), content.clone())),
            Contents::File(name) => (format!("{path}: {name}"), self.text(name)?),
            Contents::InComponent(name) => (format!("{path}: {fmu}: {name}"), self.text_in(fmu, name)?),
        };
        let wrong = |cause: String| Error::Invalid(format!("{file}: {cause}"));
        let root = Element::parse(&text).map_err(|e| wrong(e.to_string()))?;
        let notes = known::notes(&root).map_err(wrong)?;
        self.notes.extend(notes.into_iter().map(|note| format!("{file}: {note}")));
        let content = read(&root).map_err(wrong)?;
        Ok((file, content))
    }
}
