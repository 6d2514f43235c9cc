//! `documentation/index.html`: a self-contained page generated from the description.

pub mod preset;

use fmu_core::description::{Description, MemberDescription, Value, Variable, VariableKind};
use fmu_core::digits;
use fmu_core::terminal::MemberKind;
use fmu_core::variable::{Causality, Variability};
use fmu_core::{Bytes, IntegerType};
use fmu_plot::page::{document, escape};
use model_description::FmiVersion;
use std::fmt::Write;

/// Appends formatted text; writing to a `String` does not fail.
macro_rules! put {
    ($out:ident, $($arguments:tt)*) => { let _ = write!($out, $($arguments)*); };
}

const STYLE: &str = include_str!("documentation.css");

/// The whole page.
pub fn page(d: &Description, version: FmiVersion) -> String {
    let name = escape(d.model_name());
    let exchange = if d.model_exchange.is_some() { " and Model Exchange" } else { "" };
    let header = format!(
        "<header>\n{}<h1>{name}</h1>\n<p class=\"summary\">{}</p>\n<p>Version {} · FMI {version} for Co-Simulation{exchange} · {}</p>\n\
         </header>\n",
        d.icon.as_deref().map(icon).unwrap_or_default(),
        escape(&d.description),
        escape(&d.version),
        escape(&d.author),
    );
    let mut out = String::new();
    if !d.documentation.is_empty() {
        put!(out, "<section>\n{}\n</section>\n", scrolling(d.documentation.trim()));
    }
    out += &timing(d);
    for (title, causality) in
        [("Inputs", Causality::Input), ("Outputs", Causality::Output), ("Local variables", Causality::Local)]
    {
        let variables: Vec<_> = d.variables.iter().filter(|v| v.causality == causality).collect();
        out += &section(title, &variables);
    }
    out += &terminals(d);
    out += &parameters(d);
    out += &enumerations(d);
    put!(
        out,
        "<h2>In a web browser</h2>\n<p><code>fmu page {}</code>, in the workspace that built this FMU, writes one HTML file that runs \
         the model: sliders, plots, and a link that repeats a run, without a network or an installation.</p>\n",
        escape(&d.name),
    );
    put!(
        out,
        "<h2>License</h2>\n<p>{} <br>{}. The full texts, and those of the libraries in the binary, are in \
         <a href=\"licenses/license.txt\">licenses/license.txt</a>.</p>\n",
        escape(&d.copyright),
        escape(&d.license),
    );
    let (contents, body) = with_contents(&out);
    document(d.model_name(), "", STYLE, &format!("{header}{contents}<main>\n{body}</main>\n"))
}

/// The icon of the FMU as part of the page: an SVG document without its declaration, described by the adjacent name.
fn icon(svg: &str) -> String {
    let svg = svg.find("<svg").map_or(svg, |at| &svg[at..]);
    format!("<div class=\"icon\" aria-hidden=\"true\">{}</div>\n", svg.trim())
}

/// Puts drawings and tables into boxes that scroll on a narrow page.
fn scrolling(html: &str) -> String {
    let boxed = |html: String, open: &str, close: &str| {
        let mut parts = html.split(open);
        let first = parts.next().unwrap_or_default().to_owned();
        parts.fold(first, |out, part| {
            let (inside, after) = part.split_once(close).unwrap_or((part, ""));
            out + "<div class=\"scroll\">" + open + inside + close + "</div>" + after
        })
    };
    boxed(boxed(html.to_owned(), "<svg ", "</svg>"), "<table", "</table>")
}

/// A table of contents that links to the headings, and the body with their anchors.
fn with_contents(body: &str) -> (String, String) {
    let mut parts = body.split("<h2>");
    let mut out = parts.next().unwrap_or_default().to_owned();
    let mut list = String::from("<nav>\n<ul>\n");
    for part in parts {
        let title = part.split("</h2>").next().unwrap_or_default();
        let anchor = anchor(title);
        put!(list, "<li><a href=\"#{anchor}\">{title}</a></li>\n");
        put!(out, "<h2 id=\"{anchor}\">{part}");
    }
    (list + "</ul>\n</nav>\n", out)
}

/// The anchor of a heading: its letters and digits, joined. The anchors of enumerations are their names, capitalized.
fn anchor(title: &str) -> String {
    let words = title.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_lowercase).collect::<Vec<_>>().join("-")
}

