//! Systems from SSP files: inner systems, units, transformations, mappings, signals, and content refused or ignored with a note.

use crate::workshop::Workshop;
use fmu_system::cosimulation::{Integration, Method, Settings, Solver, System};
use fmu_system::ssp::load::Loaded;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

/// An SSP file of these entries.
fn packed(path: &Path, entries: &[(&str, &[u8])]) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in entries {
        zip.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap();
}

const NESTED: &str = "<s:SystemStructureDescription><s:System name='outer'>
    <s:Connectors><s:Connector name='T0' kind='parameter'/><s:Connector name='out' kind='output'/></s:Connectors>
    <s:ParameterBindings>
      <s:ParameterBinding source='p.ssv'><s:ParameterMapping source='p.ssm'/></s:ParameterBinding>
      <s:ParameterBinding><s:ParameterValues><v:ParameterSet><v:Parameters>
        <v:Parameter name='T0'><v:Real value='0.2'/></v:Parameter></v:Parameters></v:ParameterSet></s:ParameterValues></s:ParameterBinding>
    </s:ParameterBindings>
    <s:Elements>
      <s:Component name='a' source='plant.fmu'><s:Connectors><s:Connector name='z' kind='output'/>
        <s:Connector name='T' kind='parameter'/></s:Connectors></s:Component>
      <s:System name='in'>
        <s:Connectors><s:Connector name='w' kind='input'/><s:Connector name='T1' kind='parameter'/>
          <s:Connector name='r' kind='output'/></s:Connectors>
        <s:Elements><s:Component name='b' source='plant.fmu'><s:Connectors><s:Connector name='u' kind='input'/>
          <s:Connector name='z' kind='output'/><s:Connector name='T' kind='parameter'/></s:Connectors></s:Component></s:Elements>
        <s:Connections><s:Connection startConnector='w' endElement='b' endConnector='u'/>
          <s:Connection startElement='b' startConnector='z' endConnector='r'/>
          <s:Connection startConnector='T1' endElement='b' endConnector='T'><c:LinearTransformation factor='3'/></s:Connection></s:Connections>
      </s:System>
    </s:Elements>
    <s:Connections>
      <s:Connection startElement='a' startConnector='z' endElement='in' endConnector='w'>
        <c:LinearTransformation factor='0.5' offset='1'/></s:Connection>
      <s:Connection startElement='in' startConnector='r' endConnector='out'/>
      <s:Connection startConnector='T0' endElement='a' endConnector='T'/>
      <s:Connection startConnector='T0' endElement='in' endConnector='T1'/>
    </s:Connections>
  </s:System></s:SystemStructureDescription>";

