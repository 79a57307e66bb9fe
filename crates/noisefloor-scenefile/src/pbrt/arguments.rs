//! What follows the name of a directive.

use super::params::{self, Params, number};
use super::tokens::{Kind, Tokens};
use crate::error::{LoadError, Place};

/// The tokens behind a directive, and where it stands.
pub(super) struct Arguments<'a, 't> {
    tokens: &'a mut Tokens<'t>,
    line: u32,
    directive: &'a str,
}

impl<'a, 't> Arguments<'a, 't> {
    pub(super) fn new(tokens: &'a mut Tokens<'t>, line: u32, directive: &'a str) -> Self {
        Self { tokens, line, directive }
    }

    pub(super) fn place(&self) -> Place {
        self.tokens.place(self.line)
    }

    /// A name in quotes.
    pub(super) fn text(&mut self) -> Result<String, LoadError> {
        let found = self.skip()?;
        found.ok_or_else(|| self.place().bad(format!("{} needs a name in quotes", self.directive)))
    }

    /// The next token, if it is a text in quotes, or nothing.
    fn skip(&mut self) -> Result<Option<String>, LoadError> {
        let token = self.tokens.next()?;
        Ok(token.and_then(|token| if let Kind::Text(text) = token.kind { Some(text) } else { None }))
    }

    /// All names in quotes that come next, at least one.
    pub(super) fn texts(&mut self) -> Result<Vec<String>, LoadError> {
        let mut names = vec![self.text()?];
        while let Some(Kind::Text(_)) = self.tokens.peek()?.map(|token| &token.kind) {
            names.push(self.text()?);
        }
        Ok(names)
    }

    /// Passes over one token.
    pub(super) fn pass(&mut self) -> Result<(), LoadError> {
        self.skip().map(drop)
    }

    /// Passes over all up to the next directive, of which nothing is known but that it begins with a capital.
    pub(super) fn pass_all(&mut self) -> Result<(), LoadError> {
        let mut depth = 0u64;
        while let Some(token) = self.tokens.peek()? {
            match &token.kind {
                Kind::Word(word) if depth == 0 && word.starts_with(|c: char| c.is_ascii_uppercase()) => break,
                Kind::Open => depth += 1,
                Kind::Close => depth = depth.saturating_sub(1),
                Kind::Word(_) | Kind::Text(_) => {}
            }
            self.tokens.next()?;
        }
        Ok(())
    }

    /// Passes over an option: a declaration or a name in quotes, and its values. Returns its name.
    pub(super) fn option(&mut self) -> Result<String, LoadError> {
        let declaration = self.text()?;
        let here = self.place();
        params::values(self.tokens, &here, "Option")?;
        Ok(declaration.split_ascii_whitespace().next_back().unwrap_or_default().to_owned())
    }

    pub(super) fn params(&mut self) -> Result<Params, LoadError> {
        params::read(self.tokens, self.line)
    }

    /// As many numbers, bare or in brackets.
    pub(super) fn numbers<const N: usize>(&mut self) -> Result<[f64; N], LoadError> {
        let (mut found, mut count, mut bracket) = ([0.0; N], 0, false);
        while count < N || bracket {
            let token = self.tokens.next()?;
            let here = self.tokens.place(token.as_ref().map_or(self.line, |token| token.line));
            match token.map(|token| token.kind) {
                Some(Kind::Open) if count == 0 && !bracket => bracket = true,
                Some(Kind::Close) if bracket && count == N => bracket = false,
                Some(Kind::Word(word)) if count < N => {
                    found[count] = number(&word, &here)?;
                    count += 1;
                }
                _ => return Err(here.bad(format!("expected {N} numbers"))),
            }
        }
        Ok(found)
    }
}
