//! The terminals in the description.

use super::Variable;
use crate::Fault;
use crate::terminal::{self, MatchingRule, MemberKind, Picture};
use crate::variable::{Causality, Variability};
use serde::{Deserialize, Serialize};
use std::mem::discriminant;

/// A terminal of the description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TerminalDescription {
    /// Name, unique in the FMU.
    pub name: String,
    /// One sentence.
    pub description: String,
    /// How members are matched.
    pub rule: MatchingRule,
    /// The variables that it groups.
    pub members: Vec<MemberDescription>,
    /// Position and appearance.
    pub picture: Option<TerminalPicture>,
}

/// A variable of a terminal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MemberDescription {
    /// Name within the terminal.
    pub name: String,
    /// Name of the variable.
    pub variable: String,
    /// The rule by which a connection combines the values.
    pub kind: MemberKind,
}

/// How a terminal is drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TerminalPicture {
    /// Lower left and upper right corner: x1, y1, x2, y2, in a coordinate system from -100 to 100.
    pub area: [f64; 4],
    /// Base name of the icon's files.
    pub icon: String,
    /// The icon: an SVG document.
    pub svg: String,
    /// Color of lines that connect it: red, green, blue.
    pub color: [u8; 3],
}

/// The terminals, after the checks that cannot run at compile time.
pub(super) fn describe(
    terminals: &[terminal::Terminal],
    variables: &[Variable],
) -> Result<Vec<TerminalDescription>, Fault> {
    let mut described: Vec<TerminalDescription> = Vec::new();
    for terminal::Terminal { name, description, rule, members, picture } in terminals {
        let wrong = |what: String| Fault::new(format!("the terminal {name} {what}"));
        if described.iter().any(|other| other.name == *name) {
            return Err(wrong("occurs twice".into()));
        }
        for terminal::Member { variable, .. } in *members {
            match variables.iter().find(|v| v.name == *variable) {
                None => return Err(wrong(format!("names the variable {variable}, which does not exist"))),
                Some(_) if *rule == MatchingRule::Map => {}
                // FMI 3.0.2, 2.4.9.2.3; in FMI 2.0 an array is not a variable.
                Some(v) if v.causality == Causality::Local || v.is_array() => {
                    return Err(wrong(format!(
                        "has {variable}: only a scalar input, output or parameter can be a member"
                    )));
                }
                Some(_) => {}
            }
        }
        if *rule == MatchingRule::Map {
            map(members, variables).map_err(wrong)?;
        }
        let picture = picture.map(|p| picture_of(&p));
        if let Some(TerminalPicture { icon, svg, .. }) = &picture {
            let letters = icon.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
            if icon.is_empty() || icon == "icon" || !letters {
                return Err(wrong(format!(
                    "has an icon {icon:?}: a name of letters, digits and _ is allowed, other than \"icon\""
                )));
            }
            let others = described.iter().filter_map(|t| t.picture.as_ref());
            if others.into_iter().any(|p| p.icon == *icon && p.svg != *svg) {
                return Err(wrong(format!("draws its icon {icon} differently from an earlier terminal")));
            }
        }
        let member =
            |m: &terminal::Member| MemberDescription { name: m.name.into(), variable: m.variable.into(), kind: m.kind };
        described.push(TerminalDescription {
            name: (*name).into(),
            description: (*description).into(),
            rule: *rule,
            members: members.iter().map(member).collect(),
            picture,
        });
    }
    Ok(described)
}

/// The rules of FMI-LS-STRUCT for a map on a rectilinear grid. The variables exist.
fn map(members: &[terminal::Member], variables: &[Variable]) -> Result<(), String> {
    let found = |m: &terminal::Member| variables.iter().find(|v| v.name == m.variable);
    let of = |kind: MemberKind| members.iter().filter(move |m| m.kind == kind).filter_map(found).collect::<Vec<_>>();
    let set = |v: &Variable| v.causality == Causality::Parameter || v.variability == Variability::Constant;
    let (axes, tables) = (of(MemberKind::Domain), of(MemberKind::Codomain));
    if let Some(v) = axes.iter().find(|v| v.shape.len() != 1 || !set(v)) {
        return Err(format!("has the domain {}: expected a parameter or a constant with one extent", v.name));
    }
    let (extents, sizes): (Vec<usize>, Vec<u32>) =
        (axes.iter().map(|v| v.shape[0]).collect(), axes.iter().flat_map(|v| v.sized.clone()).collect());
    if let Some(v) = tables.iter().find(|v| v.shape != extents || v.sized != sizes) {
        let axes: Vec<&str> = axes.iter().map(|v| v.name.as_str()).collect();
        return Err(format!("has the codomain {}: its extents are not the lengths of {}", v.name, axes.join(", ")));
    }
    let inputs = of(MemberKind::DomainInput);
    if let Some(v) = inputs.iter().find(|v| v.shape != inputs[0].shape || v.sized != inputs[0].sized || set(v)) {
        return Err(format!(
            "has the input {} of a domain: expected an input, an output or a local variable of one shape",
            v.name
        ));
    }
    for pair in members.windows(2) {
        let reads = match pair[1].kind {
            MemberKind::DomainInput => true,
            MemberKind::CodomainOutput => false,
            _ => continue,
        };
        let (Some(values), Some(now)) = (found(&pair[0]), found(&pair[1])) else { continue };
        if discriminant(&values.kind) != discriminant(&now.kind) {
            return Err(format!("has {} of another type than {}", now.name, values.name));
        }
        if !reads && !matches!(now.causality, Causality::Output | Causality::Local) {
            return Err(format!("has the output {} of a codomain, which is an input or a parameter", now.name));
        }
    }
    Ok(())
}

fn picture_of(Picture { icon, x, y }: &Picture) -> TerminalPicture {
    let half = Picture::HALF;
    TerminalPicture {
        area: [x - half, y - half, x + half, y + half],
        icon: icon.name.into(),
        svg: icon.svg.into(),
        color: icon.color,
    }
}
