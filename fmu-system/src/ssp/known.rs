//! Allowed content of SSP files (schemas of SSP 1.0 and 2.0); everything else is reported in a note, and what occurs twice is refused,
//! so that nothing is ignored silently.

use super::element::{TYPES, at, is_on_clock, local};
use model_description::Element;

/// Without effect on a run: graphics, and information for people.
const NO_EFFECT: [&str; 6] =
    ["ElementGeometry", "SystemGeometry", "ConnectorGeometry", "ConnectionGeometry", "GraphicalElements", "MetaData"];

/// Attributes without effect on a run, of any element.
const INFORMATION: [&str; 8] =
    ["id", "description", "author", "fileversion", "copyright", "license", "generationTool", "generationDateAndTime"];

const TRANSFORMATIONS: &str = "LinearTransformation BooleanMappingTransformation IntegerMappingTransformation \
    EnumerationMappingTransformation";

/// An element, its attributes and its children; `TYPES` and `TRANSFORMATIONS` stand for those lists.
const KNOWN: [(&str, &str, &str); 33] = [
    ("SystemStructureDescription", "version name", "System Enumerations Units DefaultExperiment"),
    ("DefaultExperiment", "startTime stopTime", ""),
    ("System", "name", "Connectors ParameterBindings Elements Connections SignalDictionaries"),
    ("Component", "name type source implementation", "Connectors ParameterBindings"),
    ("SignalDictionaryReference", "name dictionary", "Connectors ParameterBindings"),
    ("SignalDictionaries", "", "SignalDictionary"),
    ("SignalDictionary", "version name type source", "SignalDictionary DictionaryEntry Enumerations Units"),
    ("DictionaryEntry", "name", "TYPES Dimension"),
    ("Elements", "", "Component SignalDictionaryReference System"),
    ("Connectors", "", "Connector"),
    ("Connector", "name kind", "TYPES Dimension"),
    ("Connections", "", "Connection"),
    (
        "Connection",
        "startElement startConnector startIndices endElement endConnector endIndices suppressUnitConversion",
        "TRANSFORMATIONS",
    ),
    ("LinearTransformation", "factor offset", ""),
    ("BooleanMappingTransformation", "", "MapEntry"),
    ("IntegerMappingTransformation", "", "MapEntry"),
    ("EnumerationMappingTransformation", "", "MapEntry"),
    ("MapEntry", "source target", ""),
    ("ParameterBindings", "", "ParameterBinding"),
    ("ParameterBinding", "type source sourceBase prefix", "ParameterValues ParameterMapping"),
    ("ParameterValues", "", "ParameterSet"),
    ("ParameterSet", "version name", "Parameters Enumerations Units"),
    ("Parameters", "", "Parameter"),
    ("Parameter", "name", "TYPES Dimension"),
    ("Value", "value", ""),
    ("ParameterMapping", "version type source sourceBase", "ParameterMapping MappingEntry"),
    ("MappingEntry", "source target suppressUnitConversion", "TRANSFORMATIONS"),
    ("Dimension", "size sizeConnector", ""),
    ("Enumerations", "", "Enumeration"),
    ("Item", "name value", ""),
    ("Units", "", "Unit"),
    ("Unit", "name", "BaseUnit"),
    ("BaseUnit", "kg m s A K mol cd rad factor offset", ""),
];

/// A type, of a connector or of a value.
const TYPE: (&str, &str) = (
    "name value unit mime-type intervalVariability intervalDecimal shiftDecimal supportsFraction resolution intervalCounter \
     shiftCounter priority",
    "Value Item",
);

/// Elements that may occur once in their parent, as a type may.
const ONCE: [&str; 13] = [
    "Enumerations",
    "Units",
    "DefaultExperiment",
    "Connectors",
    "ParameterBindings",
    "Elements",
    "Connections",
    "SignalDictionaries",
    "ParameterValues",
    "ParameterMapping",
    "ParameterSet",
    "Parameters",
    "BaseUnit",
];

/// The first child that occurs a second time, although SSP has one.
fn twice(e: &Element) -> Option<&Element> {
    let mut seen = Vec::new();
    e.children.iter().find(|child| {
        let name = local(child);
        let kind = if TYPES.contains(&name) && !is_on_clock(child) { "type" } else { name };
        let single =
            kind == "type" || ONCE.contains(&kind) || (kind == "System" && local(e) == "SystemStructureDescription");
        let again = single && seen.contains(&kind);
        seen.push(kind);
        again
    })
}

/// Content of a file that is not read: one note per kind.
///
/// # Errors
/// The line of an element that occurs twice.
pub(super) fn notes(root: &Element) -> Result<Vec<String>, String> {
    let mut notes = Vec::new();
    if let Some(version) = root.get("version").filter(|version| !["1.0", "2.0"].contains(version)) {
        notes.push(at(root, format!("version={version:?} is read as SSP 2.0")));
    }
    walk(root, &mut notes)?;
    // One of a kind, with its first line.
    let kind = |note: &String| note.split_once(": ").map_or(String::new(), |(_, what)| what.to_owned());
    let mut seen: Vec<String> = Vec::new();
    notes.retain(|note| {
        let kind = kind(note);
        let is_new = !seen.contains(&kind);
        seen.push(kind);
        is_new
    });
    Ok(notes)
}

