//! What a descriptor is, and how one is named in files.

use crate::evidence::{Plane, TilePlanes};
use crate::tile::Tile;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;
use thiserror::Error;

/// Computes numbers from a tile.
///
/// # For implementers
/// The default methods suit a descriptor that looks at one tile and does not separate noise from picture. One
/// that does separate them overrides [`TileDescriptor::project`], from which the expected need and the
/// audience follow, and
/// [`TileDescriptor::texture`], by which unfamiliar tiles are recognised.
pub trait TileDescriptor: fmt::Debug + Send + Sync {
    /// The name in model files and tables, such as `"visible"`.
    fn name(&self) -> &'static str;

    /// Version of the formulas. Raise it whenever a number changes: models trained with another version are
    /// refused.
    fn version(&self) -> u16;

    /// What [`DescriptorKind::make`] needs to make it again.
    fn parameters(&self) -> BTreeMap<String, f64>;

    /// What each number is, for the columns of tables; as many as the whole descriptor has, the picture's
    /// included.
    fn number_names(&self) -> Vec<String>;

    /// How many of the numbers are the tile's own: what [`TileDescriptor::describe`] returns.
    fn own_len(&self) -> usize {
        self.number_names().len()
    }

    /// The tile's own numbers.
    ///
    /// # Errors
    /// [`DescriptorError`] if the descriptor is not for tiles of that size.
    fn describe(&self, planes: &TilePlanes) -> Result<Vec<f32>, DescriptorError>;

    /// The whole descriptor of each of the tiles that make up a picture, or of those that are available.
    fn in_picture(&self, tiles: &[Described]) -> Vec<Vec<f32>> {
        tiles.iter().map(|t| t.own.clone()).collect()
    }

    /// The tile's own numbers, and what places them in their picture; `spp` is the samples per pixel of the tile,
    /// above 0. The default is for a descriptor that looks at tiles one by one.
    ///
    /// # Errors
    /// As of [`TileDescriptor::describe`].
    fn describe_tile(&self, planes: &TilePlanes, spp: f64) -> Result<Described, DescriptorError> {
        let (own, place) = (self.describe(planes)?, planes.place);
        Ok(Described { own, spp, place, window: 1, blocks: Vec::new() })
    }

    /// Whether a described tile, which may come from a file, is one that this descriptor can have made.
    fn is_sound(&self, tile: &Described) -> bool {
        tile.own.len() == self.own_len() && tile.own.iter().all(|v| v.is_finite()) && tile.blocks.is_empty()
    }

    /// How visible the noise is at each pixel of the tiles that make up a picture (rows × columns each), as an
    /// amplitude in a unit of the descriptor's own, whose largest value in a tile is what the tile is judged by.
    /// `None` if the descriptor does not separate noise from picture.
    fn visible_noise(&self, _tiles: &[Described]) -> Option<Vec<Plane>> {
        None
    }

    /// Which of the numbers are the tile's own texture and do not change as noise falls; none if the
    /// descriptor does not separate noise from picture.
    fn texture(&self) -> &[usize] {
        &[]
    }

    /// Smallest standard deviation over training data that is believed, in the unit of the numbers.
    fn least_deviation(&self) -> f64 {
        0.0
    }

    /// Whether the numbers depend on [`TilePlanes::viewing`]. Models with a descriptor that does not judge only
    /// for the viewing conditions they were trained for.
    fn knows_viewing(&self) -> bool {
        false
    }

    /// Changes a raw descriptor into that of `factor` times the samples, if only noise changes, as 1/√n.
    /// Returns false if the descriptor does not separate noise from picture.
    fn project(&self, _raw: &mut [f32], _factor: f32) -> bool {
        false
    }
}

/// How a descriptor is made from what a file says about it.
#[derive(Clone, Copy, Debug)]
pub struct DescriptorKind {
    /// [`TileDescriptor::name`].
    pub name: &'static str,
    /// Makes the descriptor from its parameters; the error says what is wrong with them.
    pub make: fn(&BTreeMap<String, f64>) -> Result<Descriptor, String>,
}

