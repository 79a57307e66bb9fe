//! Viewing conditions by name: those that users recognise, and the displays of ColorVideoVDP.

use crate::screen::Screen;
use crate::viewing::{Eotf, Primaries, Viewing, ViewingParams};

/// Named viewing conditions.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ViewingPreset {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, in a few words; empty for displays of ColorVideoVDP, whose names say it.
    pub about: &'static str,
    /// The screen and its distance.
    pub screen: Screen,
    /// Luminance of white, in cd/m².
    pub peak: f64,
    /// Luminance of black in a dark room, in cd/m².
    pub black: f64,
    /// Light of the room, in lux.
    pub ambient: f64,
    /// How code values become light.
    pub eotf: Eotf,
    /// Their primaries.
    pub primaries: Primaries,
}

/// Share of the room's light that displays reflect, unless one says otherwise: that of ColorVideoVDP.
pub(crate) const REFLECTIVITY: f64 = 0.005;

impl ViewingPreset {
    /// The preset of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        PRESETS.iter().find(|preset| preset.name == name)
    }

    /// Its conditions, checked.
    pub fn viewing(&self) -> Viewing {
        self.params().check().expect("a test checks every preset")
    }

    /// Its conditions, to change some of them.
    pub fn params(&self) -> ViewingParams {
        ViewingParams {
            pixels_per_degree: self.screen.pixels_per_degree(),
            peak: self.peak,
            black: self.black,
            ambient: self.ambient,
            reflectivity: REFLECTIVITY,
            eotf: self.eotf,
            primaries: self.primaries,
            frames_per_second: None,
        }
    }
}

impl Default for Viewing {
    /// `desk`: a 24-inch Full HD monitor of 200 cd/m² in an office, seen from 60 cm. The same as
    /// ColorVideoVDP's `standard_fhd`.
    fn default() -> Self {
        PRESETS[0].viewing()
    }
}

/// Columns, rows, diagonal in inches, distance in metres.
type Seen = (u32, u32, f64, f64);
/// White and black in cd/m², light of the room in lux.
type Light = (f64, f64, f64);

const fn preset(name: &'static str, about: &'static str, seen: Seen, light: Light) -> ViewingPreset {
    let screen = Screen { resolution: (seen.0, seen.1), diagonal: seen.2, distance: seen.3 };
    let (peak, black, ambient) = light;
    let (eotf, primaries) = SDR;
    ViewingPreset { name, about, screen, peak, black, ambient, eotf, primaries }
}

const fn cvvdp(
    name: &'static str,
    seen: Seen,
    light: Light,
    (eotf, primaries): (Eotf, Primaries),
) -> ViewingPreset {
    ViewingPreset { eotf, primaries, ..preset(name, "", seen, light) }
}

const SDR: (Eotf, Primaries) = (Eotf::Srgb, Primaries::Rec709);
const LINEAR: (Eotf, Primaries) = (Eotf::Linear, Primaries::Rec709);
const PQ: (Eotf, Primaries) = (Eotf::Pq, Primaries::Rec2020);
const HLG: (Eotf, Primaries) = (Eotf::Hlg, Primaries::Rec2020);
const INCH: f64 = 0.0254;
/// Distance in diagonals at which a flat screen spans 110° from corner to corner: 1/(2·tan 55°).
const SPAN_110: f64 = 0.350_103_769_104_854_9;

