//! What an EXR says of its own samples: how many, of which seed, from where.

use crate::error::{PictureError, PictureFault};
use crate::open::{Format, Opened, guarded};
use exr::meta::attribute::AttributeValue;
use exr::meta::header::Header;
use exr::prelude::Text;
use noisefloor::{stills::SampleOrigin, text::printable};
use std::collections::HashMap;
use std::path::Path;

/// Samples per pixel, the same everywhere: the attribute that pbrt writes, too.
const SPP: &str = "samplesPerPixel";
/// All else, a line each: `fewest`, `most`, `seed`, `repeats` (`samples` if the seed fixes every sample), `source`.
/// One text, because `exr` writes several attributes of its own names in another order every time.
const FACTS: &str = "noisefloor.samples";
/// Stands between scene and renderer, and the options, in `source`.
const OPTIONS: &str = ", options ";
/// Longest text of an attribute that is believed, in bytes.
const MAX_TEXT: usize = 1000;

/// What the file of a picture says of its samples.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SampleFacts {
    /// Fewest and most samples per pixel of its tiles.
    pub samples: Option<(u64, u64)>,
    /// Where the samples come from.
    pub origin: Option<SampleOrigin>,
}

impl SampleFacts {
    /// Samples per pixel, if they are the same everywhere.
    pub fn spp(&self) -> Option<u64> {
        self.samples.filter(|(fewest, most)| fewest == most).map(|(spp, _)| spp)
    }
}

/// Reads what a file says of its samples: the attributes that [`write_exr`](crate::write_exr) writes, and
/// `samplesPerPixel` of other programs, such as pbrt. Nothing, the default, for a file that says nothing, and
/// for PFM and PNG. Attributes that make no sense are as good as none.
///
/// # Errors
/// [`PictureError`] if the file cannot be read, or is an EXR whose header is broken.
pub fn read_facts(path: impl AsRef<Path>) -> Result<SampleFacts, PictureError> {
    let path = path.as_ref();
    let opened = Opened::open(path)?;
    if opened.format != Format::Exr {
        return Ok(SampleFacts::default());
    }
    guarded(path, "EXR", || {
        let reader = exr::block::read(opened.reader, false)
            .map_err(|error| PictureFault::Broken { format: "EXR", reason: error.to_string() }.of(path))?;
        Ok(reader.headers().first().map(of_header).unwrap_or_default())
    })
}

fn of_header(header: &Header) -> SampleFacts {
    let find = |name: &str| {
        let name = Text::from(name);
        header.own_attributes.other.get(&name).or_else(|| header.shared_attributes.other.get(&name))
    };
    let even = find(SPP).and_then(positive).map(|spp| (spp, spp));
    let Some(AttributeValue::Text(text)) = find(FACTS) else {
        return SampleFacts { samples: even, origin: None };
    };
    let text = text.to_string();
    let stated = |name: &str| {
        let lines = text.lines().filter(|_| text.len() <= MAX_TEXT);
        lines.filter_map(|line| line.split_once('=')).find(|(n, _)| *n == name).map(|(_, value)| value)
    };
    let count = |name| stated(name)?.parse().ok().filter(|&n: &u64| n > 0);
    let uneven = || Some((count("fewest")?, count("most")?)).filter(|(fewest, most)| fewest <= most);
    let origin = || {
        let (source, seed) = (printable(stated("source")?), stated("seed")?.parse().ok()?);
        let (source, options) = source.rsplit_once(OPTIONS).unwrap_or((&source, ""));
        let (source, options) = (source.to_owned(), options.to_owned());
        Some(SampleOrigin::new(source, options, seed, stated("repeats") == Some("samples")))
    };
    SampleFacts { samples: even.or_else(uneven), origin: origin() }
}

/// A whole number above 0, however it is stored.
fn positive(value: &AttributeValue) -> Option<u64> {
    match value {
        AttributeValue::I32(n) => u64::try_from(*n).ok().filter(|&n| n > 0),
        AttributeValue::Text(text) => text.to_string().parse().ok().filter(|&n| n > 0),
        _ => None,
    }
}

/// Texts of an EXR are in Latin-1, and `exr` panics at other characters: these become escapes.
fn latin(text: &str) -> String {
    let mut all = String::with_capacity(text.len());
    for c in text.chars() {
        if u32::from(c) < 256 { all.push(c) } else { all.extend(c.escape_unicode()) }
    }
    all
}

/// The attributes that say this, of the picture and of its only layer.
pub(crate) fn sample_attributes(facts: &SampleFacts) -> [HashMap<Text, AttributeValue>; 2] {
    let text = |value: &str| AttributeValue::Text(Text::from(value));
    let (mut spp, mut lines) = (None, String::new());
    match facts.samples {
        // Other programs expect an integer; what does not fit is text
        Some((fewest, most)) if fewest == most => {
            let number = i32::try_from(most).map(AttributeValue::I32);
            spp = Some(number.unwrap_or_else(|_| text(&most.to_string())));
        }
        Some((fewest, most)) => lines += &format!("fewest={fewest}\nmost={most}\n"),
        None => {}
    }
    if let Some(SampleOrigin { source, options, seed, repeats, .. }) = &facts.origin {
        let source = if options.is_empty() { source.clone() } else { format!("{source}{OPTIONS}{options}") };
        let repeats = if *repeats { "samples" } else { "nothing" };
        lines += &format!("seed={seed}\nrepeats={repeats}\nsource={}\n", latin(&printable(&source)));
    }
    let rest = Some(lines).filter(|lines| !lines.is_empty()).map(|lines| text(&lines));
    let attribute =
        |name, value: Option<_>| value.map(|value| (Text::from(name), value)).into_iter().collect();
    [attribute(SPP, spp), attribute(FACTS, rest)]
}
