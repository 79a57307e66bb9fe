//! Code values → light of the display → opponent channels, in cd/m².

use crate::lanes::map_rows;
use crate::math::{exp2, pow};
use crate::viewing::{Eotf, Primaries, Viewing};
use multiversion::multiversion;
use std::f32::consts::LOG2_E;
use std::ops::Range;

/// The opponent channels: achromatic, red–green, yellow–violet.
pub(crate) const CHANNELS: usize = 3;

/// Linear RGB → CIE XYZ, white at D65: IEC 61966-2-1 and ITU-R BT.2020, with the digits that ColorVideoVDP
/// 0.5.7 uses.
const REC709_TO_XYZ: [[f64; 3]; 3] = [
    [0.412_456_4, 0.357_576_1, 0.180_437_5],
    [0.212_672_9, 0.715_152_2, 0.072_175_0],
    [0.019_333_9, 0.119_192_0, 0.950_304_1],
];
const REC2020_TO_XYZ: [[f64; 3]; 3] =
    [[0.6370, 0.1446, 0.1689], [0.2627, 0.6780, 0.0593], [0.0000, 0.0281, 1.0610]];

/// CIE XYZ → responses of the cones, from the fundamentals of CIE 170-1:2006, as in ColorVideoVDP (Mantiuk et
/// al. 2024, §3.2).
const XYZ_TO_LMS: [[f64; 3]; 3] = [
    [0.187_596_268_556_126, 0.585_168_649_077_728, -0.026_384_263_306_304],
    [-0.133_397_430_663_221, 0.405_505_777_260_049, 0.034_502_127_690_364],
    [0.000_244_379_021_663, -0.000_542_995_890_619, 0.019_406_849_066_323],
];

/// Responses of the cones → opponent channels of Derrington, Krauskopf and Lennie, grey at D65 (Mantiuk et
/// al. 2024, §3.2).
const LMS_TO_DKL: [[f64; 3]; 3] =
    [[1.0, 1.0, 0.0], [1.0, -2.311_130_179_947_035, 0.0], [-1.0, -1.0, 50.977_571_328_718_78]];

/// Pixels that are converted at a time, channel by channel, as vector instructions want it: few enough to stay in the nearest
/// cache.
const AT_ONCE: usize = 128;

/// The lowest luminance that displays of linear or PQ values show, in cd/m².
const DARKEST: f32 = 0.005;

fn product(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    a.map(|row| std::array::from_fn(|column| (0..3).map(|i| row[i] * b[i][column]).sum()))
}

/// A display as a function of code values.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Photometry {
    curve: Curve,
    peak: f32,
    black: f32,
    reflected: f32,
    to_opponent: [[f32; 3]; CHANNELS],
}

/// [`Eotf`] with what it needs to know of the display.
#[derive(Clone, Copy, Debug)]
enum Curve {
    Srgb,
    Gamma(f32),
    Pq,
    /// The system gamma less one.
    Hlg(f32),
    Linear,
}

impl Photometry {
    pub(crate) fn new(viewing: &Viewing) -> Self {
        let params = viewing.params();
        let curve = match params.eotf {
            Eotf::Srgb => Curve::Srgb,
            Eotf::Gamma(gamma) => Curve::Gamma(gamma as f32),
            Eotf::Pq => Curve::Pq,
            Eotf::Hlg => Curve::Hlg(hlg_gamma(params.peak, params.ambient) as f32 - 1.0),
            Eotf::Linear => Curve::Linear,
        };
        let to_xyz = match params.primaries {
            Primaries::Rec709 => REC709_TO_XYZ,
            Primaries::Rec2020 => REC2020_TO_XYZ,
            Primaries::Measured(colours) => colours.to_xyz().expect("`ViewingParams::check` refuses others"),
        };
        let to_opponent =
            product(LMS_TO_DKL, product(XYZ_TO_LMS, to_xyz)).map(|row| row.map(|value| value as f32));
        Self {
            curve,
            peak: params.peak as f32,
            black: params.black as f32,
            reflected: viewing.reflected() as f32,
            to_opponent,
        }
    }

    /// Light of the three primaries for a code value, each in units in which their sum is white, in cd/m².
    pub(crate) fn light(&self, code: [f32; 3]) -> [f32; 3] {
        let [mut r, mut g, mut b] = code.map(|value| [value]);
        self.shine([&mut r, &mut g, &mut b]);
        [r[0], g[0], b[0]]
    }

    /// Turns code values into light, and that into opponent channels, which `here` is the place of.
    #[inline(always)]
    fn oppose(&self, codes: &mut [[f32; AT_ONCE]; 3], here: Range<usize>, planes: &mut [&mut [f32]]) {
        let [r, g, b] = codes.each_mut().map(|channel| &mut channel[..here.len()]);
        self.shine([&mut *r, &mut *g, &mut *b]);
        for (plane, weights) in planes.iter_mut().zip(&self.to_opponent) {
            let plane = &mut plane[here.clone()];
            for (((out, r), g), b) in plane.iter_mut().zip(&*r).zip(&*g).zip(&*b) {
                *out = weights[0] * r + weights[1] * g + weights[2] * b;
            }
        }
    }

