//! From the planes of a tile to the numbers that the machine judges.

mod compact;
mod pair;

use crate::evidence::TilePlanes;
use crate::mask::NoiseMask;
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What is computed of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Descriptor {
    /// Six numbers, whatever the tile size: how visible the noise is where it is most visible, how much texture hides it, and
    /// the same of the whole picture. The default.
    Compact {
        /// The noise mask.
        mask: NoiseMask,
    },
    /// The paper's: the noise mask of the tile and of what it is held against, pixel by pixel (Takouachet et al. 2017, §5).
    /// 2·edge² numbers, for tiles of exactly edge×edge pixels.
    MaskPair {
        /// The noise mask.
        mask: NoiseMask,
        /// Tile edge in pixels.
        edge: usize,
    },
    /// The paper's first try, without a mask, which failed: the luminance of the tile and of what it is held against, pixel by
    /// pixel (Takouachet et al. 2017, §4.3, §4.4). 2·edge² numbers, for tiles of exactly edge×edge pixels.
    LuminancePair {
        /// Tile edge in pixels.
        edge: usize,
    },
}

impl Default for Descriptor {
    fn default() -> Self {
        Self::Compact { mask: NoiseMask::default() }
    }
}

/// A tile that a descriptor cannot describe.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
pub enum DescriptorError {
    /// The paper's descriptor is for one tile size.
    #[error("this descriptor is for tiles of {expected}×{expected} pixels, not {width}×{height}")]
    TileSize {
        /// Edge it is for.
        expected: usize,
        /// Width of the tile.
        width: usize,
        /// Height of the tile.
        height: usize,
    },
}

/// A tile's own numbers, and what it takes to see them beside those of the rest of its picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Described {
    /// What [`Descriptor::describe`] found.
    pub own: Vec<f32>,
    /// Samples per pixel of the tile, above 0.
    pub samples: f64,
    /// Pixels of the tile: its weight in the picture.
    pub area: f64,
}

