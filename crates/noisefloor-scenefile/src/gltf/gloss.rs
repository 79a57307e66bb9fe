//! `KHR_materials_pbrSpecularGlossiness` as metal and roughness.

use noisefloor::Rgb;

/// What a dielectric reflects at normal incidence.
const DIELECTRIC: f32 = 0.04;

/// A surface by its diffuse and specular colours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gloss {
    pub(super) diffuse: Rgb,
    pub(super) specular: Rgb,
    pub(super) glossiness: f32,
}

impl Gloss {
    /// Base colour, roughness and share of metal of what reflects the same at normal incidence: of a base b with
    /// the share m of metal, that is b·(1 − m) diffusely and 0.04·(1 − m) + b·m specularly. The share is
    /// solved for with luminances, the colour then taken from the specular one as far as it is metal.
    pub(super) fn metal(self) -> (Rgb, [f32; 2]) {
        let strongest = self.specular.into_iter().fold(0.0, f32::max);
        let [d, s] = [self.diffuse, self.specular].map(noisefloor::display::luminance);
        // The diffuse colour is that below what reflects most
        let d = d * (1.0 - strongest);
        // From b = (s − 0.04·(1 − m))/m in d = b·(1 − m): a quadratic in m
        let metal = if s <= DIELECTRIC {
            0.0
        } else {
            let b = d + s - 2.0 * DIELECTRIC;
            let root = (b * b - 4.0 * DIELECTRIC * (DIELECTRIC - s)).max(0.0).sqrt();
            ((root - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
        };
        let below = (1.0 - strongest) / (1.0 - metal).max(1e-4);
        let base = std::array::from_fn(|i| {
            let plain = self.diffuse[i] * below;
            let shiny = (self.specular[i] - DIELECTRIC * (1.0 - metal)) / metal.max(1e-4);
            (plain + (shiny - plain) * metal * metal).clamp(0.0, 1.0)
        });
        (base, [1.0 - self.glossiness, metal])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plastic_and_gold_are_what_they_were() {
        let plastic = Gloss { diffuse: [0.5, 0.2, 0.1], specular: [DIELECTRIC; 3], glossiness: 0.75 };
        let (base, [roughness, metal]) = plastic.metal();
        let below = plastic.diffuse.map(|d| d * (1.0 - DIELECTRIC));
        assert!(base.iter().zip(below).all(|(a, b)| (a - b).abs() < 1e-5), "{base:?}");
        assert_eq!((roughness, metal), (0.25, 0.0));
        let gold = Gloss { diffuse: [0.0; 3], specular: [1.0, 0.77, 0.34], glossiness: 0.5 };
        let (base, [_, metal]) = gold.metal();
        assert!(metal > 0.999, "{metal}");
        assert!(base.iter().zip(gold.specular).all(|(a, b)| (a - b).abs() < 1e-3), "{base:?}");
    }

    /// Any mix of the two models comes back as it was.
    #[test]
    fn grey_mixes_come_back() {
        for (b, m) in [(0.6, 0.3), (0.9, 0.7), (0.3, 0.5)] {
            let specular = DIELECTRIC * (1.0 - m) + b * m;
            // The diffuse colour whose rest below the specular one is that of the mix
            let diffuse = b * (1.0 - m) / (1.0 - specular);
            let (base, [_, metal]) =
                Gloss { diffuse: [diffuse; 3], specular: [specular; 3], glossiness: 1.0 }.metal();
            assert!((metal - m).abs() < 1e-4 && (base[0] - b).abs() < 1e-4, "{b} {m}: {base:?} {metal}");
        }
    }
}