#[test]
fn an_ssp_with_inner_systems_mappings_and_transformations() {
    let workshop = Workshop::new();
    let fmu = std::fs::read(workshop.archive("plant", 2, &[], |xml| xml)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nested.ssp");
    let values = b"<v:ParameterSet><v:Parameters><v:Parameter name='drive'><v:Real value='3'/></v:Parameter>\
        <v:Parameter name='unused'><v:Real value='3'/></v:Parameter></v:Parameters></v:ParameterSet>";
    let mapping =
        b"<m:ParameterMapping><m:MappingEntry source='drive' target='a.u'><c:LinearTransformation factor='2'/>\
        </m:MappingEntry></m:ParameterMapping>";
    let entries: [(&str, &[u8]); 4] =
        [("SystemStructure.ssd", NESTED.as_bytes()), ("plant.fmu", &fmu), ("p.ssv", values), ("p.ssm", mapping)];
    packed(&path, &entries);
    let mut loaded = Loaded::open(&path, false).unwrap();
    assert_eq!(loaded.notes, [""; 0]);
    for name in ["a.u", "a.z", "in.b.u", "out", "a.T", "in.b.T"] {
        loaded.record(name).unwrap();
    }
    let settings = Settings { start: 0.0, stop: 0.2, step: 0.1, sequential: false };
    let recording = loaded.system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    let last: Vec<f64> = recording.columns.iter().map(|column| *column.values.last().unwrap()).collect();
    // z = 1 - 2 u.
    let expected = [6.0, -11.0, -4.5, 10.0, 0.2, 0.6];
    assert!(last.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-12), "{last:?}");

    // In Model Exchange the system has its state: x' = u - x from 1.
    let solver = Integration { solver: Solver::Dopri { rtol: 1e-9 }, ..Integration::default() };
    let exchange = |_: &[_]| System::new(Method::ModelExchange(solver));
    let mut loaded = Loaded::open_files_with(&["nested.ssp".to_owned()], folder.path(), false, exchange).unwrap();
    assert!(matches!(loaded.system.method(), Method::ModelExchange(_)));
    loaded.record("a.x").unwrap();
    let recording = loaded.system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    let x = recording.columns[0].values[2];
    assert!((x - (6.0 - 5.0 * f64::exp(-0.2))).abs() < 1e-8, "{x}");

    // Another variant, and missing parts.
    packed(&path, &[("B.ssd", NESTED.as_bytes()), ("A.ssd", NESTED.as_bytes()), entries[1], entries[2], entries[3]]);
    let open =
        |name: &str| Loaded::open_files(&[name.to_owned()], folder.path(), false).map(drop).map_err(|e| e.to_string());
    assert!(open("nested.ssp#A.ssd").is_ok());
    let error = open("nested.ssp").unwrap_err();
    assert!(
        error.contains("has no SystemStructure.ssd; its variants are A.ssd, B.ssd: name one, as in nested.ssp#A.ssd"),
        "{error}"
    );
    let twice = NESTED.replace(
        "<s:Connection startElement='in' startConnector='r'",
        "<s:Connection startElement='a' startConnector='z' endElement='in' endConnector='w'/><s:Connection startElement='in' startConnector='r'",
    );
    packed(&path, &[("SystemStructure.ssd", twice.as_bytes()), entries[1], entries[2], entries[3]]);
    let error = open("nested.ssp").unwrap_err();
    assert!(error.contains("in.w is fed twice"), "{error}");
}

/// The FMU of the tests, with a file of values in it: z = 1 - 2 u, and u = 4 if the values are used.
fn plant() -> Vec<u8> {
    let workshop = Workshop::new();
    let fmu = workshop.archive("plant", 3, &[], |xml| xml);
    let mut zip =
        zip::ZipWriter::new_append(std::fs::File::options().read(true).write(true).open(&fmu).unwrap()).unwrap();
    zip.start_file("resources/own.ssv", zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(values("<v:Parameter name='u'><v:Real value='4'/></v:Parameter>").as_bytes()).unwrap();
    zip.finish().unwrap();
    std::fs::read(fmu).unwrap()
}

fn values(inside: &str) -> String {
    format!("<v:ParameterSet><v:Parameters>{inside}</v:Parameters></v:ParameterSet>")
}

/// A system of components `a` and `b` with u, z and T, and further content; the file defines units of length.
fn description(connectors: &str, inside: &str, connections: &str) -> String {
    let of = "<s:Connectors><s:Connector name='u' kind='input'/><s:Connector name='z' kind='output'/>\
        <s:Connector name='T' kind='parameter'/></s:Connectors>";
    let component = |name: &str| format!("<s:Component name='{name}' source='plant.fmu'>{of}</s:Component>");
    format!(
        "<s:SystemStructureDescription version='2.0'><s:System name='x'><s:Connectors>{connectors}</s:Connectors>\
         <s:Elements>{}{}{inside}</s:Elements><s:Connections>{connections}</s:Connections></s:System>\
         <s:Units><c:Unit name='m'><c:BaseUnit m='1'/></c:Unit><c:Unit name='km'><c:BaseUnit m='1' factor='1000'/></c:Unit>\
         </s:Units></s:SystemStructureDescription>",
        component("a"),
        component("b"),
    )
}

/// A folder with `x.ssp`, which has this description, the FMU and other files.
fn ssp(description: &str, others: &[(&str, &str)]) -> tempfile::TempDir {
    static PLANT: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
    let folder = tempfile::tempdir().unwrap();
    let mut entries = vec![("SystemStructure.ssd", description.as_bytes()), ("plant.fmu", PLANT.get_or_init(plant))];
    entries.extend(others.iter().map(|(name, text)| (*name, text.as_bytes())));
    packed(&folder.path().join("x.ssp"), &entries);
    folder
}

fn open(folder: &tempfile::TempDir) -> Result<Loaded, String> {
    Loaded::open(&folder.path().join("x.ssp"), false).map_err(|e| e.to_string())
}

/// The last values of these names.
fn last(loaded: &mut Loaded, names: &[&str]) -> Vec<f64> {
    for name in names {
        loaded.record(name).unwrap();
    }
    let settings = Settings { start: 0.0, stop: 0.2, step: 0.1, sequential: false };
    let recording = loaded.system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    recording.columns.iter().map(|column| *column.values.last().unwrap()).collect()
}

fn near(found: &[f64], expected: &[f64]) {
    assert!(found.len() == expected.len(), "{found:?}");
    assert!(found.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-12), "{found:?} {expected:?}");
}