/// A descriptor, shared: what is computed from a tile.
///
/// ```
/// use noisefloor::{TileGrid, descriptor::Descriptor, evidence::TilePlanes};
/// let tile = TileGrid::new(32, 16, 32)?.tile(0);
/// let checker = |x: usize, y: usize| if (x + y) % 2 == 0 { [0.01; 3] } else { [-0.01; 3] };
/// let noise_at_the_left = |x, y| ([0.5; 3], if x < 16 { checker(x, y) } else { [0.0; 3] });
/// let planes = TilePlanes::gather((32, 16), tile, noise_at_the_left);
/// let descriptor = Descriptor::default();
/// let described = descriptor.describe_tile(&planes, 100.0)?;
/// let map = &descriptor.visible_noise(&[described]).unwrap()[0];
/// assert_eq!(map.size(), (16, 32));
/// // Windows of three quarters of a degree reach a little over the edge
/// assert!(map[(8, 0)] > 1.1 * map[(8, 31)]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Descriptor(Arc<dyn TileDescriptor>);

/// A descriptor as files name it: `{"visible": {"window": 0.75, …}}` in JSON.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(try_from = "Named", into = "Named"))]
pub struct DescriptorSpec {
    /// [`TileDescriptor::name`].
    pub name: String,
    /// [`TileDescriptor::parameters`].
    pub parameters: BTreeMap<String, f64>,
}

type Named = BTreeMap<String, BTreeMap<String, f64>>;

/// Why there is no such descriptor, or why it cannot describe a tile.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum DescriptorError {
    /// The descriptor is for one tile size.
    #[error("this descriptor is for tiles of {expected}×{expected} pixels, not {width}×{height}")]
    TileSize {
        /// Edge it is for.
        expected: usize,
        /// Width of the tile.
        width: usize,
        /// Height of the tile.
        height: usize,
    },
    /// No kind has that name.
    #[error("there is no descriptor {name:?}; known are {known}")]
    Unknown {
        /// The name.
        name: String,
        /// The names of all kinds.
        known: String,
    },
    /// Its parameters are wrong.
    #[error("descriptor {name:?}: {what}")]
    Parameters {
        /// The name.
        name: String,
        /// What is wrong.
        what: String,
    },
}

/// A tile's own numbers, and what it takes to place them beside those of the rest of its picture.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub struct Described {
    /// What [`TileDescriptor::describe`] returned.
    pub own: Vec<f32>,
    /// Samples per pixel of the tile, above 0; not an integer where a level is synthesised.
    pub spp: f64,
    /// Where it lies in its picture.
    pub place: Tile,
    /// Edge of the windows in which noise is looked for, in blocks of the picture.
    pub window: usize,
    /// Sums over the blocks of the picture that the tile has pixels of, of what windows are means of and of its square,
    /// row by row. Empty for a descriptor without windows, and for a tile that is to be taken by its own numbers: apart from
    /// its neighbours.
    pub blocks: Vec<[f32; 2]>,
}

impl Descriptor {
    /// Wraps a descriptor.
    pub fn new(descriptor: impl TileDescriptor + 'static) -> Self {
        Self(Arc::new(descriptor))
    }

    /// How files name it.
    pub fn spec(&self) -> DescriptorSpec {
        DescriptorSpec { name: self.name().to_owned(), parameters: self.parameters() }
    }

    /// Dimensionality of the whole descriptor, the picture's numbers included.
    pub fn dimensions(&self) -> usize {
        self.number_names().len()
    }
}

impl Deref for Descriptor {
    type Target = dyn TileDescriptor;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

impl PartialEq for Descriptor {
    fn eq(&self, other: &Self) -> bool {
        self.spec() == other.spec() && self.version() == other.version()
    }
}

impl TryFrom<Named> for DescriptorSpec {
    type Error = &'static str;

    fn try_from(named: Named) -> Result<Self, Self::Error> {
        let mut all = named.into_iter();
        match (all.next(), all.next()) {
            (Some((name, parameters)), None) => Ok(Self { name, parameters }),
            _ => Err("a descriptor has one name"),
        }
    }
}

impl From<DescriptorSpec> for Named {
    fn from(spec: DescriptorSpec) -> Self {
        Self::from([(spec.name, spec.parameters)])
    }
}
