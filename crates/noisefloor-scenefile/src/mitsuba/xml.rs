//! The tree of a scene file: names in the style of Mitsuba 3, `$parameters` put in, every element with its
//! line, and whether anything has read it.

use crate::error::{LoadError, Place};
use roxmltree::{Node, ParsingOptions};
use std::cell::Cell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Longest scene file that is read, in bytes; and the most that `$parameters` may add up to.
pub(super) const MAX_XML_BYTES: u64 = 64 << 20;
/// Most elements, texts and comments of a scene file.
const MAX_NODES: u32 = 1 << 20;
/// How deep elements may nest.
const MAX_DEPTH: u32 = 32;
/// Most attributes of an element.
const MAX_ATTRIBUTES: usize = 64;
/// Most mentions of XML name spaces, of which Mitsuba has none.
const MAX_NAMESPACES: usize = 16;
/// Longest name of a `$parameter`.
const MAX_PARAMETER: usize = 64;

/// Whether an element has been read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    No,
    Read,
    /// It makes no difference here, nor does anything in it.
    Irrelevant,
}

/// An element.
#[derive(Debug)]
pub(super) struct Element {
    /// `shape`, `float`, …
    pub(super) tag: String,
    /// Line in the file, from 1.
    pub(super) line: u32,
    /// Elements are numbered in the order of the file.
    pub(super) serial: usize,
    /// Elements in it.
    pub(super) children: Vec<Element>,
    attributes: Vec<(String, String)>,
    seen: Cell<Seen>,
}

/// A scene file.
#[derive(Debug)]
pub(super) struct Document {
    /// Where it is.
    pub(super) path: PathBuf,
    /// The first number of its version is below 2.
    pub(super) old: bool,
    /// The `scene` element.
    pub(super) root: Element,
}

impl Element {
    /// The attribute called `name`.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// The plugin that it names: the attribute `type`.
    pub(super) fn kind(&self) -> &str {
        self.attribute("type").unwrap_or_default()
    }

    /// The element called `name` in it, which is now read.
    pub(super) fn get(&self, name: &str) -> Option<&Element> {
        let found = self.children.iter().find(|child| child.attribute("name") == Some(name))?;
        found.read();
        Some(found)
    }

    /// Elements of one tag in it, which are now read.
    pub(super) fn all<'a>(&'a self, tag: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |child| child.tag == tag).inspect(|child| child.read())
    }

    /// Says that this has been read.
    pub(super) fn read(&self) {
        self.seen.set(Seen::Read);
    }

    /// Says that nothing in this makes a difference to the picture here.
    pub(super) fn irrelevant(&self) {
        self.seen.set(Seen::Irrelevant);
    }

    /// Says that none of the elements of these names makes a difference.
    pub(super) fn ignore(&self, names: &[&str]) {
        let ignored = |child: &&Element| child.attribute("name").is_some_and(|name| names.contains(&name));
        self.children.iter().filter(ignored).for_each(Element::irrelevant);
    }

    /// The elements below this that nobody has read. Of an element that is not read, what is in it is not
    /// reported.
    pub(super) fn unread<'a>(&'a self, found: &mut Vec<&'a Element>) {
        for child in &self.children {
            match child.seen.get() {
                Seen::No => found.push(child),
                Seen::Read => child.unread(found),
                Seen::Irrelevant => {}
            }
        }
    }

    /// All elements from here on that have an `id`.
    pub(super) fn identified<'a>(&'a self, found: &mut Vec<(&'a str, &'a Element)>) {
        if let Some(id) = self.attribute("id").filter(|_| self.tag != "ref") {
            found.push((id, self));
        }
        self.children.iter().for_each(|child| child.identified(found));
    }

    /// How messages call it.
    pub(super) fn label(&self) -> String {
        let mut label = format!("<{}", self.tag);
        for key in ["type", "name", "id"] {
            if let Some(value) = self.attribute(key) {
                label += &format!(" {key}=\"{value}\"");
            }
        }
        label + ">"
    }
}

impl Document {
    /// Parses the scene file `bytes`, which came from `path`.
    ///
    /// # Errors
    /// [`LoadError`] if it is not XML, not a scene, of an unknown version, too large, or nested too deeply.
    pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Self, LoadError> {
        let bad = |what: String| Place::file(path).bad(what);
        let text = std::str::from_utf8(bytes).map_err(|e| bad(format!("the file is not UTF-8: {e}")))?;
        check_attributes(text, path)?;
        // Without a DTD, entities cannot multiply
        let options =
            ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        let tree = roxmltree::Document::parse_with_options(text, options).map_err(|e| {
            let place = Place::part(path, format_args!("line {}", e.pos().row));
            place.bad(format!("the XML is broken: {e}"))
        })?;

        let scene = tree.root_element();
        let version = scene.attribute("version").unwrap_or_default();
        let major = version.split('.').next().and_then(|major| major.parse::<u32>().ok());
        let old = match (scene.tag_name().name(), major) {
            ("scene", Some(0 | 1)) => true,
            ("scene", Some(2 | 3)) => false,
            ("scene", Some(_)) => {
                return Err(Place::file(path).unsupported(format!("version {version} of Mitsuba's scenes")));
            }
            _ => return Err(bad("expected <scene version=\"…\"> of Mitsuba".to_owned())),
        };
        let lines = Lines::of(text);
        let mut builder = Builder { path, old, lines, parameters: HashMap::new(), added: 0, elements: 0 };
        Ok(Self { path: path.to_owned(), old, root: builder.element(scene, 0)? })
    }

