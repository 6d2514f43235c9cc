//! A Simulink model around an FMU, as two functions of MATLAB: the parameters as a struct, and the script that builds a masked
//! block with buses, constants around it, and a flange of Simscape if the FMU has a shaft terminal.
//!
//! - `outside`: the FMU's interface in Simulink; `script`: the functions; `text`: MATLAB's names, literals and units.

mod outside;
mod script;
mod text;

use anyhow::{Context, Result};
use outside::Outside;
use script::Names;
use std::collections::BTreeMap;
use std::path::Path;

/// Summary of the output for the user.
#[derive(Clone, Debug)]
pub struct Built {
    /// Name of the function that builds the model.
    pub function: String,
    /// The files by their names.
    pub files: BTreeMap<String, Vec<u8>>,
    /// Each reason why variables were left out, with their names.
    pub left: BTreeMap<&'static str, Vec<String>>,
    /// The FMU has a flange, which needs Simscape.
    pub flange: bool,
}

/// The files around an FMU; `step` replaces the communication step of its description.
///
/// # Errors
/// The block FMU of Simulink does not support the FMU, or the step does not fit it.
pub fn files(file: &Path, step: Option<f64>) -> Result<Built> {
    let outline = fmu_import::outline(file)?;
    let md = &outline.description;
    let of = || file.display().to_string();
    let outside = Outside::of(md, outline.terminals.as_ref(), step).with_context(of)?;
    let stem = outside::stem(md).with_context(of)?;
    let (build, parameters, model) = (format!("build_{stem}"), format!("{stem}_parameters"), format!("{stem}_system"));
    let fmu = format!("{stem}.fmu");
    let about = md.description.clone().unwrap_or_default();
    let names = Names { build: &build, parameters: &parameters, model: &model, stem: &stem, fmu: &fmu, about: &about };
    let mut files = BTreeMap::new();
    files.insert(format!("{build}.m"), script::build(&names, &outside).into_bytes());
    if !outside.settings.is_empty() {
        files.insert(format!("{parameters}.m"), script::parameters(&parameters, &fmu, &outside).into_bytes());
    }
    files.insert(fmu, std::fs::read(file).with_context(of)?);
    Ok(Built { function: build, files, flange: outside.flange.is_some(), left: outside.left })
}
