//! The images of a zone as levels: real ones, and synthesised ones between and beyond them.

use crate::corpus::{Encoding, JudgedImage as Image, JudgedZone, Patch};
use crate::error::TableError;
use crate::table::Origin;
use noisefloor::{
    Rgb, Tile,
    display::Display,
    evidence::{Evidence, Samples, TilePlanes, residual_scale},
};

/// A corpus level: samples per pixel, where it comes from, and what is to be described of it.
pub(super) type Shown = (f64, Origin, TilePlanes);

/// Display-encoded pixels of a zone with its halo.
type Pixels = Vec<Rgb>;

/// One realisation of the noise: zero mean, variance that of a single sample.
struct Noise {
    pixels: Pixels,
    /// Variance of the rounding in it.
    rounding: f64,
}

/// A level that is there: samples, picture, and a residual with the noise of the picture.
struct Real {
    spp: f64,
    shown: Pixels,
    residual: Pixels,
    rounding: f64,
}

/// What levels of one zone are made of.
pub(super) struct Material {
    size: (usize, usize),
    tile: Tile,
    converged: Pixels,
    converged_spp: f64,
    reference: Option<Pixels>,
    /// Variance of the rounding of each picture.
    rounding: f64,
    noise: [Noise; 2],
    real: Vec<Real>,
}

/// `fa`·a + `fb`·b of two pictures, pixel by pixel.
pub fn combine(a: &[Rgb], fa: f64, b: &[Rgb], fb: f64) -> Vec<Rgb> {
    let pixel =
        |(a, b): (&Rgb, &Rgb)| std::array::from_fn(|c| (f64::from(a[c]) * fa + f64::from(b[c]) * fb) as f32);
    a.iter().zip(b).map(pixel).collect()
}

impl Material {
    pub(super) fn of(
        zone: &JudgedZone,
        images: &[&Image],
        reference: Option<&Patch>,
    ) -> Result<Self, TableError> {
        let running = images.iter().all(|i| i.first == 0 && i.encoding == Encoding::Display);
        let material = if running { Self::from_running_means(images) } else { Self::from_batches(images) };
        let (scene, zone, images) = (zone.row.scene.clone(), zone.row.zone, images.len());
        let Some(mut material) = material else { return Err(TableError::TooFew { scene, zone, images }) };
        if let Some(patch) = reference {
            let size = material.size;
            if (patch.width, patch.height) != size {
                return Err(TableError::Reference { scene, zone });
            }
            material.reference = Some(patch.pixels.iter().map(|&p| Display::SRGB.encode(p)).collect());
        }
        Ok(material)
    }

    /// Running means that contain one another, in display values. Realisations are the first `a` samples and
    /// the next `b − a`.
    fn from_running_means(images: &[&Image]) -> Option<Self> {
        let last = images.last()?;
        let converged_spp = last.last as f64;
        let early: Vec<&&Image> = images.iter().filter(|i| (i.last as f64) <= 0.5 * converged_spp).collect();

        // Both realisations need many samples, and the second must not amplify rounding: at most threefold
        // more before it than in it. Among equals, the first.
        let pairs = early.iter().flat_map(|a| early.iter().map(move |b| (a, b)));
        let usable = pairs.filter(|(a, b)| b.last > a.last && a.last <= 3 * (b.last - a.last));
        let (a, b) = usable.min_by_key(|(a, b)| std::cmp::Reverse(a.last.min(b.last - a.last)))?;

        // (mean of k samples − converged) has variance 1/k − 1/N, since the converged picture contains them.
        let (na, nb) = (a.last as f64, b.last as f64);
        let unit = |samples: f64| (1.0 / samples - 1.0 / converged_spp).sqrt().recip();
        let converged = last.patch.pixels.clone();
        let rounding = f64::from(last.rounding);
        let scale = unit(na);
        let first = Noise {
            pixels: combine(&a.patch.pixels, scale, &converged, -scale),
            rounding: 2.0 * rounding * scale * scale,
        };
        let (batch, scale) = (nb - na, unit(nb - na));
        let second = combine(&b.patch.pixels, nb / batch, &a.patch.pixels, -na / batch);
        let second = Noise {
            pixels: combine(&second, scale, &converged, -scale),
            rounding: rounding * (1.0 + (na * na + nb * nb) / (batch * batch)) * scale * scale,
        };

        // An early picture is held against the converged one, a late one against the early one with most
        // samples.
        let real = |image: &&Image| {
            let is_early = (image.last as f64) <= 0.5 * converged_spp;
            let other = if is_early { last } else { b };
            let scale = residual_scale(image.last as f64, other.last as f64, Samples::Nested)?;
            let scale = f64::from(scale);
            Some(Real {
                spp: image.last as f64,
                shown: image.patch.pixels.clone(),
                residual: combine(&image.patch.pixels, scale, &other.patch.pixels, -scale),
                rounding: 2.0 * rounding * scale * scale,
            })
        };
        let real = images.iter().filter_map(real).collect();
        Some(Self {
            size: (last.patch.width, last.patch.height),
            tile: last.patch.inner,
            converged,
            converged_spp,
            reference: None,
            rounding,
            noise: [first, second],
            real,
        })
    }

