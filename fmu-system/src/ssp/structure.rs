//! SystemStructure.ssd, read (SSP 1.0, 4). A feature that our co-simulation does not support is an error with
//! its line, so that nothing is ignored silently.

use super::FMU_TYPE;
pub use super::component::{Binding, Component, Connection, ConnectionEnd, Connector, Mapping, ParameterValues};
use super::element::{at, child, list, local, required, unit, units};
use super::flat::{Flat, Level, Reach, flat};
use super::{ssm, ssv};
use model_description::{BaseUnit, Element, Measured, parse_number};

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
    /// Connections between connectors.
    pub connections: Vec<Connection>,
    /// Values by names `component.variable`, and of the system's connectors.
    pub bindings: Vec<Binding>,
    /// Units that the file defines.
    pub units: Vec<(String, BaseUnit)>,
    /// Parameters of systems, and connectors of inner systems: the variables behind them.
    pub(super) reach: Reach,
}

/// An unsupported feature, and the remedy.
fn unsupported(e: &Element, what: &str) -> String {
    at(e, format!("<{}>: {what}", e.name))
}

impl Structure {
    /// Reads the text of a SystemStructure.ssd.
    ///
    /// # Errors
    /// The line, and the element that is missing, wrong or not supported.
    pub fn read(text: &str) -> Result<Self, String> {
        let root = Element::parse(text).map_err(|e| e.to_string())?;
        if local(&root) != "SystemStructureDescription" {
            return Err(at(
                &root,
                format!("the root element is <{}>, expected <SystemStructureDescription>", root.name),
            ));
        }
        let system =
            child(&root, "System").ok_or_else(|| at(&root, format!("<{}> has no element <System>", root.name)))?;
        let experiment = child(&root, "DefaultExperiment");
        let time = |name: &str| {
            let read = |text: &str| parse_number(text).ok_or_else(|| format!("{name}={text:?} is not a number"));
            experiment
                .and_then(|e| Some((e, e.get(name)?)))
                .map(|(e, text)| read(text).map_err(|w| at(e, w)))
                .transpose()
        };
        let Flat { components, connectors, connections, bindings, reach } = flat(&level(system, String::new())?)?;
        Ok(Self {
            name: required(system, "name")?,
            start: time("startTime")?,
            stop: time("stopTime")?,
            components,
            connectors,
            connections,
            bindings,
            units: units(&root)?,
            reach,
        })
    }

    /// The unit of a connector according to the file.
    pub fn measured<'a>(&self, connector: &'a Connector) -> Option<Measured<'a>> {
        let unit = connector.unit.as_deref()?;
        let base = self.units.iter().find(|(name, _)| name == unit).map(|(_, base)| *base);
        Some(Measured { unit: Some(unit), base, relative: false })
    }

    /// The component of this name.
    pub fn component(&self, name: &str) -> Option<&Component> {
        self.components.iter().find(|c| c.name == name)
    }
}

/// A system with what is inside it.
fn level(e: &Element, path: String) -> Result<Level, String> {
    if let Some(e) = child(e, "SignalDictionaries") {
        return Err(unsupported(e, "signal dictionaries are not supported: connect the components directly"));
    }
    let (mut components, mut inner): (Vec<Component>, Vec<Level>) = (Vec::new(), Vec::new());
    for element in list(e, "Elements") {
        if local(element) == "System" {
            inner.push(level(element, format!("{path}{}.", required(element, "name")?))?);
        } else {
            components.push(component(element, &path)?);
        }
    }
    let twice = components.iter().enumerate().find(|(k, c)| components[..*k].iter().any(|b| b.name == c.name));
    if let Some((_, Component { name, line, .. })) = twice {
        return Err(format!("line {line}: two components have the name {name}: rename one"));
    }
    Ok(Level {
        components,
        connectors: connectors(e)?,
        connections: list(e, "Connections").map(connection).collect::<Result<_, _>>()?,
        bindings: bindings(e)?,
        path,
        inner,
    })
}

fn component(e: &Element, path: &str) -> Result<Component, String> {
    if local(e) != "Component" {
        return Err(unsupported(e, "only components and systems are supported"));
    }
    let source = required(e, "source")?;
    let kind = e.get("type").unwrap_or(FMU_TYPE);
    if kind != FMU_TYPE {
        return Err(at(e, format!("type={kind:?} is not supported, expected {FMU_TYPE}")));
    }
    Ok(Component {
        name: format!("{path}{}", required(e, "name")?),
        source: within(e, &source)?,
        connectors: connectors(e)?,
        bindings: bindings(e)?,
        model_exchange: e.get("implementation") == Some("ModelExchange"),
        line: e.line,
    })
}

