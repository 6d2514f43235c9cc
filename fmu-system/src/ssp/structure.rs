//! SystemStructure.ssd, read (SSP 1.0 and 2.0, 5). A feature that our co-simulation does not support is an error with
//! its line, and content without effect is reported in a note, so that nothing is ignored silently.

use super::FMU_TYPE;
pub use super::component::{Binding, Component, Connection, ConnectionEnd, Connector, Contents};
use super::element::{Definitions, TYPES, at, child, is_on_clock, list, local, required};
use super::flat::{Flat, Level, Reach, Reference, flat};
pub use super::path::{Hop, StatedUnit};
use super::{known, ssm, ssv};
use model_description::{Element, parse_number};

/// A system of FMUs.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// Name of the system.
    pub name: String,
    /// Start time in s.
    pub start: Option<f64>,
    /// Stop time in s.
    pub stop: Option<f64>,
    /// Its FMUs; an FMU of an inner system has the system's name as a prefix, as in `in.b`.
    pub components: Vec<Component>,
    /// Connectors of the system itself.
    pub connectors: Vec<Connector>,
    /// Connections between connectors, from their sources.
    pub connections: Vec<Connection>,
    /// Values by names `component.variable`, and of the systems' connectors.
    pub bindings: Vec<Binding>,
    /// Connectors of systems: the variables behind them.
    pub(super) reach: Reach,
    /// Unused content of the file.
    pub notes: Vec<String>,
}

/// An unsupported feature, and the remedy.
fn unsupported(e: &Element, what: &str) -> String {
    at(e, format!("<{}>: {what}", e.name))
}

/// Inner descriptions may be this many inside each other.
const DEEPEST: usize = 20;

impl Structure {
    /// Reads the text of a SystemStructure.ssd that refers to no file of signals or of systems.
    ///
    /// # Errors
    /// The line, and the element that is missing, wrong or not supported.
    pub fn read(text: &str) -> Result<Self, String> {
        Self::read_with(text, &mut |name| Err(format!("there is no file {name}")))
    }

    /// Reads the text of a SystemStructure.ssd; `files` reads another file of the archive.
    ///
    /// # Errors
    /// As for [`read`](Self::read), or from `files`.
    pub fn read_with(text: &str, files: &mut dyn FnMut(&str) -> Result<String, String>) -> Result<Self, String> {
        let root = Element::parse(text).map_err(|e| e.to_string())?;
        let system = system(&root)?;
        let experiment = child(&root, "DefaultExperiment");
        let time = |name: &str| {
            let read = |text: &str| parse_number(text).ok_or_else(|| format!("{name}={text:?} is not a number"));
            experiment
                .and_then(|e| Some((e, e.get(name)?)))
                .map(|(e, text)| read(text).map_err(|w| at(e, w)))
                .transpose()
        };
        let mut notes = known::notes(&root)?;
        let mut reader =
            Reader { of: Definitions::read(&root)?, folder: String::new(), files, notes: &mut notes, depth: 0 };
        let level = reader.level(system, String::new())?;
        let Flat { components, connectors, connections, bindings, reach, notes: unfed } = flat(&level)?;
        notes.extend(unfed);
        Ok(Self {
            name: required(system, "name")?,
            start: time("startTime")?,
            stop: time("stopTime")?,
            components,
            connectors,
            connections,
            bindings,
            reach,
            notes,
        })
    }

    /// The component of this name.
    pub fn component(&self, name: &str) -> Option<&Component> {
        self.components.iter().find(|c| c.name == name)
    }
}

/// The system of a description.
fn system(root: &Element) -> Result<&Element, String> {
    if local(root) != "SystemStructureDescription" {
        let expected = "expected <SystemStructureDescription>";
        return Err(at(root, format!("the root element is <{}>, {expected}", root.name)));
    }
    child(root, "System").ok_or_else(|| at(root, format!("<{}> has no element <System>", root.name)))
}

/// Reads one file.
struct Reader<'a> {
    of: Definitions,
    /// Folder of the file in the archive, which ends with a slash; empty for the top.
    folder: String,
    files: &'a mut dyn FnMut(&str) -> Result<String, String>,
    notes: &'a mut Vec<String>,
    /// Nesting depth of this description.
    depth: usize,
}

