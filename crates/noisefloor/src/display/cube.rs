//! Colour look-up tables as the text of `.cube` files (Adobe, "Cube LUT Specification 1.0", and Resolve's 1D before 3D).

use crate::display::lut::{ColourLut, LutTable};
use crate::display::tone_table::is_displayable;
use crate::rgb::Rgb;
use crate::text::{lines, stand_in, text};
use thiserror::Error;

/// Entries along one edge.
const SIZE_1D: std::ops::RangeInclusive<usize> = 2..=65_536;
const SIZE_3D: std::ops::RangeInclusive<usize> = 2..=129;
/// The shortest entry: three digits, and what separates them.
const ENTRY_BYTES: usize = 6;
const BAD_ROW: &str = "three finite numbers are expected";
/// Larger numbers could not be mixed in single precision.
const LARGEST: f32 = 1e30;

/// Why a text is no `.cube` LUT.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CubeError {
    /// A line cannot be read.
    #[error("line {line}: {reason}")]
    Line {
        /// Counted from 1.
        line: usize,
        /// What it should be.
        reason: String,
    },
    /// The bytes are known to be something else.
    #[error("{instead}")]
    Foreign {
        /// What they are, and what to do.
        instead: &'static str,
    },
    /// No size is given.
    #[error("it has neither LUT_1D_SIZE (2 to 65536) nor LUT_3D_SIZE (2 to 129)")]
    NoSize,
    /// The domain is empty.
    #[error("DOMAIN_MIN must lie below DOMAIN_MAX, which are 0 and 1 unless given")]
    Domain,
    /// More or fewer entries than the size says.
    #[error("it has {got} entries, and its size asks for {expected}")]
    Entries {
        /// By its size.
        expected: usize,
        /// As far as they were counted.
        got: usize,
    },
    /// Far too short for its size; nothing of that size was allocated.
    #[error("{bytes} bytes cannot hold the {expected} entries that its size asks for")]
    Short {
        /// By its size.
        expected: usize,
        /// All there are.
        bytes: usize,
    },
    /// An entry that is no display value.
    #[error(
        "entry {entry} is {value}: what a LUT returns is shown, and lies from 0 to 1; divide values of 8, \
         10 or 12 bits by the largest"
    )]
    Value {
        /// Its place, from 0.
        entry: usize,
        /// The value.
        value: f32,
    },
}

/// Parses the content of a `.cube` file. Memory grows with its length, whatever sizes it claims.
///
/// # Errors
/// [`CubeError`] if it is broken.
pub fn parse_cube(bytes: &[u8]) -> Result<ColourLut, CubeError> {
    if let Some(instead) = stand_in(bytes) {
        return Err(CubeError::Foreign { instead });
    }
    let text = text(bytes);
    // DOS ended files by ^Z, and some programs end them by a NUL
    let text = text.trim_end_matches(|c: char| matches!(c, '\0' | '\x1a') || c.is_whitespace());
    let contents =
        lines(text).enumerate().map(|(i, line)| (i + 1, line.split('#').next().unwrap_or_default().trim()));
    let contents = contents.filter(|(_, line)| !line.is_empty());
    // `nan` and `inf` are no keywords but bad numbers
    let is_keyword = |line: &str| {
        let word = line.split_whitespace().next().unwrap_or_default();
        word.starts_with(char::is_alphabetic) && word.parse::<f32>().is_err()
    };

    // Keywords come first, but some programs write the domain last
    let mut head = Head::default();
    for (line, keyword) in contents.clone().filter(|(_, line)| is_keyword(line)) {
        head.take(keyword).map_err(|reason| CubeError::Line { line, reason })?;
    }
    let [first, second] = head.ranges()?;
    let entries = [head.size_1d.unwrap_or(0), head.size_3d.map_or(0, |n| n.pow(3))];
    let expected = entries[0] + entries[1];
    if expected == 0 {
        return Err(CubeError::NoSize);
    }
    if expected > text.len() / ENTRY_BYTES + 1 {
        return Err(CubeError::Short { expected, bytes: bytes.len() });
    }

    // Entries: those of the 1D LUT first
    let mut values: Vec<Rgb> = Vec::with_capacity(expected);
    for (line, entry) in contents.filter(|(_, line)| !is_keyword(line)) {
        if values.len() == expected {
            return Err(CubeError::Entries { expected, got: expected + 1 });
        }
        let bad = || CubeError::Line { line, reason: BAD_ROW.to_owned() };
        values.push(numbers(entry).ok_or_else(bad)?);
    }
    if values.len() < expected {
        return Err(CubeError::Entries { expected, got: values.len() });
    }
    let cube = values.split_off(entries[0]);
    let shown = if cube.is_empty() { &values } else { &cube };
    let off = shown.iter().enumerate().find_map(|(entry, value)| {
        value.iter().find(|value| !is_displayable(**value)).map(|&value| CubeError::Value { entry, value })
    });
    off.map_or(Ok(()), Err)?;
    let curve = head.size_1d.map(|size| LutTable { size, range: first, values });
    let cube = head.size_3d.map(|size| LutTable { size, range: second, values: cube });
    Ok(ColourLut::new(curve, cube))
}