/// An inner system may pass an input on to its output, with its own units: 3 km arrive as 3000, and after a factor of 2 as 6.
#[test]
fn an_inner_system_passes_values_through() {
    let length = |unit: &str| format!("<c:Real unit='{unit}'/>");
    let (km, m) = (length("km"), length("m"));
    let inner = format!(
        "<s:System name='in'><s:Connectors><s:Connector name='i' kind='input'>{km}</s:Connector>\
         <s:Connector name='o' kind='output'>{m}</s:Connector><s:Connector name='d' kind='output'>{km}</s:Connector></s:Connectors>\
         <s:Connections><s:Connection startConnector='i' endConnector='o'/><s:Connection startConnector='i' endConnector='d'>\
         <c:LinearTransformation factor='2'/></s:Connection></s:Connections></s:System>"
    );
    let connections = "<s:Connection startConnector='x' endElement='in' endConnector='i'/>\
        <s:Connection startElement='in' startConnector='o' endElement='a' endConnector='u'/>\
        <s:Connection startElement='in' startConnector='d' endElement='b' endConnector='u'/>";
    let connectors = format!("<s:Connector name='x' kind='input'>{km}</s:Connector>");
    let mut loaded = open(&ssp(&description(&connectors, &inner, connections), &[])).unwrap();
    loaded.set("x", "3").unwrap();
    near(&last(&mut loaded, &["x", "a.u", "b.u"]), &[3.0, 3000.0, 6.0]);
}

/// A pattern stands for all names of its form, in the order of the system.
#[test]
fn a_pattern_records_all_names_of_its_form() {
    let folder = ssp(&description("", "", ""), &[]);
    let mut loaded = open(&folder).unwrap();
    loaded.record("?.z").unwrap();
    let names: Vec<&str> = loaded.system.columns().iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["a.z", "b.z"]);
    let error = loaded.record("c.*").unwrap_err().to_string();
    assert_eq!(error, "c.*: no variable has a name of this form");
}