impl Reader<'_> {
    /// A system with its contents.
    fn level(&mut self, e: &Element, path: String) -> Result<Level, String> {
        let mut level = Level { connectors: connectors(e, &self.of)?, path, ..Level::default() };
        level.bindings = self.bindings(e, &level.path, false)?;
        level.connections = list(e, "Connections").map(connection).collect::<Result<_, _>>()?;
        for dictionary in list(e, "SignalDictionaries") {
            let name = required(dictionary, "name")?;
            if level.dictionaries.iter().any(|(other, _)| *other == name) {
                return Err(at(dictionary, format!("two dictionaries have the name {name}: rename one")));
            }
            level.dictionaries.push((name, self.dictionary(dictionary)?));
        }
        let mut names: Vec<String> = Vec::new();
        for element in list(e, "Elements") {
            let name = required(element, "name")?;
            if names.contains(&name) {
                return Err(at(element, format!("two elements have the name {name}: rename one")));
            }
            match (local(element), element.get("type").unwrap_or(FMU_TYPE)) {
                ("System", _) => level.inner.push(self.level(element, format!("{}{name}.", level.path))?),
                ("Component", DEFINITION_TYPE) => level.inner.push(self.definition(element, &level.path)?),
                ("Component", _) => level.components.push(self.component(element, &level.path)?),
                ("SignalDictionaryReference", _) if child(element, "ParameterBindings").is_some() => {
                    return Err(at(element, "values for signals are not supported: bind them to the system"));
                }
                ("SignalDictionaryReference", _) => level.references.push(Reference {
                    name: name.clone(),
                    dictionary: required(element, "dictionary")?,
                    connectors: connectors(element, &self.of)?,
                }),
                _ => {
                    return Err(unsupported(
                        element,
                        "only components, systems and references to signals are supported",
                    ));
                }
            }
            names.push(name);
        }
        Ok(level)
    }

    fn component(&mut self, e: &Element, path: &str) -> Result<Component, String> {
        let kind = e.get("type").unwrap_or(FMU_TYPE);
        if kind != FMU_TYPE {
            return Err(at(e, format!("type={kind:?} is not supported, expected {FMU_TYPE} or {DEFINITION_TYPE}")));
        }
        let implementation = match e.get("implementation") {
            None | Some("any") => None,
            Some(known @ ("CoSimulation" | "ModelExchange")) => Some(known.to_owned()),
            Some(other) => {
                let expected = "expected any, CoSimulation or ModelExchange";
                return Err(at(e, format!("implementation={other:?} is not supported, {expected}")));
            }
        };
        Ok(Component {
            name: format!("{path}{}", required(e, "name")?),
            source: self.within(e, &required(e, "source")?)?,
            connectors: connectors(e, &self.of)?,
            bindings: self.bindings(e, "", true)?,
            implementation,
            line: e.line,
        })
    }

    /// A component that is a description of a system.
    fn definition(&mut self, e: &Element, path: &str) -> Result<Level, String> {
        let file = self.within(e, &required(e, "source")?)?;
        let inside = |cause: String| at(e, format!("{file}: {cause}"));
        if self.depth == DEEPEST {
            return Err(inside(format!("more than {DEEPEST} descriptions are inside each other")));
        }
        let text = (self.files)(&file).map_err(|cause| at(e, cause))?;
        let root = Element::parse(&text).map_err(|e| inside(e.to_string()))?;
        let of = Definitions::read(&root).map_err(inside)?;
        let notes = known::notes(&root).map_err(inside)?;
        self.notes.extend(notes.into_iter().map(|note| format!("{file}: {note}")));
        let path = format!("{path}{}.", required(e, "name")?);
        // Values of the component replace the system's.
        let more = self.bindings(e, &path, false)?;
        let folder = file.rfind('/').map_or("", |slash| &file[..=slash]).to_owned();
        let mut reader = Reader { of, folder, files: &mut *self.files, notes: &mut *self.notes, depth: self.depth + 1 };
        let mut level = system(&root).and_then(|system| reader.level(system, path)).map_err(inside)?;
        level.bindings.extend(more);
        Ok(level)
    }

    /// The entries of a signal dictionary.
    fn dictionary(&mut self, e: &Element) -> Result<Vec<Connector>, String> {
        expect_type(e, "application/x-ssp-signal-dictionary")?;
        let Some(source) = e.get("source") else {
            let inline = child(e, "SignalDictionary");
            return entries(inline.ok_or_else(|| at(e, "a dictionary without source and without entries"))?);
        };
        let file = self.within(e, source)?;
        let inside = |cause: String| at(e, format!("{file}: {cause}"));
        let text = (self.files)(&file).map_err(|cause| at(e, cause))?;
        let root = Element::parse(&text).map_err(|e| inside(e.to_string()))?;
        let notes = known::notes(&root).map_err(inside)?;
        self.notes.extend(notes.into_iter().map(|note| format!("{file}: {note}")));
        entries(&root).map_err(inside)
    }

    /// A relative URI as a path within the archive.
    fn within(&self, e: &Element, uri: &str) -> Result<String, String> {
        let path = relative(e, uri)?;
        Ok(format!("{}{path}", self.folder))
    }

    fn bindings(&mut self, e: &Element, path: &str, of_component: bool) -> Result<Vec<Binding>, String> {
        list(e, "ParameterBindings").map(|binding| self.binding(binding, path, of_component)).collect()
    }

    fn binding(&mut self, e: &Element, path: &str, of_component: bool) -> Result<Binding, String> {
        expect_type(e, "application/x-ssp-parameter-set")?;
        let mapping = child(e, "ParameterMapping").map(|mapping| {
            expect_type(mapping, "application/x-ssp-parameter-mapping")?;
            if let Some(source) = mapping.get("source") {
                return self.located(mapping, source, of_component);
            }
            let inline = child(mapping, "ParameterMapping");
            let inline = inline.ok_or_else(|| at(mapping, "a mapping without source and without entries"))?;
            Ok(Contents::Inline(ssm::read(inline)?))
        });
        let mapping = mapping.transpose()?;
        let values = if let Some(source) = e.get("source") {
            self.located(e, source, of_component)?
        } else {
            let set = child(e, "ParameterValues").and_then(|v| child(v, "ParameterSet"));
            let set = set.ok_or_else(|| at(e, "a binding without source and without values"))?;
            Contents::Inline(ssv::parameters(set)?)
        };
        Ok(Binding { values, prefix: e.get("prefix").unwrap_or_default().into(), mapping, path: path.into() })
    }

    /// A file beside the description, or within the component.
    fn located<T>(&self, e: &Element, source: &str, of_component: bool) -> Result<Contents<T>, String> {
        match e.get("sourceBase") {
            None | Some("SSD") => Ok(Contents::File(self.within(e, source)?)),
            Some("component") if of_component => Ok(Contents::InComponent(relative(e, source)?)),
            Some("component") => Err(at(e, "sourceBase=\"component\" is for an FMU, not for a system")),
            Some(other) => Err(at(e, format!("sourceBase={other:?} is not known, expected SSD or component"))),
        }
    }
}

