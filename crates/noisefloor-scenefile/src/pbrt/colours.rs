//! Colours and spectra of parameters.

use super::params::{Param, Params, Values};
use super::reader::Reader;
use crate::colour::{self, Quantity, TEMPERATURES};
use crate::error::LoadError;
use crate::files::{self, MAX_FILE_BYTES};
use crate::indices;
use noisefloor::{Rgb, display::luminance};

impl Reader<'_> {
    /// The colour of a factor, or an index of refraction by colour channel.
    pub(super) fn factor(&self, params: &Params, name: &str) -> Result<Option<Rgb>, LoadError> {
        Ok(self.signed(params, name)?.map(|colour| colour.map(|c| c.max(0.0))))
    }

    /// The same as it is, which may be below 0.
    pub(super) fn signed(&self, params: &Params, name: &str) -> Result<Option<Rgb>, LoadError> {
        let Some(param) = params.get(name) else { return Ok(None) };
        let colour = match (param.kind.as_str(), &*param.values) {
            (_, Values::Numbers(numbers)) => self.of_numbers(params, param, numbers, Quantity::Factor)?,
            (_, Values::Texts(texts)) => self.named_spectrum(params, texts, Quantity::Factor)?,
            _ => return Err(params.bad(format!("`{name}` is not a colour"))),
        };
        Ok(Some(colour))
    }

    /// The radiance of a light. pbrt 4 brings spectra to a luminance of 1; pbrt 3 takes them as they are, but
    /// black bodies with a peak of 1. Both take `rgb` and `xyz` as they are.
    pub(super) fn light(&self, params: &Params, name: &str) -> Result<Rgb, LoadError> {
        let scale = match params.numbers("scale")? {
            None => [1.0; 3],
            Some([grey]) => [*grey as f32; 3],
            Some([r, g, b]) => [*r as f32, *g as f32, *b as f32],
            Some(_) => return Err(params.bad("`scale` has neither one number nor three")),
        };
        let Some(param) = params.get(name) else {
            let white = params.space.to_rec709([1.0; 3], Quantity::Light);
            return Ok(std::array::from_fn(|i| white[i] * scale[i]));
        };
        let normalised = |colour: Rgb| {
            let level = luminance(colour);
            if level > 0.0 { colour.map(|c| c / level) } else { colour }
        };
        let colour = match (param.kind.as_str(), &*param.values) {
            ("blackbody", Values::Numbers(numbers)) => match numbers.as_slice() {
                [temperature] => normalised(self.black_body(params, *temperature)?),
                [temperature, scale] => {
                    // Wien's law: the peak lies at 2.898 mm·K over the temperature
                    let peak = colour::peak_of_black_body(*temperature) as f32;
                    self.black_body(params, *temperature)?.map(|c| c / peak * *scale as f32)
                }
                _ => return Err(params.bad(format!("`{name}` is not a temperature"))),
            },
            (kind, Values::Numbers(numbers)) => {
                let colour = self.of_numbers(params, param, numbers, Quantity::Light)?;
                if kind == "spectrum" && !self.version_3 { normalised(colour) } else { colour }
            }
            (_, Values::Texts(texts)) => {
                let colour = self.named_spectrum(params, texts, Quantity::Light)?;
                if self.version_3 { colour } else { normalised(colour) }
            }
            _ => return Err(params.bad(format!("`{name}` is not a colour"))),
        };
        let light = std::array::from_fn(|i| colour[i] * scale[i]);
        if light.iter().any(|c| *c < 0.0 || !c.is_finite()) {
            return Err(params.bad(format!("the light {light:?} is negative or too large")));
        }
        Ok(light)
    }

    fn black_body(&self, params: &Params, temperature: f64) -> Result<Rgb, LoadError> {
        if TEMPERATURES.contains(&temperature) {
            return Ok(colour::of_black_body(temperature));
        }
        let (low, high) = (TEMPERATURES.start(), TEMPERATURES.end());
        Err(params.bad(format!("a temperature of {temperature} K is not in {low}…{high}")))
    }

    fn of_numbers(
        &self,
        params: &Params,
        param: &Param,
        numbers: &[f64],
        quantity: Quantity,
    ) -> Result<Rgb, LoadError> {
        match (param.kind.as_str(), numbers) {
            (_, [grey]) => Ok([*grey as f32; 3]),
            ("xyz", [x, y, z]) => Ok(colour::of_xyz([*x, *y, *z])),
            ("rgb" | "color", [r, g, b]) => {
                let own = [*r as f32, *g as f32, *b as f32];
                Ok(param.space.to_rec709(own, quantity))
            }
            ("spectrum", pairs) if pairs.len() % 2 == 0 => {
                let samples: Vec<_> = pairs.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
                self.spectrum(params, samples, quantity)
            }
            _ => {
                let what = format!("`{}` has {} numbers, which is no colour", param.name, numbers.len());
                Err(params.bad(what))
            }
        }
    }

    /// A spectrum by its name, or in a file.
    fn named_spectrum(
        &self,
        params: &Params,
        texts: &[String],
        quantity: Quantity,
    ) -> Result<Rgb, LoadError> {
        let [name] = texts else { return Err(params.bad("a spectrum has one name")) };
        if let Some(rest) = name.strip_prefix("metal-") {
            let (metal, part) = rest.rsplit_once('-').unwrap_or((rest, "eta"));
            let found = if metal == "CuZn" { Some(BRASS) } else { indices::conductor(metal) };
            if let Some((eta, k)) = found {
                return Ok(if part == "k" { k } else { eta });
            }
        }
        if let Some((_, index)) = GLASSES.iter().find(|glass| glass.0 == name) {
            return Ok([*index; 3]);
        }
        let illuminant = name.strip_prefix("stdillum-").or_else(|| name.strip_prefix("illum-"));
        if let Some(colour) = illuminant.and_then(colour::of_illuminant) {
            return match quantity {
                Quantity::Light => Ok(colour),
                Quantity::Factor => Err(params.place.clone().unsupported(format!("`{name}` as a factor"))),
            };
        }
        let path = self.folder.find(name, &params.place)?;
        let bytes = self.folder.read(&path, MAX_FILE_BYTES, &params.place)?;
        let text = files::text(&bytes);
        let words = files::lines(&text)
            .flat_map(|line| line.split('#').next().unwrap_or_default().split_ascii_whitespace());
        let numbers = words.map(|word| super::params::number(word, &params.place));
        let numbers = numbers.collect::<Result<Vec<_>, _>>()?;
        let samples: Vec<_> = numbers.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
        self.spectrum(params, samples, quantity)
    }

    /// The colour of samples. pbrt 3 sorts them, takes the first and the last for all beyond, and gives
    /// factors the colour that they would have as lights (`RGBSpectrum::FromSampled`).
    fn spectrum(
        &self,
        params: &Params,
        mut samples: Vec<(f64, f64)>,
        quantity: Quantity,
    ) -> Result<Rgb, LoadError> {
        if self.version_3 {
            samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        let [Some((first, low)), Some((last, high))] =
            [samples.first(), samples.last()].map(Option::<&_>::copied)
        else {
            return Err(params.bad("a spectrum needs samples"));
        };
        if samples.windows(2).any(|pair| pair[0].0 >= pair[1].0) {
            return Err(params.bad("a spectrum needs samples at rising wavelengths"));
        }
        if !self.version_3 {
            return Ok(colour::of_spectrum(&samples, quantity));
        }
        let [shortest, longest] = colour::VISIBLE;
        samples.insert(0, (shortest.min(first) - 1.0, low));
        samples.push((longest.max(last) + 1.0, high));
        Ok(colour::of_spectrum(&samples, Quantity::Light))
    }
}

/// η + ik of brass.
const BRASS: (Rgb, Rgb) = ([0.444, 0.527, 1.094], [3.695, 2.765, 1.829]);

/// Glasses that pbrt 4 names, at 587.6 nm.
const GLASSES: [(&str, f32); 7] = [
    ("glass-BK7", 1.5168),
    ("glass-BAF10", 1.670),
    ("glass-FK51A", 1.4866),
    ("glass-LASF9", 1.8503),
    ("glass-F5", 1.6034),
    ("glass-SF10", 1.7283),
    ("glass-SF11", 1.7847),
];
