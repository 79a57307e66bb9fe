//! Parameters of a directive: `"float fov" [40]`.

use super::tokens::{Kind, Token, Tokens};
use crate::colour::ColourSpace;
use crate::error::{LoadError, Place};
use std::cell::Cell;
use std::collections::HashMap;
use std::rc::Rc;

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
    Switches(Vec<bool>),
}

#[derive(Clone, Debug)]
pub(super) struct Param {
    /// `float`, `rgb`, `texture`, …
    pub(super) kind: String,
    pub(super) name: String,
    pub(super) values: Rc<Values>,
    /// Of its numbers, if they are a colour.
    pub(super) space: ColourSpace,
    used: Cell<bool>,
}

/// All parameters of a directive, and where that is.
#[derive(Clone, Debug)]
pub(super) struct Params {
    pub(super) place: Place,
    /// Of colours that none of them gives.
    pub(super) space: ColourSpace,
    all: Vec<Param>,
}

/// Reads the parameters that follow. `line` is that of their directive.
pub(super) fn read(tokens: &mut Tokens<'_>, line: u32) -> Result<Params, LoadError> {
    let place = tokens.place(line);
    let mut all = Vec::new();
    while let Some(Token { kind: Kind::Text(declaration), line }) = tokens.peek()?.cloned() {
        let here = tokens.place(line);
        let mut words = declaration.split_ascii_whitespace();
        let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
            return Err(here.bad(format!("`{declaration}` is not a type and a name")));
        };
        let (kind, name) = (kind.to_owned(), name.to_owned());
        tokens.next()?;
        let values = values(tokens, &here, &name)?;
        let space = ColourSpace::default();
        all.push(Param { kind, name, values: Rc::new(values), space, used: Cell::new(false) });
    }
    Ok(Params { place, space: ColourSpace::default(), all })
}

/// One value, or some in brackets.
pub(super) fn values(tokens: &mut Tokens<'_>, here: &Place, name: &str) -> Result<Values, LoadError> {
    let (mut numbers, mut texts, mut switches) = (vec![], vec![], vec![]);
    let mut bracket = false;
    loop {
        let Some(token) = tokens.next()? else {
            return Err(here.bad(format!("the values of `{name}` do not end")));
        };
        match token.kind {
            Kind::Open if !bracket => {
                bracket = true;
                continue;
            }
            Kind::Open => return Err(tokens.place(token.line).bad("a bracket in a bracket")),
            Kind::Close if bracket => break,
            Kind::Close => return Err(tokens.place(token.line).bad("a `]` without a `[`")),
            Kind::Text(text) => match text.as_str() {
                "true" | "false" => switches.push(text == "true"),
                _ => texts.push(text),
            },
            Kind::Word(word) => match word.as_str() {
                "true" | "false" => switches.push(word == "true"),
                _ => numbers.push(number(&word, &tokens.place(token.line))?),
            },
        }
        if !bracket {
            break;
        }
    }
    match (numbers.is_empty(), texts.is_empty(), switches.is_empty()) {
        (_, true, true) => Ok(Values::Numbers(numbers)),
        (true, false, true) => Ok(Values::Texts(texts)),
        (true, true, false) => Ok(Values::Switches(switches)),
        _ => Err(here.bad(format!("`{name}` mixes numbers, texts and switches"))),
    }
}

/// A finite number.
pub(super) fn number(word: &str, place: &Place) -> Result<f64, LoadError> {
    let number = word.parse().ok().filter(|x: &f64| x.is_finite());
    number.ok_or_else(|| place.bad(format!("`{word}` is not a finite number")))
}

impl Params {
    /// Those of `all` that texture parameters name.
    pub(super) fn named_in<T: Clone>(&self, all: &HashMap<String, T>) -> HashMap<String, T> {
        let textures = self.all.iter().filter(|param| param.kind == "texture");
        let names = textures.flat_map(|param| match &*param.values {
            Values::Texts(names) => names.as_slice(),
            _ => &[],
        });
        names.filter_map(|name| Some((name.clone(), all.get(name)?.clone()))).collect()
    }

    pub(super) fn none(place: Place) -> Self {
        Self { place, space: ColourSpace::default(), all: vec![] }
    }

    /// Says of which space the colours are.
    pub(super) fn in_space(mut self, space: ColourSpace) -> Self {
        self.space = space;
        self.all.iter_mut().for_each(|param| param.space = space);
        self
    }

