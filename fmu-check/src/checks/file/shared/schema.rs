//! Walks the elements of modelDescription.xml, terminalsAndIcons.xml and buildDescription.xml along the rules of the standard.

use crate::checks::file::shared::date_and_time::is_date_and_time;
use crate::checks::file::shared::schema_rules::{BUILD, Rule, TERMINALS, V2, V3, expand, words};
use model_description::{Element, FmiVersion, TextContent, parse_number};
use std::borrow::Cow;
use std::str::FromStr;

/// The namespace of the attributes that XML Schema itself allows in every element.
const INSTANCE: &str = "http://www.w3.org/2001/XMLSchema-instance";

/// Every deviation, with its line.
pub(crate) fn deviations(root: &Element, version: FmiVersion) -> Vec<String> {
    let rules = match version {
        FmiVersion::V2 => V2,
        FmiVersion::V3 => V3,
    };
    along(root, "fmiModelDescription", rules)
}

/// Deviations of terminalsAndIcons.xml from its schema, which both standards share.
pub(crate) fn deviations_of_terminals(root: &Element) -> Vec<String> {
    along(root, "fmiTerminalsAndIcons", TERMINALS)
}

/// Deviations of buildDescription.xml from its schema, which both standards share.
pub(crate) fn deviations_of_build(root: &Element) -> Vec<String> {
    along(root, "fmiBuildDescription", BUILD)
}

/// A prefix that is used in an element or attribute and that neither it nor an element around it declares.
pub(crate) fn undeclared(root: &Element) -> Option<String> {
    fn within<'a>(element: &'a Element, declared: &mut Vec<&'a str>) -> Option<String> {
        let before = declared.len();
        let names = || element.attributes.iter().map(|(name, _)| name.as_str());
        declared.extend(names().filter_map(|name| name.strip_prefix("xmlns:")));
        let used = std::iter::once(element.name.as_str()).chain(names()).filter_map(|name| name.split_once(':'));
        let own = used.map(|(prefix, _)| prefix).find(|p| !["xml", "xmlns"].contains(p) && !declared.contains(p));
        let own = own.map(|prefix| format!("line {}: the prefix {prefix} is not declared", element.line));
        let found = own.or_else(|| element.children.iter().find_map(|child| within(child, declared)));
        declared.truncate(before);
        found
    }
    within(root, &mut Vec::new())
}

fn along(root: &Element, name: &str, rules: &'static [Rule]) -> Vec<String> {
    if root.name != name {
        return vec![format!("line {}: the root element is <{}>", root.line, root.name)];
    }
    let of_schema = root.attributes.iter().filter(|(_, value)| value == INSTANCE);
    let instance = of_schema.filter_map(|(name, _)| name.strip_prefix("xmlns:")).collect();
    let mut walk = Walk { rules, instance, findings: Vec::new() };
    walk.element(root, "");
    walk.findings
}

/// Attributes of the interfaces of FMI 3.0 that the standard does not define, although its schema allows any.
pub(crate) fn unknown_capabilities(root: &Element) -> Vec<String> {
    let mut walk = Walk { rules: V3, instance: Vec::new(), findings: Vec::new() };
    for element in
        root.children.iter().filter(|e| ["ModelExchange", "CoSimulation", "ScheduledExecution"].contains(&&*e.name))
    {
        if let Some(rule) = find(V3, &root.name, &element.name) {
            // Names with a prefix belong to other standards.
            walk.unknown(element, &attributes_of(rule), |name| name.contains(':'));
        }
    }
    walk.findings
}

fn find(rules: &'static [Rule], parent: &str, name: &str) -> Option<&'static Rule> {
    let long = format!("{parent}/{name}");
    let integer = |name: &str| {
        let bits = name.trim_start_matches('U').strip_prefix("Int");
        bits.is_some_and(|b| ["8", "16", "32", "64"].contains(&b))
    };
    let generic = match name {
        _ if integer(name) => "@Integer",
        _ if name.strip_suffix("Type").is_some_and(integer) => "@IntegerType",
        _ => name,
    };
    rules.iter().find(|r| r.element == long).or_else(|| rules.iter().find(|r| r.element == generic))
}

/// The attributes of a rule with their forms.
fn attributes_of(rule: &Rule) -> Vec<&'static str> {
    let words = rule.attributes.split_whitespace();
    words.flat_map(|w| if w.starts_with('@') { expand(w).split_whitespace().collect() } else { vec![w] }).collect()
}

