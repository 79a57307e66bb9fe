//! A scene file and the files that it includes, as one tree of elements.

use super::markup::{Start, Tag, Tags};
use super::xml::{Attribute, Element, Origin};
use crate::error::{LoadError, Place};
use crate::files;
use crate::load::Load;
use crate::options::LoadOptions;
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Most bytes of a scene file and all that it includes, and most bytes that `$parameters` may add up to.
const MAX_XML_BYTES: u64 = 64 << 20;
/// Most elements of all files together.
const MAX_ELEMENTS: u64 = 1 << 20;
/// How deep elements may nest, and how deep files may include each other.
const MAX_DEPTH: u32 = 32;
const MAX_FILES: u64 = 1000;
/// Longest name of a `$parameter`.
const MAX_PARAMETER: usize = 64;

#[derive(Debug)]
pub(super) struct Document {
    /// The scene file, and the files that it includes.
    pub(super) files: Vec<PathBuf>,
    /// The first number of its version is below 2.
    pub(super) old: bool,
    pub(super) root: Element,
    pub(super) load: Load,
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
            load: Load::new(path, options.root.as_deref(), options.identity()),
            parameters: options.parameters.clone().into_iter().collect(),
            bytes: 0,
            added: 0,
            elements: 0,
        };
        let (old, root) = builder.file(path, &Place::file(path), 0)?;
        if root.tag != "scene" {
            return Err(not_a_scene(path));
        }
        Ok(Self { files: builder.files, old, root, load: builder.load })
    }

    pub(super) fn place(&self, element: &Element) -> Place {
        Place::line(&self.files[element.origin.file], element.origin.line)
    }
}

fn not_a_scene(path: &Path) -> LoadError {
    Place::file(path).bad("expected <scene version=\"…\"> of Mitsuba")
}

/// Builds the tree file by file.
struct Builder {
    files: Vec<PathBuf>,
    load: Load,
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
}

impl Builder {
    /// The root element of the file in `path`, which `place` names, and whether its version is below 2.
    fn file(&mut self, path: &Path, place: &Place, depth: u32) -> Result<(bool, Element), LoadError> {
        place.at_most("files", self.files.len() as u64 + 1, MAX_FILES)?;
        let bytes = self.load.folder.read(path, MAX_XML_BYTES - self.bytes, place)?;
        self.bytes += bytes.len() as u64;
        let text = text(&bytes);
        let mut tags = Tags::new(&text, path);
        let Some(Tag::Start(root)) = tags.next()? else {
            return Err(tags.broken("it has no element"));
        };
        let version = root.attribute("version").unwrap_or_default();
        let major = version.split('.').next().and_then(|major| major.parse::<u32>().ok());
        let old = match (root.name.as_str(), major) {
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
        let source = Source { path, file, old };
        let root = self.element(root, &mut tags, &source, depth)?;
        match tags.next()? {
            None => Ok((old, root)),
            Some(_) => Err(tags.broken("something follows its last element")),
        }
    }

    /// An element, `depth` levels down, and what is in it.
    fn element(
        &mut self,
        start: Start,
        tags: &mut Tags<'_>,
        source: &Source<'_>,
        depth: u32,
    ) -> Result<Element, LoadError> {
        let origin = Origin { file: source.file, line: start.line };
        let place = Place::line(source.path, origin.line);
        place.at_most("levels of elements", u64::from(depth), u64::from(MAX_DEPTH))?;
        self.elements += 1;
        place.at_most("elements", self.elements as u64, MAX_ELEMENTS)?;
        let mut element = Element::new(start.name.clone(), origin, self.elements - 1);
        for (name, value) in &start.attributes {
            let (mut value, unset) = self.substitute(value, &place)?;
            if source.old && name == "name" {
                value = snake_case(&value);
            }
            element.unset = element.unset.or(unset);
            element.attributes.push(Attribute::new(name.clone(), value));
        }
        match element.tag.as_str() {
            "default" => self.default(&element, start.attribute("name"), &place)?,
            "path" => self.search_path(&element, &place)?,
            _ => {}
        }
        if start.empty {
            return Ok(element);
        }
        loop {
            match tags.next()? {
                Some(Tag::Start(child)) => {
                    let child = self.element(child, tags, source, depth + 1)?;
                    if child.tag == "include" {
                        self.include(&child, source, &mut element.children, depth + 1)?;
                    } else {
                        element.children.push(child);
                    }
                }
                Some(Tag::End(name)) if name == start.name => return Ok(element),
                Some(Tag::End(name)) => {
                    return Err(tags.broken(format_args!("</{name}> ends <{}>", start.name)));
                }
                None => return Err(tags.broken(format_args!("<{}> does not end", start.name))),
            }
        }
    }

    /// Notes the value of a parameter, unless it has one.
    fn default(&mut self, element: &Element, name: Option<&str>, place: &Place) -> Result<(), LoadError> {
        element.irrelevant();
        let (Some(name), Some(value)) = (name, element.attribute("value")) else {
            return Err(place.bad("a <default> needs a name and a value"));
        };
        place.at_most("bytes in the name of a parameter", name.len() as u64, MAX_PARAMETER as u64)?;
        if element.unset.is_none() {
            self.parameters.entry(name.to_owned()).or_insert_with(|| value.to_owned());
        }
        Ok(())
    }

    /// Notes a folder in which to look for files.
    fn search_path(&mut self, element: &Element, place: &Place) -> Result<(), LoadError> {
        element.irrelevant();
        let value = element.attribute("value").ok_or_else(|| place.bad("a <path> needs a value"))?;
        self.load.folder.search(value, place)
    }

    /// Adds what is in the file that `element` names to `children`.
    fn include(
        &mut self,
        element: &Element,
        source: &Source<'_>,
        children: &mut Vec<Element>,
        depth: u32,
    ) -> Result<(), LoadError> {
        let place = Place::line(source.path, element.origin.line);
        if let Some(name) = &element.unset {
            return Err(place.bad(unset(name)));
        }
        let name = element.attribute("filename");
        let name = name.ok_or_else(|| place.bad("an <include> needs a `filename`"))?;
        let path = self.load.folder.find(name, &place)?;
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
            place.at_most("bytes in parameters", self.added, MAX_XML_BYTES)?;
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

/// The text of a file. What says that it is in Latin-1 is, though it may look like UTF-8.
fn text(bytes: &[u8]) -> Cow<'_, str> {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).to_ascii_lowercase();
    let declared = head.split_once("encoding").and_then(|(_, rest)| rest.split(['"', '\'']).nth(1));
    if matches!(declared, Some("latin1" | "iso-8859-1")) {
        return bytes.iter().map(|b| *b as char).collect::<String>().into();
    }
    files::text(bytes)
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