/// A relative URI as a path within the archive.
fn within(e: &Element, uri: &str) -> Result<String, String> {
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
    let inside = !path.contains([':', '\\']) && !path.starts_with('/') && path.split('/').all(|part| part != "..");
    if inside && !path.is_empty() { Ok(path) } else { Err(bad()) }
}

fn connectors(e: &Element) -> Result<Vec<Connector>, String> {
    let one = |c: &Element| {
        let unit = c.children.iter().find_map(unit);
        Ok(Connector { name: required(c, "name")?, kind: required(c, "kind")?, unit, line: c.line })
    };
    list(e, "Connectors").map(one).collect()
}

fn connection(e: &Element) -> Result<Connection, String> {
    let (transformation, table) = match e.children.iter().find(|c| local(c).ends_with("Transformation")) {
        None => (None, None),
        Some(t) if local(t) == "LinearTransformation" => (Some(ssm::linear(t)?), None),
        Some(t) => (None, Some(ssm::table(t)?.into())),
    };

    let end = |element: &str, connector: &str| {
        Ok::<_, String>(ConnectionEnd {
            element: e.get(element).map(str::to_owned),
            connector: required(e, connector)?,
        })
    };
    Ok(Connection {
        start: end("startElement", "startConnector")?,
        end: end("endElement", "endConnector")?,
        no_conversion: matches!(e.get("suppressUnitConversion"), Some("true" | "1")),
        transformation,
        table,
        line: e.line,
    })
}

fn bindings(e: &Element) -> Result<Vec<Binding>, String> {
    list(e, "ParameterBindings").map(binding).collect()
}

fn binding(e: &Element) -> Result<Binding, String> {
    let mapping = child(e, "ParameterMapping").map(|mapping| {
        if let Some(source) = mapping.get("source") {
            return Ok::<_, String>(Mapping::File(within(mapping, source)?));
        }
        let inline = child(mapping, "ParameterMapping");
        let inline = inline.ok_or_else(|| at(mapping, "a mapping without source and without entries"))?;
        Ok(Mapping::Inline(ssm::read(inline)?))
    });
    let mapping = mapping.transpose()?;
    if e.get("sourceBase") == Some("component") {
        return Err(at(e, "sourceBase=\"component\" is not supported: put the file beside the FMU"));
    }
    let values = if let Some(source) = e.get("source") {
        ParameterValues::File(within(e, source)?)
    } else {
        let set = child(e, "ParameterValues").and_then(|v| child(v, "ParameterSet"));
        ParameterValues::Inline(ssv::parameters(
            set.ok_or_else(|| at(e, "a binding without source and without values"))?,
        )?)
    };
    Ok(Binding { values, prefix: e.get("prefix").unwrap_or_default().into(), mapping })
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
        assert_eq!(s.connectors[0].unit.as_deref(), Some("V"));
        assert_eq!(
            (&s.bindings[0].values, &*s.bindings[0].prefix),
            (&ParameterValues::File("resources/a b.ssv".into()), "a.")
        );
        let ParameterValues::Inline(values) = &s.bindings[1].values else { panic!("inline") };
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
                "line 2: <SignalDictionaryReference>",
            ),
            (system("<SignalDictionaries/>"), "signal dictionaries"),
            (component(""), "line 2: <Component> has no attribute source"),
            (component("source='../a.fmu'"), "is not a file within the archive"),
            (component("source='http://a/b.fmu'"), "is not a file within the archive"),
            (component("source='a%zz.fmu'"), "is not a file within the archive"),
            (component("source='a.ssp' type='application/x-ssp-package'"), "type=\"application/x-ssp-package\""),
            (
                system("<Elements><Component name='a' source='a'/><Component name='a' source='a'/></Elements>"),
                "two components",
            ),
            (
                system(
                    "<Connections><Connection startConnector='a' endConnector='b'><IntegerMappingTransformation>
                    <MapEntry source='1' target='2'/><MapEntry source='1' target='3'/></IntegerMappingTransformation></Connection></Connections>",
                ),
                "line 3: source=\"1\" is already in the table",
            ),
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
