//! Descriptors of a corpus: computed from its images, and as CSV.
//!
//! Observers chose among many levels, of which a corpus has few images. Levels between them, and beyond, are synthesised:
//! noise of unit variance a sample, Z = (mean of some samples − converged)·const, is laid over the converged picture R in the
//! strength of the level, R + Z/√n. Two independent realisations of Z take turns as the noise in the picture and as the
//! residual, as they do in two half buffers. Synthesised levels are marked so.

use crate::corpus::{self, Corpus, Encoding, Level as Image, Patch};
use crate::error::CorpusError;
use noisefloor::evaluation::{Level, Origin, Table, Zone, group_of_scene, noise_level};
use noisefloor::{
    Described, Descriptor, Display, Evidence, Rgb, Samples, Tile, TilePlanes, ToneMapping, residual_scale,
};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use thiserror::Error;

mod csv_file;

pub use csv_file::{read_table, write_table};

/// A corpus level: samples per pixel, where it comes from, and what is to be described of it.
type Shown = (f64, Origin, TilePlanes);

/// Synthesised levels are 10·2^(3k/4) samples per pixel, in whole samples, for these k: a grid that knows nothing of the thresholds.
const GRID: std::ops::Range<i32> = -4..20;
/// Levels are synthesised up to this factor below and above the human threshold, and wherever observers could choose.
const REACH: f64 = 8.0;

/// Why a table could not be computed, read or written.
#[derive(Debug, Error)]
pub enum TableError {
    /// The corpus.
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    /// A zone has too few images.
    #[error(
        "{scene}, zone {zone}: {images} images are too few; two independent sets of samples and a converged picture are needed"
    )]
    TooFew {
        /// The scene.
        scene: String,
        /// The zone.
        zone: u32,
        /// Its images.
        images: usize,
    },
    /// The reference has another size than the images.
    #[error("{scene}, zone {zone}: reference.exr has not the size of the full picture")]
    Reference {
        /// The scene.
        scene: String,
        /// The zone.
        zone: u32,
    },
    /// The descriptor is for tiles of another size.
    #[error("{scene}, zone {zone}: {source}")]
    Descriptor {
        /// The scene.
        scene: String,
        /// The zone.
        zone: u32,
        /// What does not fit.
        source: noisefloor::DescriptorError,
    },
    /// The CSV is malformed.
    #[error("line {line}: {what}")]
    Row {
        /// Line, from 1.
        line: u64,
        /// What is wrong with it.
        what: String,
    },
    /// The CSV cannot be read or written.
    #[error("the table cannot be read or written: {0}")]
    Csv(#[from] csv::Error),
}

/// Describes every zone of the corpora, by the evidence given. `on_zone(done, all)` is told of progress. The zones of a scene
/// are its picture.
///
/// [`Evidence::Reference`] holds pictures against the scene's reference ([`Corpus::scene_reference`]); where it has none, the most
/// converged picture stands in for it.
///
/// # Errors
/// [`TableError`] if a corpus cannot be read, or a zone has too few images.
pub fn describe_corpora(
    folders: &[PathBuf],
    descriptor: Descriptor,
    evidence: Evidence,
    on_zone: impl FnMut(usize, usize),
) -> Result<Table, TableError> {
    let levels = |scene: &[&corpus::Zone], _: &corpus::Zone, material: &Material| {
        Ok(material.levels(&synthesised_levels(scene), evidence))
    };
    describe(folders, descriptor, evidence, levels, on_zone)
}

/// Describes every zone as the paper does (Takouachet et al. 2017, §4.3): the `edge`×`edge` pixels at its centre, at `levels` levels with
/// equal steps up to its most converged image, each held against the scene's reference, or that image. All these levels are synthesised, from the two
/// realisations of the noise in turn; the real images, but for the most converged one, are there besides. `on_zone(done, all)` is told of
/// progress.
///
/// # Errors
/// [`TableError`] if a corpus cannot be read, or a zone has too few images or is smaller than `edge`×`edge` pixels.
pub fn describe_pairs(
    folders: &[PathBuf],
    descriptor: Descriptor,
    edge: usize,
    levels: usize,
    on_zone: impl FnMut(usize, usize),
) -> Result<Table, TableError> {
    let levels =
        |_: &[&corpus::Zone], zone: &corpus::Zone, material: &Material| material.pairs(zone, edge, levels);
    describe(folders, descriptor, Evidence::Reference, levels, on_zone)
}