    /// Means of separate batches, in linear light: real half buffers at every level.
    fn from_batches(images: &[&Image]) -> Option<Self> {
        let last = images.last()?;
        let converged_spp = last.last as f64;
        let encode = |linear: &[Rgb]| -> Pixels { linear.iter().map(|&p| Display::SRGB.encode(p)).collect() };
        let mut halves =
            [(0.0, vec![[0.0; 3]; last.patch.pixels.len()]), (0.0, vec![[0.0; 3]; last.patch.pixels.len()])];
        let mut early = None;
        let mut real = Vec::new();
        for image in images {
            // Each batch joins the half with fewer samples.
            let half = usize::from(halves[1].0 < halves[0].0);
            let samples = (image.last - image.first) as f64;
            let (n, mean) = &mut halves[half];
            *mean = combine(mean, *n / (*n + samples), &image.patch.pixels, samples / (*n + samples));
            *n += samples;
            let [(na, a), (nb, b)] = &halves;
            if *nb == 0.0 {
                continue;
            }
            let (a, b, all) = (encode(a), encode(b), encode(&combine(a, na / (na + nb), b, nb / (na + nb))));
            let scale = (na * nb).sqrt() / (na + nb);
            real.push(Real {
                spp: image.last as f64,
                shown: all,
                residual: combine(&a, scale, &b, -scale),
                rounding: 0.0,
            });
            if (image.last as f64) <= 0.5 * converged_spp {
                early = Some(((*na, a), (*nb, b)));
            }
        }
        let converged = real.last()?.shown.clone();
        let noise = |(samples, mean): &(f64, Pixels)| {
            let scale = (1.0 / samples - 1.0 / converged_spp).sqrt().recip();
            Noise { pixels: combine(mean, scale, &converged, -scale), rounding: 0.0 }
        };
        let (a, b) = early?;
        let noise = [noise(&a), noise(&b)];
        let (size, tile) = ((last.patch.width, last.patch.height), last.patch.inner);
        Some(Self { size, tile, converged, converged_spp, reference: None, rounding: 0.0, noise, real })
    }

    fn planes(&self, tile: Tile, shown: &[Rgb], residual: &[Rgb], rounding: f64) -> TilePlanes {
        let at = |x: usize, y: usize| y * self.size.0 + x;
        let planes = TilePlanes::gather(self.size, tile, |x, y| (shown[at(x, y)], residual[at(x, y)]));
        TilePlanes { rounding: rounding as f32, ..planes }
    }

