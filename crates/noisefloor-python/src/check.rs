//! The contract of a renderer, for a function of Python.

use crate::arrays::Pixels;
use crate::errors::{FaultError, ParameterError, whole};
use crate::verdicts::PyTile;
use noisefloor::{
    Batch, ProgressiveSource, Repeats, Request, SourceError, SourceInfo, source::PixelNoise, tile::TileGrid,
};
use noisefloor_testkit::broken_promise;
use pyo3::prelude::*;
use std::cell::RefCell;

/// A function that renders, and the exception that it raised last.
struct Callback<'a, 'py> {
    render: &'a Bound<'py, PyAny>,
    raised: &'a RefCell<Option<PyErr>>,
    info: SourceInfo,
}

impl Callback<'_, '_> {
    fn batch(&self, &Request { tile, first, spp, .. }: &Request) -> PyResult<Batch> {
        let mean = self.render.call1((PyTile::from(tile), first, spp))?;
        let mean = mean.extract::<Pixels<'_>>()?;
        let (width, height, pixels) = mean.get();
        if (width, height) != (tile.width, tile.height) {
            let (h, w) = (tile.height, tile.width);
            let message = format!("render returned shape ({height}, {width}, 3) for a tile of ({h}, {w}, 3)");
            return Err(FaultError::new_err(message));
        }
        Ok(Batch::new(tile, spp, pixels.into_owned()))
    }
}

impl ProgressiveSource for Callback<'_, '_> {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let failed = |error: PyErr, tile: usize| {
            let cause = error.to_string().into();
            *self.raised.borrow_mut() = Some(error);
            SourceError::Failed { name: self.info.name.clone(), tile: Some(tile), cause }
        };
        requests.iter().map(|r| self.batch(r).map_err(|error| failed(error, r.tile.index))).collect()
    }
}

/// Checks what sessions rely on: that the samples of a renderer are new, independent of each other and from pixel
/// to pixel, and that their number means what it says. Takes some hundred calls.
///
/// render: a function (tile, first, spp) -> array of shape (tile.height, tile.width, 3): the mean of spp new
///     samples of each pixel of a Tile of up to 32×32 pixels, which has had first samples before. It is asked from
///     first = 0 several times over.
/// width, height: of the picture that tiles are taken from; 48×40 pixels are enough.
/// repeats_samples: whether samples follow from pixel and number alone; then that is checked, too.
/// shared_pixels: whether neighbouring pixels have noise in common, by a pixel filter or a Markov chain.
///
/// Raises FaultError if something is wrong, and whatever render raises.
#[pyfunction]
#[pyo3(signature = (render, width = 48, height = 40, *, repeats_samples = false, shared_pixels = false))]
pub(crate) fn check(
    render: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = whole)] width: usize,
    #[pyo3(from_py_with = whole)] height: usize,
    repeats_samples: bool,
    shared_pixels: bool,
) -> PyResult<()> {
    TileGrid::new(width, height, 32).map_err(|error| ParameterError::new_err(error.to_string()))?;
    let repeats = if repeats_samples { Repeats::Samples } else { Repeats::Nothing };
    let noise = if shared_pixels { PixelNoise::Shared } else { PixelNoise::Independent };
    let info = SourceInfo::new("render", width, height).with_repeats(repeats).with_pixels(noise);
    let raised = RefCell::new(None);
    let broken = broken_promise(|| Callback { render, raised: &raised, info: info.clone() });
    match (raised.into_inner(), broken) {
        (Some(raised), _) => Err(raised),
        (None, Some(what)) => Err(FaultError::new_err(what)),
        (None, None) => Ok(()),
    }
}