struct Walk<'a> {
    rules: &'static [Rule],
    /// Prefixes of [`INSTANCE`].
    instance: Vec<&'a str>,
    findings: Vec<String>,
}

impl Walk<'_> {
    fn element(&mut self, element: &Element, parent: &str) {
        let Some(rule) = find(self.rules, parent, &element.name) else { return };
        self.attributes(element, rule);
        if rule.children == "*" {
            return;
        }
        self.text(element, rule);
        if rule.children == "*?" {
            if let Some(second) = element.children.get(1) {
                self.findings.push(format!(
                    "line {}: <{}> is a second element in <{}>, which has one at most",
                    second.line, second.name, element.name
                ));
            }
            return;
        }
        self.children(element, rule);
        for child in &element.children {
            self.element(child, &element.name);
        }
    }

    fn attributes(&mut self, element: &Element, rule: &Rule) {
        let all = attributes_of(rule);
        let at = format!("line {}: <{}>", element.line, element.name);
        for word in &all {
            let (name, form) = word.split_once(':').unwrap_or((word, "s"));
            let (form, required) = form.strip_suffix('!').map_or((form, false), |form| (form, true));
            let form =
                if form.contains('N') { form.replace('N', &own_type(&element.name)).into() } else { Cow::from(form) };
            match element.get(name) {
                None if required => self.findings.push(format!("{at} has no attribute {name}")),
                Some(value) if !fits(value, &form) => {
                    self.findings.push(format!("{at} has {name}={value:?}, which is not {}", say(&form)));
                }
                _ => {}
            }
        }
        if let Some(space) = element.get("xmlns").filter(|space| !space.is_empty()) {
            self.findings.push(format!("{at} is in the namespace {space:?}; the elements of FMI are in none"));
        }
        if !all.contains(&"*") {
            let instance = std::mem::take(&mut self.instance);
            self.unknown(element, &all, |name| {
                let (prefix, local) = name.split_once(':').unwrap_or(("", name));
                let schema = ["type", "nil", "schemaLocation", "noNamespaceSchemaLocation"].contains(&local);
                prefix == "xmlns" || instance.contains(&prefix) && schema
            });
            self.instance = instance;
        }
    }

    fn unknown(&mut self, element: &Element, all: &[&str], foreign: impl Fn(&str) -> bool) {
        for (name, _) in &element.attributes {
            let known = name == "xmlns" || foreign(name) || all.iter().any(|w| w.split(':').next() == Some(name));
            if !known {
                let at = format!("line {}: <{}>", element.line, element.name);
                self.findings.push(format!("{at} has an attribute {name}, which the standard does not define"));
            }
        }
    }

    /// Text where the standard has none. Blanks are allowed between children only.
    fn text(&mut self, element: &Element, rule: &Rule) {
        let (at, empty) = (format!("line {}: <{}>", element.line, element.name), rule.children.is_empty());
        match element.text {
            TextContent::Words => self.findings.push(format!("{at} contains text")),
            TextContent::Blank if empty && element.children.is_empty() => self.findings.push(format!(
                "{at} contains blanks or a line break, and the schema allows no content: write <{} .../>",
                element.name
            )),
            _ => {}
        }
    }

    /// Children that are unknown, missing, repeated, or not in the order of the standard.
    fn children(&mut self, element: &Element, rule: &Rule) {
        let free = rule.children.starts_with('~');
        let places: Vec<&str> = rule.children.trim_start_matches('~').split_whitespace().collect();
        let names = |place: &'static str| place.trim_end_matches(['?', '!', '+']).split('|');
        let place_of = |name: &str| places.iter().position(|p| names(p).any(|n| n == name));
        let at = |e: &Element| format!("line {}: <{}>", e.line, e.name);
        let mut last = 0;
        let mut seen = vec![0_usize; places.len()];
        for child in &element.children {
            match place_of(&child.name) {
                None => self.findings.push(format!("{} is not allowed in <{}>", at(child), element.name)),
                Some(place) => {
                    if place < last && !free {
                        let order = rule.children.replace(['?', '!', '+'], "").replace('|', " or ");
                        self.findings.push(format!(
                            "{} comes too late: the order in <{}> is {order}",
                            at(child),
                            element.name
                        ));
                    }
                    last = last.max(place);
                    seen[place] += 1;
                }
            }
        }
        for (place, count) in places.iter().zip(seen) {
            let name = names(place).collect::<Vec<_>>().join("> or <");
            if count == 0 && place.ends_with(['!', '+']) {
                self.findings.push(format!("{} has no <{name}>", at(element)));
            }
            if count > 1 && place.ends_with(['?', '!']) {
                self.findings.push(format!("{} has {count} of <{name}>; one is allowed", at(element)));
            }
        }
        if free && element.children.is_empty() {
            self.findings.push(format!("{} is empty", at(element)));
        }
    }
}

