//! Clear skies with a sun (Hošek and Wilkie 2012), as environment maps.

use crate::mesh::rotation;
use glam::{DMat3, DVec3};
use hw_skymodel::rgb::{Channel, SkyParams, SkyState};
use noisefloor::Rgb;
use noisefloor_ptwne::EnvironmentMap;

/// Pixels of the map around the horizon: small enough for the sun's disk to fill several.
const WIDTH: usize = 2048;
const HEIGHT: usize = WIDTH / 2;
/// From the units of the model's tables to W/(m²·sr·nm): one over the integral of the CIE's ȳ in nanometres.
const SKY_UNIT: f64 = 1.0 / 106.857;
/// Apparent diameter of the sun in degrees.
pub(crate) const SUN_DIAMETER: f64 = 0.5358;
/// Turbidities that the model knows.
pub(crate) const TURBIDITIES: std::ops::RangeInclusive<f64> = 1.0..=10.0;

/// A clear sky. +z is up.
#[derive(Clone, Debug)]
pub(crate) struct ClearSky {
    /// Towards the sun.
    pub(crate) sun: DVec3,
    /// How hazy the air is: 1…10.
    pub(crate) turbidity: f64,
    /// Reflectance of the ground, 0…1.
    pub(crate) albedo: Rgb,
    /// Factors on the radiance of the sky and of the sun; 0 leaves one out.
    pub(crate) scales: [f64; 2],
    /// Apparent diameter of the sun in degrees. Its light in all does not depend on it.
    pub(crate) sun_diameter: f64,
}

impl ClearSky {
    /// The map of this sky. Below the horizon all is black. `to_world` turns the sky, whose +z is up.
    pub(crate) fn map(&self, to_world: DMat3) -> Result<EnvironmentMap, String> {
        let sun = self.sun.try_normalize().filter(|sun| sun.z >= 0.0);
        let sun = sun.ok_or("the sun is below the horizon")?;
        let elevation = sun.z.asin().min(std::f64::consts::FRAC_PI_2);
        let params = SkyParams {
            elevation: (elevation as f32).min(std::f32::consts::FRAC_PI_2),
            turbidity: self.turbidity as f32,
            albedo: self.albedo,
        };
        let state = SkyState::new(&params).map_err(|e| e.to_string())?;

        let mut pixels = vec![[0.0f32; 3]; WIDTH * HEIGHT];
        for (index, pixel) in pixels.iter_mut().enumerate() {
            let dir = direction(index);
            if dir.z <= 0.0 || self.scales[0] <= 0.0 {
                continue;
            }
            let (theta, gamma) = (dir.z.acos() as f32, dir.dot(sun).clamp(-1.0, 1.0).acos() as f32);
            *pixel = [Channel::R, Channel::G, Channel::B].map(|channel| {
                let radiance = f64::from(state.radiance(theta, gamma, channel)) * SKY_UNIT * self.scales[0];
                radiance.max(0.0) as f32
            });
        }
        if self.scales[1] > 0.0 {
            self.add_sun(sun, elevation.to_degrees(), &mut pixels);
        }
        // The map's own axes: its +y is the sky's +z, its +z the sky's −y
        let to_world = rotation(DMat3::from_cols(to_world.x_axis, to_world.z_axis, -to_world.y_axis));
        Ok(EnvironmentMap { width: WIDTH, height: HEIGHT, pixels, to_world, poles: false })
    }

    /// Adds the sun's disk: what it gives off in all is exact, its outline as fine as the pixels.
    fn add_sun(&self, sun: DVec3, elevation: f64, pixels: &mut [Rgb]) {
        let radius = (0.5 * self.sun_diameter).to_radians();
        // A disk below a pixel's size fills one
        let reach = radius.max(std::f64::consts::PI / HEIGHT as f64).cos();
        let covered: Vec<usize> = (0..pixels.len()).filter(|i| direction(*i).dot(sun) >= reach).collect();
        let area: f64 = covered.iter().map(|i| solid_angle(*i)).sum();
        // The light of a sun of its natural size, as in all versions of Mitsuba
        let disk = std::f64::consts::TAU * (1.0 - (0.5 * SUN_DIAMETER).to_radians().cos());
        let radiance = sun_radiance(elevation, self.turbidity);
        for index in covered {
            for (value, sun) in pixels[index].iter_mut().zip(radiance) {
                *value += (sun * self.scales[1] * disk / area) as f32;
            }
        }
    }
}

