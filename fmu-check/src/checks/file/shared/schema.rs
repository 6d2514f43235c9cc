//! Walks the elements of modelDescription.xml and terminalsAndIcons.xml along the rules of the standard.

use crate::checks::file::shared::schema_rules::{Rule, TERMINALS, V2, V3, expand};
use model_description::{Element, FmiVersion, parse_number};

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

fn along(root: &Element, name: &str, rules: &'static [Rule]) -> Vec<String> {
    let mut findings = Vec::new();
    if root.name != name {
        return vec![format!("line {}: the root element is <{}>", root.line, root.name)];
    }
    walk(root, "", rules, &mut findings);
    findings
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

fn walk(element: &Element, parent: &str, rules: &'static [Rule], findings: &mut Vec<String>) {
    let Some(rule) = find(rules, parent, &element.name) else { return };
    attributes(element, rule, findings);
    if rule.children == "*" {
        return;
    }
    children(element, rule, findings);
    for child in &element.children {
        walk(child, &element.name, rules, findings);
    }
}

/// Attributes of the interfaces of FMI 3.0 that the standard does not define, although its schema allows any.
pub(crate) fn unknown_capabilities(root: &Element) -> Vec<String> {
    let mut findings = Vec::new();
    for element in
        root.children.iter().filter(|e| ["ModelExchange", "CoSimulation", "ScheduledExecution"].contains(&&*e.name))
    {
        if let Some(rule) = find(V3, &root.name, &element.name) {
            unknown(element, &words(rule), &mut findings);
        }
    }
    findings
}

fn words(rule: &Rule) -> Vec<&'static str> {
    let words = rule.attributes.split_whitespace();
    words.flat_map(|w| if w.starts_with('@') { expand(w).split_whitespace().collect() } else { vec![w] }).collect()
}

fn attributes(element: &Element, rule: &Rule, findings: &mut Vec<String>) {
    let all = words(rule);
    let at = format!("line {}: <{}>", element.line, element.name);
    for word in &all {
        let (name, form) = word.split_once(':').unwrap_or((word, "*"));
        match element.get(name) {
            None if form.ends_with('!') => findings.push(format!("{at} has no attribute {name}")),
            Some(value) if !fits(value, form.trim_end_matches('!')) => {
                findings.push(format!("{at} has {name}={value:?}, which is not {}", say(form.trim_end_matches('!'))));
            }
            _ => {}
        }
    }
    if !all.contains(&"*") {
        unknown(element, &all, findings);
    }
}

fn unknown(element: &Element, all: &[&str], findings: &mut Vec<String>) {
    for (name, _) in &element.attributes {
        // Names with a prefix belong to other standards.
        let known = name.contains(':') || name == "xmlns" || all.iter().any(|w| w.split(':').next() == Some(name));
        if !known {
            let at = format!("line {}: <{}>", element.line, element.name);
            findings.push(format!("{at} has an attribute {name}, which the standard does not define"));
        }
    }
}

fn fits(value: &str, form: &str) -> bool {
    let trimmed = value.trim();
    match form {
        "b" => ["true", "false", "0", "1"].contains(&trimmed),
        "i" => trimmed.parse::<i128>().is_ok(),
        "u" => trimmed.parse::<u64>().is_ok(),
        "d" => parse_number(trimmed).is_some(),
        "l" => trimmed.split_whitespace().all(|w| w.parse::<u32>().is_ok()),
        "c" => {
            trimmed.split_whitespace().filter(|w| w.parse::<u8>().is_ok()).count() == 3
                && trimmed.split_whitespace().count() == 3
        }
        "w" => {
            trimmed.split_whitespace().all(|w| ["dependent", "constant", "fixed", "tunable", "discrete"].contains(&w))
        }
        _ => true,
    }
}

fn say(form: &str) -> &'static str {
    match form {
        "b" => "true or false",
        "i" => "an integer",
        "u" => "an unsigned integer",
        "d" => "a number",
        "l" => "a list of unsigned integers",
        "c" => "a color, three numbers from 0 to 255",
        "w" => "a list of dependent, constant, fixed, tunable, discrete",
        _ => "of the right form",
    }
}

/// Children that are unknown, missing, repeated, or not in the order of the standard.
fn children(element: &Element, rule: &Rule, findings: &mut Vec<String>) {
    let free = rule.children.starts_with('~');
    let places: Vec<&str> = rule.children.trim_start_matches('~').split_whitespace().collect();
    let place_of =
        |name: &str| places.iter().position(|p| p.trim_end_matches(['?', '!']).split('|').any(|n| n == name));
    let at = |e: &Element| format!("line {}: <{}>", e.line, e.name);
    let mut last = 0;
    let mut seen = vec![0_usize; places.len()];
    for child in &element.children {
        match place_of(&child.name) {
            None if child.name.contains(':') => {}
            None => findings.push(format!("{} is not allowed in <{}>", at(child), element.name)),
            Some(place) => {
                if place < last && !free {
                    findings.push(format!(
                        "{} comes too late: the order in <{}> is {}",
                        at(child),
                        element.name,
                        rule.children
                    ));
                }
                last = last.max(place);
                seen[place] += 1;
            }
        }
    }
    for (place, count) in places.iter().zip(seen) {
        let name = place.trim_end_matches(['?', '!']);
        if count == 0 && (place.ends_with('!') || name.contains('|')) {
            findings.push(format!("{} has no <{}>", at(element), name.replace('|', "> or <")));
        }
        // Two of the same kind; FMI 2.0 allows one interface of each kind.
        if count > 1 && place.ends_with('?') {
            findings.push(format!("{} has {count} <{name}>", at(element)));
        }
    }
    if free && element.children.is_empty() {
        findings.push(format!("{} is empty", at(element)));
    }
}