fn describe(
    folders: &[PathBuf],
    descriptor: Descriptor,
    evidence: Evidence,
    levels: impl Fn(&[&corpus::Zone], &corpus::Zone, &Material) -> Result<Vec<Shown>, TableError> + Sync,
    mut on_zone: impl FnMut(usize, usize),
) -> Result<Table, TableError> {
    let corpora: Vec<Corpus> = folders.iter().map(Corpus::open).collect::<Result<_, _>>()?;
    let all: usize = corpora.iter().map(|c| c.zones().len()).sum();
    let mut zones = Vec::with_capacity(all);
    for corpus in &corpora {
        for scene in corpus.scenes() {
            on_zone(zones.len(), all);
            let images: Vec<Image> = corpus.scene_levels(scene)?.collect::<Result<_, _>>()?;
            let of_scene: Vec<_> = corpus.zones().iter().filter(|z| z.scene == scene).collect();
            let references =
                if evidence == Evidence::Reference { corpus.scene_reference(scene)? } else { None };
            let describe = |(i, zone): (usize, &&corpus::Zone)| {
                let images: Vec<&Image> = images.iter().filter(|i| i.zone == zone.zone).collect();
                let material = Material::of(zone, &images, references.as_ref().map(|r| &r[i]))?;
                describe_zone(zone, levels(&of_scene, zone, &material)?, descriptor)
            };
            let described = of_scene.par_iter().enumerate().map(describe).collect::<Result<Vec<_>, _>>()?;
            zones.extend(in_picture(described, descriptor));
        }
    }
    on_zone(all, all);
    let tone_mapping = ToneMapping::Srgb { exposure: 1.0 };
    Ok(Table { descriptor, evidence, tone_mapping, zones, answers: Vec::new() })
}

/// The levels that are synthesised for each zone of a scene, in samples per pixel.
fn synthesised_levels(zones: &[&corpus::Zone]) -> Vec<f64> {
    let least = |z: &&corpus::Zone| (z.first_spp as f64).min(z.human_spp / REACH);
    let most = |z: &&corpus::Zone| (z.last_spp as f64).max(z.human_spp * REACH);
    let low = zones.iter().map(least).fold(f64::INFINITY, f64::min);
    let high = zones.iter().map(most).fold(0.0, f64::max);
    let grid = GRID.map(|k| (10.0 * 2f64.powf(0.75 * f64::from(k))).round());
    grid.filter(|n| (low..=high).contains(n)).collect()
}

/// A level before it is seen in its picture.
struct Alone {
    spp: f64,
    origin: Origin,
    noise: f32,
    described: Described,
}

/// A zone, of which the levels are still to come, and these.
fn describe_zone(
    zone: &corpus::Zone,
    shown: Vec<Shown>,
    descriptor: Descriptor,
) -> Result<(Zone, Vec<Alone>), TableError> {
    let mut levels = Vec::with_capacity(shown.len());
    for (spp, origin, planes) in shown {
        let described = descriptor.describe(&planes, spp).map_err(|e| does_not_fit(zone, e))?;
        levels.push(Alone { spp, origin, noise: noise_level(&planes), described });
    }
    levels.sort_by(|a, b| a.spp.total_cmp(&b.spp));
    let zone = Zone {
        scene: zone.scene.clone(),
        group: group_of_scene(&zone.scene).to_owned(),
        zone: zone.zone,
        human_spp: zone.human_spp,
        censored: zone.censored,
        first_spp: zone.first_spp as f64,
        last_spp: zone.last_spp as f64,
        levels: Vec::new(),
    };
    Ok((zone, levels))
}

fn does_not_fit(zone: &corpus::Zone, source: noisefloor::DescriptorError) -> TableError {
    TableError::Descriptor { scene: zone.scene.clone(), zone: zone.zone, source }
}

/// Sees each level of each zone of one scene beside the same level of the other zones.
fn in_picture(zones: Vec<(Zone, Vec<Alone>)>, descriptor: Descriptor) -> Vec<Zone> {
    let (mut zones, levels): (Vec<Zone>, Vec<Vec<Alone>>) = zones.into_iter().unzip();
    // Of equal samples, the first belongs to the first of other zones: realisations of the noise come in one order.
    let mut pictures: BTreeMap<(u64, bool, usize), Vec<(usize, Alone)>> = BTreeMap::new();
    for (zone, levels) in levels.into_iter().enumerate() {
        let mut before: Option<(u64, bool, usize)> = None;
        for level in levels {
            let (spp, real) = (level.spp.to_bits(), level.origin == Origin::Real);
            let turn = before.filter(|b| (b.0, b.1) == (spp, real)).map_or(0, |b| b.2 + 1);
            before = Some((spp, real, turn));
            pictures.entry((spp, real, turn)).or_default().push((zone, level));
        }
    }
    // Positive numbers are sorted as their bits are.
    for picture in pictures.into_values() {
        let described: Vec<Described> = picture.iter().map(|(_, l)| l.described.clone()).collect();
        for ((zone, level), numbers) in picture.into_iter().zip(descriptor.in_picture(&described)) {
            let Alone { spp, origin, noise, .. } = level;
            zones[zone].levels.push(Level { spp, origin, noise, descriptor: numbers });
        }
    }
    zones
}

