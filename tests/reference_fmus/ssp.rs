//! SSP files with values of every kind: tables, clocks and bytes.

use super::archive;
use super::feedthrough::Quiet;
use fmu_sweep::{Definition, Options, Sweep};
use fmu_system::cosimulation::{Recording, Settings};
use fmu_system::ssp::load::Loaded;
use model_description::FmiVersion::V3;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

/// An SSP file of these entries and archives of packages.
fn packed(path: &Path, texts: &[(&str, &str)], packages: &[&str]) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    let mut put = |name: &str, bytes: &[u8]| {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    };
    for (name, text) in texts {
        put(name, text.as_bytes());
    }
    for name in packages {
        put(&format!("{name}.fmu"), &std::fs::read(archive(name, V3)).unwrap());
    }
    zip.finish().unwrap();
}

fn connector(name: &str, kind: &str, inside: &str) -> String {
    format!("<s:Connector name='{name}' kind='{kind}'>{inside}</s:Connector>")
}

/// Two connectors with their elements, and a transformation.
fn connection([(from, start), (to, end)]: [(&str, &str); 2], inside: &str) -> String {
    let of = |side: &str, element: &str| match element {
        "" => String::new(),
        _ => format!("{side}Element='{element}' "),
    };
    format!(
        "<s:Connection {}startConnector='{start}' {}endConnector='{end}'>{inside}</s:Connection>",
        of("start", from),
        of("end", to)
    )
}

fn table(kind: &str, entries: &[(&str, &str)]) -> String {
    let entry = |(from, to): &(&str, &str)| format!("<c:MapEntry source='{from}' target='{to}'/>");
    let entries: String = entries.iter().map(entry).collect();
    format!("<c:{kind}MappingTransformation>{entries}</c:{kind}MappingTransformation>")
}

fn run(loaded: &mut Loaded, names: &[&str]) -> Result<Recording, fmu_import::Error> {
    for name in names {
        loaded.record(name).unwrap();
    }
    let settings = Settings { start: 0.0, stop: 0.4, step: 0.1, sequential: false };
    loaded.system.run(&settings, |_| Ok(ControlFlow::Continue(())))
}

/// A system of two components `a` and `b` that pass values through.
fn feedthrough(path: &Path, connectors: &str, inside: &str, connections: &str) {
    let both = |name: &&str| {
        connector(&format!("{name}_input"), "input", "") + &connector(&format!("{name}_output"), "output", "")
    };
    let of: String = ["Enumeration", "Int32", "Boolean", "Float64_continuous"].iter().map(both).collect();
    let component = |name: &str| {
        format!("<s:Component name='{name}' source='feedthrough.fmu'><s:Connectors>{of}</s:Connectors></s:Component>")
    };
    let text = format!(
        "<s:SystemStructureDescription version='2.0'><s:System name='x'><s:Connectors>{connectors}</s:Connectors>{inside}\
         <s:Elements>{}{}</s:Elements><s:Connections>{connections}</s:Connections></s:System><s:Enumerations>\
         <c:Enumeration name='Level'><c:Item name='Low' value='10'/><c:Item name='High' value='20'/></c:Enumeration>\
         </s:Enumerations></s:SystemStructureDescription>",
        component("a"),
        component("b")
    );
    packed(path, &[("SystemStructure.ssd", &text)], &["feedthrough"]);
}

/// Connections with tables: an item becomes an integer, an integer a truth value. A value without an entry stays unchanged,
/// unless the other type cannot represent it.
#[test]
fn connections_have_tables() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ssp");
    let items = table("Enumeration", &[("Option1", "-5")]);
    let numbers = table("Integer", &[("4", "true"), ("0", "false"), ("99999999999", "true")]);
    let connections = connection([("a", "Enumeration_output"), ("b", "Int32_input")], &items)
        + &connection([("a", "Int32_output"), ("b", "Boolean_input")], &numbers);
    feedthrough(&path, "", "", &connections);
    let with = |item: &str, number: &str| {
        let mut loaded = Loaded::open(&path, false).unwrap();
        loaded.set("a.Enumeration_input", item).unwrap();
        loaded.set("a.Int32_input", number).unwrap();
        run(&mut loaded, &["b.Int32_input", "b.Int32_output", "b.Boolean_output"])
    };
    let last = |item: &str, number: &str| {
        with(item, number).unwrap().columns.iter().map(|column| column.last().real()).collect::<Vec<_>>()
    };
    assert_eq!(last("Option1", "4"), [-5.0, -5.0, 1.0]);
    assert_eq!(last("Option2", "0"), [2.0, 2.0, 0.0]);
    let error = with("Option1", "3").unwrap_err().to_string();
    assert_eq!(error, "Boolean_input: the table of its connection has no entry for 3");
    let linear = "<c:LinearTransformation factor='2'/>";
    feedthrough(&path, "", "", &connection([("a", "Int32_output"), ("b", "Boolean_input")], linear));
    let error = Loaded::open(&path, false).map(drop).unwrap_err().to_string();
    assert!(error.contains("b.Boolean_input: has the type Boolean, a.Int32_output has Int32"), "{error}");
}

