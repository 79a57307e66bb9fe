//! The contract of a renderer, for those behind a function of C.

use crate::session::NfTile;
use crate::status::{Failure, NfStatus, guard};
use noisefloor::{
    Batch, ProgressiveSource, Repeats, Request, Rgb, SourceError, SourceInfo, source::PixelNoise,
};
use noisefloor_testkit::broken_promise;
use std::ffi::c_void;

/// Renders the mean of spp new samples of each pixel of a tile, of which it has rendered first samples before:
/// mean has room for 3 * width * height floats of the tile. Returns 0, or anything else if it failed.
/// It must not throw: an exception that leaves it ends the program.
pub type NfRender = Option<
    unsafe extern "C" fn(user: *mut c_void, tile: NfTile, first: u64, spp: u64, mean: *mut f32) -> i32,
>;

struct Callback {
    render: unsafe extern "C" fn(*mut c_void, NfTile, u64, u64, *mut f32) -> i32,
    user: *mut c_void,
    info: SourceInfo,
}

impl ProgressiveSource for Callback {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let batch = |&Request { tile, first, spp, .. }: &Request| {
            let mut mean: Vec<Rgb> = vec![[0.0; 3]; tile.pixels()];
            // SAFETY: there is as much room as the function is told; the rest is its promise.
            let status = unsafe {
                (self.render)(self.user, tile.into(), first, spp, mean.as_flattened_mut().as_mut_ptr())
            };
            let failed = || SourceError::Failed {
                name: self.info.name.clone(),
                tile: Some(tile.index),
                cause: format!("it returned {status}").into(),
            };
            if status == 0 { Ok(Batch::new(tile, spp, mean)) } else { Err(failed()) }
        };
        requests.iter().map(batch).collect()
    }
}

/// Checks what sessions rely on: that samples of a renderer are new, independent of each other and, unless
/// shared_pixels is true, from pixel to pixel, and that their number means what it says. With repeats_samples,
/// also that they follow from pixel and sample number, however requests are cut. NF_STATUS_FAULT and
/// nf_last_error say what is wrong. render is called on this thread, some hundred times with tiles of 32 x 32
/// pixels; 48 x 40 pixels are enough, and several times over from first = 0, which must restart nothing unless
/// repeats_samples is true.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_check(
    render: NfRender,
    user: *mut c_void,
    width: usize,
    height: usize,
    repeats_samples: bool,
    shared_pixels: bool,
) -> NfStatus {
    guard(|| {
        let render = render.ok_or_else(|| Failure::new(NfStatus::NullPointer, "render is NULL"))?;
        let repeats = if repeats_samples { Repeats::Samples } else { Repeats::Nothing };
        let pixels = if shared_pixels { PixelNoise::Shared } else { PixelNoise::Independent };
        let info = SourceInfo::new("render", width, height).with_repeats(repeats).with_pixels(pixels);
        match broken_promise(|| Callback { render, user, info: info.clone() }) {
            None => Ok(()),
            Some(what) => Err(Failure::new(NfStatus::Fault, what)),
        }
    })
}