/// Every connection converts from the unit of one connector to that of the next, and then transforms; a value for a connector
/// is in the connector's unit.
#[test]
fn connectors_of_systems_have_units_and_transformations() {
    let length = |unit: &str| format!("<c:Real unit='{unit}'/>");
    let connectors = format!(
        "<s:Connector name='in' kind='input'>{}</s:Connector><s:Connector name='out' kind='output'>{}</s:Connector>\
         <s:Connector name='time_constant' kind='parameter'>{}</s:Connector>",
        length("km"),
        length("km"),
        length("km"),
    );
    // The FMU has no units, so the units of the inner system's connectors apply.
    let inner = format!(
        "<s:System name='i'><s:Connectors><s:Connector name='u' kind='input'>{m}</s:Connector><s:Connector name='z' kind='output'>{m}</s:Connector>\
         <s:Connector name='T' kind='parameter'>{m}</s:Connector></s:Connectors><s:Elements><s:Component name='c' source='plant.fmu'><s:Connectors>\
         <s:Connector name='u' kind='input'/><s:Connector name='z' kind='output'/><s:Connector name='T' kind='parameter'/>\
         </s:Connectors></s:Component></s:Elements>\
         <s:Connections><s:Connection startConnector='u' endElement='c' endConnector='u'/><s:Connection startElement='c' startConnector='z' endConnector='z'/>\
         <s:Connection startConnector='T' endElement='c' endConnector='T'/></s:Connections></s:System>",
        m = length("m"),
    );
    let connections = "<s:Connection startConnector='in' endElement='i' endConnector='u'><c:LinearTransformation offset='5'/></s:Connection>\
        <s:Connection startElement='i' startConnector='z' endConnector='out'><c:LinearTransformation factor='10'/></s:Connection>\
        <s:Connection startConnector='time_constant' endElement='i' endConnector='T'><c:LinearTransformation factor='0.5'/></s:Connection>";
    let bound = |inside: &str, mapping: &str| {
        let text = description(&connectors, &inner, connections);
        let binding = format!(
            "<s:ParameterBindings><s:ParameterBinding><s:ParameterValues>{}</s:ParameterValues>{mapping}</s:ParameterBinding>\
             </s:ParameterBindings><s:Elements>",
            values(inside)
        );
        ssp(&text.replacen("<s:Elements>", &binding, 1), &[])
    };
    let (parameter, value) = (
        "<v:Parameter name='time_constant'><v:Real value='2e-4'/></v:Parameter>",
        "<v:Parameter name='in'><v:Real value='0.002'/></v:Parameter>",
    );
    // in: 0.002 km = 2 m, 7 m. z = 1 - 14. out: -0.013 km * 10. T: 2e-4 km = 0.2 m * 0.5.
    let folder = bound(&format!("{parameter}{value}"), "");
    let mut loaded = open(&folder).unwrap();
    near(&last(&mut loaded, &["i.c.u", "out", "in", "i.c.T"]), &[7.0, -0.13, 0.002, 0.1]);
    let mut loaded = open(&folder).unwrap();
    loaded.set("in", "0.003").unwrap();
    near(&last(&mut loaded, &["i.c.u", "in"]), &[8.0, 0.003]);
    let mut loaded = open(&folder).unwrap();
    loaded.points("in", "0:0.001~0.1:0.003").unwrap();
    near(&last(&mut loaded, &["i.c.u", "in", "out"]), &[8.0, 0.003, -0.15]);
    let mut loaded = open(&folder).unwrap();
    let error = loaded.set("in", "3 m").unwrap_err().to_string();
    assert!(error.contains("\"3 m\" has a unit, and a transformation follows: write the number alone"), "{error}");
    // A mapping transforms after the conversion to the unit of its target: 2 m = 0.002 km, 0.006 km = 6 m, 11 m.
    let defined = "<s:Units><c:Unit name='m'><c:BaseUnit m='1'/></c:Unit></s:Units></v:ParameterSet>";
    let length = values("<v:Parameter name='l'><v:Real value='2' unit='m'/></v:Parameter>");
    let length = length.replace("</v:ParameterSet>", defined);
    let text = description(&connectors, &inner, connections);
    for (attribute, u) in [("", 11.0), ("suppressUnitConversion='true'", 6005.0)] {
        let binding = format!(
            "<s:ParameterBindings><s:ParameterBinding source='l.ssv'><s:ParameterMapping><m:ParameterMapping>\
             <m:MappingEntry source='l' target='in' {attribute}><c:LinearTransformation factor='3'/></m:MappingEntry>\
             </m:ParameterMapping></s:ParameterMapping></s:ParameterBinding></s:ParameterBindings><s:Elements>"
        );
        let folder = ssp(&text.replacen("<s:Elements>", &binding, 1), &[("l.ssv", &length)]);
        near(&last(&mut open(&folder).unwrap(), &["i.c.u"]), &[u]);
    }
}

