//! terminalsAndIcons.xml, written and read.
#![allow(missing_docs)]

mod common;

use common::{AWKWARD, rare_sample, sample};
use fmu_core::Description;
use model_description::FmiVersion::V3;
use model_description::{Area, CoordinateSystem, read_terminals, write_terminals};

/// The whole text. `UPDATE_GOLDEN=1 cargo test -p model-description` accepts a change.
#[test]
fn golden_file() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/sample-terminals.xml");
    let written = write_terminals(&sample(), V3).unwrap();
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(path, &written).unwrap();
    }
    assert!(std::fs::read_to_string(path).unwrap() == written, "{path} differs from what is written now:\n{written}");
}

#[test]
fn what_is_written_reads_back() {
    let read = read_terminals(write_terminals(&sample(), V3).unwrap()).unwrap();
    assert_eq!((read.fmi_version.as_str(), read.coordinates), ("3.0", CoordinateSystem::default()));
    assert_eq!(read.icon, Some(CoordinateSystem::default().area));
    assert_eq!(read.terminals.len(), 2);
    let supply = read.terminal("supply").unwrap();
    assert_eq!((supply.matching_rule.as_str(), supply.description.as_deref()), ("plug", Some(AWKWARD)));
    let members: Vec<_> =
        supply.members.iter().map(|m| (m.name.as_deref().unwrap(), m.variable.as_str(), m.kind.as_str())).collect();
    assert_eq!(members, [("u", "u_dc", "inflow"), ("ready", "ready", "outflow")]);
    let picture = supply.picture.as_ref().unwrap();
    assert_eq!(picture.area, Area { x1: -110.0, y1: 30.5, x2: -90.0, y2: 50.5 });
    assert_eq!((picture.icon.as_str(), picture.color), ("dc", Some([255, 0, 7])));
    let all = read.terminal("all").unwrap();
    assert_eq!((all.matching_rule.as_str(), &*all.members[0].kind, &all.picture), ("bus", "signal", &None));
}

/// FMI-LS-STRUCT and FMI-LS-BUS.
#[test]
fn a_map_and_a_bus_have_their_layered_standards() {
    let read = read_terminals(write_terminals(&rare_sample(), V3).unwrap()).unwrap();
    let [map, can] = ["map", "can"].map(|name| read.terminal(name).unwrap());
    let of_map = "org.fmi-standard.fmi-ls-struct.map";
    assert_eq!((map.matching_rule.as_str(), map.kind.clone()), (of_map, Some(format!("{of_map}.rectilinearGrid"))));
    let kinds: Vec<_> = map.members.iter().map(|m| m.kind.strip_prefix(of_map).unwrap()).collect();
    assert_eq!(kinds, [".domain", ".domainInput", ".codomain", ".codomainOutput"]);
    assert_eq!(can.matching_rule, "org.fmi-ls-bus.transceiver");
    assert_eq!(can.kind.as_deref(), Some("org.fmi-ls-bus.network-terminal"));
}

#[test]
fn a_model_without_has_no_file() {
    let bare = Description { terminals: Vec::new(), icon: None, ..sample() };
    assert_eq!(write_terminals(&bare, V3), None);
    let only_icon = write_terminals(&Description { terminals: Vec::new(), ..sample() }, V3).unwrap();
    assert!(only_icon.contains("<Icon ") && !only_icon.contains("<Terminals"), "an empty list is not valid XML");
    let no_icon = write_terminals(&Description { icon: None, ..sample() }, V3).unwrap();
    assert!(!no_icon.contains("<Icon ") && no_icon.contains("<Terminals>"));
}

/// Features that our writer does not use: terminals inside terminals, streams, foreign rules.
#[test]
fn files_of_others() {
    let read = read_terminals(
        br#"<fmiTerminalsAndIcons fmiVersion="3.0-rc.1"><Terminals>
        <Terminal name="a.b" matchingRule="org.example.rule" terminalKind="_k"><Terminal name="c" matchingRule="sequence">
        <TerminalMemberVariable variableName="x" variableKind="signal"/>
        <TerminalStreamMemberVariable inStreamMemberName="i" outStreamMemberName="o" inStreamVariableName="vi"
          outStreamVariableName="vo"/>
        <TerminalGraphicalRepresentation x1="0" y1="1" x2="2" y2="3" iconBaseName="p/q" defaultConnectionStrokeSize="0.5"/>
        </Terminal></Terminal></Terminals></fmiTerminalsAndIcons>"#,
    )
    .unwrap();
    let inner = read.terminal("a.b.c").unwrap();
    assert_eq!((inner.members[0].name.as_deref(), inner.line, inner.members[0].line), (None, 2, 3));
    assert_eq!(inner.streams[0].inside, ("vi".into(), "i".into()));
    assert_eq!(inner.picture.as_ref().unwrap().stroke, Some(0.5));
    assert!(read.terminal("a.b").unwrap().kind.is_some() && read.terminal("a.b.x").is_none() && read.icon.is_none());
}

#[test]
fn a_fault_names_its_line() {
    let inside = |terminal: &str| {
        let xml = format!(
            "<fmiTerminalsAndIcons fmiVersion='3.0'><Terminals>\n{terminal}</Terminals></fmiTerminalsAndIcons>"
        );
        read_terminals(xml).unwrap_err().to_string()
    };
    let picture = |attributes: &str| {
        inside(&format!(
            "<Terminal name='a' matchingRule='bus'>\n<TerminalGraphicalRepresentation {attributes}/></Terminal>"
        ))
    };
    for (error, expected) in [
        (
            read_terminals("<a/>").unwrap_err().to_string(),
            "line 1: the root element is <a>, expected <fmiTerminalsAndIcons>",
        ),
        (inside("<Terminal name='a'/>"), "line 2: <Terminal> has no attribute \"matchingRule\""),
        (
            picture("x1='0' y1='0' x2='1' iconBaseName='a'"),
            "line 3: <TerminalGraphicalRepresentation> has no attribute \"y2\"",
        ),
        (
            picture("x1='0' y1='0' x2='1' y2='1' iconBaseName='a' defaultConnectionColor='0 0 256'"),
            "line 3: <TerminalGraphicalRepresentation> has defaultConnectionColor=\"0 0 256\", expected three numbers from 0 to 255",
        ),
    ] {
        assert_eq!(error, expected);
    }
}
