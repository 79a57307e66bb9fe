//! Descriptors of a corpus, computed from its images.
//!
//! Observers chose among many levels, of which a corpus has few images. Levels between them, and beyond, are
//! synthesised: noise of unit variance a sample, Z = (mean of some samples − converged)·const, is laid over
//! the converged picture R in the strength of the level, R + Z/√n. Two independent realisations of Z take
//! turns as the noise in the picture and as the residual, as they do in two half buffers. Synthesised levels
//! are marked so.

mod material;

use crate::corpus::{Corpus, JudgedImage as Image, JudgedZone};
use crate::error::TableError;
use crate::stimulus::as_noise;
use crate::table::{Level, Origin, Table, Zone, first_word};
pub use material::combine;
use material::{Material, Shown, does_not_fit};
use noisefloor::{
    Viewing,
    descriptor::{Described, Descriptor, NoiseMask},
    evidence::{Evidence, TilePlanes},
    internal::ROUNDING_LUMINANCE,
};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Synthesised levels are 10·2^(3k/4) samples per pixel, in whole samples, for these k: a grid that knows
/// nothing of the thresholds.
const GRID: std::ops::Range<i32> = -4..20;
/// Levels are synthesised up to this factor below and above the human threshold, and wherever observers could
/// choose.
const REACH: f64 = 8.0;

/// Folders with corpora. Scenes belong together if their names begin with the same word; see [`first_word`].
#[derive(Clone, Copy, Debug)]
pub struct Corpora<'a> {
    pub folders: &'a [PathBuf],
    /// On which display people saw the pictures, and from how far.
    pub viewing: Viewing,
}

impl<'a> Corpora<'a> {
    /// Corpora seen on the default display.
    pub fn new(folders: &'a [PathBuf]) -> Self {
        Self { folders, viewing: Viewing::default() }
    }
}

/// Describes every zone of the corpora, by the evidence given. `on_zone(done, all)` reports progress. The
/// zones of a scene are its picture.
///
/// [`Evidence::Reference`] holds pictures against the scene's reference (`reference.exr`); where
/// it has none, the most converged picture stands in for it.
pub fn describe_corpora(
    corpora: Corpora<'_>,
    descriptor: &Descriptor,
    evidence: Evidence,
    on_zone: impl FnMut(usize, usize),
) -> Result<Table, TableError> {
    let levels = |scene: &[&JudgedZone], _: &JudgedZone, material: &Material| {
        Ok(material.levels(&synthesised_levels(scene), evidence))
    };
    describe(corpora, descriptor, evidence, levels, on_zone)
}

/// Describes every zone as the paper does (Takouachet et al. 2017, §4.3): the `edge`×`edge` pixels at its
/// centre, at `levels` levels with equal steps up to its most converged image, each held against the scene's
/// reference, or that image. All these levels are synthesised, from the two realisations of the noise in
/// turn; the real images, except the most converged one, are there besides. `on_zone(done, all)` reports
/// progress.
pub fn describe_pairs(
    corpora: Corpora<'_>,
    descriptor: &Descriptor,
    edge: usize,
    levels: usize,
    on_zone: impl FnMut(usize, usize),
) -> Result<Table, TableError> {
    let levels =
        |_: &[&JudgedZone], zone: &JudgedZone, material: &Material| material.pairs(zone, edge, levels);
    describe(corpora, descriptor, Evidence::Reference, levels, on_zone)
}

