//! Colours and spectra.

use super::context::Context;
use super::xml::Element;
use crate::colour::{self, EQUAL_ENERGY, Quantity, TEMPERATURES};
use crate::error::LoadError;
use crate::files::{self, MAX_FILE_BYTES};
use noisefloor::{Rgb, display::srgb_decode};

/// Elements that are colours.
const COLOURS: [&str; 6] = ["rgb", "srgb", "spectrum", "blackbody", "float", "integer"];
const MAX_SAMPLES: usize = 1 << 16;

impl<'d> Context<'d> {
    /// The linear value of an `rgb`, `srgb`, `spectrum`, `blackbody` or `float`.
    pub(super) fn colour(
        &self,
        object: &'d Element,
        name: &str,
        quantity: Quantity,
    ) -> Result<Option<Rgb>, LoadError> {
        let colour = self.signed(object, name, quantity)?;
        if let Some(colour) = colour.filter(|colour| colour.iter().any(|c| *c < 0.0)) {
            let element = object.get(name).unwrap_or(object);
            return Err(self.bad(element, format!("the colour {colour:?} is negative or too large")));
        }
        Ok(colour)
    }

    /// The same, which may be below 0.
    pub(super) fn signed(
        &self,
        object: &'d Element,
        name: &str,
        quantity: Quantity,
    ) -> Result<Option<Rgb>, LoadError> {
        let Some(element) = object.get(name) else { return Ok(None) };
        if !COLOURS.contains(&element.tag.as_str()) {
            let what = format!("`{name}` is a <{}>; expected <{}>", element.tag, COLOURS.join(">, <"));
            return Err(self.bad(element, what));
        }
        let colour = match element.tag.as_str() {
            "spectrum" if !element.kind().is_empty() => self.spectrum_plugin(element, quantity)?,
            "spectrum" => self.spectrum(element, quantity)?,
            "blackbody" => self.black_body(element)?,
            tag => self.rgb(element, tag == "srgb")?,
        };
        if !colour.iter().all(|c| c.is_finite()) {
            return Err(self.bad(element, format!("the colour {colour:?} is negative or too large")));
        }
        Ok(Some(colour))
    }

    /// One or three numbers, or `#rrggbb`, which is always encoded as sRGB.
    fn rgb(&self, element: &Element, encoded: bool) -> Result<Rgb, LoadError> {
        let name = element.attribute("name").unwrap_or_default();
        let value = element.attribute("value");
        let value = value.ok_or_else(|| self.bad(element, format!("`{name}` has no value")))?;
        if let Some(hex) = value.trim().strip_prefix('#') {
            let code = |at: usize| {
                let code = hex.get(at..at + 2).filter(|_| hex.len() == 6)?;
                u8::from_str_radix(code, 16).ok().map(|code| srgb_decode(f32::from(code) / 255.0))
            };
            return match [code(0), code(2), code(4)] {
                [Some(r), Some(g), Some(b)] => Ok([r, g, b]),
                _ => Err(self.bad(element, format!("`{value}` is not a colour like #80ff00"))),
            };
        }
        let colour = match self.numbers(element, value)?.as_slice() {
            [grey] => [*grey as f32; 3],
            [r, g, b] => [*r as f32, *g as f32, *b as f32],
            other => {
                return Err(self.bad(element, format!("{} numbers; a colour has 1 or 3", other.len())));
            }
        };
        Ok(if encoded { colour.map(srgb_decode) } else { colour })
    }

    /// One number for all wavelengths, three for red, green and blue, pairs of wavelength and value, or a
    /// file of such pairs.
    fn spectrum(&self, element: &Element, quantity: Quantity) -> Result<Rgb, LoadError> {
        let samples = match (element.attribute("filename"), element.attribute("value")) {
            (Some(name), _) => self.spectrum_file(element, name)?,
            (None, Some(value)) if value.contains(':') => {
                let pairs = value.split([',', ' ', '\t', '\n', '\r']).filter(|word| !word.is_empty());
                let pair = |word: &str| match word.split_once(':') {
                    Some((wavelength, value)) => {
                        Ok((self.number(element, wavelength)?, self.number(element, value)?))
                    }
                    None => Err(self.bad(element, format!("`{word}` is not a pair wavelength:value"))),
                };
                pairs.map(pair).collect::<Result<Vec<_>, _>>()?
            }
            (None, Some(value)) => {
                return match self.numbers(element, value)?.as_slice() {
                    [level] => Ok(self.uniform(*level as f32, quantity)),
                    [r, g, b] => Ok([*r as f32, *g as f32, *b as f32]),
                    [] => Err(self.bad(element, "the spectrum is empty")),
                    _ => Err(self.bad(element, "a spectrum is one number, three, or pairs wavelength:value")),
                };
            }
            (None, None) => return Err(self.bad(element, "a spectrum needs a `value` or a `filename`")),
        };
        self.of_samples(element, &samples, quantity)
    }

