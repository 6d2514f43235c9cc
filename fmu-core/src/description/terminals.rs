//! The terminals in the description.

use super::Variable;
use crate::Fault;
use crate::terminal::{self, MatchingRule, MemberKind, Picture};
use crate::variable::Causality;
use serde::{Deserialize, Serialize};

/// A terminal of the description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TerminalDescription {
    /// Name, unique in the FMU.
    pub name: String,
    /// One sentence.
    pub description: String,
    /// How members find each other.
    pub rule: MatchingRule,
    /// The variables that it groups.
    pub members: Vec<MemberDescription>,
    /// Where and how it is drawn.
    pub picture: Option<TerminalPicture>,
}

/// A variable of a terminal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MemberDescription {
    /// Name within the terminal.
    pub name: String,
    /// Name of the variable.
    pub variable: String,
    /// How a connection combines the values.
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
                // FMI 3.0.2, 2.4.9.2.3; in FMI 2.0 an array is not a variable.
                Some(v) if v.causality == Causality::Local || v.is_array() => {
                    return Err(wrong(format!(
                        "has {variable}: only a scalar input, output or parameter can be a member"
                    )));
                }
                Some(_) => {}
            }
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

fn picture_of(Picture { icon, x, y }: &Picture) -> TerminalPicture {
    let half = Picture::HALF;
    TerminalPicture {
        area: [x - half, y - half, x + half, y + half],
        icon: icon.name.into(),
        svg: icon.svg.into(),
        color: icon.color,
    }
}