/// The recommended experiment, and the behavior at other steps.
fn timing(d: &Description) -> String {
    let x = d.experiment;
    let discrete =
        d.variables.iter().any(|v| v.causality == Causality::Output && v.variability == Variability::Discrete);
    let outputs = if discrete {
        "Outputs marked “sampled” change at the model's own sample instants, independent of the communication step."
    } else {
        "Outputs apply to the end of the step."
    };
    format!(
        "<h2>Recommended experiment and timing</h2>\n<table>\n\
         <tr><th>Start</th><td class=\"number\">{} s</td></tr>\n<tr><th>Stop</th><td class=\"number\">{} s</td></tr>\n\
         <tr><th>Communication step</th><td class=\"number\">{} s</td></tr>\n</table>\n\
         <p>Inputs are held over a communication step of Co-Simulation. {outputs}</p>\n",
        number(x.start),
        number(x.stop),
        number(x.step),
    )
}

/// Parameters under a heading for each prefix, those without one first.
fn parameters(d: &Description) -> String {
    let of = |c: Causality| {
        matches!(c, Causality::Parameter | Causality::CalculatedParameter | Causality::StructuralParameter)
    };
    let all: Vec<_> = d.variables.iter().filter(|v| of(v.causality)).collect();
    let mut prefixes: Vec<&str> = Vec::new();
    for variable in &all {
        if !prefixes.contains(&prefix(&variable.name)) {
            prefixes.push(prefix(&variable.name));
        }
    }
    prefixes.sort_by_key(|p| !p.is_empty());
    let mut out = String::from(if all.is_empty() { "" } else { "<h2>Parameters</h2>\n" });
    for p in prefixes {
        let variables: Vec<_> = all.iter().copied().filter(|v| prefix(&v.name) == p).collect();
        if !p.is_empty() {
            put!(out, "<h3 id=\"parameters-{}\">{}</h3>\n", anchor(p), escape(p));
        }
        out += &table(&variables);
    }
    out
}

/// The terminals.
fn terminals(d: &Description) -> String {
    if d.terminals.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "<h2>Terminals</h2>\n<p>Variables that are connected together: two terminals connect the members of the same name.</p>\n\
         <div class=\"scroll\">\n<table class=\"variables\">\n<tr><th>Terminal</th><th class=\"wide\">Description</th>\
         <th>Members</th></tr>\n",
    );
    for t in &d.terminals {
        let member = |m: &MemberDescription| {
            let kind = match m.kind {
                MemberKind::Signal => "",
                MemberKind::Inflow => " <small>flows in</small>",
                MemberKind::Outflow => " <small>flows out</small>",
                MemberKind::Domain => " <small>an axis</small>",
                MemberKind::Codomain => " <small>a table</small>",
                MemberKind::DomainInput | MemberKind::CodomainOutput => " <small>read now</small>",
            };
            let other = Some(&m.variable).filter(|v| **v != m.name).map(|v| format!(" = {}", escape(v)));
            format!("{}{}{kind}", escape(&m.name), other.unwrap_or_default())
        };
        let members: Vec<String> = t.members.iter().map(member).collect();
        let (name, text) = (escape(&t.name), escape(&t.description));
        put!(out, "<tr><td class=\"name\">{name}</td><td>{text}</td><td>{}</td></tr>\n", members.join(", "));
    }
    out + "</table>\n</div>\n"
}

/// Everything before the last dot.
fn prefix(name: &str) -> &str {
    name.rsplit_once('.').map_or("", |(prefix, _)| prefix)
}

fn section(title: &str, variables: &[&Variable]) -> String {
    if variables.is_empty() { String::new() } else { format!("<h2>{title}</h2>\n{}", table(variables)) }
}

fn table(variables: &[&Variable]) -> String {
    // Calculated variables have no start value and no bounds; omit empty columns.
    let settable = variables.iter().any(|v| v.start.is_some());
    let columns = if settable { "<th class=\"number\">Start</th><th>Allowed</th>" } else { "" };
    let mut out = format!(
        "<div class=\"scroll\">\n<table class=\"variables\">\n<tr><th>Name</th><th class=\"wide\">Description</th>\
         <th>Unit</th>{columns}</tr>\n"
    );
    for v in variables {
        let kind = match (v.causality, v.variability) {
            (Causality::StructuralParameter, Variability::Tunable) => " <small>a size, tunable</small>",
            (Causality::StructuralParameter, _) => " <small>a size, set before the initialization</small>",
            (_, Variability::Tunable) => " <small>tunable</small>",
            (Causality::Output | Causality::Input | Causality::Local, Variability::Discrete) => {
                " <small>sampled</small>"
            }
            (Causality::CalculatedParameter, _) => " <small>calculated</small>",
            (_, Variability::Constant) => " <small>constant</small>",
            _ => "",
        };
        let extents: Vec<String> = v.shape.iter().map(usize::to_string).collect();
        let size = if v.is_array() { format!("[{}]", extents.join(",")) } else { String::new() };
        let (name, text, unit) = (escape(&v.name), escape(&v.description), unit(v));
        put!(out, "<tr><td class=\"name\">{name}{size}</td><td>{text}{kind}</td><td class=\"unit\">{unit}</td>");
        if settable {
            let bounded = v.min.is_some() || v.max.is_some();
            let allowed = if bounded { escape(&v.range().to_string()) } else { String::new() };
            put!(out, "<td class=\"number\">{}</td><td>{allowed}</td>", start(v));
        }
        out += "</tr>\n";
    }
    out + "</table>\n</div>\n"
}

