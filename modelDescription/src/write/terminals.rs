//! terminalsAndIcons.xml (FMI 3.0.2, 2.4.9).
//!
//! An FMU of FMI 2.0 contains the file of FMI 3.0 (FMI 2.0.5, 2.3), so both get the same text.

use crate::number;
use crate::terminals::CoordinateSystem;
use crate::version::FmiVersion;
use crate::xml::{Element, print};
use fmu_core::Description;
use fmu_core::description::{MemberDescription, TerminalDescription};
use fmu_core::terminal::{MatchingRule, MemberKind};

/// The names of the parts in FMI-LS-STRUCT 1.0.0-rc.1.
const STRUCT: &str = "org.fmi-standard.fmi-ls-struct.map";

/// terminalsAndIcons.xml for an FMU of this standard; `None` for a model without terminals and icon. FMI 2.0 has no maps, because
/// their members are arrays, and no networks, whose members are clocks and bytes.
pub fn write_terminals(description: &Description, version: FmiVersion) -> Option<String> {
    let Description { terminals, icon, .. } = description;
    let terminals: Vec<_> = terminals.iter().filter(|t| version == FmiVersion::V3 || !t.rule.is_layered()).collect();
    if terminals.is_empty() && icon.is_none() {
        return None;
    }
    let CoordinateSystem { area, to_mm } = CoordinateSystem::default();
    let corners = [area.x1, area.y1, area.x2, area.y2];
    let system = placed("CoordinateSystem", corners).with("suggestedScalingFactorTo_mm", number::format(to_mm));
    let icon = icon.as_ref().map(|_| placed("Icon", corners));
    let list = Element::new("Terminals").children(terminals.iter().copied().map(terminal));
    let root = Element::new("fmiTerminalsAndIcons")
        .with("fmiVersion", FmiVersion::V3.to_string())
        .children([Element::new("GraphicalRepresentation").children([system]).children(icon)])
        .children((!terminals.is_empty()).then_some(list));
    Some(print(&root))
}

fn terminal(t: &TerminalDescription) -> Element {
    let rule = match t.rule {
        MatchingRule::Plug => "plug",
        MatchingRule::Bus => "bus",
        MatchingRule::Transceiver => "org.fmi-ls-bus.transceiver",
        MatchingRule::Map => STRUCT,
    };
    let picture = t.picture.as_ref().map(|p| {
        let color: Vec<String> = p.color.iter().map(u8::to_string).collect();
        let element = Element::new("TerminalGraphicalRepresentation").with("defaultConnectionColor", color.join(" "));
        place(element, p.area).with("iconBaseName", &*p.icon)
    });
    let element = Element::new("Terminal").with("name", &*t.name);
    let element = match t.rule {
        MatchingRule::Map => element.with("terminalKind", format!("{STRUCT}.rectilinearGrid")),
        MatchingRule::Transceiver => element.with("terminalKind", "org.fmi-ls-bus.network-terminal"),
        MatchingRule::Plug | MatchingRule::Bus => element,
    };
    element
        .with("matchingRule", rule)
        .with_text("description", &t.description)
        .children(t.members.iter().map(member))
        .children(picture)
}

fn member(m: &MemberDescription) -> Element {
    let kind = match m.kind {
        MemberKind::Signal => "signal".to_owned(),
        MemberKind::Inflow => "inflow".to_owned(),
        MemberKind::Outflow => "outflow".to_owned(),
        MemberKind::Domain => format!("{STRUCT}.domain"),
        MemberKind::DomainInput => format!("{STRUCT}.domainInput"),
        MemberKind::Codomain => format!("{STRUCT}.codomain"),
        MemberKind::CodomainOutput => format!("{STRUCT}.codomainOutput"),
    };
    Element::new("TerminalMemberVariable")
        .with("variableName", &*m.variable)
        .with("memberName", &*m.name)
        .with("variableKind", kind)
}

fn placed(name: &str, corners: [f64; 4]) -> Element {
    place(Element::new(name), corners)
}

fn place(element: Element, corners: [f64; 4]) -> Element {
    let names = ["x1", "y1", "x2", "y2"];
    names.into_iter().zip(corners).fold(element, |e, (name, x)| e.with(name, number::format(x)))
}
