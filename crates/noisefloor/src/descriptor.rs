//! From the planes of a tile to the numbers that the machine judges.
//!
//! A descriptor is a [`TileDescriptor`]; its [`DescriptorKind`] makes it again from the name and the
//! parameters in a model file. To add one, write both and name the kind in `KINDS`, or, outside this crate,
//! hand it to
//! [`Model::read_with`](crate::Model::read_with).

mod kind;
mod mask;
mod texture;
mod visible;
mod windows;

pub use kind::{Described, Descriptor, DescriptorError, DescriptorKind, DescriptorSpec, TileDescriptor};
pub use mask::{NoiseMask, SigmaError};

const KINDS: [DescriptorKind; 1] = [visible::KIND];

impl Descriptor {
    /// Five numbers, whatever the tile size: how many times too strong the noise is by a model of human vision,
    /// the tile's texture and brightness, and noise and brightness of the whole picture.
    /// Knows viewing conditions.
    pub fn visible() -> Self {
        Self::new(visible::Visible::default())
    }

    /// The descriptor that a file names: one of `kinds`, or a built-in one.
    ///
    /// # Errors
    /// [`DescriptorError::Unknown`], [`DescriptorError::Parameters`].
    pub fn from_spec(spec: &DescriptorSpec, kinds: &[DescriptorKind]) -> Result<Self, DescriptorError> {
        let all = || kinds.iter().chain(&KINDS);
        let Some(kind) = all().find(|kind| kind.name == spec.name) else {
            let known = all().map(|kind| kind.name).collect::<Vec<_>>().join(", ");
            return Err(DescriptorError::Unknown { name: spec.name.clone(), known });
        };
        (kind.make)(&spec.parameters)
            .map_err(|what| DescriptorError::Parameters { name: spec.name.clone(), what })
    }
}

impl Default for Descriptor {
    fn default() -> Self {
        Self::visible()
    }
}