fn describe(
    corpora: Corpora<'_>,
    descriptor: &Descriptor,
    evidence: Evidence,
    levels: impl Fn(&[&JudgedZone], &JudgedZone, &Material) -> Result<Vec<Shown>, TableError> + Sync,
    mut on_zone: impl FnMut(usize, usize),
) -> Result<Table, TableError> {
    let opened: Vec<Corpus> = corpora.folders.iter().map(Corpus::open).collect::<Result<_, _>>()?;
    let all: usize = opened.iter().map(|c| c.zones().len()).sum();
    let mut zones = Vec::with_capacity(all);
    for corpus in &opened {
        for scene in corpus.scenes() {
            on_zone(zones.len(), all);
            let images: Vec<Image> = corpus.scene_levels(scene)?.collect::<Result<_, _>>()?;
            let of_scene: Vec<_> = corpus.zones().iter().filter(|z| z.row.scene == scene).collect();
            let references =
                if evidence == Evidence::Reference { corpus.scene_reference(scene)? } else { None };
            let describe = |(i, zone): (usize, &&JudgedZone)| {
                let images: Vec<&Image> = images.iter().filter(|i| i.zone == zone.row.zone).collect();
                let material = Material::of(zone, &images, references.as_ref().map(|r| &r[i]))?;
                let mut shown = levels(&of_scene, zone, &material)?;
                shown.iter_mut().for_each(|(_, _, planes)| planes.viewing = corpora.viewing);
                let (described, levels) = describe_zone(zone, shown, descriptor)?;
                // A residual from what people compared with is what they saw
                let seen = evidence == Evidence::Reference;
                let reference_spp = if seen { f64::INFINITY } else { described.reference_spp };
                Ok((Zone { reference_spp, ..described }, levels))
            };
            let described =
                of_scene.par_iter().enumerate().map(describe).collect::<Result<Vec<_>, TableError>>()?;
            zones.extend(in_picture(described, descriptor));
        }
    }
    on_zone(all, all);
    Ok(Table { viewing: corpora.viewing, ..Table::new(descriptor.clone(), evidence, zones) })
}

/// The levels that are synthesised for each zone of a scene, in samples per pixel.
fn synthesised_levels(zones: &[&JudgedZone]) -> Vec<f64> {
    let least = |z: &&JudgedZone| (z.row.first_spp as f64).min(z.row.human_spp / REACH);
    // Noise as weak as the difference that was just seen may lie beyond the last picture
    let as_noise =
        |z: &&JudgedZone| as_noise(z.row.human_spp.min(0.9 * z.reference_spp()), z.reference_spp());
    let most = |z: &&JudgedZone| (z.row.last_spp as f64).max(as_noise(z) * REACH);
    let low = zones.iter().map(least).fold(f64::INFINITY, f64::min);
    let high = zones.iter().map(most).fold(0.0, f64::max);
    let grid = GRID.map(|k| (10.0 * 2f64.powf(0.75 * f64::from(k))).round());
    grid.filter(|n| (low..=high).contains(n)).collect()
}

/// A level before it is seen in its picture.
pub(crate) struct Alone {
    pub(crate) spp: f64,
    pub(crate) origin: Origin,
    pub(crate) noise: f32,
    pub(crate) described: Described,
}

/// A zone, of which the levels are still to come, and these.
fn describe_zone(
    zone: &JudgedZone,
    shown: Vec<Shown>,
    descriptor: &Descriptor,
) -> Result<(Zone, Vec<Alone>), TableError> {
    let mut levels = Vec::with_capacity(shown.len());
    for (spp, origin, planes) in shown {
        let described = descriptor.describe_tile(&planes, spp).map_err(|e| does_not_fit(zone, e))?;
        // People judged each zone by itself: no window reaches over its edge
        let described = Described { blocks: Vec::new(), ..described };
        levels.push(Alone { spp, origin, noise: noise_level(&planes), described });
    }
    levels.sort_by(|a, b| a.spp.total_cmp(&b.spp));
    let zone = Zone {
        scene: zone.row.scene.clone(),
        group: first_word(&zone.row.scene).to_owned(),
        zone: zone.row.zone,
        human_spp: zone.row.human_spp,
        censored: zone.censored(),
        first_spp: zone.row.first_spp as f64,
        last_spp: zone.row.last_spp as f64,
        reference_spp: zone.reference_spp(),
        levels: Vec::new(),
    };
    Ok((zone, levels))
}

/// Sees each level of each zone of one scene beside the same level of the other zones.
pub(crate) fn in_picture(zones: Vec<(Zone, Vec<Alone>)>, descriptor: &Descriptor) -> Vec<Zone> {
    let (mut zones, levels): (Vec<Zone>, Vec<Vec<Alone>>) = zones.into_iter().unzip();
    // Of equal samples, the first belongs to the first of other zones: realisations of the noise come in one
    // order.
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

/// Standard deviation of the noise mask (σ = 1) of the luminance residual over a zone, less known rounding
/// noise; in display values. The constant-noise baseline goes by it.
pub(crate) fn noise_level(planes: &TilePlanes) -> f32 {
    let (mask, t) = (NoiseMask::default(), planes.inner);
    let plane = mask.apply(&planes.residual);
    let variance = plane.inside(t).map(|v| v * v).sum::<f32>() / t.pixels() as f32;
    (variance - mask.white_noise_gain() * planes.rounding * ROUNDING_LUMINANCE).max(0.0).sqrt()
}