/// Where the middle of a pixel lies, +z up: u = 0 is at −y of the map's −z, and runs towards +x.
fn direction(index: usize) -> DVec3 {
    let u = (index % WIDTH) as f64 + 0.5;
    let v = (index / WIDTH) as f64 + 0.5;
    let (sin_phi, cos_phi) = (std::f64::consts::TAU * u / WIDTH as f64).sin_cos();
    let (sin, cos) = (std::f64::consts::PI * v / HEIGHT as f64).sin_cos();
    // The map's (x, y, z) is (sin φ, cos θ, −cos φ); its +z is the sky's −y
    DVec3::new(sin * sin_phi, sin * cos_phi, cos)
}

/// Solid angle of a pixel.
fn solid_angle(index: usize) -> f64 {
    let edge = |row: usize| (std::f64::consts::PI * row as f64 / HEIGHT as f64).cos();
    let row = index / WIDTH;
    (edge(row) - edge(row + 1)) * std::f64::consts::TAU / WIDTH as f64
}

/// Radiance of the sun's disk in W/(m²·sr·nm) as linear Rec.709, interpolated between what Mitsuba 3.9.1
/// gives for it.
fn sun_radiance(elevation: f64, turbidity: f64) -> [f64; 3] {
    let (e, et) = place(&ELEVATIONS, elevation);
    let (t, tt) = place(&SUN_TURBIDITIES, turbidity);
    std::array::from_fn(|c| {
        let row = |t: usize| SUN[t][e][c] + (SUN[t][e + 1][c] - SUN[t][e][c]) * et;
        row(t) + (row(t + 1) - row(t)) * tt
    })
}

/// Between which two of rising numbers `x` lies, and how far from the first to the second.
fn place(all: &[f64], x: f64) -> (usize, f64) {
    let i = all.partition_point(|a| *a <= x).clamp(1, all.len() - 1) - 1;
    (i, ((x - all[i]) / (all[i + 1] - all[i])).clamp(0.0, 1.0))
}

/// Rows and columns of [`SUN`]: turbidities, and elevations of the sun in degrees.
const SUN_TURBIDITIES: [f64; 7] = [1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0];
const ELEVATIONS: [f64; 8] = [1.0, 3.0, 6.0, 10.0, 20.0, 40.0, 65.0, 90.0];
#[rustfmt::skip]
const SUN: [[[f64; 3]; 8]; 7] = [
    [[7058.0, 2011.0, 0.0], [8826.0, 3226.0, 177.6], [13400.0, 6689.0, 1313.0], [16740.0, 10280.0, 3633.0], [20080.0, 14880.0, 8438.0], [21930.0, 17900.0, 12830.0], [22580.0, 19040.0, 14770.0], [22730.0, 19300.0, 15250.0]],
    [[5598.0, 1562.0, 0.0], [7443.0, 2723.0, 167.6], [12250.0, 6077.0, 1208.0], [15860.0, 9688.0, 3439.0], [19540.0, 14440.0, 8201.0], [21610.0, 17610.0, 12640.0], [22350.0, 18820.0, 14610.0], [22520.0, 19110.0, 15100.0]],
    [[3819.0, 1032.0, 0.0], [5666.0, 2079.0, 149.2], [10560.0, 5189.0, 1051.0], [14490.0, 8789.0, 3141.0], [18680.0, 13740.0, 7824.0], [21100.0, 17150.0, 12330.0], [21980.0, 18470.0, 14350.0], [22180.0, 18790.0, 14860.0]],
    [[2035.0, 519.5, 0.0], [3703.0, 1366.0, 119.6], [8298.0, 4012.0, 837.6], [12510.0, 7490.0, 2704.0], [17340.0, 12660.0, 7237.0], [20280.0, 16420.0, 11820.0], [21370.0, 17910.0, 13940.0], [21620.0, 18260.0, 14470.0]],
    [[583.9, 133.0, 0.0], [1760.0, 656.2, 74.51], [5310.0, 2496.0, 551.7], [9519.0, 5568.0, 2048.0], [15100.0, 10880.0, 6264.0], [18850.0, 15140.0, 10950.0], [20290.0, 16910.0, 13200.0], [20630.0, 17340.0, 13770.0]],
    [[53.37, 9.733, 0.0], [543.1, 198.3, 27.88], [2392.0, 1073.0, 261.3], [5792.0, 3247.0, 1236.0], [11740.0, 8236.0, 4809.0], [16480.0, 13060.0, 9513.0], [18450.0, 15220.0, 11950.0], [18930.0, 15760.0, 12580.0]],
    [[0.09032, 0.007226, 0.0], [34.0, 10.02, 1.719], [320.2, 127.8, 38.37], [1533.0, 767.3, 318.7], [5900.0, 3866.0, 2343.0], [11440.0, 8723.0, 6490.0], [14250.0, 11440.0, 9108.0], [14970.0, 12160.0, 9842.0]],
];