/// Signals of a dictionary, in the description or in a file, are shared by all references, including in inner systems.
#[test]
fn signals_travel_through_dictionaries() {
    let entries = |units: &str| {
        format!(
            "<b:SignalDictionary version='2.0'><b:DictionaryEntry name='s'><c:Real unit='mm'/></b:DictionaryEntry>\
             <b:DictionaryEntry name='unused'><c:Real/></b:DictionaryEntry>{units}</b:SignalDictionary>"
        )
    };
    let units = "<b:Units><c:Unit name='mm'><c:BaseUnit m='1' factor='0.001'/></c:Unit></b:Units>";
    let reference = |name: &str, kind: &str| {
        format!(
            "<s:SignalDictionaryReference name='{name}' dictionary='bus'><s:Connectors><s:Connector name='s' kind='{kind}'/>\
             </s:Connectors></s:SignalDictionaryReference>"
        )
    };
    let inside = format!(
        "{}<s:System name='i'><s:Connectors><s:Connector name='z' kind='output'><c:Real unit='km'/></s:Connector></s:Connectors>\
         <s:Elements>{}<s:Component name='c' source='plant.fmu'><s:Connectors><s:Connector name='u' kind='input'>\
         <c:Real unit='m'/></s:Connector></s:Connectors></s:Component></s:Elements><s:Connections>\
         <s:Connection startElement='r' startConnector='s' endElement='c' endConnector='u'/></s:Connections></s:System>",
        reference("to", "inout"),
        reference("r", "output"),
    );
    let connections = "<s:Connection startElement='to' startConnector='s' endElement='a' endConnector='z'/>\
        <s:Connection startElement='to' startConnector='s' endElement='b' endConnector='u'/>";
    let with = |dictionary: &str, others: &[(&str, &str)], change: &dyn Fn(String) -> String| {
        let text = description("", &inside, connections).replace(
            "</s:System><s:Units>",
            &format!("<s:SignalDictionaries>{dictionary}</s:SignalDictionaries></s:System><s:Units>"),
        );
        open(&ssp(&change(text), others))
    };
    let inline = format!("<s:SignalDictionary name='bus'>{}</s:SignalDictionary>", entries(units));
    let from_file = "<s:SignalDictionary name='bus' source='bus.ssb'/>";
    let file = entries(units);
    for (dictionary, others) in [(inline.as_str(), &[][..]), (from_file, &[("bus.ssb", file.as_str())][..])] {
        let mut loaded = with(dictionary, others, &|text| text).unwrap();
        loaded.set("a.u", "2").unwrap();
        // z = -3 mm: at the connector in m, -0.003.
        near(&last(&mut loaded, &["a.z", "b.u", "i.c.u"]), &[-3.0, -3.0, -0.003]);
        assert!(loaded.system.take_notes().iter().all(|note| note.contains("has no unit")));
    }
    for (old, new, cause) in [
        (
            "dictionary='bus'><s:Connectors><s:Connector name='s' kind='output'",
            "dictionary='can'><s:Connectors><s:Connector name='s' kind='output'",
            "r refers to the dictionary can, which no system has",
        ),
        (
            "b:DictionaryEntry name='s'",
            "b:DictionaryEntry name='t'",
            "the dictionary bus has no connector s; it has t, unused",
        ),
        (
            "<s:Connector name='s' kind='output'/>",
            "<s:Connector name='s' kind='output'><c:Real unit='m'/></s:Connector>",
            "r.s is in m, and the dictionary bus has s in mm",
        ),
        (
            "endElement='a' endConnector='z'",
            "endElement='a' endConnector='u'",
            "line 1: nothing feeds the entry s of the dictionary bus: a.u keeps its value",
        ),
        (
            "<s:SignalDictionary name='bus'>",
            "<s:SignalDictionary name='bus' type='text/csv'>",
            "type=\"text/csv\" is not supported",
        ),
        (
            "<b:SignalDictionary version='2.0'>",
            "<b:Signals/><b:SignalDictionary version='2.0'>",
            "<SignalDictionary> of SSP has no element <Signals>",
        ),
    ] {
        let found = with(&inline, &[], &|text| {
            assert!(text.contains(old), "{old}");
            text.replace(old, new)
        });
        let said = found.map_or_else(|error| error, |loaded| loaded.notes.join("; "));
        assert!(said.contains(cause), "{said}: {cause}");
    }
    let twice = "<s:Connection startElement='to' startConnector='s' endElement='b' endConnector='z'/></s:Connections>";
    let replaced = |text: String| {
        let at = text.rfind("</s:Connections>").unwrap();
        format!("{}{twice}{}", &text[..at], &text[at + "</s:Connections>".len()..])
    };
    let error = with(&inline, &[], &replaced).map(drop).unwrap_err();
    assert!(error.contains("the entry s of the dictionary bus is fed twice"), "{error}");
    let error = with(from_file, &[], &|text| text).map(drop).unwrap_err();
    assert!(error.ends_with("x.ssp: SystemStructure.ssd: line 1: has no bus.ssb"), "{error}");
}

