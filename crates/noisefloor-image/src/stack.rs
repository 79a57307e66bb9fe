//! A stack of images on disk, played back as a source.

use crate::decode_exr::read_exr;
use crate::error::{PictureFault, StackError, StackFault};
use crate::frames::{self, Frame, Layout};
use crate::picture::LinearImage;
use crate::read::read_picture;
use noisefloor::{
    Batch, Counts, ProgressiveSource, Repeats, Request, Rgb, SourceError, SourceInfo, Tile,
    source::SourceIdentity,
};
use std::collections::VecDeque;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Images kept in memory: a running mean and the one before it.
const CACHED: usize = 2;

/// A folder of images of one render, played back batch by batch. Nothing is rendered: stored images are
/// handed out.
///
/// # Layouts
/// - **Running means**: `00050.png`, `00100.exr`, … named by their
///   samples per pixel. They are nested, so the mean of the new samples is (n₂·I₂ − n₁·I₁)/(n₂ − n₁) in
///   linear light; PNGs are linearised first. The difference amplifies their quantisation by n₂/(n₂ − n₁),
///   about 200 between 9,900 and 9,950 spp: such a batch says little by itself and may be negative. It is not
///   clamped, so that the sum of all batches is the stored image. A value that the PNG clipped at 1 comes out
///   as 1: noise on highlights is lost.
/// - **Batches**: `batch_<first>_<last>.exr`, each the mean of samples
///   `first`+1…`last` only.
///
/// # What a request returns
/// The stored batch that starts at [`Request::first`], with all its samples, however many were requested; an
/// empty batch at the end of the stack; an error if no batch starts there. Single tiles can be requested.
/// Each image is decoded when first needed, and the last two are kept.
#[derive(Debug)]
pub struct StackSource {
    name: String,
    dir: PathBuf,
    width: usize,
    height: usize,
    layout: Layout,
    frames: Vec<Frame>,
    cache: VecDeque<(usize, Arc<LinearImage>)>,
}

impl StackSource {
    /// Opens a folder of either layout; its file names tell which. Reads the first picture.
    ///
    /// # Errors
    /// [`StackError`] if they follow neither or both, those of [`running_means`](crate::running_means) and
    /// [`batches`](crate::batches), or if the first picture cannot be read.
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, StackError> {
        let dir = dir.as_ref();
        let layout = frames::detect(dir)?;
        let frames = match layout {
            Layout::RunningMeans => frames::running_means(dir)?,
            Layout::Batches => frames::batches(dir)?,
        };
        let first = read(layout, &frames[0].path)?;
        let folder = dir.file_name().unwrap_or(dir.as_os_str()).to_string_lossy();
        Ok(Self {
            name: format!("stack {folder}"),
            dir: dir.to_owned(),
            width: first.width,
            height: first.height,
            layout,
            frames,
            cache: VecDeque::from([(0, Arc::new(first))]),
        })
    }

    /// An image of the stack by its index, from memory or disk.
    fn image(&mut self, index: usize) -> Result<Arc<LinearImage>, StackError> {
        if let Some((_, image)) = self.cache.iter().find(|(cached, _)| *cached == index) {
            return Ok(Arc::clone(image));
        }
        let path = &self.frames[index].path;
        let image = Arc::new(read(self.layout, path)?);
        if (image.width, image.height) != (self.width, self.height) {
            let (size, got) = ((self.width, self.height), (image.width, image.height));
            return Err(StackFault::Size { size, got }.of(path));
        }
        while self.cache.len() >= CACHED {
            self.cache.pop_front();
        }
        self.cache.push_back((index, Arc::clone(&image)));
        Ok(image)
    }

    fn batch(&mut self, request: &Request) -> Result<Batch, StackError> {
        let tile = request.tile;
        self.check_tile(&tile)?;
        let Some(index) = self.frames.iter().position(|frame| frame.first == request.first) else {
            let end = self.frames.last().map_or(0, |frame| frame.last);
            if request.first == end {
                return Ok(Batch::new(tile, 0, Vec::new()));
            }
            let starts = self.frames.iter().map(|frame| frame.first).chain([end]);
            let near = starts.min_by_key(|start| start.abs_diff(request.first)).unwrap_or(0);
            return Err(StackFault::Boundary { first: request.first, near }.of(&self.dir));
        };

        // The first running mean, and every batch, holds only new samples
        let (first, last) = (self.frames[index].first, self.frames[index].last);
        let old = match self.layout {
            Layout::RunningMeans if index > 0 => Some(self.image(index - 1)?),
            _ => None,
        };
        let new = self.image(index)?;
        let mean = match old {
            None => tile.rows(self.width).flat_map(|row| new.pixels[row].iter().copied()).collect(),
            Some(old) => tile
                .rows(self.width)
                .flat_map(|row| old.pixels[row.clone()].iter().zip(&new.pixels[row]))
                .map(|(old, new)| difference(old, first, new, last))
                .collect(),
        };
        Ok(Batch::new(tile, last - first, mean))
    }

    fn check_tile(&self, tile: &Tile) -> Result<(), StackError> {
        let inside = |at: usize, len: usize, edge: usize| at.checked_add(len).is_some_and(|end| end <= edge);
        if inside(tile.x, tile.width, self.width) && inside(tile.y, tile.height, self.height) {
            return Ok(());
        }
        Err(StackFault::Tile { tile: *tile, size: (self.width, self.height) }.of(&self.dir))
    }
}

impl ProgressiveSource for StackSource {
    fn info(&self) -> SourceInfo {
        SourceInfo::new(self.name.clone(), self.width, self.height)
            .with_repeats(Repeats::Samples)
            .with_counts(Counts::Stored)
    }

    /// Reads every picture once, for its digest.
    fn identity(&self) -> Result<SourceIdentity, SourceError> {
        let mut identity = SourceIdentity::new(format!("stack, {:?}", self.layout));
        for Frame { path, .. } in &self.frames {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
            let added = File::open(path).and_then(|file| identity.add_from(name, file));
            added.map_err(|source| {
                let cause = PictureFault::Io(source).of(path);
                SourceError::Failed { name: self.name.clone(), tile: None, cause: Box::new(cause) }
            })?;
        }
        Ok(identity)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        // By sample order, so that tiles at different depths do not decode an image twice
        let mut order: Vec<usize> = (0..requests.len()).collect();
        order.sort_by_key(|&i| requests[i].first);
        let mut batches = Vec::with_capacity(requests.len());
        for i in order {
            let batch = self.batch(&requests[i]).map_err(|cause| SourceError::Failed {
                name: self.name.clone(),
                tile: Some(requests[i].tile.index),
                cause: Box::new(cause),
            })?;
            batches.push((i, batch));
        }
        batches.sort_by_key(|(i, _)| *i);
        Ok(batches.into_iter().map(|(_, batch)| batch).collect())
    }
}

/// Batches are linear by definition; running means may be display-encoded.
fn read(layout: Layout, path: &Path) -> Result<LinearImage, StackError> {
    Ok(match layout {
        Layout::RunningMeans => read_picture(path)?.into_linear(),
        Layout::Batches => read_exr(path)?,
    })
}

/// Mean of the samples after the first `n1`, from the means of the first `n1` and the first `n2`.
fn difference(old: &Rgb, n1: u64, new: &Rgb, n2: u64) -> Rgb {
    let (n1, n2) = (n1 as f64, n2 as f64);
    std::array::from_fn(|c| ((n2 * f64::from(new[c]) - n1 * f64::from(old[c])) / (n2 - n1)) as f32)
}
