//! A small element tree: names, attributes, children, and whether there is text.

mod element;
mod names;
mod parse;
mod print;

pub use element::{Element, TextContent};
pub(crate) use parse::parse;
pub(crate) use print::print;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_reads_back() {
        let text = "a < b & \"c\" 'd' >\n\tnext\r\u{e9}\u{1f50b} ]]> &amp;";
        let tree = Element::new("root")
            .with("text", text)
            .children([Element::new("leaf").with("x", ""), Element::new("branch").children([Element::new("leaf")])]);
        let printed = print(&tree);
        let mut back = parse(&printed).unwrap();
        forget_layout(&mut back);
        assert_eq!(back, tree);
    }

    fn forget_layout(element: &mut Element) {
        (element.line, element.text) = (0, TextContent::None);
        element.children.iter_mut().for_each(forget_layout);
    }
}
