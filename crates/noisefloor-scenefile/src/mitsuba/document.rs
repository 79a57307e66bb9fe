//! A scene file and the files that it includes, as one tree of elements.

use super::xml::{Element, Origin};
use crate::error::{LoadError, Place};
use crate::files::Folder;
use crate::options::LoadOptions;
use roxmltree::{Node, ParsingOptions};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Most bytes of a scene file and all that it includes, and most bytes that `$parameters` may add up to.
const MAX_XML_BYTES: u64 = 64 << 20;
/// Most elements, texts and comments of a file, and most elements of all files together.
const MAX_NODES: u32 = 1 << 20;
/// How deep elements may nest, and how deep files may include each other.
const MAX_DEPTH: u32 = 32;
/// Most files.
const MAX_FILES: u64 = 1000;
/// Most attributes of an element.
const MAX_ATTRIBUTES: usize = 64;
/// Most mentions of XML name spaces, of which Mitsuba has none.
const MAX_NAMESPACES: usize = 16;
/// Longest name of a `$parameter`.
const MAX_PARAMETER: usize = 64;

/// A scene file.
#[derive(Debug)]
pub(super) struct Document {
    /// The scene file, and the files that it includes.
    pub(super) files: Vec<PathBuf>,
    /// The first number of its version is below 2.
    pub(super) old: bool,
    /// The `scene` element.
    pub(super) root: Element,
    /// Where the files are that it names.
    pub(super) folder: Folder,
}

impl Document {
    /// Parses the scene file in `path`.
    ///
    /// # Errors
    /// [`LoadError`] if a file cannot be read, is not XML, not a scene, of an unknown version, too large, or
    /// nested too deeply.
    pub(super) fn read(path: &Path, options: &LoadOptions) -> Result<Self, LoadError> {
        let mut builder = Builder {
            files: vec![],
            folder: Folder::of(path, options.root.as_deref(), options.identity()),
            parameters: options.parameters.clone().into_iter().collect(),
            bytes: 0,
            added: 0,
            elements: 0,
        };
        let (old, root) = builder.file(path, &Place::file(path), 0)?;
        if root.tag != "scene" {
            return Err(not_a_scene(path));
        }
        Ok(Self { files: builder.files, old, root, folder: builder.folder })
    }

    /// Where `element` is.
    pub(super) fn place(&self, element: &Element) -> Place {
        Place::part(&self.files[element.origin.file], format_args!("line {}", element.origin.line))
    }

    /// The scene file.
    pub(super) fn path(&self) -> &Path {
        &self.files[0]
    }
}

fn not_a_scene(path: &Path) -> LoadError {
    Place::file(path).bad("expected <scene version=\"…\"> of Mitsuba")
}

/// Builds the tree file by file.
struct Builder {
    files: Vec<PathBuf>,
    folder: Folder,
    /// Given by the caller, or by `default` elements so far. The first value of a name stays.
    parameters: HashMap<String, String>,
    /// Bytes read so far.
    bytes: u64,
    /// Bytes that parameters have become.
    added: u64,
    elements: usize,
}

/// What of a file its elements need.
struct Source<'a> {
    path: &'a Path,
    file: usize,
    old: bool,
    lines: Lines,
}

impl Builder {
    /// The root element of the file in `path`, which `place` names, and whether its version is below 2.
    fn file(&mut self, path: &Path, place: &Place, depth: u32) -> Result<(bool, Element), LoadError> {
        place.clone().at_most("files", self.files.len() as u64 + 1, MAX_FILES)?;
        let bytes = self.folder.read(path, MAX_XML_BYTES - self.bytes, place)?;
        self.bytes += bytes.len() as u64;
        let bad = |what: String| Place::file(path).bad(what);
        let text = std::str::from_utf8(&bytes).map_err(|e| bad(format!("the file is not UTF-8: {e}")))?;
        check_attributes(text, path)?;
        // Without a DTD, entities cannot multiply
        let options =
            ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        let tree = roxmltree::Document::parse_with_options(text, options).map_err(|e| {
            let place = Place::part(path, format_args!("line {}", e.pos().row));
            place.bad(format!("the XML is broken: {e}"))
        })?;

        let root = tree.root_element();
        let version = root.attribute("version").unwrap_or_default();
        let major = version.split('.').next().and_then(|major| major.parse::<u32>().ok());
        let old = match (root.tag_name().name(), major) {
            ("scene", Some(0 | 1)) => true,
            ("scene", Some(2 | 3)) => false,
            ("scene", Some(_)) => {
                return Err(Place::file(path).unsupported(format!("version {version} of Mitsuba's scenes")));
            }
            ("scene", None) => return Err(not_a_scene(path)),
            // Included: a single element
            _ => false,
        };
        let file = self.files.len();
        self.files.push(path.to_owned());
        let source = Source { path, file, old, lines: Lines::of(text) };
        Ok((old, self.element(root, &source, depth)?))
    }