/// Tables at connectors of the system, for single values, values over time and outputs, and for parameters.
#[test]
fn connectors_of_the_system_and_parameters_have_tables() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ssp");
    let connectors = connector("stop", "input", "<c:Boolean/>")
        + &connector("scaled", "input", "<c:Real/>")
        + &connector("mode", "parameter", "<c:Enumeration name='Level'/>")
        + &connector("level", "output", "<c:Enumeration name='Level'/>")
        + &connector("code", "output", "<c:Integer/>");
    let not = table("Boolean", &[("1", "false"), ("0", "true")]);
    let levels = table("Enumeration", &[("Option1", "Low"), ("Option2", "High")]);
    let connections = connection([("", "stop"), ("b", "Boolean_input")], &not)
        + &connection([("", "scaled"), ("a", "Float64_continuous_input")], "<c:LinearTransformation factor='10'/>")
        + &connection([("", "mode"), ("a", "Int32_input")], &table("Enumeration", &[("High", "7"), ("Low", "3")]))
        + &connection([("a", "Enumeration_output"), ("", "level")], &levels)
        + &connection([("a", "Int32_output"), ("", "code")], &table("Integer", &[("7", "70")]));
    let values = |inside: &str, mapping: &str| {
        format!(
            "<s:ParameterBindings><s:ParameterBinding><s:ParameterValues><v:ParameterSet><v:Parameters>{inside}</v:Parameters>\
             </v:ParameterSet></s:ParameterValues><s:ParameterMapping><m:ParameterMapping>{mapping}</m:ParameterMapping>\
             </s:ParameterMapping></s:ParameterBinding></s:ParameterBindings>"
        )
    };
    let given = |mode: &str, choice: &str| {
        let inside = format!(
            "<v:Parameter name='m'><v:Enumeration value='{mode}'/></v:Parameter>\
             <v:Parameter name='c'><v:String value='{choice}'/></v:Parameter>"
        );
        let mapping = format!(
            "<m:MappingEntry source='m' target='mode'/><m:MappingEntry source='c' target='a.Enumeration_input'>{}</m:MappingEntry>",
            table("Enumeration", &[("two", "Option2")])
        );
        values(&inside, &mapping)
    };
    feedthrough(&path, &connectors, &given("High", "two"), &connections);
    let names = [
        "b.Boolean_output",
        "a.Int32_output",
        "a.Enumeration_output",
        "level",
        "code",
        "a.Float64_continuous_output",
        "scaled",
    ];
    let mut loaded = Loaded::open(&path, false).unwrap();
    loaded.set("stop", "true").unwrap();
    loaded.set("scaled", "0.5").unwrap();
    let recording = run(&mut loaded, &names).unwrap();
    let last: Vec<f64> = recording.columns.iter().map(|column| column.last().real()).collect();
    assert_eq!(last, [0.0, 7.0, 2.0, 20.0, 70.0, 5.0, 0.5]);
    let level = recording.column("level").unwrap();
    assert_eq!(level.item(20.0), Some("High"));
    // Values without an entry stay; values over time pass through the table.
    feedthrough(&path, &connectors, &given("4", "Option1"), &connections);
    let mut loaded = Loaded::open(&path, false).unwrap();
    loaded.points("stop", "0:false,0.2:true").unwrap();
    loaded.points("scaled", "0:0,0.2:1").unwrap();
    let recording = run(&mut loaded, &names).unwrap();
    let column = |name: &str| recording.column(name).unwrap().values.clone();
    assert_eq!(column("b.Boolean_output"), [1.0, 1.0, 1.0, 0.0, 0.0]);
    assert_eq!(column("a.Float64_continuous_output"), [0.0, 0.0, 0.0, 10.0, 10.0]);
    assert_eq!([column("code")[4], column("level")[4], column("scaled")[3]], [4.0, 10.0, 1.0]);
    let mut loaded = Loaded::open(&path, false).unwrap();
    let error = loaded.record("stop").unwrap_err().to_string();
    assert!(error.contains("stop: is behind a table: record b.Boolean_input instead"), "{error}");
    let error = loaded.set("scaled", "true").unwrap_err().to_string();
    assert_eq!(error, "a.Float64_continuous_input: \"true\" is not a number");
    // A sweep varies and reads the connectors.
    let definition = |varied: &str| {
        let text = format!(
            "fmus = ['x.ssp']\nstop = 0.4\nstep = 0.1\ndesign = {{ kind = 'grid' }}\n[vary]\n{varied} = {{ values = [1, 2] }}\n[measure]\n\
             first = {{ of = 'a.Float64_continuous_output', is = 'final' }}\nlevel = {{ of = 'level', is = 'final' }}\n"
        );
        Sweep::new(Definition::parse(&text).unwrap(), folder.path().to_owned())
    };
    let sweep = definition("scaled").unwrap();
    let done = fmu_sweep::run(&sweep, &folder.path().join("out"), &Options::default(), &Quiet).unwrap();
    let rows = std::fs::read_to_string(done.results.unwrap()).unwrap();
    assert_eq!(rows.split_once('\n').unwrap().1, "0,1,10,Low,0.4,\n1,2,20,Low,0.4,\n");
    let error = definition("stop").map(drop).unwrap_err().to_string();
    assert!(error.contains("stop: is behind a table: vary b.Boolean_input instead"), "{error}");
}

