//! The whole metric: two pictures → quality and a map.

use crate::check::{check_pixels, checked};
use crate::engine::{Adapted, Engine, build, collapse};
use crate::error::VisionError;
use crate::masking::EPSILON;
use crate::photometry::CHANNELS;
use crate::pooling;
use crate::pyramid::Size;
use crate::temporal::{ALL_CHANNELS, TRANSIENT};
use crate::viewing::Viewing;
use crate::workspace::{Sizes, VisionWorkspace};

/// ColorVideoVDP for still pictures, and for still views in films (Mantiuk et al. 2024), on one display: what is
/// constant for it, computed once. About 25 kB.
#[derive(Clone, Debug)]
pub struct VisionModel {
    viewing: Viewing,
    pub(crate) engine: Engine,
}

/// What [`VisionModel::compare`] found. It borrows the workspace, from which the map is made when it is asked
/// for.
#[derive(Debug)]
pub struct VisionComparison<'a> {
    jod: f64,
    film: bool,
    sizes: Sizes,
    workspace: &'a mut VisionWorkspace,
}

impl VisionModel {
    /// Computes what depends only on the display.
    pub fn new(viewing: &Viewing) -> Self {
        Self { viewing: *viewing, engine: Engine::new(viewing) }
    }

    /// The display it is made for.
    pub fn viewing(&self) -> &Viewing {
        &self.viewing
    }

    /// How well `test` stands in for `reference`: both of `width`×`height` pixels, row by row, in code values
    /// of the display (in [0, 1], or in cd/m² if it is linear). Values beyond what the display shows are cut
    /// off. The result is that of ColorVideoVDP 0.5.7 within 0.01 JOD.
    ///
    /// In a film ([`Viewing::frames_per_second`]), `test` is one frame of a still view, and the difference is noise
    /// that is new in every frame: see [`VisionModel::compare_frame`].
    ///
    /// # Errors
    /// If a side has fewer than two pixels, or the pictures are too large, of another size, or not finite.
    pub fn compare<'a>(
        &self,
        test: &[[f32; 3]],
        reference: &[[f32; 3]],
        (width, height): (usize, usize),
        workspace: &'a mut VisionWorkspace,
    ) -> Result<VisionComparison<'a>, VisionError> {
        self.compared(test, None, reference, (width, height), workspace)
    }

    /// How well a film stands in for a still `reference` after its first quarter of a second, from one frame of it:
    /// `standing` is what all frames have in common, as the mean of very many would, and `test` is one of them. The
    /// mean of a film is seen as it is, and eyes average over what is new in each frame. For a still, `standing` does
    /// not matter.
    ///
    /// Frames are taken to be independent of each other, and all alike.
    ///
    /// # Errors
    /// As of [`VisionModel::compare`].
    pub fn compare_frame<'a>(
        &self,
        test: &[[f32; 3]],
        standing: &[[f32; 3]],
        reference: &[[f32; 3]],
        size: (usize, usize),
        workspace: &'a mut VisionWorkspace,
    ) -> Result<VisionComparison<'a>, VisionError> {
        self.compared(test, Some(standing), reference, size, workspace)
    }

    fn compared<'a>(
        &self,
        test: &[[f32; 3]],
        standing: Option<&[[f32; 3]]>,
        reference: &[[f32; 3]],
        (width, height): (usize, usize),
        workspace: &'a mut VisionWorkspace,
    ) -> Result<VisionComparison<'a>, VisionError> {
        let size = checked(width, height)?;
        for picture in [test, reference].into_iter().chain(standing) {
            check_pixels(picture, size)?;
        }
        let engine = &self.engine;
        let film = engine.film.is_some();
        let sizes = workspace.fit(size, engine.bands.levels(size), CHANNELS, film);
        let load = |of: usize, picture: &[[f32; 3]], workspace: &mut VisionWorkspace| {
            engine.load::<CHANNELS>(of, size, workspace, |y, row| {
                row.copy_from_slice(&picture[y * width..][..width])
            });
        };
        if let Some(standing) = standing.filter(|_| film) {
            load(0, standing, workspace);
            let VisionWorkspace { gauss: [test, _], standing, .. } = workspace;
            test.iter_mut().zip(standing).for_each(|(test, standing)| std::mem::swap(&mut test[0], standing));
        }
        load(0, test, workspace);
        load(1, reference, workspace);
        engine.filter::<CHANNELS>(size, standing.is_some(), workspace);
        build::<CHANNELS>(&sizes, film, workspace);
        let baseband = sizes.len() - 1;
        let mut pooled = Vec::with_capacity(sizes.len());
        for (band, &size) in sizes[..baseband].iter().enumerate() {
            let whole = 0..size.height;
            engine.band::<CHANNELS>(
                band,
                size,
                (whole.clone(), whole),
                (Adapted::ToReference, &engine.masking),
                workspace,
            );
            pooled.push(pool(&workspace.differences, band, size, film));
        }
        engine.baseband(baseband, sizes[baseband], workspace);
        pooled.push(pool(&workspace.differences, baseband, sizes[baseband], film));
        let jod = pooling::quality(&pooled, if film { 1.0 } else { pooling::STILL });
        Ok(VisionComparison { jod, film, sizes, workspace })
    }
}

impl VisionComparison<'_> {
    /// Quality in just-objectionable differences: 10 if nobody sees a difference, 9 if three of four people
    /// prefer the reference.
    pub fn jod(&self) -> f64 {
        self.jod
    }

    /// Where the difference is: JODs lost, row by row, in the size of the pictures. Ten times the raw map of
    /// ColorVideoVDP 0.5.7.
    pub fn map(&mut self) -> &[f32] {
        let VisionWorkspace { differences, map, strip, .. } = &mut *self.workspace;
        let last = self.sizes.len() - 1;
        for (band, (size, map)) in self.sizes.iter().zip(&mut *map).enumerate() {
            let weight = |channel: usize| {
                let integration = if self.film { pooling::WEIGHTS[channel] } else { pooling::STILL };
                (if band == last { pooling::BASEBAND[channel] } else { 1.0 } * integration) as f32
            };
            let share = if band == 0 || band == last { 1.0 } else { 0.5 };
            let out = &mut map[..size.area()];
            let plane = |channel: usize| &differences[channel][band][..size.area()];
            if self.film {
                let planes: [_; ALL_CHANNELS] = std::array::from_fn(plane);
                pooling::across_channels(planes, std::array::from_fn(weight), share, out);
            } else {
                let planes: [_; CHANNELS] = std::array::from_fn(plane);
                pooling::across_channels(planes, std::array::from_fn(weight), share, out);
            }
        }
        let sizes = &self.sizes;
        let whole = |band: usize| 0..sizes[band].height;
        collapse(map, 0..sizes.len(), sizes, whole, &mut strip.narrow, &mut strip.places);
        let map = &mut map[0][..self.sizes[0].area()];
        pooling::lost_in(map);
        map
    }
}

/// Pools each channel of a band over its pixels.
fn pool(
    differences: &[Vec<Vec<f32>>; ALL_CHANNELS],
    band: usize,
    size: Size,
    film: bool,
) -> [f64; ALL_CHANNELS] {
    std::array::from_fn(|channel| {
        if channel == TRANSIENT && !film {
            return 0.0;
        }
        let rows = differences[channel][band][..size.area()].chunks_exact(size.width);
        let sum = rows.map(|row| f64::from(row.iter().map(|d| d * (d + 2.0 * EPSILON)).sum::<f32>())).sum();
        pooling::over_pixels(sum, size.area())
    })
}