    /// Replaces code values by light, channel by channel.
    #[inline(always)]
    fn shine(&self, [r, g, b]: [&mut [f32]; 3]) {
        if let Curve::Hlg(gamma) = self.curve {
            return self.shine_hlg(gamma, [r, g, b]);
        }
        // A loop, where `map` would not be compiled for the processor's vector instructions
        for plane in [r, g, b] {
            match self.curve {
                Curve::Srgb => self.emit(plane, srgb),
                Curve::Gamma(gamma) => self.emit(plane, |v| if v > 0.0 { pow(v, gamma) } else { 0.0 }),
                Curve::Pq => self.emit_absolute(plane, DARKEST, self.black, |v| pq(unit(v))),
                Curve::Linear | Curve::Hlg(_) => {
                    self.emit_absolute(plane, DARKEST.max(self.black), 0.0, |v| v);
                }
            }
        }
    }

    /// Hybrid log-gamma has a gain that depends on all channels.
    #[inline(always)]
    fn shine_hlg(&self, gamma: f32, [r, g, b]: [&mut [f32]; 3]) {
        let (range, floor) = (self.peak - self.black, self.black + self.reflected);
        for ((r, g), b) in r.iter_mut().zip(g).zip(b) {
            let [x, y, z] = [hlg(unit(*r)), hlg(unit(*g)), hlg(unit(*b))];
            // BT.2100 fixes these weights, whatever the primaries of the display
            let luminance = 0.2627 * x + 0.6780 * y + 0.0593 * z;
            let gain = if luminance > 0.0 { range * pow(luminance, gamma) } else { 0.0 };
            [*r, *g, *b] = [gain * x + floor, gain * y + floor, gain * z + floor];
        }
    }

    /// For curves onto [0, 1] between black and the peak.
    #[inline(always)]
    fn emit(&self, plane: &mut [f32], curve: impl Fn(f32) -> f32) {
        let (range, floor) = (self.peak - self.black, self.black + self.reflected);
        plane.iter_mut().for_each(|v| *v = range * curve(unit(*v)) + floor);
    }

    /// For curves onto cd/m², cut off at `least` and at the peak.
    #[inline(always)]
    fn emit_absolute(&self, plane: &mut [f32], least: f32, black: f32, curve: impl Fn(f32) -> f32) {
        let floor = black + self.reflected;
        for v in plane {
            let light = curve(*v);
            let light = if light > least { light } else { least };
            *v = if light < self.peak { light } else { self.peak } + floor;
        }
    }
}

impl Viewing {
    /// Luminance of a grey of this code value, in cd/m², with the light of the room that the display
    /// reflects.
    pub fn luminance(&self, code: f32) -> f64 {
        f64::from(Photometry::new(self).light([code; 3])[1])
    }
}

/// Holds code values within [0, 1]; NaN becomes 0.
#[inline(always)]
fn unit(v: f32) -> f32 {
    let v = if v > 0.0 { v } else { 0.0 };
    if v < 1.0 { v } else { 1.0 }
}

/// IEC 61966-2-1, within 3·10⁻⁶ of it: most of the time of a tile would go into powers of 2.4.
#[inline(always)]
fn srgb(v: f32) -> f32 {
    // y^2.4 = y²·u^0.8 with u = √y, and u^0.8 is nearly a polynomial (minimax of the relative error) where
    // the curve is a power
    let y = (v + 0.055) * (1.0 / 1.055);
    let u = y.sqrt();
    let high = 1.321_410_7 + u * (-1.154_611_3 + u * (0.579_627_75 + u * -0.125_126_02));
    let power = 0.031_182_42 + u * (1.388_462_9 + u * (-1.040_948_8 + u * high));
    if v > 0.04045 { y * y * power } else { v * (1.0 / 12.92) }
}

/// SMPTE ST 2084, onto cd/m².
#[inline(always)]
fn pq(v: f32) -> f32 {
    const N: f32 = 0.159_301_76;
    const M: f32 = 78.843_75;
    const C: [f32; 3] = [0.835_937_5, 18.851_563, 18.687_5];
    let root = if v > 0.0 { pow(v, 1.0 / M) } else { 0.0 };
    let above = root - C[0];
    if above > 0.0 { 10_000.0 * pow(above / (C[1] - C[2] * root), 1.0 / N) } else { 0.0 }
}

