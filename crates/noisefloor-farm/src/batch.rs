//! A batch as plans and shards describe it.

use noisefloor::{Request, Session, StoppingCriterion, Tile, source::Sequence};
use serde::{Deserialize, Serialize, Serializer};

/// A batch that is asked for.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct PlannedBatch {
    pub tile: usize,
    /// Index of its first sample.
    pub first: u64,
    /// Samples per pixel asked for.
    pub spp: u64,
    /// Number of the [`Sequence`] that they belong to.
    pub sequence: u32,
    /// Index of the first of them in the sequence.
    pub point: u64,
}

impl PlannedBatch {
    /// A batch of a pixel's only sequence, as of [`Request::new`].
    pub fn new(tile: usize, first: u64, spp: u64) -> Self {
        Self { tile, first, spp, sequence: 0, point: first }
    }

    /// What all open tiles of a session are going to need; see [`Session::batches_ahead`].
    pub fn ahead<C: StoppingCriterion>(session: &Session<C>) -> Vec<Self> {
        let tiles = 0..session.film().grid().len();
        tiles.flat_map(|tile| session.batches_ahead(tile)).map(Self::from).collect()
    }

    /// The request for it, in a picture of which it names this tile.
    pub(crate) fn request(&self, tile: Tile) -> Request {
        let sequence = Sequence::new(self.sequence, self.point);
        Request::new(tile, self.first, self.spp).in_sequence(sequence)
    }
}

impl From<Request> for PlannedBatch {
    fn from(Request { tile, first, spp, sequence, .. }: Request) -> Self {
        Self { tile: tile.index, first, spp, sequence: sequence.number, point: sequence.first }
    }
}

/// As a short list of numbers: a round can have millions of batches.
impl Serialize for PlannedBatch {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let &Self { tile, first, spp, sequence, point } = self;
        (tile, first, spp, sequence, point).serialize(to)
    }
}