/// What the keywords say.
#[derive(Default)]
struct Head {
    size_1d: Option<usize>,
    size_3d: Option<usize>,
    domain: [Option<Rgb>; 2],
    range_1d: Option<[Rgb; 2]>,
    range_3d: Option<[Rgb; 2]>,
}

impl Head {
    fn take(&mut self, line: &str) -> Result<(), String> {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let size =
            |sizes: std::ops::RangeInclusive<usize>| rest.trim().parse().ok().filter(|n| sizes.contains(n));
        let range = || {
            let [low, high] = numbers(rest)?;
            (low < high).then_some([[low; 3], [high; 3]])
        };
        let bad_range = "two finite numbers are expected, the lower one first";
        match keyword.to_ascii_uppercase().as_str() {
            "TITLE" => {}
            "LUT_1D_SIZE" => self.size_1d = Some(size(SIZE_1D).ok_or("a 1D LUT has 2 to 65536 entries")?),
            "LUT_3D_SIZE" => self.size_3d = Some(size(SIZE_3D).ok_or("a 3D LUT has an edge of 2 to 129")?),
            "DOMAIN_MIN" => self.domain[0] = Some(numbers(rest).ok_or(BAD_ROW)?),
            "DOMAIN_MAX" => self.domain[1] = Some(numbers(rest).ok_or(BAD_ROW)?),
            "LUT_1D_INPUT_RANGE" => self.range_1d = Some(range().ok_or(bad_range)?),
            "LUT_3D_INPUT_RANGE" => self.range_3d = Some(range().ok_or(bad_range)?),
            _ => {
                let keyword: String = keyword.chars().take(40).collect();
                let known = "TITLE, LUT_1D_SIZE, LUT_3D_SIZE, DOMAIN_… and LUT_…_INPUT_RANGE are";
                return Err(format!("the keyword {keyword:?} is not known; {known}"));
            }
        }
        Ok(())
    }

    /// Of the 1D LUT and of the 3D one. DOMAIN is that of the first.
    fn ranges(&self) -> Result<[[Rgb; 2]; 2], CubeError> {
        let unit = [[0.0; 3], [1.0; 3]];
        let domain = [self.domain[0].unwrap_or(unit[0]), self.domain[1].unwrap_or(unit[1])];
        if (0..3).any(|c| domain[0][c] >= domain[1][c]) {
            return Err(CubeError::Domain);
        }
        let of_cube = if self.size_1d.is_some() { unit } else { domain };
        Ok([self.range_1d.unwrap_or(domain), self.range_3d.unwrap_or(of_cube)])
    }
}

/// Exactly `N` finite numbers of a sane size.
fn numbers<const N: usize>(text: &str) -> Option<[f32; N]> {
    let mut words = text.split_whitespace();
    let mut values = [0.0; N];
    for value in &mut values {
        *value = words.next()?.parse().ok().filter(|v: &f32| v.abs() <= LARGEST)?;
    }
    words.next().is_none().then_some(values)
}
