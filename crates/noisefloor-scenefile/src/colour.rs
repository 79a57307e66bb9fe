//! Spectra, and colours of other spaces, as linear Rec.709 colours.

use glam::{DMat3, DVec3};
use noisefloor::Rgb;

/// First wavelength of [`CIE`] in nanometres, and the step between its rows.
const FIRST: f64 = 360.0;
const STEP: f64 = 5.0;
/// Wavelengths of the first and the last row in nanometres.
pub(crate) const VISIBLE: [f64; 2] = [FIRST, 830.0];
/// Integral of the second column of [`CIE`], which is what turns a spectrum of 1 into a Y of 1.
const Y_INTEGRAL: f64 = 106.857;
/// Temperatures that black bodies may have, in kelvin.
pub(crate) const TEMPERATURES: std::ops::RangeInclusive<f64> = 100.0..=1e6;

/// Linear Rec.709 colour of a spectrum that is 1 at all wavelengths: an equal-energy white is a little redder
/// than D65.
pub(crate) const EQUAL_ENERGY: Rgb = [1.20479, 0.948_29, 0.908_92];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// A factor on light, such as a reflectance: seen under D65, the white of Rec.709, so that 1 at all
    /// wavelengths is white.
    Factor,
    Light,
}

/// The colour of a spectrum given at rising wavelengths in nanometres: linear in between, zero beyond.
/// Channels that would be negative, as colours outside Rec.709 have them, are zero.
pub(crate) fn of_spectrum(samples: &[(f64, f64)], quantity: Quantity) -> Rgb {
    let at = |wavelength: f64| {
        let next = samples.partition_point(|(w, _)| *w <= wavelength);
        match (next.checked_sub(1).map(|i| samples[i]), samples.get(next)) {
            (Some((w0, v0)), Some((w1, v1))) => v0 + (v1 - v0) * (wavelength - w0) / (w1 - w0),
            (Some((w0, v0)), None) if w0 == wavelength => v0,
            _ => 0.0,
        }
    };
    integrate(at, quantity)
}

/// The colour of light from a black body of that temperature in kelvin: Planck's radiance per nanometre, in
/// W/(m²·sr·nm).
pub(crate) fn of_black_body(temperature: f64) -> Rgb {
    integrate(|nanometres| planck(nanometres, temperature), Quantity::Light)
}

/// Planck's law.
fn planck(nanometres: f64, temperature: f64) -> f64 {
    // CODATA 2018: h, c and Boltzmann's constant
    let (h, c, k) = (6.626_070_15e-34, 299_792_458.0, 1.380_649e-23);
    let wavelength = nanometres * 1e-9;
    2.0 * h * c * c / (wavelength.powi(5) * (h * c / (wavelength * k * temperature)).exp_m1()) * 1e-9
}

/// The largest radiance of a black body per nanometre, in W/(m²·sr·nm).
pub(crate) fn peak_of_black_body(temperature: f64) -> f64 {
    // Wien's displacement law
    planck(2.897_772e6 / temperature, temperature)
}

/// The colour of a standard illuminant of luminance 1, by its name without `stdillum-` or `illum-`.
pub(crate) fn of_illuminant(name: &str) -> Option<Rgb> {
    let (_, [x, y]) = ILLUMINANTS.iter().find(|illuminant| illuminant.0 == name)?;
    Some(of_xyz([x / y, 1.0, (1.0 - x - y) / y]))
}

/// XYZ as a linear Rec.709 colour; what is negative becomes 0.
pub(crate) fn of_xyz(xyz: [f64; 3]) -> Rgb {
    linear(xyz).map(|c| c.max(0.0) as f32)
}

fn linear(xyz: [f64; 3]) -> [f64; 3] {
    RGB_OF_XYZ.map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2])
}

/// The space of a colour's three numbers, as pbrt 4 names them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ColourSpace {
    /// Linear Rec.709, as everything here.
    #[default]
    Srgb,
    Rec2020,
    /// Of displays, with a white of D65.
    DciP3,
    /// AP0, whose white is D60.
    Aces,
}