fn unit(v: &Variable) -> String {
    match &v.kind {
        VariableKind::Real { unit, display, relative, .. } => {
            let difference = if *relative { ", a difference" } else { "" };
            let shown =
                display.as_ref().map(|(name, ..)| format!(" <small>shown in {}{difference}</small>", escape(name)));
            escape(unit) + &shown.unwrap_or_default()
        }
        VariableKind::Integer(of) if *of == IntegerType::Int32 => "<small>integer</small>".into(),
        VariableKind::Integer(of) => format!("<small>integer, {}</small>", of.name()),
        VariableKind::Text => "<small>text</small>".into(),
        VariableKind::Clock(_) => "<small>clock, s</small>".into(),
        VariableKind::Binary { mime_type, most } => {
            format!("<small>bytes, at most {most}: {}</small>", escape(mime_type))
        }
        VariableKind::Boolean => "<small>true or false</small>".into(),
        VariableKind::Enumeration { name, .. } => format!("<a href=\"#{0}\">{0}</a>", escape(name)),
    }
}

fn start(v: &Variable) -> String {
    let item = |x: i128| match &v.kind {
        VariableKind::Enumeration { items, .. } => {
            items.iter().find(|(value, ..)| i128::from(*value) == x).map(|(_, name, _)| escape(name))
        }
        _ => None,
    };
    let one = |x: &Value| match x {
        Value::Real(x) => number(*x),
        Value::Integer(x) => item(*x).unwrap_or_else(|| x.to_string()),
        Value::Boolean(x) => x.to_string(),
        Value::Text(x) => format!("“{}”", escape(x)),
        Value::Binary(x) => Bytes::from(x).to_string(),
    };
    let all: Vec<String> = v.start.iter().flatten().map(one).collect();
    match all.as_slice() {
        [first, .., last] if all.len() > 4 => format!("{first} … {last}"),
        _ => all.join(", "),
    }
}

fn enumerations(d: &Description) -> String {
    let mut out = String::new();
    let mut seen: Vec<&str> = Vec::new();
    for v in &d.variables {
        let VariableKind::Enumeration { name, description, items } = &v.kind else { continue };
        if seen.contains(&name.as_str()) {
            continue;
        }
        seen.push(name);
        let title = escape(name);
        put!(
            out,
            "<h2 id=\"{title}\">{title}</h2>\n<p>{}</p>\n<table>\n<tr><th class=\"number\">Value</th><th>Name</th>\
             <th>Description</th></tr>\n",
            escape(description)
        );
        for (value, item, text) in items {
            let (item, text) = (escape(item), escape(text));
            put!(out, "<tr><td class=\"number\">{value}</td><td class=\"name\">{item}</td><td>{text}</td></tr>\n");
        }
        out += "</table>\n";
    }
    out
}

/// A number for display: six digits are enough for an engineer; the XML has all digits.
fn number(x: f64) -> String {
    digits::text(x, 6, 1e6).replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        let cases = [
            (0.0, "0"),
            (325.0, "325"),
            (1e-4, "0.0001"),
            (3.2e-5, "3.2e−5"),
            (1_570.796_326_8, "1570.8"),
            (-2.5, "−2.5"),
        ];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
    }

    #[test]
    fn markup_in_a_description_stays_text() {
        assert_eq!(escape("a < b & \"c\""), "a &lt; b &amp; &quot;c&quot;");
    }

    #[test]
    fn headings_become_contents() {
        let (contents, body) = with_contents("<p>a</p><h2>One &amp; two</h2><p>b</p><h2 id=\"X\">X</h2><h2>Three</h2>");
        assert_eq!(
            body,
            "<p>a</p><h2 id=\"one-amp-two\">One &amp; two</h2><p>b</p><h2 id=\"X\">X</h2><h2 id=\"three\">Three</h2>"
        );
        assert!(contents.contains("<li><a href=\"#one-amp-two\">One &amp; two</a></li>\n<li><a href=\"#three\">"));
    }

    #[test]
    fn prefixes() {
        assert_eq!((prefix("T_s"), prefix("motor.R_s"), prefix("plant.motor.R_s")), ("", "motor", "plant.motor"));
    }
}