/// The form of a value of a variable or type with this name.
fn own_type(element: &str) -> String {
    let name = element.trim_end_matches("Type");
    if name.starts_with("Float") { "d".into() } else { name.replace("UInt", "u").replace("Int", "i") }
}

fn is<T: FromStr>(text: &str) -> bool {
    text.parse::<T>().is_ok()
}

fn fits(value: &str, form: &str) -> bool {
    if let Some(one) = form.strip_prefix('*') {
        return value.split_whitespace().all(|word| fits(word, one));
    }
    // The words of the schema keep their blanks.
    if let Some(kind) = form.strip_prefix('=') {
        return words(kind).contains(&value);
    }
    let value = value.trim();
    match form {
        "b" => ["true", "false", "0", "1"].contains(&value),
        "i8" => is::<i8>(value),
        "i16" => is::<i16>(value),
        "i32" => is::<i32>(value),
        "i64" => is::<i64>(value),
        "u8" => is::<u8>(value),
        "u16" => is::<u16>(value),
        "u32" => is::<u32>(value),
        "u64" => is::<u64>(value),
        "n" => !value.is_empty() && value.bytes().all(|c| c.is_ascii_digit()),
        "d" => parse_number(value).is_some(),
        "t" => is_date_and_time(value),
        "x" => value.len().is_multiple_of(2) && value.bytes().all(|c| c.is_ascii_hexdigit()),
        "c" => value.split_whitespace().count() == 3 && value.split_whitespace().all(is::<u8>),
        _ => true,
    }
}

fn say(form: &str) -> String {
    if let Some(one) = form.strip_prefix('*') {
        return format!("{}, or several with blanks between them", say(one));
    }
    if let Some(kind) = form.strip_prefix('=') {
        return format!("one of {}", words(kind).join(", "));
    }
    match form {
        "b" => "true or false".into(),
        "n" => "an integer from 0 on".into(),
        "d" => "a number".into(),
        "t" => "a date and time, such as 2026-01-02T03:04:05Z".into(),
        "x" => "hexadecimal, two digits for each byte".into(),
        "c" => "a color, three numbers from 0 to 255".into(),
        _ => match form.split_at_checked(1) {
            Some(("i", bits)) => format!("an integer of {bits} bits"),
            Some(("u", bits)) => format!("an unsigned integer of {bits} bits"),
            _ => "of the right form".into(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prefix_is_declared_around_its_use() {
        let of = |text: &str| undeclared(&Element::parse(text).unwrap());
        assert_eq!(of("<a xml:lang='en' xmlns:p='x'><p:b p:c='1'/></a>"), None);
        assert_eq!(of("<a>\n<b xmlns:p='x'><p:c/></b>\n<p:d/></a>").unwrap(), "line 3: the prefix p is not declared");
        assert_eq!(of("<a q:b='1'/>").unwrap(), "line 1: the prefix q is not declared");
    }
}
