//! The words of a pbrt file.

use crate::error::{LoadError, Place};
use std::path::Path;

/// A word, and the line it is on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Token {
    pub(super) kind: Kind,
    pub(super) line: u32,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// A directive, a number, `true` or `false`.
    Word(String),
    Text(String),
    Open,
    Close,
}

pub(super) struct Tokens<'a> {
    pub(super) path: &'a Path,
    rest: &'a str,
    line: u32,
    peeked: Option<Token>,
}

impl<'a> Tokens<'a> {
    pub(super) fn new(path: &'a Path, text: &'a str) -> Self {
        Self { path, rest: text, line: 1, peeked: None }
    }

    /// The next token, which stays.
    pub(super) fn peek(&mut self) -> Result<Option<&Token>, LoadError> {
        if self.peeked.is_none() {
            self.peeked = self.read()?;
        }
        Ok(self.peeked.as_ref())
    }

    pub(super) fn next(&mut self) -> Result<Option<Token>, LoadError> {
        match self.peeked.take() {
            Some(token) => Ok(Some(token)),
            None => self.read(),
        }
    }

    fn read(&mut self) -> Result<Option<Token>, LoadError> {
        self.skip_space();
        let line = self.line;
        let Some(first) = self.rest.chars().next() else { return Ok(None) };
        let kind = match first {
            '[' | ']' => {
                self.rest = &self.rest[1..];
                if first == '[' { Kind::Open } else { Kind::Close }
            }
            '"' => {
                let body = &self.rest[1..];
                let unended = || self.place(line).bad("a quote does not end");
                let end = body.find('"').ok_or_else(unended)?;
                self.line += lines(&body[..end]);
                self.rest = &body[end + 1..];
                Kind::Text(body[..end].to_owned())
            }
            _ => {
                let ends = |c: char| c.is_whitespace() || matches!(c, '"' | '[' | ']' | '#' | ',');
                let end = self.rest.find(ends).unwrap_or(self.rest.len());
                let (word, rest) = self.rest.split_at(end);
                self.rest = rest;
                Kind::Word(word.to_owned())
            }
        };
        Ok(Some(Token { kind, line }))
    }

    pub(super) fn place(&self, line: u32) -> Place {
        Place::line(self.path, line)
    }

    fn skip_space(&mut self) {
        loop {
            // Exporters of version 3 put commas between numbers
            let trimmed = self.rest.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
            self.line += lines(&self.rest[..self.rest.len() - trimmed.len()]);
            self.rest = trimmed;
            if !self.rest.starts_with('#') {
                return;
            }
            self.rest = &self.rest[self.rest.find(['\n', '\r']).unwrap_or(self.rest.len())..];
        }
    }
}

/// How many lines end in a text: by \n, \r\n, or a \r alone, as on old Macs.
fn lines(text: &str) -> u32 {
    let alone = text.matches('\r').count() - text.matches("\r\n").count();
    (text.matches('\n').count() + alone) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_split_and_counted() {
        let text = "Shape # a \"comment\"\n\"point P\"[0, 1e-3,]\n\n\"a\nb\" end";
        let path = Path::new("a.pbrt");
        let mut tokens = Tokens::new(path, text);
        let mut all = Vec::new();
        while let Some(token) = tokens.next().unwrap() {
            all.push((token.kind, token.line));
        }
        let word = |word: &str| Kind::Word(word.to_owned());
        let quoted = |text: &str| Kind::Text(text.to_owned());
        assert_eq!(
            all,
            [
                (word("Shape"), 1),
                (quoted("point P"), 2),
                (Kind::Open, 2),
                (word("0"), 2),
                (word("1e-3"), 2),
                (Kind::Close, 2),
                (quoted("a\nb"), 4),
                (word("end"), 5),
            ]
        );
        let error = Tokens::new(path, "\n\"open").next().unwrap_err();
        assert_eq!(error.to_string(), "a.pbrt: line 2: a quote does not end");
        // A comment ends with its line, however that ends
        let mut tokens = Tokens::new(path, "# a\rShape # b\r\n\"x\"");
        assert_eq!(tokens.next().unwrap(), Some(Token { kind: word("Shape"), line: 2 }));
        assert_eq!(tokens.next().unwrap(), Some(Token { kind: quoted("x"), line: 3 }));
    }
}
