//! Colours that a file states, converted to those that everything here expects: Rec.709, white at D65.

#![cfg_attr(not(feature = "profiles"), allow(dead_code, reason = "what profiles become"))]

use noisefloor::Rgb;
use noisefloor::display::{srgb_decode, srgb_encode};
use noisefloor::viewing::{Chromaticities, Eotf, Viewing};

type Matrix = [[f64; 3]; 3];

/// Chromaticities that differ by less are the same, rounded.
const SAME: f64 = 1e-3;
/// Determinant of primaries below which nothing can be computed from them; that of Rec.709 is 0.2.
const THINNEST: f64 = 1e-4;
/// Coordinates of chromaticities, at most: ACES AP0 has a y of −0.077.
const FARTHEST: f64 = 2.0;
/// Illuminant E and the primaries of XYZ: coordinates of light rather than the colours of a device.
const XYZ: Chromaticities =
    Chromaticities { red: [1.0, 0.0], green: [0.0, 1.0], blue: [0.0, 0.0], white: [1.0 / 3.0; 2] };
/// The white to which the colours of ICC profiles refer (ICC.1:2022, §7.2.16), as XYZ.
const PROFILE_WHITE: [f64; 3] = [0.9642, 1.0, 0.8249];
/// Cone responses of Bradford's chromatic adaptation (ICC.1:2022, annex E).
const BRADFORD: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
/// White of pictures for HDR displays, in cd/m² (ITU-R BT.2408, §2.1).
const HDR_WHITE: f64 = 203.0;
/// Peak of the display that HLG is converted for, in cd/m², and its system gamma (ITU-R BT.2100, table 5).
const HLG_PEAK: f64 = 1000.0;
const HLG_GAMMA: f64 = 1.2;

/// Whether these are the same primaries and white, but for rounding.
fn same(a: &Chromaticities, b: &Chromaticities) -> bool {
    let all = |c: &Chromaticities| [c.red, c.green, c.blue, c.white];
    all(a).as_flattened().iter().zip(all(b).as_flattened()).all(|(a, b)| (a - b).abs() < SAME)
}

/// Linear RGB in colours of a file → linear RGB in Rec.709.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ToRec709(Matrix);

impl ToRec709 {
    /// Out of the colours' chromaticities: `Ok(None)` if they are those of Rec.709, `Err` if no colours have
    /// them. What is `neutral` becomes white, by Bradford's adaptation; without it, the white of the colours
    /// does, except that of XYZ, which stays what it is.
    pub(crate) fn new(of: &Chromaticities, neutral: Option<[f64; 2]>) -> Result<Option<Self>, ()> {
        let own = if same(of, &XYZ) { Chromaticities::D65 } else { of.white };
        let neutral = neutral.unwrap_or(own);
        let stays = neutral.iter().zip(Chromaticities::D65).all(|(a, b)| (a - b).abs() < SAME);
        if same(of, &Chromaticities::REC709) && stays {
            return Ok(None);
        }
        let to_xyz = to_xyz(of).ok_or(())?;
        Self::from_xyz(to_xyz, xyz(neutral).ok_or(())?).map(Some).ok_or(())
    }

    /// Out of the colorants of an ICC profile, row by row.
    pub(crate) fn of_profile(colorants: Matrix) -> Option<Self> {
        colorants.as_flattened().iter().all(|v| v.abs() <= 4.0).then_some(())?;
        Self::from_xyz(colorants, PROFILE_WHITE)
    }

    fn from_xyz(to_xyz: Matrix, neutral: [f64; 3]) -> Option<Self> {
        let from_rec709 = inverse(&self::to_xyz(&Chromaticities::REC709)?)?;
        let (from, to) = (apply(&BRADFORD, neutral), apply(&BRADFORD, xyz(Chromaticities::D65)?));
        let gains: [f64; 3] = std::array::from_fn(|i| to[i] / from[i]);
        gains.iter().all(|gain| (0.1..10.0).contains(gain)).then_some(())?;
        let scaled: Matrix = std::array::from_fn(|row| BRADFORD[row].map(|v| v * gains[row]));
        let adapted = product(&inverse(&BRADFORD)?, &scaled);
        Some(Self(product(&from_rec709, &product(&adapted, &to_xyz))))
    }

    /// The same light. Values that are not finite stay as they are.
    pub(crate) fn convert(&self, pixel: Rgb) -> Rgb {
        if pixel.iter().all(|v| v.is_finite()) {
            apply(&self.0, pixel.map(f64::from)).map(|v| v as f32)
        } else {
            pixel
        }
    }
}

/// How a picture for a display says that its codes are to be shown.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stated {
    /// Of its primaries and white, if not by a profile.
    pub(crate) gamut: Option<Chromaticities>,
    /// To Rec.709, if that is another gamut.
    pub(crate) matrix: Option<ToRec709>,
    pub(crate) curve: Curve,
}

/// From codes in 0…1 to light, 1 being the display's white.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Curve {
    Srgb,
    Power(f64),
    /// SMPTE ST 2084.
    Pq,
    /// Hybrid log-gamma of ITU-R BT.2100.
    Hlg,
    /// The light of equally distant codes from 0 to 1, of a profile's red, green and blue.
    Table(Box<[Vec<f32>; 3]>),
}