impl ColourSpace {
    /// The space called so by pbrt's `ColorSpace`, which takes any case.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let spaces = [
            ("srgb", Self::Srgb),
            ("rec2020", Self::Rec2020),
            ("dci-p3", Self::DciP3),
            ("aces2065-1", Self::Aces),
        ];
        spaces.into_iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, space)| space)
    }

    /// A colour of this space as one of Rec.709. A factor of 1 stays white; light of 1 is the white of the space.
    /// Channels that would be negative are zero.
    pub(crate) fn to_rec709(self, colour: Rgb, quantity: Quantity) -> Rgb {
        let (primaries, white) = match self {
            Self::Srgb => return colour,
            // ITU-R BT.2020, table 3
            Self::Rec2020 => ([[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]], D65),
            // SMPTE EG 432-1
            Self::DciP3 => ([[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]], D65),
            // SMPTE ST 2065-1
            Self::Aces => ([[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.0770]], [0.321_68, 0.337_67]),
        };
        // Linear RGB → XYZ, white having a Y of 1 (SMPTE RP 177)
        let [red, green, blue] = primaries.map(|[x, y]| DVec3::new(x, y, 1.0 - x - y));
        let columns = DMat3::from_cols(red, green, blue);
        let xyz_of = |[x, y]: [f64; 2]| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
        let to_xyz = columns * DMat3::from_diagonal(columns.inverse() * xyz_of(white));
        let rec709 = |colour: DVec3| linear((to_xyz * colour).to_array());
        let found = rec709(DVec3::from_array(colour.map(f64::from)));
        let light = quantity == Quantity::Light && white != D65;
        let white = if light { [1.0; 3] } else { rec709(DVec3::ONE) };
        std::array::from_fn(|i| (found[i] / white[i]).max(0.0) as f32)
    }
}

/// The white of Rec.709.
const D65: [f64; 2] = [0.3127, 0.3290];

/// Integrates a spectrum against the colour matching functions in steps of a nanometre.
fn integrate(at: impl Fn(f64) -> f64, quantity: Quantity) -> Rgb {
    let last = (CIE.len() - 1) as f64 * STEP;
    let (mut sums, mut white) = ([0.0; 3], [0.0; 3]);
    for nanometre in 0..=last as u32 {
        let x = f64::from(nanometre) / STEP;
        let row = (x as usize).min(CIE.len() - 2);
        let [r, g, b, d65] =
            std::array::from_fn(|i| CIE[row][i] + (CIE[row + 1][i] - CIE[row][i]) * (x - row as f64));
        let light = if quantity == Quantity::Factor { d65 } else { 1.0 };
        let value = at(FIRST + f64::from(nanometre));
        for (i, matching) in [r, g, b].into_iter().enumerate() {
            sums[i] += value * matching * light;
            white[i] += matching * light;
        }
    }
    match quantity {
        Quantity::Light => linear(sums.map(|sum| sum / Y_INTEGRAL)).map(|c| c.max(0.0) as f32),
        // The table's D65 is white to three digits: divide the rest away
        Quantity::Factor => {
            let (colour, white) = (linear(sums), linear(white));
            std::array::from_fn(|i| (colour[i] / white[i]).max(0.0) as f32)
        }
    }
}

/// From XYZ to linear Rec.709 (IEC 61966-2-1).
const RGB_OF_XYZ: [[f64; 3]; 3] = [
    [3.240_479, -1.537_15, -0.498_535],
    [-0.969_256, 1.875_991, 0.041_556],
    [0.055_648, -0.204_043, 1.057_311],
];

/// Chromaticities x and y of the CIE's standard illuminants (CIE 15:2004, tables T.3 and T.8; the y of F10 is that of
/// its spectrum), and of the D60 of ACES (SMPTE ST 2065-1).
const ILLUMINANTS: [(&str, [f64; 2]); 16] = [
    ("A", [0.447_57, 0.407_45]),
    ("D50", [0.345_67, 0.358_50]),
    ("D65", [0.312_72, 0.329_03]),
    ("acesD60", [0.321_68, 0.337_67]),
    ("F1", [0.313_10, 0.337_27]),
    ("F2", [0.372_08, 0.375_29]),
    ("F3", [0.409_10, 0.394_30]),
    ("F4", [0.440_18, 0.403_29]),
    ("F5", [0.313_79, 0.345_31]),
    ("F6", [0.377_90, 0.388_35]),
    ("F7", [0.312_92, 0.329_33]),
    ("F8", [0.345_88, 0.358_75]),
    ("F9", [0.374_17, 0.372_81]),
    ("F10", [0.346_09, 0.358_96]),
    ("F11", [0.380_52, 0.377_13]),
    ("F12", [0.436_95, 0.404_41]),
];

