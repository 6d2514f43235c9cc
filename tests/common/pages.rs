//! Rules for every page.

use std::collections::BTreeSet;

/// A page works offline: no address except that of the SVG name space; its links lead to its anchors or to files that are
/// `there`; every element is closed.
pub fn stands_alone(page: &str, there: impl Fn(&str) -> bool) {
    let outside = page.replace("http://www.w3.org/2000/svg", "");
    for part in ["http:", "https:", "src=", "@import", "url(h", "<link", "<iframe", "fetch(", "import("] {
        assert!(!outside.contains(part), "{part}");
    }
    for part in ["<meta name=\"viewport\"", "prefers-color-scheme: dark", "lang=\"en\""] {
        assert!(page.contains(part), "{part}");
    }
    let mut places = BTreeSet::new();
    for place in page.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
        assert!(places.insert(place), "the place {place} is there twice");
    }
    for target in page.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
        assert!(target.strip_prefix('#').map_or_else(|| there(target), |p| places.contains(p)), "a link to {target}");
    }
    for tag in [
        "table", "thead", "tbody", "tr", "td", "th", "p", "ul", "li", "h1", "h2", "h3", "svg", "text", "sub", "sup",
        "b", "i", "code", "div", "script", "noscript", "style", "main", "nav", "small", "span",
    ] {
        let opened = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
        assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "<{tag}>");
    }
}

/// The data of the figures of a page.
pub fn figures(page: &str) -> Vec<serde_json::Value> {
    let data = page.split("<script type=\"application/json\">").skip(1);
    data.map(|rest| serde_json::from_str(rest.split("</script>").next().unwrap()).unwrap()).collect()
}

/// A module with the parts that a page checks, of the model with this token.
pub fn module(token: &str) -> Vec<u8> {
    [b"\0asm\x01\0\0\0", "fmi3DoStep __indirect_function_table ".as_bytes(), token.as_bytes()].concat()
}
