//! What one load reads, counts and says, whatever the format.

use crate::bounds::Bounds;
use crate::channels::{self, Means};
use crate::error::{LoadError, Place, Warning};
use crate::files::Folder;
use crate::mesh::rows;
use glam::DMat4;
use noisefloor::Rgb;
use noisefloor_ptwne::{ObjectId, SceneBuilder, SceneError, Texture};
use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// Most pixels that the pictures of a scene have together, where they are kept more than once counted as often.
const MAX_PIXELS: u64 = 1 << 27;
const MAX_WARNINGS: usize = 10_000;

#[derive(Debug)]
pub(crate) struct Load {
    /// The file of the scene.
    pub(crate) path: PathBuf,
    pub(crate) folder: Folder,
    /// Of what is in something of its kind, and of all work.
    pub(crate) bounds: Bounds,
    pub(crate) means: Means,
    pixels: Cell<u64>,
    warnings: RefCell<Vec<Warning>>,
    /// Warnings that there are already.
    said: RefCell<HashSet<String>>,
}

impl Load {
    /// `options` are what changes the scene beside its files, which must lie in `root` as [`Folder::of`] says.
    pub(crate) fn new(path: &Path, root: Option<&Path>, options: String) -> Self {
        let (bounds, means, pixels, warnings, said) = Default::default();
        let folder = Folder::of(path, root, options);
        Self { path: path.to_owned(), folder, bounds, means, pixels, warnings, said }
    }

    /// Warns, once, that something is left out.
    pub(crate) fn ignored(&self, place: &Place, what: impl fmt::Display) {
        self.warn(Warning::ignored(place.clone(), what));
    }

    /// Warns, once, that something is replaced by something that looks much the same.
    pub(crate) fn approximated(&self, place: &Place, what: impl fmt::Display) {
        self.warn(Warning::approximated(place.clone(), what));
    }

    fn warn(&self, warning: Warning) {
        let mut warnings = self.warnings.borrow_mut();
        if warnings.len() > MAX_WARNINGS || !self.said.borrow_mut().insert(warning.to_string()) {
            return;
        }
        let last = || Warning::ignored(Place::file(&self.path), "further warnings are left out");
        let full = warnings.len() == MAX_WARNINGS;
        warnings.push(if full { last() } else { warning });
    }

    /// All warnings, in the order in which they came up.
    pub(crate) fn into_warnings(self) -> Vec<Warning> {
        self.warnings.into_inner()
    }

    /// Shows an object; the result is whether it is seen. Where its transform is singular, `what` it is is left out.
    pub(crate) fn instance(
        &self,
        builder: &mut SceneBuilder,
        object: ObjectId,
        to_world: DMat4,
        what: &str,
        place: &Place,
    ) -> Result<bool, LoadError> {
        match builder.instance(object, rows(to_world)) {
            Ok(()) => Ok(true),
            Err(SceneError::Singular) => {
                self.ignored(place, format_args!("{what} is left out: its transform is singular"));
                Ok(false)
            }
            Err(cause) => Err(place.refused()(cause)),
        }
    }

    /// Counts pixels that are kept.
    pub(crate) fn count_pixels(&self, place: &Place, count: usize) -> Result<(), LoadError> {
        self.pixels.set(self.pixels.get().saturating_add(count as u64));
        place.at_most("pixels in all pictures so far", self.pixels.get(), MAX_PIXELS)
    }

    /// An index of refraction of a conductor. Values a little below 0, which fits of measurements have, count as 0.
    pub(crate) fn conductor_index(&self, place: &Place, name: &str, index: Rgb) -> Rgb {
        let nearest = index.map(|n| n.clamp(0.0, 100.0));
        if nearest != index {
            self.approximated(place, format_args!("`{name}` is {index:?}, and is brought into 0…100"));
        }
        nearest
    }

    /// Textures as one, whose pixels `put` makes of their colours.
    pub(crate) fn combined<const N: usize>(
        &self,
        place: &Place,
        parts: [&Texture; N],
        put: impl Fn([Rgb; N]) -> Rgb,
    ) -> Result<Texture, LoadError> {
        let (texture, replaced) = channels::combined(parts, |texture| self.means.of(texture), put);
        if replaced {
            self.approximated(place, "a second texture of another layout is replaced by its mean");
        }
        if let Texture::Image(image) = &texture {
            self.count_pixels(place, image.width * image.height)?;
        }
        Ok(texture)
    }

    /// The same of grey ones.
    pub(crate) fn joined<const N: usize>(
        &self,
        place: &Place,
        parts: [&Texture; N],
        put: impl Fn([f32; N]) -> Rgb,
    ) -> Result<Texture, LoadError> {
        let grey = |p: Rgb| (p[0] + p[1] + p[2]) / 3.0;
        self.combined(place, parts, |colours| put(colours.map(grey)).map(|c| c.clamp(0.0, 1.0)))
    }
}
