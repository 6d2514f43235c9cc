//! The archive of an SSP: its files, and the values of its bindings.

use super::component::{Binding, Mapping, ParameterValues};
use super::error::{Error, invalid};
use super::ssm;
use super::ssv::{self, Parameter};
use fmu_import::{document, limits};
use model_description::{Element, decode};
use std::fs::File;
use std::io::Read;
use std::path::Path;
use zip::ZipArchive;

/// The archive, with its path for errors.
pub(super) struct Package<'a> {
    pub(super) path: &'a Path,
    /// Name of the description that is read.
    pub(super) description: &'a str,
    pub(super) zip: ZipArchive<File>,
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
        let bytes = document(&mut self.zip, name).map_err(of)?;
        let bytes = bytes.ok_or_else(|| of(format!("has no {name}")))?;
        let text = decode(&bytes).map_err(|e| of(format!("{name}: {e}")))?;
        Ok(text.to_owned())
    }

    /// The values of a binding, its prefix before every name, with a name for their file.
    pub(super) fn parameters(&mut self, binding: &Binding) -> Result<(String, Vec<Parameter>), Error> {
        let (path, description) = (self.path.display().to_string(), self.description);
        let (file, parameters) = match &binding.values {
            ParameterValues::Inline(parameters) => (format!("{path}: {description}"), parameters.clone()),
            ParameterValues::File(name) => {
                let file = format!("{path}: {name}");
                let read = ssv::read(&self.text(name)?).map_err(|cause| Error::Invalid(format!("{file}: {cause}")))?;
                (file, read)
            }
        };
        let parameters = match &binding.mapping {
            None => parameters,
            Some(Mapping::Inline(entries)) => ssm::apply(entries, &parameters)
                .map_err(|cause| Error::Invalid(format!("{path}: {description}: {cause}")))?,
            Some(Mapping::File(name)) => {
                let wrong = |cause: String| Error::Invalid(format!("{path}: {name}: {cause}"));
                let root = Element::parse(&self.text(name)?).map_err(|e| wrong(e.to_string()))?;
                let entries = ssm::read(&root).map_err(wrong)?;
                ssm::apply(&entries, &parameters).map_err(wrong)?
            }
        };
        let named = |p: Parameter| Parameter { name: format!("{}{}", binding.prefix, p.name), ..p };
        Ok((file, parameters.into_iter().map(named).collect()))
    }
}
