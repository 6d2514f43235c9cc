//! Parses an element tree. Any input yields a tree or an error: no panic, no unbounded recursion, no entity expansion, no
//! external file.

use super::element::{Element, TextContent};
use super::names::{is_legal, is_name};
use crate::error::Error;
use crate::limits;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

/// The root element of an XML document.
pub(crate) fn parse(text: &str) -> Result<Element, Error> {
    limits::XML.check(text.len() as u64).map_err(Error::Limit)?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut reader = Reader::from_str(text);
    reader.config_mut().enable_all_checks(true);
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
            Event::Eof => break,
            other => {
                beside(&other, open.is_empty()).map_err(|e| wrong(&e))?;
                if let Some(element) = open.last_mut() {
                    element.text = element.text.max(content(&other));
                }
                continue;
            }
        };
        if root.is_some() {
            return Err(wrong(&"a second root element"));
        }
        limits::LEVELS.check(open.len() as u64 + 1).map_err(|e| wrong(&e))?;
        // The position is after the tag, which may contain line breaks between its attributes.
        let line = line - tag.matches('\n').count();
        let mut element = start(&tag).map_err(|reason| Error::NotXml { line, reason })?;
        nodes += 1 + element.attributes.len() as u64;
        limits::NODES.check(nodes).map_err(Error::Limit)?;
        element.line = line;
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

/// The text that this part of an element's content is.
fn content(event: &Event<'_>) -> TextContent {
    match event {
        Event::Text(text) if text.xml10_content().trim().is_empty() => TextContent::Blank,
        Event::Text(_) | Event::CData(_) | Event::GeneralRef(_) => TextContent::Words,
        _ => TextContent::None,
    }
}

/// Checks what is not an element: text, comment, declaration, `outside` the root element or inside.
fn beside(event: &Event<'_>, outside: bool) -> Result<(), String> {
    match event {
        Event::Text(text) if outside && !text.xml10_content().trim().is_empty() => {
            Err("text outside the root element".into())
        }
        Event::CData(_) | Event::GeneralRef(_) if outside => Err("text outside the root element".into()),
        Event::Text(text) if text.contains("]]>") => Err("]]> in a text".into()),
        Event::GeneralRef(entity) => match entity.resolve_char_ref().map_err(|e| e.to_string())? {
            Some(c) => legal("a text", c.encode_utf8(&mut [0; 4])),
            None if ["amp", "lt", "gt", "quot", "apos"].contains(&&**entity) => Ok(()),
            None => Err(format!("the entity &{}; is unknown", &**entity)),
        },
        Event::Text(text) => legal("a text", text),
        Event::CData(text) => legal("a text", text),
        Event::Comment(text) => legal("a comment", text),
        Event::PI(text) if !is_name(text.target()) => Err(format!("{:?} is not a name of XML", text.target())),
        Event::PI(text) => legal("a processing instruction", text),
        Event::Decl(_) if !outside => Err("an XML declaration inside the root element".into()),
        Event::Decl(text) => {
            let tag = start(&BytesStart::from_content(&**text, 3))?;
            let mut allowed = ["version", "encoding", "standalone"].iter();
            match tag.attributes.iter().find(|(name, _)| !allowed.any(|one| one == name)) {
                Some((name, _)) => Err(format!("{name} has no place in an XML declaration")),
                None => Ok(()),
            }
        }
        _ => Ok(()),
    }
}

/// Checks the characters of a `part` of the document.
fn legal(part: impl std::fmt::Display, text: &str) -> Result<(), String> {
    // Most texts are printable ASCII, which the compiler checks 16 bytes at a time.
    if text.bytes().fold(true, |all, byte| all & (b' '..=b'~').contains(&byte)) {
        return Ok(());
    }
    match text.chars().find(|&c| !is_legal(c)) {
        None => Ok(()),
        Some(c) => Err(format!("{part} has the character U+{:04X}, which XML does not allow", u32::from(c))),
    }
}

fn start(tag: &BytesStart<'_>) -> Result<Element, String> {
    let named = |name: &str| if is_name(name) { Ok(()) } else { Err(format!("{name:?} is not a name of XML")) };
    let mut element = Element::new(tag.name().as_ref());
    named(&element.name)?;
    for attribute in tag.attributes() {
        let attribute = attribute.map_err(|e| e.to_string())?;
        let name = attribute.key.as_ref();
        named(name)?;
        if attribute.value.contains('<') {
            return Err(format!("the attribute {name} contains <, which is written &lt;"));
        }
        let after = attribute.value.as_ptr().addr().wrapping_sub(tag.as_ptr().addr()) + attribute.value.len() + 1;
        if tag.as_bytes().get(after).is_some_and(|c| !c.is_ascii_whitespace()) {
            return Err(format!("no blank after the attribute {name}"));
        }
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| e.to_string())?;
        legal(format_args!("the attribute {name}"), &value)?;
        element.attributes.push((name.into(), value.into_owned()));
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
            parse("\u{feff}<?xml version='1.0' standalone='no'?>\n<!-- -->\n<a\n  x='&#x41;&lt;'>\n <b/> text &gt; <![CDATA[<]]>\n</a>\n")
                .unwrap();
        assert_eq!((tree.line, tree.get("x"), tree.children[0].line), (3, Some("A<"), 5));
    }

    #[test]
    fn text_is_noticed() {
        for (inside, text) in [
            ("", TextContent::None),
            ("<!-- x --><b>x</b>", TextContent::None),
            ("\n<b/>\n", TextContent::Blank),
            ("<b/>x\n", TextContent::Words),
            ("&#65;", TextContent::Words),
            ("<![CDATA[x]]>", TextContent::Words),
        ] {
            assert_eq!(parse(&format!("<a>{inside}</a>")).unwrap().text, text, "{inside}");
        }
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
            ("<a>\n<\n/></a>", 2),
            ("<a>\n<1b/></a>", 2),
            ("<a>\n<b 1x='1'/></a>", 2),
            ("<a>\n<b x='<'/></a>", 2),
            ("<a>\n<b x='\u{1}'/></a>", 2),
            ("<a>\n<b x='&#1;'/></a>", 2),
            ("<a>\n\u{1}</a>", 2),
            ("<a>\n&#1;</a>", 2),
            ("<a>\n&unknown;</a>", 2),
            ("<a>\n]]></a>", 2),
            ("<a>\n<![CDATA[\u{ffff}]]></a>", 2),
            ("<a>\n<!-- \u{1f} --></a>", 2),
            ("<a>\n<!-- -- --></a>", 2),
            ("<a>\n<?x \u{0}?></a>", 2),
            ("<a>\n<?x\"?></a>", 2),
            ("<a>\n<b x='1'y='2'/></a>", 2),
            ("<?xml encoding='UTF-8' version='1.0'?><a/>", 1),
            ("<?xml version='1.0' e='UTF-8'?><a/>", 1),
            ("<a>\n<?xml version='1.0'?></a>", 2),
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
