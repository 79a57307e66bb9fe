//! Tags of XML, as pugixml reads them for Mitsuba: more than XML allows.
//!
//! Comments may have `--` in them, an `&` may stand alone, an attribute may come twice (the first counts),
//! and a DOCTYPE is passed over with all that it defines, so that no entity can multiply. Text between tags
//! says nothing in a scene. roxmltree 0.21, which was used before, refuses all of it, as it should.

use crate::error::{LoadError, Place};
use std::path::Path;

const MAX_ATTRIBUTES: u64 = 64;

/// The begin of an element.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Start {
    pub(super) name: String,
    pub(super) attributes: Vec<(String, String)>,
    /// From 1.
    pub(super) line: u32,
    /// Whether it ends here, too.
    pub(super) empty: bool,
}

impl Start {
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

#[derive(Debug, PartialEq, Eq)]
pub(super) enum Tag {
    Start(Start),
    End(String),
}

#[derive(Debug)]
pub(super) struct Tags<'a> {
    path: &'a Path,
    rest: &'a str,
    line: u32,
}

impl<'a> Tags<'a> {
    pub(super) fn new(text: &'a str, path: &'a Path) -> Self {
        Self { path, rest: text, line: 1 }
    }

    /// The XML is broken on the current line.
    pub(super) fn broken(&self, what: impl std::fmt::Display) -> LoadError {
        Place::line(self.path, self.line).bad(format_args!("the XML is broken: {what}"))
    }

    /// The next tag; none at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<Tag>, LoadError> {
        loop {
            let Some(at) = self.rest.find('<') else {
                self.take(self.rest.len());
                return Ok(None);
            };
            self.take(at);
            for (begin, end) in [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")] {
                if let Some(inside) = self.rest.strip_prefix(begin) {
                    let ends = || self.broken(format_args!("`{begin}` without `{end}`"));
                    let length = begin.len() + inside.find(end).ok_or_else(ends)? + end.len();
                    self.take(length);
                }
            }
            if self.rest.starts_with("<!") {
                let length = declaration(self.rest).ok_or_else(|| self.broken("`<!` without `>`"))?;
                self.take(length);
            } else if self.rest.starts_with("</") {
                self.take(2);
                let name = self.name()?;
                self.skip_space();
                self.expect(">")?;
                return Ok(Some(Tag::End(name)));
            } else if self.rest.starts_with('<') {
                return self.start().map(|start| Some(Tag::Start(start)));
            }
        }
    }

    fn start(&mut self) -> Result<Start, LoadError> {
        let line = self.line;
        self.take(1);
        let name = self.name()?;
        let mut attributes: Vec<(String, String)> = Vec::new();
        loop {
            self.skip_space();
            if self.rest.starts_with("/>") || self.rest.starts_with('>') {
                let empty = self.rest.starts_with('/');
                self.take(1 + usize::from(empty));
                return Ok(Start { name, attributes, line, empty });
            }
            let key = self.name()?;
            self.skip_space();
            self.expect("=")?;
            self.skip_space();
            let quote = self.rest.chars().next().filter(|c| matches!(c, '"' | '\''));
            let quote =
                quote.ok_or_else(|| self.broken(format_args!("the value of `{key}` has no quotes")))?;
            let ends = || self.broken(format_args!("the value of `{key}` does not end"));
            let length = self.rest[1..].find(quote).ok_or_else(ends)?;
            let value = unescaped(&self.rest[1..=length]);
            self.take(length + 2);
            let place = Place::line(self.path, line);
            place.at_most("attributes of one element", attributes.len() as u64 + 1, MAX_ATTRIBUTES)?;
            if !attributes.iter().any(|(known, _)| *known == key) {
                attributes.push((key, value));
            }
        }
    }

    /// The name of an element or attribute.
    fn name(&mut self) -> Result<String, LoadError> {
        let ends = |c: char| c.is_whitespace() || matches!(c, '/' | '>' | '<' | '=' | '"' | '\'' | '\0');
        let length = self.rest.find(ends).unwrap_or(self.rest.len());
        if length == 0 {
            return Err(self.broken("a name is missing"));
        }
        let name = self.rest[..length].to_owned();
        self.take(length);
        Ok(name)
    }

    fn expect(&mut self, what: &str) -> Result<(), LoadError> {
        if !self.rest.starts_with(what) {
            return Err(self.broken(format_args!("expected `{what}`")));
        }
        self.take(what.len());
        Ok(())
    }

    fn skip_space(&mut self) {
        self.take(self.rest.len() - self.rest.trim_start().len());
    }

    /// Passes over so many bytes, and counts their lines.
    fn take(&mut self, bytes: usize) {
        let (passed, rest) = self.rest.split_at(bytes);
        let alone = passed.matches('\r').count() - passed.matches("\r\n").count();
        self.line += (passed.matches('\n').count() + alone) as u32;
        self.rest = rest;
    }
}