/// Light of the scene for a code value of hybrid log-gamma (ITU-R BT.2100, table 5).
#[inline(always)]
fn hlg(v: f32) -> f32 {
    const A: f32 = 0.178_832_77;
    const B: f32 = 1.0 - 4.0 * A;
    const C: f32 = 0.559_910_7; // ½ − A·ln 4A
    let high = (exp2((v - C) * (LOG2_E / A)) + B) * (1.0 / 12.0);
    if v <= 0.5 { v * v * (1.0 / 3.0) } else { high }
}

/// System gamma of hybrid log-gamma: ITU-R BT.2100, and BBC White Paper 369 for the light of the room.
fn hlg_gamma(peak: f64, ambient: f64) -> f64 {
    if peak > 1000.0 { 1.2 + 0.42 * (peak / 1000.0).log10() - 0.07623 * (ambient / 5.0).log10() } else { 1.2 }
}

/// Converts a row of code values to opponent channels; as many channels as there are planes.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn opponent_row(photometry: &Photometry, codes: &[[f32; 3]], planes: &mut [&mut [f32]]) {
    let mut light = [[0.0; AT_ONCE]; 3];
    for (place, codes) in codes.chunks(AT_ONCE).enumerate() {
        let [r, g, b] = &mut light;
        for (((code, r), g), b) in codes.iter().zip(&mut *r).zip(&mut *g).zip(&mut *b) {
            [*r, *g, *b] = *code;
        }
        photometry.oppose(&mut light, place * AT_ONCE..place * AT_ONCE + codes.len(), planes);
    }
}

/// The same of planes of code values, those of a picture and a share of its residual.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn opponent_planes(
    photometry: &Photometry,
    picture: [&[f32]; 3],
    (share, residual): (f32, [&[f32]; 3]),
    planes: &mut [&mut [f32]],
) {
    let mut light = [[0.0; AT_ONCE]; 3];
    let length = planes[0].len();
    for from in (0..length).step_by(AT_ONCE) {
        let here = from..(from + AT_ONCE).min(length);
        for c in 0..3 {
            let rows = [&picture[c][here.clone()], &residual[c][here.clone()]];
            map_rows(rows, [&mut light[c][..here.len()]], |[picture, residual]| [picture + share * residual]);
        }
        photometry.oppose(&mut light, here, planes);
    }
}

/// Converts grey code values, those of a picture and a share of its residual, to the achromatic channel.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn greys(
    photometry: &Photometry,
    picture: &[f32],
    (share, residual): (f32, &[f32]),
    light: &mut [f32],
) {
    let [r, g, b] = photometry.to_opponent[0];
    let white = r + g + b;
    let (range, floor) = (photometry.peak - photometry.black, photometry.black + photometry.reflected);
    if let Curve::Srgb = photometry.curve {
        map_rows([picture, residual], [light], |[picture, residual]| {
            [(range * srgb(unit(picture + share * residual)) + floor) * white]
        });
        return;
    }
    // Curves that hardly anybody asks for
    for ((light, picture), residual) in light.iter_mut().zip(picture).zip(residual) {
        *light = photometry.light([picture + share * residual; 3])[1] * white;
    }
}