/// All presets: first those that users recognise, then `display_models.json` of ColorVideoVDP 0.5.7, under
/// its names.
#[rustfmt::skip]
pub const PRESETS: &[ViewingPreset] = &[
    preset("desk", "24-inch monitor in an office, from 60 cm", (1920, 1080, 24.0, 0.6), (200.0, 0.2, 250.0)),
    preset("laptop", "14-inch laptop indoors, from 50 cm", (1920, 1200, 14.0, 0.5), (300.0, 0.3, 250.0)),
    preset("tv", "55-inch television in a dim room, from 3 m", (3840, 2160, 55.0, 3.0), (350.0, 0.1, 50.0)),
    preset("phone", "6-inch phone indoors, from 40 cm", (2400, 1080, 6.0, 0.4), (500.0, 0.05, 250.0)),
    // 48 cd/m² and 2000:1: SMPTE ST 431-1, RP 431-2. The picture is 5 m high, which makes a diagonal of 422
    // inches.
    preset("cinema", "4K cinema, from two picture heights", (4096, 2160, 422.0, 10.0), (48.0, 0.024, 0.0)),
    cvvdp("standard_4k", (3840, 2160, 30.0, 0.7472), (200.0, 0.2, 250.0), SDR),
    cvvdp("standard_hdr_pq", (3840, 2160, 30.0, 0.7472), (1500.0, 0.0015, 10.0), PQ),
    cvvdp("standard_hdr_hlg", (3840, 2160, 30.0, 0.7472), (1500.0, 0.0015, 10.0), HLG),
    cvvdp("standard_hdr_linear", (3840, 2160, 30.0, 0.7472), (1500.0, 0.0015, 10.0), LINEAR),
    cvvdp("standard_hdr_linear_dark", (3840, 2160, 30.0, 0.7472), (1500.0, 0.0015, 0.0), LINEAR),
    cvvdp("standard_hdr_linear_zoom", (3840, 2160, 30.0, 0.25), (10_000.0, 0.01, 10.0), LINEAR),
    cvvdp("standard_fhd", (1920, 1080, 24.0, 0.6), (200.0, 0.2, 250.0), SDR),
    cvvdp("standard_hmd", (1440, 1600, 100.0, 100.0 * INCH * SPAN_110), (100.0, 0.1, 0.0), SDR),
    cvvdp("standard_phone", (2400, 1080, 6.0, 0.4), (500.0, 0.05, 250.0), SDR),
    cvvdp("sdr_4k_30", (3840, 2160, 30.0, 0.6), (100.0, 0.1, 250.0), SDR),
    cvvdp("sdr_fhd_24", (1920, 1080, 24.0, 0.6), (100.0, 0.1, 250.0), SDR),
    cvvdp("htc_vive_pro", (1440, 1600, 100.0, 100.0 * INCH * SPAN_110), (133.3, 0.1, 0.0), SDR),
    cvvdp("iphone_12_pro", (2532, 1170, 6.1, 20.0 * INCH), (825.0, 0.0004, 250.0), SDR),
    cvvdp("iphone_14_pro", (2532, 1170, 6.1, 20.0 * INCH), (1025.0, 0.0004, 250.0), SDR),
    cvvdp("iphone_14_pro_vert", (1170, 2532, 6.1, 20.0 * INCH), (1025.0, 0.0004, 250.0), SDR),
    cvvdp("iphone_14_pro_hdr", (2532, 1170, 6.1, 20.0 * INCH), (1590.0, 0.0004, 10.0), HLG),
    cvvdp("iphone_14_pro_hdr_vert", (1170, 2532, 6.1, 20.0 * INCH), (1590.0, 0.0004, 10.0), HLG),
    cvvdp("ipad_pro_12_9", (2732, 2048, 12.9, 20.0 * INCH), (600.0, 0.37, 250.0), SDR),
    cvvdp("macbook_pro_16", (3072, 1920, 16.0, 25.0 * INCH), (500.0, 0.37, 250.0), SDR),
    cvvdp("lg_oled_2017_sdr", (3840, 2160, 64.5, 101.0 * INCH), (272.0, 0.014, 100.0), SDR),
    cvvdp("lg_oled_2017_hdr", (3840, 2160, 64.5, 101.0 * INCH), (754.0, 0.038, 100.0), SDR),
    cvvdp("eizo_CG3146", (4096, 2160, 31.063, 0.73406), (300.0, 0.1, 0.0), SDR),
    cvvdp("65inch_hdr_pq_4knit", (3840, 2160, 65.0, 1.98), (4000.0, 0.004, 5.0), PQ),
    cvvdp("65inch_hdr_pq_2Knit", (3840, 2160, 65.0, 1.98), (2000.0, 0.002, 5.0), PQ),
    cvvdp("65inch_hdr_pq_1Knit", (3840, 2160, 65.0, 1.98), (1000.0, 0.001, 5.0), PQ),
    cvvdp("lg_oled_2026_hdr_pq", (3840, 2160, 64.9, 86.62 * INCH), (3000.0, 0.0005, 5.0), PQ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_valid_and_has_a_name_of_its_own() {
        for (i, preset) in PRESETS.iter().enumerate() {
            assert!(preset.params().check().is_ok(), "{}", preset.name);
            assert!(PRESETS[..i].iter().all(|other| other.name != preset.name), "{}", preset.name);
        }
        assert_eq!(Viewing::default(), ViewingPreset::named("standard_fhd").unwrap().viewing());
    }

    #[test]
    fn pixels_per_degree_of_recognised_presets() {
        let pixels_per_degree = |name| ViewingPreset::named(name).unwrap().viewing().pixels_per_degree();
        for (name, expected) in
            [("desk", 37.85), ("laptop", 55.56), ("tv", 165.1), ("phone", 120.6), ("cinema", 75.4)]
        {
            assert!(
                (pixels_per_degree(name) - expected).abs() < 0.05 * expected / 10.0,
                "{name}: {}",
                pixels_per_degree(name)
            );
        }
        // A screen that spans 110° along its diagonal has fewer pixels per degree in its centre than 2153/110
        assert!(
            (pixels_per_degree("standard_hmd") - 13.16).abs() < 0.1,
            "{}",
            pixels_per_degree("standard_hmd")
        );
    }
}