fn walk(e: &Element, notes: &mut Vec<String>) -> Result<(), String> {
    let name = local(e);
    let known =
        KNOWN.iter().find(|(known, ..)| *known == name).map(|(_, attributes, children)| (*attributes, *children));
    let Some((attributes, children)) = known.or_else(|| TYPES.contains(&name).then_some(TYPE)) else { return Ok(()) };
    let has = |list: &str, name: &str| list.split_whitespace().any(|one| one == name);
    for (attribute, _) in &e.attributes {
        let namespaced = attribute.contains(':') || attribute == "xmlns";
        if !namespaced && !has(attributes, attribute) && !INFORMATION.contains(&attribute.as_str()) {
            notes.push(at(e, format!("<{name}> of SSP has no attribute {attribute}: it is ignored")));
        }
    }
    if let Some(second) = twice(e) {
        return Err(at(
            second,
            format!("<{}> is the second one in <{}>: remove it, or join both", local(second), local(e)),
        ));
    }
    for child in &e.children {
        match local(child) {
            "Annotations" => {
                for annotation in &child.children {
                    let of = annotation.get("type").unwrap_or_default();
                    notes.push(at(annotation, format!("annotations of the type {of:?} are ignored")));
                }
            }
            "Signature" => notes.push(at(child, "a signature is not verified")),
            other if NO_EFFECT.contains(&other) => {}
            other
                if has(children, other)
                    || (has(children, "TYPES") && TYPES.contains(&other))
                    || (has(children, "TRANSFORMATIONS") && has(TRANSFORMATIONS, other)) =>
            {
                walk(child, notes)?;
            }
            other => notes.push(at(child, format!("<{name}> of SSP has no element <{other}>: it is ignored"))),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_ignored_silently() {
        let of = |text: &str| notes(&Element::parse(text).unwrap()).unwrap();
        assert_eq!(
            of("<s:System name='a' id='i' xmlns:s='s'><s:ElementGeometry x1='0'/><s:Connections>\n\
                <s:Connection startConnector='a' endConnector='b' supressUnitConversion='true'/>\n\
                <s:Connection supressUnitConversion='true'/></s:Connections>\n\
                <s:Sytem/><s:Signature/><s:Annotations><c:Annotation type='org.a'/></s:Annotations></s:System>"),
            [
                "line 2: <Connection> of SSP has no attribute supressUnitConversion: it is ignored",
                "line 4: <System> of SSP has no element <Sytem>: it is ignored",
                "line 4: a signature is not verified",
                "line 4: annotations of the type \"org.a\" are ignored",
            ]
        );
        assert_eq!(
            of("<v:ParameterSet version='3.0'><v:Parameters><v:Parameter name='a'><v:Real value='1' unti='V'/>\
                <c:Dimension size='1'/></v:Parameter></v:Parameters></v:ParameterSet>"),
            [
                "line 1: version=\"3.0\" is read as SSP 2.0",
                "line 1: <Real> of SSP has no attribute unti: it is ignored"
            ]
        );
    }

    #[test]
    fn a_second_one_is_refused() {
        let of = |text: &str| notes(&Element::parse(text).unwrap());
        let inside = |text: &str| {
            of(&format!("<SystemStructureDescription><System>{text}</System></SystemStructureDescription>"))
        };
        assert_eq!(
            inside("<Elements><System/><System/></Elements><Connections><Connection/><Connection/></Connections>"),
            Ok(vec![])
        );
        assert_eq!(
            inside("<Connections/><Elements/>\n<Connections/>"),
            Err("line 2: <Connections> is the second one in <System>: remove it, or join both".into())
        );
        let clocked = "<Connectors><Connector><Real/><Clock name='a'/><Clock name='b'/></Connector></Connectors>";
        assert_eq!(inside(clocked), Ok(vec![]));
        let connector = "<Connectors><Connector><Real/><Dimension/><Dimension/>\n<Integer/></Connector></Connectors>";
        assert_eq!(
            inside(connector),
            Err("line 2: <Integer> is the second one in <Connector>: remove it, or join both".into())
        );
        let root = of("<SystemStructureDescription><System/>\n<System/></SystemStructureDescription>");
        assert!(root.unwrap_err().starts_with("line 2: <System> is the second one in <SystemStructureDescription>"));
    }

    #[test]
    fn every_child_is_known() {
        let is_known = |name: &str| ["TYPES", "TRANSFORMATIONS"].contains(&name) || KNOWN.iter().any(|k| k.0 == name);
        let children = KNOWN.iter().flat_map(|(_, _, children)| children.split_whitespace());
        let missing: Vec<&str> = children.chain(TRANSFORMATIONS.split_whitespace()).filter(|c| !is_known(c)).collect();
        // An enumeration is defined, and is a type.
        assert_eq!(missing, ["Enumeration"]);
    }
}
