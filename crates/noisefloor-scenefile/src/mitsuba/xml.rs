//! The elements of a scene file, each with its line and whether anything has read it.

use std::cell::Cell;

/// Whether an element has been read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    No,
    Read,
    /// It makes no difference here, nor does anything in it.
    Irrelevant,
}

/// An attribute, and whether anything has read it.
#[derive(Debug)]
pub(super) struct Attribute {
    name: String,
    value: String,
    read: Cell<bool>,
}

impl Attribute {
    pub(super) fn new(name: String, value: String) -> Self {
        Self { name, value, read: Cell::new(false) }
    }
}

/// Attributes that only say what an element is, or what it is called.
const NAMES: [&str; 4] = ["id", "name", "type", "version"];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin {
    /// Index of its file: the scene itself is 0, files that it includes follow.
    pub(super) file: usize,
    /// Line in that file, from 1.
    pub(super) line: u32,
}

/// An element. Names are those of Mitsuba 3, `$parameters` have their values.
#[derive(Debug)]
pub(super) struct Element {
    /// `shape`, `float`, …
    pub(super) tag: String,
    pub(super) origin: Origin,
    /// Elements are numbered in the order in which they are parsed.
    pub(super) serial: usize,
    pub(super) children: Vec<Element>,
    pub(super) attributes: Vec<Attribute>,
    /// A `$parameter` in its attributes that has no value.
    pub(super) unset: Option<String>,
    seen: Cell<Seen>,
}

impl Element {
    /// An element with nothing in it, not yet read.
    pub(super) fn new(tag: String, origin: Origin, serial: usize) -> Self {
        let (children, attributes) = (vec![], vec![]);
        Self { tag, origin, serial, children, attributes, unset: None, seen: Cell::new(Seen::No) }
    }

    /// The attribute called `name`, which is now read.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|attribute| attribute.name == name)?;
        found.read.set(true);
        Some(&found.value)
    }

    /// Attributes that nobody has read, but for those that are names.
    pub(super) fn unread_attributes(&self) -> impl Iterator<Item = &str> {
        let unread = self.attributes.iter().filter(|attribute| !attribute.read.get());
        unread.map(|attribute| attribute.name.as_str()).filter(|name| !NAMES.contains(name))
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

    /// Whether an element called `name` is in it.
    pub(super) fn has(&self, name: &str) -> bool {
        self.children.iter().any(|child| child.attribute("name") == Some(name))
    }

    /// Elements of one tag in it, which are now read.
    pub(super) fn all<'a>(&'a self, tag: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |child| child.tag == tag).inspect(|child| child.read())
    }

    /// Marks it as read.
    pub(super) fn read(&self) {
        self.seen.set(Seen::Read);
    }

    /// Marks it, and all in it, as making no difference to the picture here.
    pub(super) fn irrelevant(&self) {
        self.seen.set(Seen::Irrelevant);
    }

    /// Marks the elements of these names in it as making no difference.
    pub(super) fn ignore(&self, names: &[&str]) {
        let ignored = |child: &&Element| child.attribute("name").is_some_and(|name| names.contains(&name));
        self.children.iter().filter(ignored).for_each(Element::irrelevant);
    }

    /// Tells `visit` of the elements below this one, and whether they were read. An element that is not read
    /// stands for all in it.
    pub(super) fn visit<'a>(&'a self, visit: &mut impl FnMut(&'a Element, bool)) {
        for child in &self.children {
            match child.seen.get() {
                Seen::No => visit(child, false),
                Seen::Read => {
                    visit(child, true);
                    child.visit(visit);
                }
                Seen::Irrelevant => {}
            }
        }
    }

    /// The first element from here on that has been read although a `$parameter` of it has no value.
    pub(super) fn read_unset(&self) -> Option<&Element> {
        match self.seen.get() {
            Seen::Read if self.unset.is_some() => Some(self),
            Seen::Read => self.children.iter().find_map(Element::read_unset),
            Seen::No | Seen::Irrelevant => None,
        }
    }

    /// Collects all elements from here on that have an `id`.
    pub(super) fn identified<'a>(&'a self, found: &mut Vec<(&'a str, &'a Element)>) {
        if let Some(id) = self.attribute("id").filter(|_| self.tag != "ref" && self.tag != "alias") {
            found.push((id, self));
        }
        self.children.iter().for_each(|child| child.identified(found));
    }

    /// How messages call it.
    pub(super) fn label(&self) -> String {
        self.tag_with(&["type", "name", "id"])
    }

    /// How messages call it where its id does not matter.
    pub(super) fn species(&self) -> String {
        self.tag_with(&["type", "name"])
    }

    fn tag_with(&self, keys: &[&str]) -> String {
        let values = keys.iter().filter_map(|key| Some(format!(" {key}=\"{}\"", self.attribute(key)?)));
        format!("<{}{}>", self.tag, values.collect::<String>())
    }
}