    /// Where `element` is.
    pub(super) fn place(&self, element: &Element) -> Place {
        Place::part(&self.path, format_args!("line {}", element.line))
    }
}

/// Checks what the parser takes quadratic time for: attributes of one element, and name spaces.
fn check_attributes(text: &str, path: &Path) -> Result<(), LoadError> {
    let place = Place::file(path);
    place.clone().at_most(
        "name spaces",
        text.matches("xmlns").take(MAX_NAMESPACES + 1).count() as u64,
        MAX_NAMESPACES as u64,
    )?;
    // No attribute contains `<`, and each has two quotes
    let quotes = |tag: &str| tag.bytes().filter(|b| matches!(b, b'"' | b'\'')).count();
    let most = text.split('<').filter(|tag| !tag.starts_with("!--")).map(quotes).max().unwrap_or(0);
    place.at_most("attributes of one element", most as u64 / 2, MAX_ATTRIBUTES as u64)
}

/// Finds the line of a position by bisection: to count from the start each time would take quadratic time.
struct Lines {
    starts: Vec<usize>,
}

impl Lines {
    fn of(text: &str) -> Self {
        Self { starts: text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(at, _)| at + 1).collect() }
    }

    fn at(&self, position: usize) -> u32 {
        self.starts.partition_point(|start| *start <= position) as u32 + 1
    }
}

struct Builder<'a> {
    path: &'a Path,
    old: bool,
    lines: Lines,
    /// From `default` elements so far.
    parameters: HashMap<String, String>,
    /// Bytes that parameters have become.
    added: u64,
    elements: usize,
}

impl Builder<'_> {
    /// An element, `depth` levels down, and what is in it.
    fn element(&mut self, node: Node<'_, '_>, depth: u32) -> Result<Element, LoadError> {
        let line = self.lines.at(node.range().start);
        let place = Place::part(self.path, format_args!("line {line}"));
        place.clone().at_most("levels of elements", u64::from(depth), u64::from(MAX_DEPTH))?;
        let tag = node.tag_name().name().to_owned();
        let mut attributes = Vec::new();
        for attribute in node.attributes() {
            let mut value = self.substitute(attribute.value(), &place)?;
            if self.old && attribute.name() == "name" {
                value = snake_case(&value);
            }
            attributes.push((attribute.name().to_owned(), value));
        }
        let serial = self.elements;
        self.elements += 1;
        let mut element =
            Element { tag, line, serial, children: vec![], attributes, seen: Cell::new(Seen::No) };

        if element.tag == "default" {
            element.irrelevant();
            let (Some(name), Some(value)) = (node.attribute("name"), element.attribute("value")) else {
                return Err(place.bad("a <default> needs a name and a value"));
            };
            place.at_most("bytes in the name of a parameter", name.len() as u64, MAX_PARAMETER as u64)?;
            self.parameters.insert(name.to_owned(), value.to_owned());
        }
        for child in node.children().filter(Node::is_element) {
            element.children.push(self.element(child, depth + 1)?);
        }
        Ok(element)
    }

    /// Puts in the values of `$parameters`; of two names that fit, the longer one.
    fn substitute(&mut self, text: &str, place: &Place) -> Result<String, LoadError> {
        let mut pieces = text.split('$');
        let mut result = pieces.next().unwrap_or_default().to_owned();
        for piece in pieces {
            let ends = (1..=piece.len().min(MAX_PARAMETER)).rev().filter(|end| piece.is_char_boundary(*end));
            let found = ends.into_iter().find_map(|end| Some((end, self.parameters.get(&piece[..end])?)));
            let Some((end, value)) = found else {
                let what = format!("`${piece}`: no <default> before this gives the parameter a value");
                return Err(place.clone().bad(what));
            };
            self.added += value.len() as u64;
            place.clone().at_most("bytes in parameters", self.added, MAX_XML_BYTES)?;
            result += value;
            result += &piece[end..];
        }
        Ok(result)
    }
}

/// The name that Mitsuba 2 and 3 have for one of older versions: `toWorld` is `to_world`, `intIOR` is
/// `int_ior`.
fn snake_case(name: &str) -> String {
    let mut result = String::with_capacity(name.len() + 4);
    let mut after_small = false;
    for c in name.chars() {
        if c.is_ascii_uppercase() && after_small {
            result.push('_');
        }
        after_small = !c.is_ascii_uppercase();
        result.push(c.to_ascii_lowercase());
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_names_become_new_ones() {
        for (old, new) in [
            ("toWorld", "to_world"),
            ("maxDepth", "max_depth"),
            ("diffuseReflectance", "diffuse_reflectance"),
            ("intIOR", "int_ior"),
            ("faceNormals", "face_normals"),
            ("fovAxis", "fov_axis"),
            ("alpha", "alpha"),
            ("k", "k"),
        ] {
            assert_eq!(snake_case(old), new);
        }
    }
}