/// The nodes of `examples/can-bus` as an SSP: their clocks, with the bytes on them, also through an inner system.
#[test]
fn clocks_connect_with_what_is_on_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ssp");
    let clock = |ticks: &str| format!("<c:Clock intervalVariability='{ticks}'/>");
    let on = |clock: &str| format!("<c:Binary/><s:Clock name='{clock}'/>");
    let node = |name: &str, tx: &str, kind: &str| {
        let connectors = connector("Tx_Clock", kind, &clock(tx))
            + &connector("Tx_Data", "output", &on("Tx_Clock"))
            + &connector("Rx_Clock", "input", &clock("triggered"))
            + &connector("Rx_Data", "input", &on("Rx_Clock"));
        format!(
            "<s:Component name='{name}' source='can-{name}.fmu'><s:Connectors>{connectors}</s:Connectors></s:Component>"
        )
    };
    // A clock that requests ticks passes through a system like an output.
    let inner = format!(
        "<s:System name='i'><s:Connectors>{}{}</s:Connectors><s:Elements>{}</s:Elements><s:Connections>{}{}</s:Connections></s:System>",
        connector("clock", "output", &clock("changing")),
        connector("data", "output", "<c:Binary/>"),
        node("sensor", "changing", "input"),
        connection([("sensor", "Tx_Clock"), ("", "clock")], ""),
        connection([("sensor", "Tx_Data"), ("", "data")], "")
    );
    let text = |inner: &str| {
        format!(
            "<s:SystemStructureDescription version='2.0'><s:System name='x'><s:Elements>{inner}{}</s:Elements><s:Connections>{}{}\
             </s:Connections></s:System></s:SystemStructureDescription>",
            node("display", "triggered", "output"),
            connection([("i", "clock"), ("display", "Rx_Clock")], ""),
            connection([("i", "data"), ("display", "Rx_Data")], "")
        )
    };
    packed(&path, &[("SystemStructure.ssd", &text(&inner))], &["can-sensor", "can-display"]);
    let mut loaded = Loaded::open(&path, false).unwrap();
    assert_eq!(loaded.notes, [""; 0]);
    loaded.set("i.sensor.speed", "1.5").unwrap();
    for name in ["display.frames", "display.speed"] {
        loaded.record(name).unwrap();
    }
    let settings = Settings { start: 0.0, stop: 0.04, step: 0.004, sequential: false };
    let recording = loaded.system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    assert_eq!([recording.columns[0].last().real(), recording.columns[1].last().real()], [4.0, 1.5]);
    for (old, new, cause) in [
        (
            "intervalVariability='changing'/></s:Connector><s:Connector name='Tx_Data'",
            "intervalVariability='countdown'/></s:Connector><s:Connector name='Tx_Data'",
            "i.sensor.Tx_Clock is changing and not countdown: correct intervalVariability",
        ),
        (
            "<s:Clock name='Tx_Clock'/>",
            "<s:Clock name='Rx_Clock'/>",
            "i.sensor.Tx_Data is not on the clock Rx_Clock: remove it",
        ),
    ] {
        assert!(inner.contains(old), "{old}");
        packed(&path, &[("SystemStructure.ssd", &text(&inner.replacen(old, new, 1)))], &["can-sensor", "can-display"]);
        let error = Loaded::open(&path, false).map(drop).unwrap_err().to_string();
        assert!(error.contains(cause), "{error}");
    }
}
