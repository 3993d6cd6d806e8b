//! A document of XML as a flat list of elements with their places.
//!
//! Guarantees: an element comes before its children; time in proportion to the text; no native recursion.

use std::sync::Arc;

use roxmltree::{Document, Error, ParsingOptions};

use crate::fault::{FilePlace, TreeFault};

/// Most nodes of one document, texts and comments included.
const MAX_NODES: u32 = 4_000_000;

/// An attribute of an element.
#[derive(Clone, Debug)]
pub(crate) struct Attribute {
    pub(crate) name: String,
    pub(crate) value: String,
    pub(crate) place: FilePlace,
}

/// An element of a document.
#[derive(Clone, Debug)]
pub(crate) struct XmlElement {
    pub(crate) name: String,
    pub(crate) place: FilePlace,
    pub(crate) attributes: Vec<Attribute>,
    /// Indices of the children, which are greater than its own.
    pub(crate) children: Vec<usize>,
}

impl XmlElement {
    /// Returns the attribute of this name.
    pub(crate) fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|attribute| attribute.name == name)
    }

    /// Returns the value of the attribute of this name.
    pub(crate) fn value(&self, name: &str) -> Option<&str> {
        self.attribute(name).map(|attribute| &*attribute.value)
    }
}

/// Finds lines and columns of offsets that only grow.
struct PlaceCursor<'a> {
    text: &'a str,
    offset: usize,
    place: FilePlace,
}

impl PlaceCursor<'_> {
    fn place_of(&mut self, offset: usize) -> FilePlace {
        let passed = self.text.get(self.offset..offset).unwrap_or_default();
        for c in passed.chars() {
            if c == '\n' {
                self.place = FilePlace { line: self.place.line + 1, column: 1 };
            } else {
                self.place.column += 1;
            }
        }
        self.offset = self.offset.max(offset);
        self.place
    }
}

/// Returns the elements of a document, the root first.
///
/// # Errors
/// The first place that is not well-formed.
pub(crate) fn read(file: &Arc<str>, text: &str) -> Result<Vec<XmlElement>, TreeFault> {
    // A byte order mark counts as no column.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        let position = error.pos();
        TreeFault {
            file: file.clone(),
            place: FilePlace { line: position.row, column: position.col },
            message: explain(&error, character_at(text, position.row, position.col)),
        }
    })?;
    let mut cursor = PlaceCursor { text, offset: 0, place: FilePlace { line: 1, column: 1 } };
    let mut elements: Vec<XmlElement> = Vec::new();
    // The indices of the elements by the numbers of their nodes.
    let mut numbers =
        vec![usize::MAX; document.descendants().next_back().map_or(1, |node| node.id().get_usize() + 1)];
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        let place = cursor.place_of(node.range().start);
        let attributes = node.attributes().map(|attribute| Attribute {
            name: attribute.name().to_owned(),
            value: attribute.value().to_owned(),
            place: cursor.place_of(attribute.range().start),
        });
        let element = XmlElement {
            name: node.tag_name().name().to_owned(),
            place,
            attributes: attributes.collect(),
            children: Vec::new(),
        };
        let index = elements.len();
        if let Some(number) = numbers.get_mut(node.id().get_usize()) {
            *number = index;
        }
        let parent = node.parent().and_then(|parent| numbers.get(parent.id().get_usize()));
        if let Some(parent) = parent.and_then(|&parent| elements.get_mut(parent)) {
            parent.children.push(index);
        }
        elements.push(element);
    }
    Ok(elements)
}

/// Returns the character at a place.
fn character_at(text: &str, line: u32, column: u32) -> Option<char> {
    let line = text.lines().nth(line.checked_sub(1)? as usize)?;
    line.chars().nth(column.checked_sub(1)? as usize)
}

/// Returns the fault of a text that is not well-formed at a character, and the remedy.
fn explain(error: &Error, character: Option<char>) -> String {
    match error {
        Error::UnexpectedCloseTag(expected, found, _) => {
            format!(
                "`</{found}>` closes nothing: expected `</{expected}>`; close the elements in the order in which they were opened"
            )
        }
        Error::DuplicatedAttribute(name, _) => {
            format!("the attribute `{name}` occurs twice in one element: remove one of both")
        }
        Error::UnknownEntityReference(name, _) => {
            format!("`&{name};` is not defined: expected `&lt;`, `&gt;`, `&amp;`, `&quot;` or `&apos;`")
        }
        Error::MalformedEntityReference(_) => {
            "`&` begins a reference: write `&amp;` for the character itself, as in `a &amp;&amp; b`".into()
        }
        Error::InvalidAttributeValue(_) => {
            "`<` cannot stand in the value of an attribute: write `&lt;`".into()
        }
        Error::NoRootNode => "the document has no element: expected `<root BTCPP_format=\"4\">`".into(),
        Error::UnclosedRootNode => "the document ends inside an element: close `<root>` by `</root>`".into(),
        Error::DtdDetected => "a `<!DOCTYPE …>` is not supported: remove it".into(),
        Error::NodesLimitReached => format!("the document has more than {MAX_NODES} nodes"),
        Error::UnknownNamespace(prefix, _) => {
            format!("the prefix `{prefix}:` is not declared: expected a name without a prefix")
        }
        _ if character == Some('<') => {
            "`<` is not expected here: close the tag before it, and write `&lt;` in the value of an attribute"
                .into()
        }
        other => {
            // The place is said elsewhere.
            let text = other.to_string();
            let text = text.split(" at ").next().unwrap_or_default();
            format!("the document is not well-formed XML: {text}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(text: &str) -> String {
        read(&"t.xml".into(), text).map_or_else(|fault| fault.to_string(), |_| "none".into())
    }

    #[test]
    fn elements_have_their_places() {
        let elements =
            read(&"t.xml".into(), "<root>\n  <a x='1'\n   y='2'><b/></a>\n</root>").expect("well-formed");
        let places: Vec<_> = elements.iter().map(|e| (&*e.name, e.place.line, e.place.column)).collect();
        assert_eq!(places, [("root", 1, 1), ("a", 2, 3), ("b", 3, 10)]);
        let y = elements[1].attribute("y").expect("it is there");
        assert_eq!((&*y.value, y.place.line, y.place.column), ("2", 3, 4));
        assert_eq!((&*elements[0].children, &*elements[1].children), (&[1][..], &[2][..]));
    }

    #[test]
    fn faults_say_the_place_and_what_to_do() {
        assert_eq!(
            fault("<root>\n <a></b>\n</root>"),
            "t.xml:2:5: `</b>` closes nothing: expected `</a>`; close the elements in the order in which they were \
             opened"
        );
        assert!(fault("<root x='1' x='2'/>").contains("the attribute `x` occurs twice"));
        assert!(fault("<root x='a && b'/>").contains("write `&amp;`"));
        assert!(fault("<root x='a < b'/>").contains("write `&lt;`"));
        assert!(fault("<root>").contains("close `<root>`"));
        assert!(fault("").contains("expected `<root"));
        assert!(fault("<!DOCTYPE x><root/>").contains("not supported"));
    }

    #[test]
    fn depth_takes_no_native_stack() {
        let depth = 100_000;
        let text = format!("{}{}", "<a>".repeat(depth), "</a>".repeat(depth));
        assert_eq!(read(&"t.xml".into(), &text).expect("well-formed").len(), depth);
    }
}