#[cfg(test)]
mod tests {
    use super::*;

    fn sky(scales: [f64; 2]) -> ClearSky {
        let sun = DVec3::new(0.0, 0.6, 0.8);
        ClearSky { sun, turbidity: 3.0, albedo: [0.15; 3], scales, sun_diameter: SUN_DIAMETER }
    }

    /// The pixel that shows the direction.
    fn pixel_towards(map: &EnvironmentMap, dir: DVec3) -> Rgb {
        let dir = dir.normalize();
        let nearest =
            (0..map.pixels.len()).max_by(|a, b| direction(*a).dot(dir).total_cmp(&direction(*b).dot(dir)));
        map.pixels[nearest.unwrap_or_default()]
    }

    /// What Mitsuba 3.9.1 computes for the same sky.
    #[test]
    fn skies_are_those_of_mitsuba() {
        let map = sky([1.0, 0.0]).map(DMat3::IDENTITY).unwrap();
        for (dir, want) in [
            (DVec3::new(0.0, 0.0, 1.0), [0.027_04, 0.044_02, 0.087_27]),
            (DVec3::new(0.6, 0.0, 0.8), [0.027_36, 0.048_64, 0.097_83]),
            (DVec3::new(0.0, -0.6, 0.8), [0.020_32, 0.040_43, 0.087_35]),
            (DVec3::new(0.0, 0.8, 0.6), [0.119_57, 0.153_45, 0.208_63]),
            (DVec3::new(0.99, 0.0, 0.141), [0.085_04, 0.133_63, 0.206_64]),
            (DVec3::new(0.0, 0.0, -1.0), [0.0; 3]),
        ] {
            let got = pixel_towards(&map, dir);
            let off = got.iter().zip(want).any(|(got, want): (&f32, f32)| (got - want).abs() > 0.03 * want);
            assert!(!off, "{dir}: {got:?}, want {want:?}");
        }
    }

    /// The flux of the sun is that of its disk, wherever it stands.
    #[test]
    fn suns_have_their_flux() {
        let map = sky([0.0, 1.0]).map(DMat3::IDENTITY).unwrap();
        let flux: f64 = map.pixels.iter().enumerate().map(|(i, p)| f64::from(p[1]) * solid_angle(i)).sum();
        let disk = std::f64::consts::TAU * (1.0 - (0.5 * SUN_DIAMETER).to_radians().cos());
        assert!((flux / (18_034.7 * disk) - 1.0).abs() < 0.02, "{flux}");
        assert!(pixel_towards(&map, DVec3::new(0.0, 0.6, 0.8))[1] > 1000.0);
        // A larger sun gives off as much
        let large = ClearSky { sun_diameter: 4.0 * SUN_DIAMETER, ..sky([0.0, 1.0]) };
        let map = large.map(DMat3::IDENTITY).unwrap();
        let spread: f64 = map.pixels.iter().enumerate().map(|(i, p)| f64::from(p[1]) * solid_angle(i)).sum();
        assert!((spread / flux - 1.0).abs() < 1e-3, "{spread} {flux}");
    }

    #[test]
    fn suns_below_the_horizon_are_errors() {
        let low = ClearSky { sun: DVec3::NEG_Z, ..sky([1.0; 2]) };
        assert!(low.map(DMat3::IDENTITY).unwrap_err().contains("below the horizon"));
        let hazy = ClearSky { turbidity: 11.0, ..sky([1.0; 2]) };
        assert!(hazy.map(DMat3::IDENTITY).is_err());
    }
}
