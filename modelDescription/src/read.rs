//! modelDescription.xml of any FMU of either standard.
//!
//! The reader requires the minimum for an importer: well-formed XML, a known version, required attributes and values of the
//! right form. It does not check the content: duplicate names and undefined units are left to a checker. It ignores unknown
//! elements and attributes.

mod attributes;
mod document;
mod structure;
mod terminals;
mod types;
mod variables;

use crate::description::{Experiment, Interface, LogCategory, ModelDescription, Names};
use crate::error::Error;
use crate::version::FmiVersion;
use crate::xml::{Element, parse};
pub use document::decode;
pub use terminals::read_terminals;

use attributes::{boolean, integer, number, owned, required};
use document::of_kind;

/// Reads modelDescription.xml; the bytes must be UTF-8, as both standards require.
///
/// # Errors
/// States the line, the content found and expected.
pub fn read(xml: impl AsRef<[u8]>) -> Result<ModelDescription, Error> {
    read_element(&parse(decode(xml.as_ref())?)?)
}

/// Reads the elements of modelDescription.xml.
///
/// # Errors
/// As [`read`].
pub fn read_element(root: &Element) -> Result<ModelDescription, Error> {
    of_kind(root, "fmiModelDescription")?;
    let version = version(root)?;
    let token = match version {
        FmiVersion::V2 => "guid",
        FmiVersion::V3 => "instantiationToken",
    };
    let types = types::definitions(root, version)?;
    let structure = element(root, "ModelStructure")?;
    Ok(ModelDescription {
        version,
        fmi_version: required(root, "fmiVersion")?.into(),
        model_name: required(root, "modelName")?.into(),
        token: required(root, token)?.into(),
        description: owned(root, "description"),
        author: owned(root, "author"),
        model_version: owned(root, "version"),
        copyright: owned(root, "copyright"),
        license: owned(root, "license"),
        generation_tool: owned(root, "generationTool"),
        generation_date_and_time: owned(root, "generationDateAndTime"),
        structured_names: root.get("variableNamingConvention") == Some("structured"),
        co_simulation: interface(root, "CoSimulation", version)?,
        model_exchange: interface(root, "ModelExchange", version)?,
        scheduled_execution: interface(root, "ScheduledExecution", version)?,
        number_of_event_indicators: integer(root, "numberOfEventIndicators")?,
        default_experiment: root.child("DefaultExperiment").map_or(Ok(Experiment::default()), experiment)?,
        units: types::units(root)?,
        variables: variables::variables(element(root, "ModelVariables")?, version, &types)?,
        types,
        log_categories: log_categories(root)?,
        outputs: structure::unknowns(structure, version, "Outputs", "Output")?,
        derivatives: structure::unknowns(structure, version, "Derivatives", "ContinuousStateDerivative")?,
        initial_unknowns: structure::unknowns(structure, version, "InitialUnknowns", "InitialUnknown")?,
        event_indicators: structure::unknowns(structure, version, "", "EventIndicator")?,
        clocked_states: structure::unknowns(structure, version, "", "ClockedState")?,
        names: Names::default(),
    })
}

/// The version, before anything else: FMI 1.0 has the same root element and other attributes.
fn version(root: &Element) -> Result<FmiVersion, Error> {
    let found = required(root, "fmiVersion")?;
    // The schema of FMI 3.0 allows patch numbers and suffixes, 3.0.1 or 3.0-rc.2; FMI 3.0.2, 2.4.1 has 3.0-alpha.2.
    let patch = found.strip_prefix("3.0").is_some_and(|rest| rest.starts_with(['.', '-']));
    match found {
        "2.0" => Ok(FmiVersion::V2),
        _ if found == "3.0" || patch => Ok(FmiVersion::V3),
        _ => Err(Error::UnsupportedVersion { line: root.line, found: found.into() }),
    }
}

/// A required child.
fn element<'a>(parent: &'a Element, name: &str) -> Result<&'a Element, Error> {
    let missing = || Error::MissingElement { line: parent.line, parent: parent.name.clone(), element: name.into() };
    parent.child(name).ok_or_else(missing)
}

fn interface(root: &Element, name: &str, version: FmiVersion) -> Result<Option<Interface>, Error> {
    const IDENTIFIER: &str = "modelIdentifier";
    let Some(element) = root.child(name) else { return Ok(None) };
    for (name, _) in &element.attributes {
        // Every capability that begins like this is an xs:boolean, in both standards.
        if ["can", "completed", "has", "might", "needs", "provides"].iter().any(|verb| name.starts_with(verb)) {
            boolean(element, name)?;
        }
    }
    Ok(Some(Interface {
        model_identifier: required(element, IDENTIFIER)?.into(),
        attributes: element.attributes.iter().filter(|(name, _)| name != IDENTIFIER).cloned().collect(),
        version,
        line: element.line,
    }))
}

fn experiment(element: &Element) -> Result<Experiment, Error> {
    Ok(Experiment {
        start: number(element, "startTime")?,
        stop: number(element, "stopTime")?,
        step: number(element, "stepSize")?,
        tolerance: number(element, "tolerance")?,
    })
}

fn log_categories(root: &Element) -> Result<Vec<LogCategory>, Error> {
    let categories = root.child("LogCategories").into_iter().flat_map(|list| list.all("Category"));
    categories
        .map(|e| Ok(LogCategory { name: required(e, "name")?.into(), description: owned(e, "description") }))
        .collect()
}
