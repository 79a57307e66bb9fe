//! Colour look-up tables as the text of `.cube` files (Adobe, "Cube LUT Specification 1.0", and Resolve's 1D before 3D).

use crate::display::lut::{ColourLut, LutTable};
use crate::rgb::Rgb;
use thiserror::Error;

/// Entries along one edge.
const SIZE_1D: std::ops::RangeInclusive<usize> = 2..=65_536;
const SIZE_3D: std::ops::RangeInclusive<usize> = 2..=129;
/// The shortest entry: three digits, and what separates them.
const ENTRY_BYTES: usize = 6;
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
        reason: &'static str,
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
}

/// Parses the content of a `.cube` file. Memory grows with its length, whatever sizes it claims.
///
/// # Errors
/// [`CubeError`] if it is broken.
pub fn parse_cube(text: &[u8]) -> Result<ColourLut, CubeError> {
    let mut head = Head::default();
    // A byte order mark, as Windows writes it
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let lines = text.split(|&b| b == b'\n').enumerate().map(|(i, line)| {
        let line = line.split(|&b| b == b'#').next().unwrap_or_default();
        (i + 1, String::from_utf8_lossy(line).trim().to_owned())
    });
    let mut lines = lines.filter(|(_, line)| !line.is_empty()).peekable();

    // Keywords come before entries
    while let Some((line, keyword)) = lines.next_if(|(_, line)| line.starts_with(char::is_alphabetic)) {
        head.take(&keyword).map_err(|reason| CubeError::Line { line, reason })?;
    }
    let [first, second] = head.ranges()?;
    let entries = [head.size_1d.unwrap_or(0), head.size_3d.map_or(0, |n| n.pow(3))];
    let expected = entries[0] + entries[1];
    if expected == 0 {
        return Err(CubeError::NoSize);
    }
    if expected > text.len() / ENTRY_BYTES + 1 {
        return Err(CubeError::Short { expected, bytes: text.len() });
    }

    // Entries: those of the 1D LUT first
    let mut values: Vec<Rgb> = Vec::with_capacity(expected);
    for (line, entry) in lines {
        if values.len() == expected {
            return Err(CubeError::Entries { expected, got: expected + 1 });
        }
        let reason = "three finite numbers are expected";
        values.push(numbers(&entry).ok_or(CubeError::Line { line, reason })?);
    }
    if values.len() < expected {
        return Err(CubeError::Entries { expected, got: values.len() });
    }
    let cube = values.split_off(entries[0]);
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
    fn take(&mut self, line: &str) -> Result<(), &'static str> {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let size =
            |sizes: std::ops::RangeInclusive<usize>| rest.trim().parse().ok().filter(|n| sizes.contains(n));
        let range = || {
            let [low, high] = numbers(rest)?;
            (low < high).then_some([[low; 3], [high; 3]])
        };
        let bad_range = "two finite numbers are expected, the lower one first";
        let bad_domain = "three finite numbers are expected";
        match keyword {
            "TITLE" => {}
            "LUT_1D_SIZE" => self.size_1d = Some(size(SIZE_1D).ok_or("a 1D LUT has 2 to 65536 entries")?),
            "LUT_3D_SIZE" => self.size_3d = Some(size(SIZE_3D).ok_or("a 3D LUT has an edge of 2 to 129")?),
            "DOMAIN_MIN" => self.domain[0] = Some(numbers(rest).ok_or(bad_domain)?),
            "DOMAIN_MAX" => self.domain[1] = Some(numbers(rest).ok_or(bad_domain)?),
            "LUT_1D_INPUT_RANGE" => self.range_1d = Some(range().ok_or(bad_range)?),
            "LUT_3D_INPUT_RANGE" => self.range_3d = Some(range().ok_or(bad_range)?),
            _ => return Err("this keyword is not known; SIZE, DOMAIN, INPUT_RANGE and TITLE are"),
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