    /// An element, `depth` levels down, and what is in it.
    fn element(&mut self, node: Node<'_, '_>, source: &Source<'_>, depth: u32) -> Result<Element, LoadError> {
        let origin = Origin { file: source.file, line: source.lines.at(node.range().start) };
        let place = Place::part(source.path, format_args!("line {}", origin.line));
        place.clone().at_most("levels of elements", u64::from(depth), u64::from(MAX_DEPTH))?;
        self.elements += 1;
        place.clone().at_most("elements", self.elements as u64, u64::from(MAX_NODES))?;
        let mut element = Element::new(node.tag_name().name().to_owned(), origin, self.elements - 1);
        for attribute in node.attributes() {
            let (mut value, unset) = self.substitute(attribute.value(), &place)?;
            if source.old && attribute.name() == "name" {
                value = snake_case(&value);
            }
            element.unset = element.unset.or(unset);
            element.attributes.push((attribute.name().to_owned(), value));
        }
        match element.tag.as_str() {
            "default" => self.default(&element, node.attribute("name"), &place)?,
            "path" => self.search_path(&element, &place)?,
            _ => {}
        }
        for child in node.children().filter(Node::is_element) {
            let child = self.element(child, source, depth + 1)?;
            if child.tag == "include" {
                self.include(&child, source, &mut element.children, depth + 1)?;
            } else {
                element.children.push(child);
            }
        }
        Ok(element)
    }

    /// Notes the value of a parameter, unless it has one.
    fn default(&mut self, element: &Element, name: Option<&str>, place: &Place) -> Result<(), LoadError> {
        element.irrelevant();
        let (Some(name), Some(value)) = (name, element.attribute("value")) else {
            return Err(place.clone().bad("a <default> needs a name and a value"));
        };
        place.clone().at_most("bytes in the name of a parameter", name.len() as u64, MAX_PARAMETER as u64)?;
        if element.unset.is_none() {
            self.parameters.entry(name.to_owned()).or_insert_with(|| value.to_owned());
        }
        Ok(())
    }

    /// Notes a folder in which to look for files.
    fn search_path(&mut self, element: &Element, place: &Place) -> Result<(), LoadError> {
        element.irrelevant();
        let value = element.attribute("value").ok_or_else(|| place.clone().bad("a <path> needs a value"))?;
        self.folder.search(value, place)
    }

    /// Adds what is in the file that `element` names to `children`.
    fn include(
        &mut self,
        element: &Element,
        source: &Source<'_>,
        children: &mut Vec<Element>,
        depth: u32,
    ) -> Result<(), LoadError> {
        let place = Place::part(source.path, format_args!("line {}", element.origin.line));
        if let Some(name) = &element.unset {
            return Err(place.bad(unset(name)));
        }
        let name = element.attribute("filename");
        let name = name.ok_or_else(|| place.clone().bad("an <include> needs a `filename`"))?;
        let path = self.folder.find(name, &place)?;
        let (_, root) = self.file(&path, &place, depth)?;
        if root.tag == "scene" {
            children.extend(root.children);
        } else {
            children.push(root);
        }
        Ok(())
    }

    /// Puts in the values of `$parameters`, of two names that fit the longer one. The second result is the
    /// first name without a value.
    fn substitute(&mut self, text: &str, place: &Place) -> Result<(String, Option<String>), LoadError> {
        let mut pieces = text.split('$');
        let mut result = pieces.next().unwrap_or_default().to_owned();
        let mut unset = None;
        for piece in pieces {
            let ends = (1..=piece.len().min(MAX_PARAMETER)).rev().filter(|end| piece.is_char_boundary(*end));
            let found = ends.into_iter().find_map(|end| Some((end, self.parameters.get(&piece[..end])?)));
            let Some((end, value)) = found else {
                let is_name = |c: char| c.is_alphanumeric() || c == '_';
                let end = piece.find(|c| !is_name(c)).unwrap_or(piece.len());
                unset.get_or_insert_with(|| piece[..end].to_owned());
                result.push('$');
                result += piece;
                continue;
            };
            self.added += value.len() as u64;
            place.clone().at_most("bytes in parameters", self.added, MAX_XML_BYTES)?;
            result += value;
            result += &piece[end..];
        }
        Ok((result, unset))
    }
}

/// What is wrong with a parameter without a value.
pub(super) fn unset(name: &str) -> String {
    format!("`${name}` has no value: no <default> gives it one, and it was not set by `-D {name}=…`")
}

/// Checks what the parser takes quadratic time for: attributes of one element, and name spaces.
fn check_attributes(text: &str, path: &Path) -> Result<(), LoadError> {
    let place = Place::file(path);
    let namespaces = text.matches("xmlns").take(MAX_NAMESPACES + 1).count();
    place.clone().at_most("name spaces", namespaces as u64, MAX_NAMESPACES as u64)?;
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
