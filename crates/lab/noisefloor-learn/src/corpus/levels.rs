//! The images of zones, cut out with a halo.

use super::error::CorpusError;
use super::zone::{JudgedZone, ZoneImages};
use noisefloor::{Rgb, Tile, internal::HALO};
use noisefloor_image::{
    Frame, Picture, StackError, StackFault, batches, read_exr, read_picture, running_means,
};
use std::collections::VecDeque;

/// Name of a scene's noise-free reference.
const REFERENCE: &str = "reference.exr";

/// What the numbers of a patch mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// sRGB-encoded, 0…1: what the observer's display got.
    Display,
    /// Linear radiance, Rec.709.
    Linear,
}

/// A zone's pixels, and up to [`HALO`] pixels around them where the image has any.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Width with halo, in pixels.
    pub width: usize,
    /// Height with halo, in pixels.
    pub height: usize,
    /// Row-major, `width * height` values.
    pub pixels: Vec<Rgb>,
    /// The zone, in pixels of the patch.
    pub inner: Tile,
}

impl Patch {
    /// The zone's own pixels, row-major, without the halo.
    pub fn inner_pixels(&self) -> impl Iterator<Item = Rgb> {
        let Tile { x, y, width, height, .. } = self.inner;
        (y..y + height).flat_map(move |row| self.pixels[row * self.width + x..][..width].iter().copied())
    }
}

/// One real image of one zone: the mean of its samples `first`+1…`last`.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgedImage {
    pub scene: String,
    /// The zone's number in the scene.
    pub zone: u32,
    /// Samples per pixel before the first one in this image: 0 for a running mean.
    pub first: u64,
    /// Cumulative samples per pixel with this image.
    pub last: u64,
    /// What the numbers mean: display values for a PNG, linear for an EXR.
    pub encoding: Encoding,
    /// Variance of the rounding of each value; see [`Picture::rounding`].
    pub rounding: f32,
    pub patch: Patch,
}

/// An iterator over images of zones that decodes each image once, when it is needed. Ends after the first
/// error.
#[derive(Debug)]
pub struct JudgedImages<'a> {
    jobs: VecDeque<Job<'a>>,
    ready: VecDeque<JudgedImage>,
    /// Size of the images of the stack being read; each stack starts with a job that forgets it.
    size: Option<(usize, usize)>,
}

/// An image, and the zones it shows.
#[derive(Debug)]
struct Job<'a> {
    starts_stack: bool,
    batch: bool,
    frame: Frame,
    zones: Vec<&'a JudgedZone>,
}

impl<'a> JudgedImages<'a> {
    pub(super) fn of(zones: &[&'a JudgedZone]) -> Result<Self, CorpusError> {
        let mut jobs = VecDeque::new();
        let mut left = zones.to_vec();
        while let Some(stack) = left.first().map(|zone| &zone.stack) {
            // All zones that share a stack, together
            let (sharing, rest): (Vec<&JudgedZone>, Vec<&JudgedZone>) =
                left.iter().partition(|zone| zone.stack == *stack);
            let (batch, frames) = match stack {
                ZoneImages::RunningMeans(dir) => (false, running_means(dir)?),
                ZoneImages::Batches(dir) => (true, batches(dir)?),
            };
            jobs.extend(frames.into_iter().enumerate().map(|(i, frame)| Job {
                starts_stack: i == 0,
                batch,
                frame,
                zones: sharing.clone(),
            }));
            left = rest;
        }
        Ok(Self { jobs, ready: VecDeque::new(), size: None })
    }

    fn run(&mut self, job: &Job<'a>) -> Result<(), CorpusError> {
        let path = &job.frame.path;
        let picture = if job.batch { read_exr(path).map(Picture::Linear) } else { read_picture(path) }
            .map_err(StackError::from)?;

        // All images of a stack have one size
        let got = picture.size();
        if job.starts_stack {
            self.size = None;
        }
        let size = *self.size.get_or_insert(got);
        if size != got {
            return Err(StackFault::Size { size, got }.of(path).into());
        }
        let (width, height) = size;

        let (encoding, pixels) = match &picture {
            Picture::Linear(image) => (Encoding::Linear, &image.pixels),
            Picture::Display(image) => (Encoding::Display, &image.pixels),
        };
        for row in job.zones.iter().map(|zone| &zone.row) {
            // A batch is only the zone
            let zone = if job.batch { Tile { x: 0, y: 0, ..row.tile() } } else { row.tile() };
            let exact = (row.width, row.height) == size;
            if !is_inside(zone, size) || job.batch && !exact {
                let (path, scene) = (path.clone(), row.scene.clone());
                return Err(CorpusError::Zone { path, scene, zone: row.zone, width, height });
            }
            self.ready.push_back(JudgedImage {
                scene: row.scene.clone(),
                zone: row.zone,
                first: if job.batch { job.frame.first } else { 0 },
                last: job.frame.last,
                encoding,
                rounding: picture.rounding(),
                patch: cut(pixels, size, zone, HALO),
            });
        }
        Ok(())
    }
}

/// The reference of a scene cut into patches of the same shape as its images', zone by zone; `None` if there
/// is none.
pub(super) fn reference(zones: &[&JudgedZone]) -> Result<Option<Vec<Patch>>, CorpusError> {
    let Some(first) = zones.first() else { return Ok(None) };
    let folder = match &first.stack {
        ZoneImages::RunningMeans(dir) => Some(dir.as_path()),
        ZoneImages::Batches(dir) => dir.parent(),
    };
    let Some(path) = folder.map(|dir| dir.join(REFERENCE)).filter(|path| path.is_file()) else {
        return Ok(None);
    };
    let image = read_exr(&path).map_err(StackError::from)?;
    let (width, height) = (image.width, image.height);
    let cut_out = |zone: &&JudgedZone| {
        if !is_inside(zone.row.tile(), (width, height)) {
            let (path, scene) = (path.clone(), zone.row.scene.clone());
            return Err(CorpusError::Zone { path, scene, zone: zone.row.zone, width, height });
        }
        // A batch is only the zone
        let halo = if matches!(zone.stack, ZoneImages::Batches(_)) { 0 } else { HALO };
        Ok(cut(&image.pixels, (width, height), zone.row.tile(), halo))
    };
    zones.iter().map(cut_out).collect::<Result<_, _>>().map(Some)
}

impl Iterator for JudgedImages<'_> {
    type Item = Result<JudgedImage, CorpusError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.ready.is_empty() {
            let job = self.jobs.pop_front()?;
            if let Err(e) = self.run(&job) {
                self.jobs.clear();
                self.ready.clear();
                return Some(Err(e));
            }
        }
        self.ready.pop_front().map(Ok)
    }
}

fn is_inside(zone: Tile, (width, height): (usize, usize)) -> bool {
    zone.x.saturating_add(zone.width) <= width && zone.y.saturating_add(zone.height) <= height
}

/// The rectangle and its halo, clipped to an image of the size given.
fn cut(pixels: &[Rgb], (width, height): (usize, usize), zone: Tile, halo: usize) -> Patch {
    let (left, top) = (zone.x.saturating_sub(halo), zone.y.saturating_sub(halo));
    let right = (zone.x + zone.width + halo).min(width);
    let bottom = (zone.y + zone.height + halo).min(height);
    Patch {
        width: right - left,
        height: bottom - top,
        pixels: (top..bottom)
            .flat_map(|y| pixels[y * width + left..y * width + right].iter().copied())
            .collect(),
        inner: Tile { x: zone.x - left, y: zone.y - top, ..zone },
    }
}
