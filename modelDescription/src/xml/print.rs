//! Prints an element tree: declaration, one element per line, two blanks per level.

use super::element::Element;
use super::names::is_legal;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, Event};

/// The XML document of a tree, in UTF-8, with a newline at its end.
pub(crate) fn print(root: &Element) -> String {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    let mut events = vec![Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None))];
    collect(root, &mut events);
    for event in events {
        // Writing to a Vec cannot fail, and the writer has no other source of errors.
        let _ = writer.write_event(event);
    }
    let mut bytes = writer.into_inner();
    bytes.push(b'\n');
    String::from_utf8_lossy(&bytes).into_owned()
}

impl Element {
    /// The XML document whose root this is, in UTF-8.
    pub fn to_xml(&self) -> String {
        print(self)
    }
}

fn collect<'a>(element: &'a Element, events: &mut Vec<Event<'a>>) {
    let mut start = BytesStart::new(element.name.as_str());
    for (name, value) in &element.attributes {
        let value: String = value.chars().map(legal).collect();
        start.push_attribute((name.as_str(), value.as_str()));
    }
    if element.children.is_empty() {
        events.push(Event::Empty(start));
        return;
    }
    events.push(Event::Start(start));
    element.children.iter().for_each(|child| collect(child, events));
    events.push(Event::End(BytesEnd::new(element.name.as_str())));
}

/// Replaces characters that XML 1.0 cannot represent, not even by reference, with the replacement character.
fn legal(c: char) -> char {
    if is_legal(c) { c } else { '\u{fffd}' }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn form() {
        let tree = Element::new("a").children([Element::new("b").with("x", "1 < 2\n\"\u{1}\"")]);
        let expected =
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<a>\n  <b x=\"1 &lt; 2&#10;&quot;\u{fffd}&quot;\"/>\n</a>\n";
        assert_eq!(print(&tree), expected);
    }
}
