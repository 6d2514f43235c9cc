//! An element: name, attributes, children.

/// Text directly inside an element, outside its children.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum TextContent {
    /// None, or comments only.
    #[default]
    None,
    /// Only blanks and line breaks.
    Blank,
    /// Other characters.
    Words,
}

/// An element of an XML document, as in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Element {
    /// Name, with its namespace prefix if it has one.
    pub name: String,
    /// Attributes in the order of the file, values unescaped.
    pub attributes: Vec<(String, String)>,
    /// Child elements in the order of the file.
    pub children: Vec<Element>,
    /// Line of the start tag, from 1; 0 for one that was not read.
    pub line: usize,
    /// Whether it has text; neither standard uses it, so the text itself is not stored.
    pub text: TextContent,
}

impl Element {
    /// An empty element.
    pub fn new(name: &str) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Adds an attribute.
    pub fn with(mut self, name: &str, value: impl Into<String>) -> Self {
        self.attributes.push((name.into(), value.into()));
        self
    }

    /// Adds an attribute if there is a value for it.
    pub fn with_some(self, name: &str, value: Option<impl Into<String>>) -> Self {
        match value {
            Some(value) => self.with(name, value),
            None => self,
        }
    }

    /// Adds an attribute unless the text is empty.
    pub fn with_text(self, name: &str, value: &str) -> Self {
        self.with_some(name, Some(value).filter(|text| !text.is_empty()))
    }

    /// Adds children.
    pub fn children(mut self, children: impl IntoIterator<Item = Element>) -> Self {
        self.children.extend(children);
        self
    }

    /// The value of an attribute.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str())
    }

    /// The first child with this name.
    pub fn child(&self, name: &str) -> Option<&Element> {
        self.children.iter().find(|c| c.name == name)
    }

    /// All children with this name.
    pub fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |c| c.name == name)
    }
}