/// Values from a file in the FMU, a prefix before the names of a mapping, and a description that is a component.
#[test]
fn files_within_files() {
    let own = "<s:ParameterBindings><s:ParameterBinding sourceBase='component' source='resources/own.ssv'/></s:ParameterBindings></s:Component>";
    let with_own = |text: String| text.replacen("</s:Component>", own, 1);
    let text = with_own(description("", "", ""));
    near(&last(&mut open(&ssp(&text, &[])).unwrap(), &["a.u", "b.u"]), &[4.0, 0.0]);
    let error = open(&ssp(&text.replace("own.ssv", "no.ssv"), &[])).map(drop).unwrap_err();
    assert!(error.ends_with("plant.fmu: has no resources/no.ssv"), "{error}");

    let prefixed = |entry: &str| {
        let binding = "<s:ParameterBindings><s:ParameterBinding prefix='p.' source='v.ssv'><s:ParameterMapping source='m.ssm'/>\
             </s:ParameterBinding></s:ParameterBindings><s:Elements>";
        let mapping = format!("<m:ParameterMapping>{entry}</m:ParameterMapping>");
        let text = description("", "", "").replacen("<s:Elements>", binding, 1);
        let given = values("<v:Parameter name='u'><v:Real value='3'/></v:Parameter>");
        open(&ssp(&text, &[("v.ssv", &given), ("m.ssm", &mapping)]))
    };
    let mut loaded = prefixed("<m:MappingEntry source='p.u' target='b.u'/>").unwrap();
    near(&last(&mut loaded, &["b.u"]), &[3.0]);
    let error = prefixed("<m:MappingEntry source='u' target='b.u'/>").map(drop).unwrap_err();
    assert!(
        error.ends_with("m.ssm: line 1: u to b.u: no value has this name; with the prefix of the binding it is p.u"),
        "{error}"
    );
    let twice = "<m:MappingEntry source='p.u' target='b.u'/>".repeat(2);
    let error = prefixed(&twice).map(drop).unwrap_err();
    assert!(error.ends_with("target=\"b.u\" is already mapped: remove one of the entries"), "{error}");

    let definition = "<s:Component name='i' type='application/x-ssp-definition' source='inner/i.ssd'><s:Connectors>\
        <s:Connector name='u' kind='input'/></s:Connectors><s:ParameterBindings><s:ParameterBinding source='u.ssv'/>\
        </s:ParameterBindings></s:Component>";
    let to = "<s:Connection startElement='a' startConnector='z' endElement='i' endConnector='w'/>";
    let inner = "<s:SystemStructureDescription version='1.0'><s:System name='x'><s:Connectors><s:Connector name='w' kind='input'>\
        <c:Real unit='m'/></s:Connector></s:Connectors><s:Elements><s:Component name='c' source='p.fmu'><s:Connectors>\
        <s:Connector name='u' kind='input'><c:Real unit='mm'/></s:Connector></s:Connectors></s:Component></s:Elements><s:Connections>\
        <s:Connection startConnector='w' endElement='c' endConnector='u'/></s:Connections></s:System><s:Units>\
        <c:Unit name='m'><c:BaseUnit m='1'/></c:Unit><c:Unit name='mm'><c:BaseUnit m='1' factor='0.001'/></c:Unit></s:Units>\
        </s:SystemStructureDescription>";
    let text = description("", definition, to);
    let given = values("<v:Parameter name='c.T'><v:Real value='0.3'/></v:Parameter>");
    let folder = ssp(&text, &[("inner/i.ssd", inner), ("u.ssv", &given)]);
    let error = open(&folder).map(drop).unwrap_err();
    assert!(error.ends_with("has no inner/p.fmu"), "{error}");
    let inner = inner.replace("source='p.fmu'", "source='../p.fmu'");
    let error = open(&ssp(&text, &[("inner/i.ssd", &inner), ("u.ssv", &given)])).map(drop).unwrap_err();
    assert!(
        error.contains("line 1: inner/i.ssd: line 1: source=\"../p.fmu\" is not a file within the archive"),
        "{error}"
    );
    let inner = inner.replace("../p.fmu", "plant.fmu");
    let text = text.replace("inner/i.ssd", "i.ssd");
    let mut loaded = open(&ssp(&text, &[("i.ssd", &inner), ("u.ssv", &given)])).unwrap();
    // z = 1 m is 1000 mm.
    near(&last(&mut loaded, &["a.z", "i.c.u", "i.c.T"]), &[1.0, 1000.0, 0.3]);
    let endless = inner.replace(
        "<s:Elements>",
        "<s:Elements><s:Component name='j' type='application/x-ssp-definition' source='i.ssd'/>",
    );
    let error = open(&ssp(&text, &[("i.ssd", &endless), ("u.ssv", &given)])).map(drop).unwrap_err();
    assert!(error.ends_with("more than 20 descriptions are inside each other"), "{error}");
}