/// What to do with codes for a display.
pub(crate) enum Treatment<'a> {
    /// The display takes such codes, or says nothing else.
    Keep,
    Convert(&'a Stated),
    /// The display takes codes of another kind.
    Refuse(&'a Stated),
}

impl Stated {
    /// A display without colour management shows the codes that it gets: those of its own kind are kept, and
    /// all others become sRGB, where the display takes that.
    pub(crate) fn on(&self, viewing: &Viewing) -> Treatment<'_> {
        let params = viewing.params();
        let shown = params.primaries.chromaticities();
        let own_gamut = || self.gamut.is_some_and(|gamut| same(&gamut, &shown));
        match (params.eotf, &self.curve) {
            (_, Curve::Srgb) if self.matrix.is_none() => Treatment::Keep,
            (Eotf::Pq, Curve::Pq) | (Eotf::Hlg, Curve::Hlg) if own_gamut() => Treatment::Keep,
            (Eotf::Srgb | Eotf::Gamma(_), Curve::Srgb) if own_gamut() => Treatment::Keep,
            (Eotf::Srgb | Eotf::Gamma(_), _) => Treatment::Convert(self),
            _ => Treatment::Refuse(self),
        }
    }

    /// In words, for a message.
    pub(crate) fn describe(&self) -> String {
        let gamut = match (&self.gamut, &self.matrix) {
            (_, None) => "Rec.709",
            (Some(g), _) if *g == Chromaticities::REC2020 => "Rec.2020",
            (Some(g), _) if *g == Chromaticities::DISPLAY_P3 => "P3",
            (Some(_), _) => "its own",
            (None, _) => "its profile's",
        };
        match &self.curve {
            Curve::Srgb => format!("{gamut} primaries with the curve of sRGB"),
            Curve::Power(gamma) => format!("{gamut} primaries with a gamma of {gamma:.2}"),
            Curve::Pq => format!("{gamut} primaries with PQ"),
            Curve::Hlg => format!("{gamut} primaries with HLG"),
            Curve::Table(_) => format!("{gamut} primaries with curves of a profile"),
        }
    }

    /// Whether light above the white of an sRGB display can occur.
    pub(crate) fn is_hdr(&self) -> bool {
        matches!(self.curve, Curve::Pq | Curve::Hlg)
    }

    /// Replaces codes, multiples of `step` in 0…1, by those of an sRGB display, and returns by how much one
    /// step of the file changes them (root mean square).
    pub(crate) fn to_srgb(&self, pixels: &mut [Rgb], step: f32) -> f32 {
        let most = (1.0 / step).round() as usize;
        let light: [Vec<f32>; 3] = std::array::from_fn(|c| {
            (0..=most).map(|code| self.light(c, code as f64 / most as f64) as f32).collect()
        });
        let shown = |codes: [usize; 3]| self.shown(std::array::from_fn(|c| light[c][codes[c]]));
        let mut squares = 0.0;
        for pixel in pixels.iter_mut() {
            let codes = pixel.map(|v| ((v / step).round() as usize).min(most));
            *pixel = shown(codes);
            // Where the next code is none, the one before
            let beside = shown(codes.map(|code| if code < most { code + 1 } else { code - 1 }));
            squares += pixel.iter().zip(beside).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        }
        (squares / (3 * pixels.len().max(1)) as f64).sqrt() as f32
    }

    /// Light of a code in one channel.
    fn light(&self, channel: usize, code: f64) -> f64 {
        match &self.curve {
            // IEC 61966-2-1
            Curve::Srgb if code <= 0.040_45 => code / 12.92,
            Curve::Srgb => ((code + 0.055) / 1.055).powf(2.4),
            Curve::Power(gamma) => code.powf(*gamma),
            Curve::Pq => pq(code) / HDR_WHITE,
            Curve::Hlg => hlg(code),
            Curve::Table(tables) => {
                let table = &tables[channel];
                let at = code * (table.len() - 1) as f64;
                let (low, high) = (at.floor() as usize, at.ceil() as usize);
                let (low, high) = (f64::from(table[low]), f64::from(table[high]));
                low + (high - low) * at.fract()
            }
        }
    }

    /// The code of an sRGB display for light.
    fn shown(&self, mut light: Rgb) -> Rgb {
        if self.curve == Curve::Hlg {
            // BT.2100, table 5: the display's light has the colours of the scene, and its luminance to the
            // power of γ
            let weights = [0.2627, 0.6780, 0.0593];
            let y: f64 = light.iter().zip(weights).map(|(v, weight)| f64::from(*v) * weight).sum();
            let gain = (HLG_PEAK / HDR_WHITE * y.powf(HLG_GAMMA - 1.0)) as f32;
            light = light.map(|v| v * gain);
        }
        let light = self.matrix.map_or(light, |matrix| matrix.convert(light));
        light.map(|v| srgb_encode(v.clamp(0.0, 1.0)))
    }
}