    /// Adds those of `more` that are not there yet.
    pub(super) fn or(mut self, more: &Params) -> Self {
        for param in &more.all {
            if !self.all.iter().any(|p| p.name == param.name) {
                self.all.push(param.clone());
            }
        }
        self
    }

    pub(super) fn bad(&self, what: impl std::fmt::Display) -> LoadError {
        self.place.bad(what)
    }

    /// The parameter of that name, whatever its type.
    pub(super) fn get(&self, name: &str) -> Option<&Param> {
        let found = self.all.iter().find(|p| p.name == name)?;
        found.used.set(true);
        Some(found)
    }

    /// Whether both parameters are given and say the same.
    pub(super) fn same(&self, one: &str, other: &str) -> bool {
        let find = |name: &str| self.all.iter().find(|p| p.name == name).map(|p| (&p.kind, &p.values));
        find(one).is_some() && find(one) == find(other)
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    pub(super) fn numbers_in_all(&self) -> usize {
        let count = |p: &Param| if let Values::Numbers(numbers) = &*p.values { numbers.len() } else { 1 };
        self.all.iter().map(count).sum()
    }

    /// Whether any parameter is a texture.
    pub(super) fn has_texture(&self) -> bool {
        self.all.iter().any(|p| p.kind == "texture")
    }

    /// Marks parameters that make no difference.
    pub(super) fn ignore(&self, names: &[&str]) {
        self.all.iter().filter(|p| names.contains(&p.name.as_str())).for_each(|p| p.used.set(true));
    }

    /// Parameters that nobody asked for.
    pub(super) fn unused(&self) -> impl Iterator<Item = &Param> {
        self.all.iter().filter(|p| !p.used.get())
    }

    pub(super) fn numbers(&self, name: &str) -> Result<Option<&[f64]>, LoadError> {
        match self.get(name).map(|p| &*p.values) {
            None => Ok(None),
            Some(Values::Numbers(numbers)) => Ok(Some(numbers)),
            Some(_) => Err(self.bad(format!("`{name}` must be numbers"))),
        }
    }

    /// The one number of a parameter.
    pub(super) fn float(&self, name: &str) -> Result<Option<f64>, LoadError> {
        match self.numbers(name)? {
            None => Ok(None),
            Some([number]) => Ok(Some(*number)),
            Some(other) => Err(self.bad(format!("`{name}` has {} numbers instead of one", other.len()))),
        }
    }

    /// A whole number of at least 0.
    pub(super) fn count(&self, name: &str) -> Result<Option<u64>, LoadError> {
        match self.float(name)? {
            None => Ok(None),
            Some(x) if x >= 0.0 && x.fract() == 0.0 && x < 1e15 => Ok(Some(x as u64)),
            Some(x) => Err(self.bad(format!("`{name}` is {x}, not a whole number of at least 0"))),
        }
    }

    pub(super) fn triple(&self, name: &str) -> Result<Option<glam::DVec3>, LoadError> {
        match self.numbers(name)? {
            None => Ok(None),
            Some([x, y, z]) => Ok(Some(glam::DVec3::new(*x, *y, *z))),
            Some(other) => Err(self.bad(format!("`{name}` has {} numbers instead of three", other.len()))),
        }
    }

    /// The one text of a parameter.
    pub(super) fn text(&self, name: &str) -> Result<Option<&str>, LoadError> {
        match self.get(name).map(|p| &*p.values) {
            None => Ok(None),
            Some(Values::Texts(texts)) if texts.len() == 1 => Ok(Some(&texts[0])),
            Some(_) => Err(self.bad(format!("`{name}` must be one text"))),
        }
    }

    pub(super) fn switch(&self, name: &str, missing: bool) -> Result<bool, LoadError> {
        match self.get(name).map(|p| &*p.values) {
            None => Ok(missing),
            Some(Values::Switches(all)) if all.len() == 1 => Ok(all[0]),
            Some(_) => Err(self.bad(format!("`{name}` must be true or false"))),
        }
    }

    /// Rows of `N` numbers.
    pub(super) fn rows<const N: usize>(&self, name: &str) -> Result<Option<Vec<[f32; N]>>, LoadError> {
        let Some(numbers) = self.numbers(name)? else { return Ok(None) };
        if numbers.len() % N != 0 {
            return Err(self.bad(format!("`{name}` has {} numbers, not a multiple of {N}", numbers.len())));
        }
        let row = |row: &[f64]| std::array::from_fn(|i| row[i] as f32);
        Ok(Some(numbers.chunks_exact(N).map(row).collect()))
    }
}