/// The length of a DOCTYPE: up to the `>` that is in no quotes and no declaration in it.
fn declaration(text: &str) -> Option<usize> {
    let (mut depth, mut quote) = (0u32, None);
    for (at, c) in text.char_indices() {
        match (quote, c) {
            (Some(open), _) if open != c => {}
            (Some(_), _) => quote = None,
            (None, '"' | '\'') => quote = Some(c),
            (None, '<') => depth += 1,
            (None, '>') if depth <= 1 => return Some(at + 1),
            (None, '>') => depth -= 1,
            _ => {}
        }
    }
    None
}

/// A value with its entities and white space as XML has them. What is no entity stays.
fn unescaped(value: &str) -> String {
    let mut result = String::with_capacity(value.len());
    let mut rest = value;
    while let Some(at) = rest.find('&') {
        result += &rest[..at];
        let entity = rest[at + 1..].split_once(';').and_then(|(name, _)| Some((name, entity(name)?)));
        match entity {
            Some((name, c)) => {
                result.push(c);
                rest = &rest[at + name.len() + 2..];
            }
            None => {
                result.push('&');
                rest = &rest[at + 1..];
            }
        }
    }
    result += rest;
    if result.contains(['\n', '\r', '\t']) { result.replace(['\n', '\r', '\t'], " ") } else { result }
}

fn entity(name: &str) -> Option<char> {
    match name {
        "lt" => Some('<'),
        "gt" => Some('>'),
        "amp" => Some('&'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => {
            let number = name.strip_prefix('#').filter(|number| number.len() <= 8)?;
            let code = match number.strip_prefix('x') {
                Some(hex) => u32::from_str_radix(hex, 16),
                None => number.parse(),
            };
            char::from_u32(code.ok()?)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Tag>, String> {
        let mut tags = Tags::new(text, Path::new("a.xml"));
        let mut all = Vec::new();
        while let Some(tag) = tags.next().map_err(|e| e.to_string())? {
            all.push(tag);
        }
        Ok(all)
    }

    fn start(name: &str, attributes: &[(&str, &str)], line: u32, empty: bool) -> Tag {
        let attributes = attributes.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        Tag::Start(Start { name: name.to_owned(), attributes, line, empty })
    }

    #[test]
    fn tags_have_lines_and_attributes() {
        let text = "\n<?xml version='1.0'?><!-- a -- b --->\n<!DOCTYPE s [<!ENTITY e \">\">\n]><a x = \"1 &lt; 2\"\n\
            y='&#65;&#x42;&e;&' x='3'><b/>text<![CDATA[<c>]]></a >\0";
        let a = start("a", &[("x", "1 < 2"), ("y", "AB&e;&")], 4, false);
        assert_eq!(read(text).unwrap(), [a, start("b", &[], 5, true), Tag::End("a".to_owned())]);
        assert_eq!(read("\r\r<a\r/>").unwrap(), [start("a", &[], 3, true)]);
    }

    #[test]
    fn what_is_broken_says_its_line() {
        for (text, want) in [
            ("<a>\n<!-- b", "line 2: the XML is broken: `<!--` without `-->`"),
            ("<a b>", "expected `=`"),
            ("<a b=c>", "the value of `b` has no quotes"),
            ("<a b='c>", "the value of `b` does not end"),
            ("<a", "a name is missing"),
            ("<>", "a name is missing"),
            ("<!x [", "`<!` without `>`"),
            ("</a b>", "expected `>`"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(want), "{text}: {error}");
        }
    }
}