/// The colour matching functions x̄, ȳ and z̄ of the CIE 1931 standard observer (CIE 018:2019), and the
/// relative power of the illuminant D65 (ISO/CIE 11664-2), every 5 nm from 360 to 830.
#[rustfmt::skip]
const CIE: [[f64; 4]; 95] = [
    [0.0001299, 3.917e-06, 0.0006061, 46.6383],
    [0.0002321, 6.965e-06, 0.001086, 49.3637],
    [0.0004149, 1.239e-05, 0.001946, 52.0891],
    [0.0007416, 2.202e-05, 0.003486, 51.0323],
    [0.001368, 3.9e-05, 0.00645, 49.9755],
    [0.002236, 6.4e-05, 0.01055, 52.3118],
    [0.004243, 0.00012, 0.02005, 54.6482],
    [0.00765, 0.000217, 0.03621, 68.7015],
    [0.01431, 0.000396, 0.06785, 82.7549],
    [0.02319, 0.00064, 0.1102, 87.1204],
    [0.04351, 0.00121, 0.2074, 91.486],
    [0.07763, 0.00218, 0.3713, 92.4589],
    [0.13438, 0.004, 0.6456, 93.4318],
    [0.21477, 0.0073, 1.03905, 90.057],
    [0.2839, 0.0116, 1.3856, 86.6823],
    [0.3285, 0.01684, 1.62296, 95.7736],
    [0.34828, 0.023, 1.74706, 104.865],
    [0.34806, 0.0298, 1.7826, 110.936],
    [0.3362, 0.038, 1.77211, 117.008],
    [0.3187, 0.048, 1.7441, 117.41],
    [0.2908, 0.06, 1.6692, 117.812],
    [0.2511, 0.0739, 1.5281, 116.336],
    [0.19536, 0.09098, 1.28764, 114.861],
    [0.1421, 0.1126, 1.0419, 115.392],
    [0.09564, 0.13902, 0.81295, 115.923],
    [0.05795, 0.1693, 0.6162, 112.367],
    [0.03201, 0.20802, 0.46518, 108.811],
    [0.0147, 0.2586, 0.3533, 109.082],
    [0.0049, 0.323, 0.272, 109.354],
    [0.0024, 0.4073, 0.2123, 108.578],
    [0.0093, 0.503, 0.1582, 107.802],
    [0.0291, 0.6082, 0.1117, 106.296],
    [0.06327, 0.71, 0.07825, 104.79],
    [0.1096, 0.7932, 0.05725, 106.239],
    [0.1655, 0.862, 0.04216, 107.689],
    [0.22575, 0.91485, 0.02984, 106.047],
    [0.2904, 0.954, 0.0203, 104.405],
    [0.3597, 0.9803, 0.0134, 104.225],
    [0.43345, 0.99495, 0.00875, 104.046],
    [0.51205, 1.0, 0.00575, 102.023],
    [0.5945, 0.995, 0.0039, 100.0],
    [0.6784, 0.9786, 0.00275, 98.1671],
    [0.7621, 0.952, 0.0021, 96.3342],
    [0.8425, 0.9154, 0.0018, 96.0611],
    [0.9163, 0.87, 0.00165, 95.788],
    [0.9786, 0.8163, 0.0014, 92.2368],
    [1.0263, 0.757, 0.0011, 88.6856],
    [1.0567, 0.6949, 0.001, 89.3459],
    [1.0622, 0.631, 0.0008, 90.0062],
    [1.0456, 0.5668, 0.0006, 89.8026],
    [1.0026, 0.503, 0.00034, 89.5991],
    [0.9384, 0.4412, 0.00024, 88.6489],
    [0.85445, 0.381, 0.00019, 87.6987],
    [0.7514, 0.321, 0.0001, 85.4936],
    [0.6424, 0.265, 5e-05, 83.2886],
    [0.5419, 0.217, 3e-05, 83.4939],
    [0.4479, 0.175, 2e-05, 83.6992],
    [0.3608, 0.1382, 1e-05, 81.863],
    [0.2835, 0.107, 0.0, 80.0268],
    [0.2187, 0.0816, 0.0, 80.1207],
    [0.1649, 0.061, 0.0, 80.2146],
    [0.1212, 0.04458, 0.0, 81.2462],
    [0.0874, 0.032, 0.0, 82.2778],
    [0.0636, 0.0232, 0.0, 80.281],
    [0.04677, 0.017, 0.0, 78.2842],
    [0.0329, 0.01192, 0.0, 74.0027],
    [0.0227, 0.00821, 0.0, 69.7213],
    [0.01584, 0.005723, 0.0, 70.6652],
    [0.0113592, 0.004102, 0.0, 71.6091],
    [0.00811092, 0.002929, 0.0, 72.979],
    [0.00579035, 0.002091, 0.0, 74.349],
    [0.00410946, 0.001484, 0.0, 67.9765],
    [0.00289933, 0.001047, 0.0, 61.604],
    [0.00204919, 0.00074, 0.0, 65.7448],
    [0.00143997, 0.00052, 0.0, 69.8856],
    [0.000999949, 0.0003611, 0.0, 72.4863],
    [0.000690079, 0.0002492, 0.0, 75.087],
    [0.000476021, 0.0001719, 0.0, 69.3398],
    [0.000332301, 0.00012, 0.0, 63.5927],
    [0.000234826, 8.48e-05, 0.0, 55.0054],
    [0.00016615, 6e-05, 0.0, 46.4182],
    [0.000117413, 4.24e-05, 0.0, 56.6118],
    [8.30753e-05, 3e-05, 0.0, 66.8054],
    [5.87065e-05, 2.12e-05, 0.0, 65.0941],
    [4.15099e-05, 1.499e-05, 0.0, 63.3828],
    [2.93533e-05, 1.06e-05, 0.0, 63.8434],
    [2.06738e-05, 7.4657e-06, 0.0, 64.304],
    [1.45598e-05, 5.2578e-06, 0.0, 61.8779],
    [1.0254e-05, 3.7029e-06, 0.0, 59.4519],
    [7.22146e-06, 2.6078e-06, 0.0, 55.7054],
    [5.08587e-06, 1.8366e-06, 0.0, 51.959],
    [3.58165e-06, 1.2934e-06, 0.0, 54.6998],
    [2.52252e-06, 9.1093e-07, 0.0, 57.4406],
    [1.77651e-06, 6.4153e-07, 0.0, 58.8765],
    [1.25114e-06, 4.5181e-07, 0.0, 60.3125],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn close(got: Rgb, want: Rgb, tolerance: f32) {
        let off = got.iter().zip(want).any(|(got, want)| (got - want).abs() > tolerance);
        assert!(!off, "{got:?}, want {want:?}");
    }

    /// As Mitsuba 3.9.1 has them in its RGB mode.
    #[test]
    fn spectra_have_the_colours_of_mitsuba() {
        let flat = [(300.0, 1.0), (900.0, 1.0)];
        close(of_spectrum(&flat, Quantity::Light), EQUAL_ENERGY, 1e-3);
        close(of_spectrum(&flat, Quantity::Factor), [1.0; 3], 1e-6);
        let rising = [(400.0, 0.1), (500.0, 0.2), (600.0, 0.3), (700.0, 0.4)];
        close(of_spectrum(&rising, Quantity::Light), [0.402_061, 0.231_368, 0.124_453], 1e-3);
        close(of_spectrum(&rising, Quantity::Factor), [0.340_779, 0.242_912, 0.140_304], 2e-3);
        let cut = [(400.0, 1.0), (500.0, 1.0), (600.0, 1.0)];
        close(of_spectrum(&cut, Quantity::Light), [0.230_967, 0.994_374, 0.917_431], 1e-2);
    }

    /// 6500 K is nearly D65: white within a few per cent. And as Stefan and Boltzmann have it, hotter is
    /// brighter.
    #[test]
    fn black_bodies_are_red_white_and_blue() {
        let [r, g, b] = of_black_body(6500.0);
        assert!((r / g - 1.0).abs() < 0.08 && (b / g - 1.0).abs() < 0.08, "{r} {g} {b}");
        let [r, g, b] = of_black_body(2000.0);
        assert!(r > 2.0 * g && g > 2.0 * b);
        let [r, g, b] = of_black_body(15_000.0);
        assert!(b > g && g > r);
        assert_eq!(of_black_body(*TEMPERATURES.start()), [0.0; 3]);
    }

    /// ITU-R BT.2087, table 2, and the matrices of P3 and AP0 without adaptation (colour-science 0.4.6).
    #[test]
    fn spaces_are_the_published_ones() {
        for (space, green) in [
            (ColourSpace::Rec2020, [0.0, 1.1329, 0.0]),
            (ColourSpace::DciP3, [0.0, 1.0421, 0.0]),
            (ColourSpace::Srgb, [0.0, 1.0, 0.0]),
        ] {
            close(space.to_rec709([0.0, 1.0, 0.0], Quantity::Light), green, 1e-3);
            close(space.to_rec709([1.0; 3], Quantity::Light), [1.0; 3], 1e-6);
            close(space.to_rec709([1.0; 3], Quantity::Factor), [1.0; 3], 1e-6);
        }
        // What lies inside both: BT.2087 of (0.5, 0.5, 0.25)
        let mixed = ColourSpace::Rec2020.to_rec709([0.5, 0.5, 0.25], Quantity::Factor);
        close(mixed, [0.5183, 0.5022, 0.2206], 1e-3);
        let d60 = of_illuminant("acesD60").unwrap();
        close(ColourSpace::Aces.to_rec709([1.0; 3], Quantity::Light), d60, 1e-3);
        close(ColourSpace::Aces.to_rec709([1.0; 3], Quantity::Factor), [1.0; 3], 1e-6);
        assert_eq!(ColourSpace::named("Rec2020"), Some(ColourSpace::Rec2020));
        assert_eq!(ColourSpace::named("acescg"), None);
    }

    #[test]
    fn one_wavelength_has_no_area() {
        assert_eq!(of_spectrum(&[(555.0, 0.0)], Quantity::Light), [0.0; 3]);
        assert_eq!(of_spectrum(&[], Quantity::Light), [0.0; 3]);
    }
}
