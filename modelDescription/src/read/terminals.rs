//! terminalsAndIcons.xml.

use super::attributes::{number, owned, required, wrong};
use super::document::{decode, of_kind};
use crate::error::Error;
use crate::terminals::{Area, CoordinateSystem, Member, StreamMember, Terminal, TerminalPicture, TerminalsAndIcons};
use crate::xml::{Element, parse};

/// Reads terminalsAndIcons.xml of an FMU of either standard; the bytes must be UTF-8.
///
/// Like [`read`](crate::read()), it does not check the content: it accepts unknown variables.
///
/// # Errors
/// States the line, the content found and expected.
pub fn read_terminals(xml: impl AsRef<[u8]>) -> Result<TerminalsAndIcons, Error> {
    let root = parse(decode(xml.as_ref())?)?;
    of_kind(&root, "fmiTerminalsAndIcons")?;
    let picture = root.child("GraphicalRepresentation");
    let system = picture.and_then(|p| p.child("CoordinateSystem"));
    Ok(TerminalsAndIcons {
        fmi_version: required(&root, "fmiVersion")?.into(),
        coordinates: system.map_or(Ok(CoordinateSystem::default()), |e| {
            Ok(CoordinateSystem { area: area(e)?, to_mm: coordinate(e, "suggestedScalingFactorTo_mm")? })
        })?,
        icon: picture.and_then(|p| p.child("Icon")).map(area).transpose()?,
        terminals: root.child("Terminals").map_or(Ok(Vec::new()), terminals)?,
    })
}

fn terminals(parent: &Element) -> Result<Vec<Terminal>, Error> {
    parent.all("Terminal").map(terminal).collect()
}

fn terminal(e: &Element) -> Result<Terminal, Error> {
    Ok(Terminal {
        name: required(e, "name")?.into(),
        matching_rule: required(e, "matchingRule")?.into(),
        kind: owned(e, "terminalKind"),
        description: owned(e, "description"),
        members: e.all("TerminalMemberVariable").map(member).collect::<Result<_, _>>()?,
        streams: e.all("TerminalStreamMemberVariable").map(stream).collect::<Result<_, _>>()?,
        terminals: terminals(e)?,
        picture: e.child("TerminalGraphicalRepresentation").map(graphical).transpose()?,
        line: e.line,
    })
}

fn member(e: &Element) -> Result<Member, Error> {
    Ok(Member {
        variable: required(e, "variableName")?.into(),
        name: owned(e, "memberName"),
        kind: required(e, "variableKind")?.into(),
        line: e.line,
    })
}

fn stream(e: &Element) -> Result<StreamMember, Error> {
    let both = |variable, member| Ok::<_, Error>((required(e, variable)?.to_owned(), required(e, member)?.to_owned()));
    Ok(StreamMember {
        inside: both("inStreamVariableName", "inStreamMemberName")?,
        outside: both("outStreamVariableName", "outStreamMemberName")?,
        line: e.line,
    })
}

fn graphical(e: &Element) -> Result<TerminalPicture, Error> {
    const COLOR: &str = "defaultConnectionColor";
    let bytes = |text: &str| {
        let list: Result<Vec<u8>, _> = text.split_ascii_whitespace().map(str::parse).collect();
        list.ok().and_then(|list| list.try_into().ok()).ok_or_else(|| wrong(e, COLOR, "three numbers from 0 to 255"))
    };
    Ok(TerminalPicture {
        area: area(e)?,
        icon: required(e, "iconBaseName")?.into(),
        color: e.get(COLOR).map(bytes).transpose()?,
        stroke: number(e, "defaultConnectionStrokeSize")?,
        line: e.line,
    })
}

fn area(e: &Element) -> Result<Area, Error> {
    let [x1, y1, x2, y2] = ["x1", "y1", "x2", "y2"].map(|name| coordinate(e, name));
    Ok(Area { x1: x1?, y1: y1?, x2: x2?, y2: y2? })
}

fn coordinate(e: &Element, name: &str) -> Result<f64, Error> {
    required(e, name)?;
    // `required` has already reported a missing one.
    number(e, name).map(Option::unwrap_or_default)
}