/// Turns the light of two pictures in colour into that of their greys, which differs by as much as before where
/// that is more.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn keep_greys([one, other]: [&mut [f32]; 2], [grey, other_grey]: [&[f32]; 2]) {
    let pairs = one.iter_mut().zip(other).zip(grey.iter().zip(other_grey));
    for ((one, other), (&grey, &other_grey)) in pairs {
        let (sum, difference) = (*one + *other, *one - *other);
        let (greys, of_greys) = (grey + other_grey, grey - other_grey);
        let stronger = difference.abs() * greys > of_greys.abs() * sum;
        let apart = if stronger { difference * greys / sum } else { of_greys };
        (*one, *other) = (0.5 * (greys + apart), 0.5 * (greys - apart));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chromaticity::Chromaticities;
    use crate::viewing::ViewingParams;
    use proptest::prelude::*;

    fn viewing(text: &str) -> Viewing {
        text.parse().expect("conditions")
    }

    #[test]
    fn luminances_that_can_be_computed_by_hand() {
        let desk = viewing("desk"); // 200 cd/m², 1000:1, 250 lux on 0.5 %
        let reflected = 250.0 / std::f64::consts::PI * 0.005;
        for (code, luminance) in
            [(0.0, 0.2), (1.0, 200.0), (0.5, 0.2 + 199.8 * 0.214_041_14), (-3.0, 0.2), (7.0, 200.0)]
        {
            assert!(
                (desk.luminance(code) - luminance - reflected).abs() < 1e-3,
                "{code}: {}",
                desk.luminance(code)
            );
        }
        let gamma = viewing("peak=100,black=0,ambient=0,eotf=gamma2");
        assert!((gamma.luminance(0.5) - 25.0).abs() < 1e-3);
        // ST 2084: a code of 0.508 is 100 cd/m²; values above the peak are cut off
        let pq = viewing("peak=1000,black=0,ambient=0,eotf=pq,primaries=rec2020");
        assert!((pq.luminance(0.508_078) - 100.0).abs() < 0.05, "{}", pq.luminance(0.508_078));
        assert!((pq.luminance(1.0) - 1000.0).abs() < 1e-3);
        // BT.2100: half the signal is a twelfth of the scene's light, to the power of 1.2
        let hlg = viewing("peak=1000,black=0,ambient=0,eotf=hlg,primaries=rec2020");
        assert!(
            (hlg.luminance(0.5) - 1000.0 * (1f64 / 12.0).powf(1.2)).abs() < 0.01,
            "{}",
            hlg.luminance(0.5)
        );
        assert!((hlg.luminance(1.0) - 1000.0).abs() < 0.05);
        let linear = viewing("peak=1000,black=0,ambient=0,eotf=linear");
        assert!((linear.luminance(123.0) - 123.0).abs() < 1e-4);
    }

    #[test]
    fn greys_have_hardly_any_colour_and_about_their_luminance() {
        let photometry = Photometry::new(&viewing("desk"));
        let [achromatic, red, violet] = opponent(&viewing("desk"), [0.6; 3]);
        let luminance = viewing("desk").luminance(0.6) as f32;
        assert!((achromatic / luminance - 1.0).abs() < 0.1, "{achromatic} for {luminance}");
        assert!(red.abs() < 0.02 * luminance && violet.abs() < 0.02 * luminance, "{red}, {violet}");
        let mut grey = [0.0];
        greys(&photometry, &[0.5], (-0.5, &[-0.2]), &mut grey);
        assert!((grey[0] / achromatic - 1.0).abs() < 1e-6);
    }

    /// Opponent channels of one colour.
    fn opponent(viewing: &Viewing, code: [f32; 3]) -> [f32; CHANNELS] {
        let mut planes = [[0.0; 1]; CHANNELS];
        let [a, b, c] = planes.each_mut();
        opponent_row(&Photometry::new(viewing), &[code], &mut [a, b, c]);
        planes.map(|[value]| value)
    }

    #[test]
    fn matrices_of_standards_are_those_of_their_chromaticities() {
        // That of Rec.709 was made for the D65 of ASTM E308, (0.31273, 0.32902); that of BT.2020 has four digits
        for (colours, matrix) in
            [(Chromaticities::REC709, REC709_TO_XYZ), (Chromaticities::REC2020, REC2020_TO_XYZ)]
        {
            let derived = colours.to_xyz().unwrap();
            for (a, b) in derived.iter().flatten().zip(matrix.iter().flatten()) {
                assert!((a - b).abs() < 3e-4, "{a} for {b}");
            }
        }
    }

    #[test]
    fn whites_colour_greys_and_hardly_change_their_light() {
        let grey = |text: &str| opponent(&viewing(text), [0.6; 3]);
        let [light, red, violet] = grey("desk,white=0.3127:0.3291");
        let [warm_light, warm_red, warm_violet] = grey("desk,white=d50");
        let [cold_light, cold_red, cold_violet] = grey("desk,white=d93");
        // Yellow is negative: with a white of D50 greys are redder and more yellow, with one of D93 bluer
        assert!(warm_red > red + 0.02 * light && warm_violet < violet - 0.1 * light);
        assert!(cold_red < red && cold_violet > violet + 0.1 * light);
        assert!((warm_light / light - 1.0).abs() < 0.003 && (cold_light / light - 1.0).abs() < 0.003);
        // White's luminance stays the peak, only its parts change: there is less blue light in a warm white
        let blue = |text: &str| opponent(&viewing(text), [0.0, 0.0, 1.0])[0];
        assert!(blue("desk,white=d50") < 0.8 * blue("desk"));
    }

    proptest! {
        #[test]
        fn srgb_is_that_of_the_standard(code in 0.0f32..1.0) {
            let v = f64::from(code);
            let exact = if v > 0.04045 { ((v + 0.055) / 1.055).powf(2.4) } else { v / 12.92 };
            prop_assert!((f64::from(srgb(code)) - exact).abs() <= 3e-6 * exact, "{code}");
        }

        #[test]
        fn more_code_is_more_light(
            eotf in prop_oneof![
                Just(Eotf::Srgb), Just(Eotf::Pq), Just(Eotf::Hlg), (1.0f64..4.0).prop_map(Eotf::Gamma)
            ],
            code in 0.0f32..1.0, step in 0.0f32..0.5,
        ) {
            let params = ViewingParams { eotf, ..viewing("desk").params() };
            let viewing = params.check().unwrap();
            prop_assert!(viewing.luminance(code + step) >= viewing.luminance(code) * (1.0 - 1e-4));
        }
    }
}