/// Whether these are sRGB, rounded: wherever the codes are, they differ by less than half a code of 8 bits,
/// or their light by less than 1/2000 of white: digits of profiles end there.
pub(crate) fn is_srgb(stated: &Stated) -> bool {
    let codes = (0..9 * 9 * 9).map(|i| [i % 9, i / 9 % 9, i / 81].map(|v| v as f64 / 8.0));
    codes.into_iter().all(|codes| {
        let shown = stated.shown(std::array::from_fn(|c| stated.light(c, codes[c]) as f32));
        shown.iter().zip(codes).all(|(&shown, code)| {
            let code = code as f32;
            (shown - code).abs() < 0.5 / 255.0 || (srgb_decode(shown) - srgb_decode(code)).abs() < 5e-4
        })
    })
}

/// cd/m² (SMPTE ST 2084, §5.1).
fn pq(code: f64) -> f64 {
    let (m1, m2) = (2610.0 / 16384.0, 2523.0 / 4096.0 * 128.0);
    let (c1, c2, c3) = (3424.0 / 4096.0, 2413.0 / 4096.0 * 32.0, 2392.0 / 4096.0 * 32.0);
    let root = code.powf(1.0 / m2);
    10_000.0 * ((root - c1).max(0.0) / (c2 - c3 * root)).powf(1.0 / m1)
}

/// Light of the scene in 0…1 (ITU-R BT.2100, table 5).
fn hlg(code: f64) -> f64 {
    const A: f64 = 0.178_832_77;
    let b = 1.0 - 4.0 * A;
    let c = 0.5 - A * (4.0 * A).ln();
    if code <= 0.5 { code * code / 3.0 } else { (((code - c) / A).exp() + b) / 12.0 }
}

/// XYZ of a chromaticity, Y being 1.
fn xyz([x, y]: [f64; 2]) -> Option<[f64; 3]> {
    let plausible = (1e-3..=1.0).contains(&y) && (0.0..=1.0).contains(&x);
    plausible.then(|| [x / y, 1.0, (1.0 - x - y) / y])
}

/// Linear RGB → XYZ, white having a Y of 1 (SMPTE RP 177). Unlike those of displays, primaries may lie
/// outside the colours that can be seen.
fn to_xyz(of: &Chromaticities) -> Option<Matrix> {
    let primaries = [of.red, of.green, of.blue];
    primaries.as_flattened().iter().all(|v| v.abs() <= FARTHEST).then_some(())?;
    let columns = primaries.map(|[x, y]| [x, y, 1.0 - x - y]);
    let matrix: Matrix = std::array::from_fn(|row| std::array::from_fn(|i| columns[i][row]));
    let sums = apply(&inverse(&matrix)?, xyz(of.white)?);
    Some(matrix.map(|row| std::array::from_fn(|i| row[i] * sums[i])))
}

fn apply(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| std::array::from_fn(|column| (0..3).map(|i| row[i] * b[i][column]).sum()))
}

/// By cofactors; `None` if there is none that could be computed with.
fn inverse(m: &Matrix) -> Option<Matrix> {
    let cofactor = |row: usize, column: usize| {
        let at = |r: usize, c: usize| m[(row + r) % 3][(column + c) % 3];
        at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
    };
    let determinant: f64 = (0..3).map(|column| m[0][column] * cofactor(0, column)).sum();
    (determinant.abs() >= THINNEST)
        .then(|| std::array::from_fn(|row| std::array::from_fn(|column| cofactor(column, row) / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_colours_have_is_refused() {
        let bad = [
            Chromaticities { white: [0.3, 0.0], ..Chromaticities::REC709 },
            Chromaticities { red: Chromaticities::REC709.green, ..Chromaticities::REC709 },
            Chromaticities { blue: [f64::NAN; 2], ..Chromaticities::REC709 },
            Chromaticities { blue: [1e30; 2], ..Chromaticities::REC709 },
        ];
        for colours in bad {
            assert_eq!(ToRec709::new(&colours, None), Err(()), "{colours:?}");
        }
        assert_eq!(ToRec709::new(&Chromaticities::REC709, None), Ok(None));
    }

    /// ST 2084 and BT.2100: the ends; BT.2408, table 1: 203 cd/m² is 58 % PQ and 75 % HLG.
    #[test]
    fn curves_have_their_known_values() {
        assert!((pq(0.0), (pq(1.0) - 10_000.0).abs() < 1e-6) == (0.0, true));
        assert!((pq(0.5807) - 203.0).abs() < 0.5, "{}", pq(0.5807));
        assert!(hlg(0.0) == 0.0 && (hlg(1.0) - 1.0).abs() < 1e-6 && (hlg(0.5) - 1.0 / 12.0).abs() < 1e-9);
        let stated = |curve| Stated { gamut: Some(Chromaticities::REC709), matrix: None, curve };
        let grey = |curve, code: f64| stated(curve).shown([stated(Curve::Hlg).light(0, code) as f32; 3])[0];
        assert!((grey(Curve::Hlg, 0.75) - 1.0).abs() < 0.01, "{}", grey(Curve::Hlg, 0.75));
        assert!(is_srgb(&stated(Curve::Srgb)) && !is_srgb(&stated(Curve::Power(2.2))));
    }
}