/// Content that is refused, with its line, and content without effect, in a note.
#[test]
fn the_rest_is_refused_or_noted() {
    let connection = |from: &str, to: &str| {
        format!("<s:Connection startElement='a' startConnector='{from}' endElement='b' endConnector='{to}'/>")
    };
    let kind = |name: &str, kind: &str| format!("<s:Connector name='{name}' kind='{kind}'/>");
    let of = |text: String, others: &[(&str, &str)]| {
        open(&ssp(&text, others)).map_or_else(|error| error, |loaded| loaded.notes.join("; "))
    };
    let changed = |old: &str, new: &str, connections: &str| {
        let text = description("", "", connections);
        assert!(text.contains(old), "{old}");
        of(text.replacen(old, new, 1), &[])
    };
    let z = kind("z", "output");
    for (stated, differs) in [("Boolean", true), ("String", true), ("Binary", true), ("Integer", true), ("Real", false)]
    {
        let said = changed(&z, &z.replace("/>", &format!("><c:{stated}/></s:Connector>")), "");
        let note = format!("line 1: a.z is not {stated} but Float64, which counts");
        assert!(if differs { said.ends_with(&note) } else { said.is_empty() }, "{stated}: {said}");
    }
    for (said, cause) in [
        (changed(&z, &kind("z", "local"), ""), "line 1: a.z is output and not local: correct kind"),
        (
            changed(&z, &kind("z", "unspecified"), &connection("z", "u")),
            "a.z is of kind unspecified, which is not supported",
        ),
        (
            changed("", "", &connection("z", "T")),
            "connects a.z (output) with b.T (parameter): expected an output and an input",
        ),
        (changed("", "", &connection("u", "u")), "connects a.u (input) with b.u (input)"),
        (
            changed(&z, &kind("z", "calculatedParameter"), &connection("z", "T")),
            "a value that is computed cannot set a parameter: give b.T a value instead of a.z",
        ),
        (changed(&z, &kind("z", "constant"), ""), "line 1: a.z is output and not constant: correct kind"),
        (
            changed(&z, &z.replace("/>", "><c:Real/><c:Dimension size='3'/></s:Connector>"), ""),
            "line 1: a.z has the extents \"\" and not 3: correct Dimension",
        ),
        (
            changed(&z, &z.replace("/>", "><c:Clock intervalVariability='fixed'/></s:Connector>"), ""),
            "a.z is no clock and not fixed",
        ),
        (
            changed(&z, &z.replace("/>", "><c:Real/><s:Clock name='u'/></s:Connector>"), ""),
            "a.z is not on the clock u: remove it",
        ),
        (
            changed("source='plant.fmu'", "source='plant.fmu' implementation='ModelExchange'", ""),
            "implementation=\"ModelExchange\" is not Co-Simulation: simulate it with --me",
        ),
        (
            changed(
                "</s:Connections>",
                "</s:Connections><s:Annotations><c:Annotation type='org.openmodelica'/></s:Annotations>",
                "",
            ),
            "line 1: annotations of the type \"org.openmodelica\" are ignored",
        ),
        (
            changed(
                "<s:Elements>",
                "<s:ParameterBindings><s:ParameterBinding source='v.ssv'/></s:ParameterBindings><s:Elements>",
                "",
            ),
            "has no v.ssv",
        ),
        (
            changed("source='plant.fmu'", "source='other.ssp' type='application/x-ssp-package'", ""),
            "line 1: type=\"application/x-ssp-package\" is not supported, expected application/x-fmu-sharedlibrary or \
             application/x-ssp-definition",
        ),
    ] {
        assert!(said.contains(cause), "{said:?}: {cause}");
    }
    // Information for readers only, with any content and without a file.
    let information =
        "<s:MetaData kind='general' type='text/plain' source='no.txt'><s:Content><a b='1'/></s:Content></s:MetaData>";
    assert_eq!(changed("<s:Elements>", &format!("{information}<s:Elements>"), ""), changed("", "", ""));
    let binding = "<s:ParameterBindings><s:ParameterBinding source='v.ssv'/></s:ParameterBindings><s:Elements>";
    let text = description("", "", "").replacen("<s:Elements>", binding, 1);
    let given = values("<v:Parameter nam='x' name='a.nothing'><v:Real value='3'/></v:Parameter>");
    let said = of(text, &[("v.ssv", &given)]);
    assert!(said.contains("v.ssv: line 1: there is no a.nothing; the value is ignored"), "{said}");
    assert!(said.contains("v.ssv: line 1: <Parameter> of SSP has no attribute nam: it is ignored"), "{said}");

    // Only Co-Simulation, in a run by Model Exchange.
    let text =
        description("", "", "").replacen("source='plant.fmu'", "source='plant.fmu' implementation='CoSimulation'", 1);
    let folder = ssp(&text, &[]);
    let exchange = |_: &[(String, fmu_import::Fmu)]| System::new(Method::ModelExchange(Integration::default()));
    let loaded = Loaded::open_files_with(&["x.ssp".into()], folder.path(), false, exchange).unwrap();
    let note = "implementation=\"CoSimulation\", and it is integrated, as requested";
    assert!(loaded.notes.iter().any(|text| text.contains(note)), "{:?}", loaded.notes);
}