/// MIME type of a component that is a description of a system.
const DEFINITION_TYPE: &str = "application/x-ssp-definition";

/// Only the type of SSP is supported.
fn expect_type(e: &Element, expected: &str) -> Result<(), String> {
    match e.get("type").filter(|kind| *kind != expected) {
        Some(other) => Err(at(e, format!("type={other:?} is not supported, expected {expected}"))),
        None => Ok(()),
    }
}

fn relative(e: &Element, uri: &str) -> Result<String, String> {
    let bad =
        || at(e, format!("source={uri:?} is not a file within the archive, expected for example resources/plant.fmu"));
    let mut bytes = Vec::new();
    let mut rest = uri.strip_prefix("./").unwrap_or(uri).bytes();
    while let Some(byte) = rest.next() {
        bytes.push(if byte == b'%' {
            let digit = |b: Option<u8>| b.and_then(|b| char::from(b).to_digit(16));
            let value = digit(rest.next()).zip(digit(rest.next())).map(|(high, low)| 16 * high + low);
            value.and_then(|v| u8::try_from(v).ok()).ok_or_else(bad)?
        } else {
            byte
        });
    }
    let path = String::from_utf8(bytes).map_err(|_| bad())?;
    let inside = !path.contains([':', '\\', '#']) && !path.starts_with('/') && path.split('/').all(|part| part != "..");
    if inside && !path.is_empty() { Ok(path) } else { Err(bad()) }
}

