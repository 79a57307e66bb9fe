//! Colours and spectra of parameters.

use super::params::{Param, Params, Values};
use super::reader::Reader;
use crate::colour::{self, Quantity, TEMPERATURES};
use crate::error::{LoadError, LoadFault};
use crate::files::{self, MAX_FILE_BYTES};
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

    /// The radiance of a light as the film takes it. pbrt 4 brings spectra to a luminance of 1; pbrt 3 takes them as they are, but
    /// black bodies with a peak of 1. Both take `rgb` and `xyz` as they are.
    pub(super) fn light(&mut self, params: &Params, name: &str) -> Result<Rgb, LoadError> {
        let exposure = self.view.exposure;
        let scale = match params.numbers("scale")? {
            None => [1.0; 3],
            Some([grey]) => [*grey as f32; 3],
            Some([r, g, b]) => [*r as f32, *g as f32, *b as f32],
            Some(_) => return Err(params.bad("`scale` has neither one number nor three")),
        }
        .map(|c: f32| c * exposure);
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
                if texts[0] == "stdillum-D50" {
                    let what = "`stdillum-D50` is that of the CIE, [1.176 0.976 0.722]; \
                        pbrt's table of it lacks red: [1.087 1.000 0.750]";
                    self.load.approximated(&params.place, what);
                }
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
        let not_as = |what: &str| Err(params.place.unsupported(format!("`{name}` as a {what}")));
        let glass = GLASSES.iter().find(|glass| glass.0 == name).map(|glass| [glass.1; 3]);
        if let Some(index) = glass.or_else(|| metal(name)) {
            return if quantity == Quantity::Factor { Ok(index) } else { not_as("light") };
        }
        if let Some(colour) = illuminant(name) {
            return if quantity == Quantity::Light { Ok(colour) } else { not_as("factor") };
        }
        if is_of_a_sensor(name) {
            return not_as("spectrum: it is what a camera's sensor responds to, which is not held here");
        }
        let path = self.load.folder.find(name, &params.place).map_err(|error| match &error.fault {
            LoadFault::Read(cause) if cause.kind() == std::io::ErrorKind::NotFound => params.bad(format!(
                "there is no spectrum `{name}`: it is none of pbrt's names, and there is no such file"
            )),
            _ => error,
        })?;
        let bytes = self.load.folder.read(&path, MAX_FILE_BYTES, &params.place)?;
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

/// An illuminant by its name in pbrt 4.
fn illuminant(name: &str) -> Option<Rgb> {
    match name.strip_prefix("stdillum-") {
        Some("acesD60") => None,
        Some(standard) => colour::of_illuminant(standard),
        None => colour::of_illuminant(name.strip_prefix("illum-").filter(|name| *name == "acesD60")?),
    }
}

/// η or k of a metal by its name in pbrt 4.
fn metal(name: &str) -> Option<Rgb> {
    let (metal, part) = name.strip_prefix("metal-")?.rsplit_once('-')?;
    let (_, eta, k) = METALS.iter().find(|known| known.0 == metal)?;
    match part {
        "eta" => Some(*eta),
        "k" => Some(*k),
        _ => None,
    }
}

/// Whether pbrt 4 calls one channel of a camera's sensor so.
fn is_of_a_sensor(name: &str) -> bool {
    let makes = ["canon_eos_", "hasselblad_", "nikon_", "sony_ilce_"];
    makes.iter().any(|make| name.starts_with(make))
        && ["_r", "_g", "_b"].iter().any(|end| name.ends_with(end))
}

/// η and k of the metals, and of the crystals among them, that pbrt 4 names: its measured spectra as Rec.709 colours of
/// factors, seen under D65. Fresnel's equations make of them the colour that the spectra reflect, to 0.03.
const METALS: [(&str, Rgb, Rgb); 7] = [
    ("Ag", [0.1285, 0.1235, 0.1509], [4.0649, 3.2863, 2.3917]),
    ("Al", [1.4074, 0.9267, 0.5840], [7.7404, 6.6026, 5.3603]),
    ("Au", [0.0801, 0.4047, 1.5614], [3.3905, 2.5038, 1.7709]),
    ("Cu", COPPER.0, COPPER.1),
    ("CuZn", [0.4184, 0.5199, 1.1231], [3.6678, 2.6808, 1.7710]),
    ("MgO", [1.7337, 1.7409, 1.7535], [0.0, 0.0, 0.0]),
    ("TiO2", [2.8604, 2.9565, 3.1855], [0.0001, 0.0, 0.0006]),
];

/// Copper, of which metals are if nothing else is said.
pub(super) const COPPER: (Rgb, Rgb) = ([0.1045, 0.9782, 1.2047], [3.2733, 2.5924, 2.3692]);

/// Glasses that pbrt 4 names, at 587.6 nm. What it calls F5, F10 and F11 is Schott's SF5, SF10 and SF11.
const GLASSES: [(&str, f32); 7] = [
    ("glass-BK7", 1.5168),
    ("glass-BAF10", 1.670),
    ("glass-FK51A", 1.4866),
    ("glass-LASF9", 1.8503),
    ("glass-F5", 1.6727),
    ("glass-F10", 1.7283),
    ("glass-F11", 1.7847),
];