/// Display-encoded pixels of a zone with its apron.
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
struct Material {
    size: (usize, usize),
    tile: Tile,
    converged: Pixels,
    converged_spp: f64,
    /// The scene's noise-free reference.
    reference: Option<Pixels>,
    /// Variance of the rounding of each picture.
    rounding: f64,
    noise: [Noise; 2],
    real: Vec<Real>,
}

fn combine(a: &[Rgb], fa: f64, b: &[Rgb], fb: f64) -> Pixels {
    let pixel =
        |(a, b): (&Rgb, &Rgb)| std::array::from_fn(|c| (f64::from(a[c]) * fa + f64::from(b[c]) * fb) as f32);
    a.iter().zip(b).map(pixel).collect()
}

impl Material {
    fn of(zone: &corpus::Zone, images: &[&Image], reference: Option<&Patch>) -> Result<Self, TableError> {
        let running = images.iter().all(|i| i.first == 0 && i.encoding == Encoding::Display);
        let material = if running { Self::from_running_means(images) } else { Self::from_batches(images) };
        let (scene, zone, images) = (zone.scene.clone(), zone.zone, images.len());
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

    fn frame(patch: &Patch) -> ((usize, usize), Tile) {
        let inner = patch.inner;
        let tile = Tile { index: 0, x: inner.x, y: inner.y, width: inner.width, height: inner.height };
        ((patch.width, patch.height), tile)
    }

    /// Running means that contain one another, in display values. Realisations are the first `a` samples and the next `b − a`.
    fn from_running_means(images: &[&Image]) -> Option<Self> {
        let last = images.last()?;
        let converged_spp = last.last as f64;
        let early: Vec<&&Image> = images.iter().filter(|i| (i.last as f64) <= 0.5 * converged_spp).collect();

        // Both realisations need many samples, and the second must not amplify rounding: at most threefold more before it than
        // in it. Among equals, the first.
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

        // An early picture is held against the converged one, a late one against the early one with most samples.
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
        let (size, tile) = Self::frame(&last.patch);
        Some(Self {
            size,
            tile,
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
        let (size, tile) = Self::frame(&last.patch);
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
        self.planes(tile, shown, &combine(shown, 1.0, reference, -1.0), rounding)
    }

    /// Real levels, and those of `synthesised`, twice each: two realisations of the noise.
    fn levels(&self, synthesised: &[f64], evidence: Evidence) -> Vec<Shown> {
        let planes = |r: &Real| match evidence {
            Evidence::Halves => self.planes(self.tile, &r.shown, &r.residual, r.rounding),
            Evidence::Reference => {
                let pictures = if self.reference.is_some() { 1.0 } else { 2.0 };
                self.to_reference(self.tile, &r.shown, pictures * self.rounding)
            }
            Evidence::Alone => self.planes(self.tile, &r.shown, &r.shown, self.rounding),
        };
        let real = self.real.iter().map(|r| (r.spp, Origin::Real, planes(r)));
        let synthesised = synthesised.iter().flat_map(|&spp| {
            [0, 1].map(|turn| (spp, Origin::Synthesised, self.synthesise(spp, turn, evidence)))
        });
        real.chain(synthesised).collect()
    }

    /// Levels of the centre, held against the most converged image.
    fn pairs(&self, zone: &corpus::Zone, edge: usize, levels: usize) -> Result<Vec<Shown>, TableError> {
        let Tile { x, y, width, height, .. } = self.tile;
        if width < edge || height < edge {
            let error = noisefloor::DescriptorError::TileSize { expected: edge, width, height };
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

    /// The picture of `spp` samples, its noise one realisation (0 or 1). The converged picture has noise of its own, so that less is
    /// laid over it; beyond its samples none is.
    fn shown(&self, spp: f64, realisation: usize) -> Pixels {
        let missing = (1.0 / spp - 1.0 / self.converged_spp).max(0.0).sqrt();
        combine(&self.converged, 1.0, &self.noise[realisation].pixels, missing)
    }

    /// The level of `spp` samples: one realisation (0 or 1) is the noise in the picture, the other the residual.
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
            Evidence::Alone => self.planes(self.tile, &shown, &shown, rounding + self.rounding),
        }
    }
}