fn connectors(e: &Element, of: &Definitions) -> Result<Vec<Connector>, String> {
    list(e, "Connectors").map(|c| typed(c, of, required(c, "kind")?)).collect()
}

/// The entries of a signal dictionary.
fn entries(root: &Element) -> Result<Vec<Connector>, String> {
    if local(root) != "SignalDictionary" {
        return Err(at(root, format!("<{}> is not a SignalDictionary of SSP", root.name)));
    }
    let of = Definitions::read(root)?;
    let all = root.children.iter().filter(|c| local(c) == "DictionaryEntry");
    all.map(|entry| typed(entry, &of, "inout".into())).collect()
}

/// A connector, or an entry of a dictionary.
fn typed(e: &Element, of: &Definitions, kind: String) -> Result<Connector, String> {
    let base = e.children.iter().find(|c| TYPES.contains(&local(c)) && !is_on_clock(c));
    let extent = |d: &Element| {
        let number = |text: &str| text.parse().map_err(|_| at(d, format!("size={text:?} is not a size")));
        d.get("size").map(number).transpose()
    };
    Ok(Connector {
        name: required(e, "name")?,
        kind,
        base: base.map(|base| local(base).to_owned()),
        unit: base.and_then(|base| of.unit(base)),
        items: base.map(|base| of.items(base)).unwrap_or_default(),
        ticks: base.filter(|base| local(base) == "Clock").and_then(|c| c.get("intervalVariability")).map(str::to_owned),
        clocks: e.children.iter().filter(|c| is_on_clock(c)).filter_map(|c| c.get("name")).map(str::to_owned).collect(),
        extents: e.children.iter().filter(|c| local(c) == "Dimension").map(extent).collect::<Result<_, _>>()?,
        line: e.line,
    })
}