    /// A spectrum of the same value at all wavelengths. Mitsuba 3 takes emitters for equal-energy whites,
    /// which are a little redder than the white of Rec.709.
    fn uniform(&self, level: f32, quantity: Quantity) -> Rgb {
        match quantity {
            Quantity::Light => EQUAL_ENERGY.map(|white| white * level),
            Quantity::Factor => [level; 3],
        }
    }

    fn of_samples(
        &self,
        element: &Element,
        samples: &[(f64, f64)],
        quantity: Quantity,
    ) -> Result<Rgb, LoadError> {
        self.place(element).at_most("samples of a spectrum", samples.len() as u64, MAX_SAMPLES as u64)?;
        if samples.windows(2).any(|pair| pair[0].0 >= pair[1].0) {
            return Err(self.bad(element, "the wavelengths of a spectrum must rise"));
        }
        match samples {
            [] => Err(self.bad(element, "the spectrum is empty")),
            _ if samples.iter().any(|(_, value)| *value < 0.0) => {
                Err(self.bad(element, "the spectrum has a negative value"))
            }
            _ => Ok(colour::of_spectrum(samples, quantity)),
        }
    }

    /// Lines of wavelength and value; `#` begins a comment.
    fn spectrum_file(&self, element: &Element, name: &str) -> Result<Vec<(f64, f64)>, LoadError> {
        let place = self.place(element);
        let path = self.load.folder.find(name, &place)?;
        let bytes = self.load.folder.read(&path, MAX_FILE_BYTES, &place)?;
        let text = files::text(&bytes);
        let lines = files::lines(&text).map(|line| line.split('#').next().unwrap_or_default().trim());
        let mut samples = Vec::new();
        for line in lines.filter(|line| !line.is_empty()) {
            match self.numbers(element, line)?.as_slice() {
                [wavelength, value] => samples.push((*wavelength, *value)),
                _ => {
                    return Err(
                        self.bad(element, format!("`{name}`: a line that is not a wavelength and a value"))
                    );
                }
            }
            place.at_most("samples of a spectrum", samples.len() as u64, MAX_SAMPLES as u64)?;
        }
        Ok(samples)
    }

    /// `<spectrum type="…">` of Mitsuba 3.
    fn spectrum_plugin(&self, element: &'d Element, quantity: Quantity) -> Result<Rgb, LoadError> {
        let list = |name: &str| match self.string(element, name)? {
            Some(text) => self.numbers(element, text),
            None => Err(self.bad(element, format!("`{name}` is missing"))),
        };
        match element.kind() {
            "uniform" | "d65" => {
                let name = if element.kind() == "d65" { "scale" } else { "value" };
                Ok([self.float(element, name)?.unwrap_or(1.0) as f32; 3])
            }
            "blackbody" => self.black_body(element),
            "irregular" => {
                let (wavelengths, values) = (list("wavelengths")?, list("values")?);
                if wavelengths.len() != values.len() {
                    return Err(self.bad(element, "it has not as many values as wavelengths"));
                }
                let samples: Vec<_> = wavelengths.into_iter().zip(values).collect();
                self.of_samples(element, &samples, quantity)
            }
            "regular" => {
                let (low, high) =
                    (self.float(element, "wavelength_min")?, self.float(element, "wavelength_max")?);
                let values = list("values")?;
                let (low, high) = (low.unwrap_or(360.0), high.unwrap_or(830.0));
                let step = (high - low) / values.len().saturating_sub(1).max(1) as f64;
                let samples = values.iter().enumerate().map(|(i, v)| (low + step * i as f64, *v));
                self.of_samples(element, &samples.collect::<Vec<_>>(), quantity)
            }
            _ => Err(self.unsupported_kind(element)),
        }
    }

    /// Light of a temperature: attributes in Mitsuba 0.6, elements in Mitsuba 3.
    fn black_body(&self, element: &'d Element) -> Result<Rgb, LoadError> {
        let number = |name: &str| match element.attribute(name) {
            Some(text) => self.number(element, text.trim().trim_end_matches(['K', 'k'])).map(Some),
            None => self.float(element, name),
        };
        let temperature = number("temperature")?;
        let temperature = temperature.filter(|t| TEMPERATURES.contains(t)).ok_or_else(|| {
            let (low, high) = (TEMPERATURES.start(), TEMPERATURES.end());
            self.bad(element, format!("a black body needs a `temperature` of {low} to {high} kelvin"))
        })?;
        let scale = number("scale")?.unwrap_or(1.0);
        Ok(colour::of_black_body(temperature).map(|c| c * scale as f32))
    }
}
