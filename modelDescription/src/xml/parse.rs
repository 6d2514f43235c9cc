//! Parses an element tree. Any input yields a tree or an error: no panic, no unbounded recursion, no entity expansion, no
//! external file.

use super::element::Element;
use crate::error::Error;
use crate::limits;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

/// The root element of an XML document.
pub(crate) fn parse(text: &str) -> Result<Element, Error> {
    limits::XML.check(text.len() as u64).map_err(Error::Limit)?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut reader = Reader::from_str(text);
    let mut lines = Lines { text, offset: 0, line: 1 };
    let mut open: Vec<Element> = Vec::new();
    let mut root = None;
    let mut nodes = 0;
    loop {
        let event = reader.read_event();
        let line = lines.at(match &event {
            Ok(_) => reader.buffer_position(),
            Err(_) => reader.error_position(),
        });
        let wrong = |reason: &dyn std::fmt::Display| Error::NotXml { line, reason: reason.to_string() };
        let (tag, empty) = match event.map_err(|e| wrong(&e))? {
            Event::Start(tag) => (tag, false),
            Event::Empty(tag) => (tag, true),
            Event::End(_) => {
                // The reader has checked that the end tag matches.
                if let Some(element) = open.pop() {
                    place(element, &mut open, &mut root);
                }
                continue;
            }
            Event::Text(content) if open.is_empty() && !content.xml10_content().trim().is_empty() => {
                return Err(wrong(&"text outside the root element"));
            }
            Event::CData(_) | Event::GeneralRef(_) if open.is_empty() => {
                return Err(wrong(&"text outside the root element"));
            }
            Event::Eof => break,
            _ => continue,
        };
        if root.is_some() {
            return Err(wrong(&"a second root element"));
        }
        limits::LEVELS.check(open.len() as u64 + 1).map_err(|e| wrong(&e))?;
        let mut element = start(&tag).map_err(|e| wrong(&e))?;
        nodes += 1 + element.attributes.len() as u64;
        limits::NODES.check(nodes).map_err(Error::Limit)?;
        // The position is after the tag, which may contain line breaks between its attributes.
        element.line = line - tag.matches('\n').count();
        if empty {
            place(element, &mut open, &mut root);
        } else {
            open.push(element);
        }
    }
    let line = lines.line;
    match (open.pop(), root) {
        (Some(element), _) => Err(Error::NotXml { line, reason: format!("<{}> is not closed", element.name) }),
        (None, None) => Err(Error::NotXml { line, reason: "no root element".into() }),
        (None, Some(root)) => Ok(root),
    }
}

impl Element {
    /// The root element of an XML document.
    ///
    /// # Errors
    /// The document is not well-formed or is nested too deeply.
    pub fn parse(text: &str) -> Result<Self, Error> {
        parse(text)
    }
}

fn place(element: Element, open: &mut [Element], root: &mut Option<Element>) {
    match open.last_mut() {
        Some(parent) => parent.children.push(element),
        None => *root = Some(element),
    }
}

fn start(tag: &BytesStart<'_>) -> Result<Element, quick_xml::Error> {
    let mut element = Element::new(tag.name().as_ref());
    for attribute in tag.attributes() {
        let attribute = attribute?;
        let value = attribute.normalized_value(XmlVersion::Implicit1_0)?;
        element.attributes.push((attribute.key.as_ref().into(), value.into_owned()));
    }
    // The most frequent case in a description.
    element.attributes.shrink_to_fit();
    Ok(element)
}

/// Counts lines incrementally, so that all positions together cost one pass.
struct Lines<'a> {
    text: &'a str,
    offset: usize,
    line: usize,
}

impl Lines<'_> {
    fn at(&mut self, position: u64) -> usize {
        let position = usize::try_from(position).unwrap_or(usize::MAX).clamp(self.offset, self.text.len());
        let passed = &self.text.as_bytes()[self.offset..position];
        self.line += passed.split(|&b| b == b'\n').count() - 1;
        self.offset = position;
        self.line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_references() {
        let tree =
            parse("\u{feff}<?xml version='1.0'?>\n<!-- -->\n<a\n  x='&#x41;&lt;'>\n <b/> text <![CDATA[<]]>\n</a>\n")
                .unwrap();
        assert_eq!((tree.line, tree.get("x"), tree.children[0].line), (3, Some("A<"), 5));
    }

    #[test]
    fn broken_documents_name_their_line() {
        for (text, line) in [
            ("", 1),
            ("plain", 1),
            ("<a>\n<b>\n</a>", 3),
            ("<a/>\n<b/>", 2),
            ("<a x='1' x='2'/>", 1),
            ("<a>\n<b x=1/></a>", 2),
            ("<a x='&unknown;'/>", 1),
            ("<a/>\n&amp;", 2),
            ("<a>\n\n", 3),
        ] {
            match parse(text) {
                Err(Error::NotXml { line: at, .. }) => assert_eq!(at, line, "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
    }

    #[test]
    fn depth_is_bounded() {
        let deep = "<a>".repeat(1_000_000);
        assert!(matches!(parse(&deep), Err(Error::NotXml { .. })));
    }
}