impl Descriptor {
    /// A short name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Compact { .. } => "compact",
            Self::MaskPair { .. } => "mask-pair",
            Self::LuminancePair { .. } => "luminance-pair",
        }
    }

    /// Version of the formulas: models trained with another one are refused.
    pub fn version(&self) -> u16 {
        match self {
            Self::Compact { .. } => 2,
            Self::MaskPair { .. } | Self::LuminancePair { .. } => 1,
        }
    }

    /// Number of numbers, the picture's included.
    #[expect(clippy::len_without_is_empty, reason = "a descriptor is never empty")]
    pub fn len(&self) -> usize {
        match self {
            Self::Compact { .. } => compact::NAMES.len(),
            Self::MaskPair { edge, .. } | Self::LuminancePair { edge } => 2 * edge * edge,
        }
    }

    /// Number of a tile's own numbers.
    pub(crate) fn own_len(&self) -> usize {
        match self {
            Self::Compact { .. } => compact::OWN,
            Self::MaskPair { .. } | Self::LuminancePair { .. } => self.len(),
        }
    }

    /// What each number is, for the columns of tables.
    pub fn number_names(&self) -> Vec<String> {
        match self {
            Self::Compact { .. } => compact::NAMES.map(str::to_owned).to_vec(),
            Self::MaskPair { .. } => (0..self.len()).map(|i| format!("m{i}")).collect(),
            Self::LuminancePair { .. } => (0..self.len()).map(|i| format!("l{i}")).collect(),
        }
    }

    /// Describes a tile, which has `samples` samples per pixel, by itself.
    ///
    /// # Errors
    /// [`DescriptorError`] if the tile has a size the descriptor is not for.
    pub fn describe(&self, planes: &TilePlanes, samples: f64) -> Result<Described, DescriptorError> {
        let fits = |edge: usize| {
            let (width, height) = (planes.inner.width, planes.inner.height);
            let error = DescriptorError::TileSize { expected: edge, width, height };
            if (width, height) == (edge, edge) { Ok(()) } else { Err(error) }
        };
        let own = match *self {
            Self::Compact { mask } => compact::describe(planes, mask).to_vec(),
            Self::MaskPair { mask, edge } => {
                fits(edge)?;
                pair::masks(planes, mask)
            }
            Self::LuminancePair { edge } => {
                fits(edge)?;
                pair::luminances(planes)
            }
        };
        Ok(Described { own, samples, area: planes.inner.pixels() as f64 })
    }

    /// The whole descriptor of each of the tiles that make up a picture, or what is there of it.
    pub fn in_picture(&self, tiles: &[Described]) -> Vec<Vec<f32>> {
        match self {
            Self::Compact { .. } => compact::in_picture(tiles),
            Self::MaskPair { .. } | Self::LuminancePair { .. } => {
                tiles.iter().map(|t| t.own.clone()).collect()
            }
        }
    }

    /// How visible the noise is at each pixel of the tile (its rows × its columns): an amplitude in 8-bit display steps, weighted
    /// by scale and brightness and lowered by texture as the descriptor weighs it, for each block of 8×8 pixels. What the
    /// verdict on the tile goes by is pooled from this. `None` if the descriptor does not tell noise from picture.
    ///
    /// ```
    /// use noisefloor::{Descriptor, TileGrid, TilePlanes};
    /// let tile = TileGrid::new(32, 16, 32)?.tile(0);
    /// let checker = |x: usize, y: usize| if (x + y) % 2 == 0 { [0.01; 3] } else { [-0.01; 3] };
    /// let noise_at_the_left = |x, y| ([0.5; 3], if x < 16 { checker(x, y) } else { [0.0; 3] });
    /// let planes = TilePlanes::gather((32, 16), tile, noise_at_the_left);
    /// let map = Descriptor::default().visible_noise(&planes).unwrap();
    /// assert_eq!(map.dim(), (16, 32));
    /// assert!(map[(8, 0)] > 1.0 && map[(8, 31)] < 0.01);
    /// # Ok::<(), noisefloor::TileError>(())
    /// ```
    pub fn visible_noise(&self, planes: &TilePlanes) -> Option<Array2<f32>> {
        match *self {
            Self::Compact { mask } => Some(compact::visible_noise(planes, mask)),
            Self::MaskPair { .. } | Self::LuminancePair { .. } => None,
        }
    }

    /// The amplitude of [`Descriptor::visible_noise`] that a raw descriptor has pooled.
    pub(crate) fn pooled_visible_noise(&self, descriptor: &[f32]) -> Option<f32> {
        match self {
            Self::Compact { .. } => Some(compact::pooled_amplitude(descriptor)),
            Self::MaskPair { .. } | Self::LuminancePair { .. } => None,
        }
    }

    /// Those of the numbers that are the tile's own texture, and stay as they are when noise falls; empty if the descriptor does not
    /// tell noise from picture.
    pub fn texture_of(&self, numbers: &[f32]) -> Vec<f32> {
        match self {
            Self::Compact { .. } => compact::TEXTURE.map(|i| numbers[i]).to_vec(),
            Self::MaskPair { .. } | Self::LuminancePair { .. } => Vec::new(),
        }
    }

    /// Standard deviation over the training data that is taken for granted, in the unit of the numbers.
    pub fn least_deviation(&self) -> f64 {
        match self {
            Self::Compact { .. } => compact::LEAST_DEVIATION,
            Self::MaskPair { .. } | Self::LuminancePair { .. } => 0.0,
        }
    }

    /// How many of the numbers are texture.
    pub fn texture_numbers(&self) -> usize {
        match self {
            Self::Compact { .. } => compact::TEXTURE.len(),
            Self::MaskPair { .. } | Self::LuminancePair { .. } => 0,
        }
    }

    /// Changes a raw descriptor into what it would be with `factor` times the samples, if noise alone changes, as 1/√n. False if
    /// the descriptor does not tell noise from picture.
    pub(crate) fn project(&self, descriptor: &mut [f32], factor: f32) -> bool {
        match self {
            Self::Compact { .. } => {
                compact::project(descriptor, factor);
                true
            }
            Self::MaskPair { .. } | Self::LuminancePair { .. } => false,
        }
    }
}