fn connection(e: &Element) -> Result<Connection, String> {
    let end = |element: &str, connector: &str| {
        Ok::<_, String>(ConnectionEnd {
            element: e.get(element).map(str::to_owned),
            connector: required(e, connector)?,
        })
    };
    if let Some(name) = ["startIndices", "endIndices"].into_iter().find(|name| e.get(name).is_some()) {
        let remedy = "SSP does not say whether it counts from 0 or 1: name the element, as in m[1,2]";
        return Err(at(e, format!("{name} is not supported, and {remedy}")));
    }
    let hop = Hop { unit: None, no_conversion: ssm::suppresses(e)?, transformation: ssm::transformation(e)? };
    Ok(Connection {
        start: end("startElement", "startConnector")?,
        end: end("endElement", "endConnector")?,
        hops: vec![hop],
        line: e.line,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(inside: &str) -> Result<Structure, String> {
        Structure::read(&format!(
            "<s:SystemStructureDescription><s:System name='x'>\n{inside}</s:System></s:SystemStructureDescription>"
        ))
    }

    #[test]
    fn what_is_there_is_read() {
        let s = system(
            "<s:Connectors><s:Connector name='u' kind='input'><c:Real unit='V'/></s:Connector></s:Connectors>
            <s:ParameterBindings><s:ParameterBinding prefix='a.' source='./resources/a%20b.ssv'/><s:ParameterBinding>
            <s:ParameterValues><v:ParameterSet><v:Parameters><v:Parameter name='a.x'><v:Real value='3' unit='V'/></v:Parameter>
            </v:Parameters></v:ParameterSet></s:ParameterValues></s:ParameterBinding></s:ParameterBindings>
            <s:Elements><s:Component name='a' source='resources/a.fmu'><s:Connectors><s:Connector name='v' kind='input'/>
            </s:Connectors></s:Component></s:Elements>
            <s:Connections><s:Connection startConnector='u' endElement='a' endConnector='v'/></s:Connections>",
        )
        .unwrap();
        assert_eq!(s.connectors[0].unit.as_ref().map(|unit| unit.name.as_str()), Some("V"));
        assert_eq!(
            (&s.bindings[0].values, &*s.bindings[0].prefix),
            (&Contents::File("resources/a b.ssv".into()), "a.")
        );
        let Contents::Inline(values) = &s.bindings[1].values else { panic!("inline") };
        assert_eq!((values[0].name.as_str(), values[0].unit.as_deref()), ("a.x", Some("V")));
        assert_eq!(
            (s.connections[0].start.to_string(), s.connections[0].end.to_string()),
            ("u of the system".into(), "a.v".into())
        );
    }

    #[test]
    fn what_is_not_supported_is_told_with_its_line() {
        let component = |attributes: &str| system(&format!("<Elements><Component name='a' {attributes}/></Elements>"));
        for (structure, part) in [
            (Structure::read("<a/>"), "line 1: the root element is <a>"),
            (system("<Elements><System/></Elements>"), "line 2: <System> has no attribute name"),
            (
                system("<Elements><SignalDictionaryReference name='i'/></Elements>"),
                "line 2: <SignalDictionaryReference> has no attribute dictionary",
            ),
            (system("<Elements><Sytem name='a'/></Elements>"), "line 2: <Sytem>: only components, systems and references"),
            (component("source='a.fmu' implementation='ScheduledExecution'"), "implementation=\"ScheduledExecution\""),
            (component("source='#other'"), "is not a file within the archive"),
            (component("source='a' type='text/x-modelica'"), "type=\"text/x-modelica\" is not supported"),
            (
                system("<Connections><Connection startConnector='a' endConnector='b' startIndices='1'/></Connections>"),
                "line 2: startIndices is not supported, and SSP does not say whether it counts from 0 or 1",
            ),
            (
                system("<ParameterBindings><ParameterBinding source='a' type='text/csv'/></ParameterBindings>"),
                "line 2: type=\"text/csv\" is not supported, expected application/x-ssp-parameter-set",
            ),
            (
                system("<ParameterBindings><ParameterBinding source='a' sourceBase='component'/></ParameterBindings>"),
                "line 2: sourceBase=\"component\" is for an FMU, not for a system",
            ),
            (component(""), "line 2: <Component> has no attribute source"),
            (component("source='../a.fmu'"), "is not a file within the archive"),
            (component("source='http://a/b.fmu'"), "is not a file within the archive"),
            (component("source='a%zz.fmu'"), "is not a file within the archive"),
            (component("source='a.ssp' type='application/x-ssp-package'"), "type=\"application/x-ssp-package\""),
            (
                system("<Elements><Component name='a' source='a'/><Component name='a' source='a'/></Elements>"),
                "two elements have the name a",
            ),
            (
                system(
                    "<Connections><Connection startConnector='a' endConnector='b'><IntegerMappingTransformation>
                    <MapEntry source='1' target='2'/><MapEntry source='1' target='3'/></IntegerMappingTransformation></Connection></Connections>",
                ),
                "line 3: source=\"1\" is already in the table",
            ),
            (
                system("<Connections><Connection startConnector='a' endConnector='b' suppressUnitConversion='True'/></Connections>"),
                "line 2: suppressUnitConversion=\"True\" is not true or false",
            ),
            (system("<Connections/>\n<Connections/>"), "line 3: <Connections> is the second one in <System>"),
            (
                system(
                    "<ParameterBindings><ParameterBinding source='a'><ParameterMapping/></ParameterBinding></ParameterBindings>",
                ),
                "line 2: a mapping without source and without entries",
            ),
            (system("<ParameterBindings><ParameterBinding/></ParameterBindings>"), "without source and without values"),
        ] {
            let error = structure.unwrap_err();
            assert!(error.contains(part), "{error}: {part}");
        }
    }
}