    /// A picture held against the reference, or the converged one, as it is.
    fn to_reference(&self, tile: Tile, shown: &[Rgb], rounding: f64) -> TilePlanes {
        let reference = self.reference.as_ref().unwrap_or(&self.converged);
        let (middle, apart) = (combine(shown, 0.5, reference, 0.5), combine(shown, 1.0, reference, -1.0));
        self.planes(tile, &middle, &apart, rounding)
    }

    /// Real levels, and those of `synthesised`, twice each: two realisations of the noise.
    pub(super) fn levels(&self, synthesised: &[f64], evidence: Evidence) -> Vec<Shown> {
        let planes = |r: &Real| match evidence {
            Evidence::Halves => self.planes(self.tile, &r.shown, &r.residual, r.rounding),
            Evidence::Reference => {
                let pictures = if self.reference.is_some() { 1.0 } else { 2.0 };
                self.to_reference(self.tile, &r.shown, pictures * self.rounding)
            }
        };
        let real = self.real.iter().map(|r| (r.spp, Origin::Real, planes(r)));
        let synthesised = synthesised.iter().flat_map(|&spp| {
            [0, 1].map(|turn| (spp, Origin::Synthesised, self.synthesise(spp, turn, evidence)))
        });
        real.chain(synthesised).collect()
    }

    /// Levels of the centre, held against the most converged image.
    pub(super) fn pairs(
        &self,
        zone: &JudgedZone,
        edge: usize,
        levels: usize,
    ) -> Result<Vec<Shown>, TableError> {
        let Tile { x, y, width, height, .. } = self.tile;
        if width < edge || height < edge {
            let error = noisefloor::descriptor::DescriptorError::TileSize { expected: edge, width, height };
            return Err(does_not_fit(zone, error));
        }
        let (x, y) = (x + (width - edge) / 2, y + (height - edge) / 2);
        let centre = Tile { index: 0, x, y, width: edge, height: edge };
        let pair = |shown: &[Rgb]| self.to_reference(centre, shown, 0.0);
        let real = self.real.iter().filter(|r| r.spp < self.converged_spp);
        let real = real.map(|r| (r.spp, Origin::Real, pair(&r.shown)));
        let synthesised = (1..=levels).map(|k| {
            let spp = self.converged_spp * k as f64 / levels as f64;
            (spp, Origin::Synthesised, pair(&self.shown(spp, k % 2)))
        });
        Ok(real.chain(synthesised).collect())
    }

    /// The picture of `spp` samples, its noise one realisation (0 or 1). The converged picture has noise of
    /// its own, so that less is laid over it; beyond its samples none is.
    fn shown(&self, spp: f64, realisation: usize) -> Pixels {
        let missing = (1.0 / spp - 1.0 / self.converged_spp).max(0.0).sqrt();
        combine(&self.converged, 1.0, &self.noise[realisation].pixels, missing)
    }

    /// The level of `spp` samples: one realisation (0 or 1) is the noise in the picture, the other the
    /// residual.
    fn synthesise(&self, spp: f64, realisation: usize, evidence: Evidence) -> TilePlanes {
        let held_against = &self.noise[1 - realisation];
        let strength = (1.0 / spp).sqrt();
        let shown = self.shown(spp, realisation);
        let missing = (1.0 / spp - 1.0 / self.converged_spp).max(0.0);
        let rounding = self.noise[realisation].rounding * missing;
        match evidence {
            Evidence::Halves => {
                let residual = combine(&held_against.pixels, strength, &held_against.pixels, 0.0);
                self.planes(self.tile, &shown, &residual, held_against.rounding / spp)
            }
            // The rounding of the converged picture is in both, and falls out of their difference.
            Evidence::Reference => {
                let own = if self.reference.is_some() { self.rounding } else { 0.0 };
                self.to_reference(self.tile, &shown, rounding + own)
            }
        }
    }
}

/// A zone of a size that the descriptor is not for.
pub(super) fn does_not_fit(zone: &JudgedZone, source: noisefloor::descriptor::DescriptorError) -> TableError {
    TableError::Descriptor { scene: zone.row.scene.clone(), zone: zone.row.zone, source }
}
