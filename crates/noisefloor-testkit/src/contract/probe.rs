//! Asking a source for samples, and checking the shape of each answer.

use noisefloor::{
    Batch, Counts, ProgressiveSource, Repeats, Request, SourceInfo, Tile, TileGrid, tile::check_image,
};

/// Tile edge that sources are asked in: an image of 48×40 pixels has a narrower tile to the right, and both
/// are higher than this.
pub(super) const EDGE: usize = 32;

/// The answer to one call that asks for every tile, in the order of the grid.
pub(super) type Round = Vec<Batch>;

/// The source that is checked: how one is made, and how each describes itself.
pub(super) struct Subject<F> {
    make: F,
    pub(super) info: SourceInfo,
}

impl<S: ProgressiveSource, F: Fn() -> S> Subject<F> {
    /// Checks that the description is in range.
    pub(super) fn new(make: F) -> Self {
        let info = make().info();
        assert!(!info.name.trim().is_empty(), "a source needs a name, for reports and messages");
        check_image(info.width, info.height).unwrap_or_else(|e| panic!("{e}"));
        Self { make, info }
    }

    /// A new source, which has the description of the first.
    pub(super) fn start(&self) -> Probe<S> {
        let source = (self.make)();
        assert_eq!(
            source.info(),
            self.info,
            "two sources of one construction describe themselves differently"
        );
        Probe::new(source)
    }

    /// What a new source gives for each of these numbers of samples in turn.
    pub(super) fn rounds(&self, spp: &[u64]) -> Vec<Round> {
        let mut probe = self.start();
        let rounds = spp.iter().map(|&n| probe.ask_all(n)).collect();
        assert_eq!(probe.source.info(), self.info, "the description changed with use");
        rounds
    }

    /// Whether the source promises to repeat at least this.
    pub(super) fn promises(&self, least: Repeats) -> bool {
        self.info.repeats == Repeats::Samples || self.info.repeats == least
    }
}

/// A source, and how many samples each of its tiles has given.
pub(super) struct Probe<S> {
    pub(super) source: S,
    pub(super) tiles: Vec<Tile>,
    taken: Vec<u64>,
    counts: Counts,
    /// Tiles that gave fewer samples than asked for.
    ended: Vec<bool>,
}

impl<S: ProgressiveSource> Probe<S> {
    fn new(source: S) -> Self {
        let info = source.info();
        let grid = TileGrid::new(info.width, info.height, EDGE).expect("the size was checked");
        Self {
            source,
            tiles: grid.tiles().collect(),
            taken: vec![0; grid.len()],
            counts: info.counts,
            ended: vec![false; grid.len()],
        }
    }

    /// Asks for the next samples of some tiles, and checks the shape of the answer.
    pub(super) fn ask(&mut self, tiles: &[usize], spp: u64) -> Vec<Batch> {
        let request = |&i: &usize| Request::new(self.tiles[i], self.taken[i], spp);
        let requests: Vec<Request> = tiles.iter().map(request).collect();
        let answer = self.source.sample(&requests);
        let batches = answer.unwrap_or_else(|e| panic!("sampling failed: {e} ({e:?})"));
        assert_eq!(batches.len(), requests.len(), "the number of batches is not the number of requests");
        for (request, batch) in requests.iter().zip(&batches) {
            let tile = request.tile.index;
            assert_eq!(batch.tile, request.tile, "batches are not in the order of the requests");
            let pixels = if batch.spp == 0 { 0 } else { batch.tile.pixels() };
            let values = batch.mean.len();
            assert_eq!(
                values, pixels,
                "wrong number of values in a batch of {} samples, tile {tile}",
                batch.spp
            );
            self.check_count(request, batch.spp);
            self.taken[tile] += batch.spp;
        }
        batches
    }

    /// A tile gives as many samples as its source says until it ends: then what it has left, and nothing from
    /// then on.
    fn check_count(&mut self, request: &Request, samples: u64) {
        let (tile, asked) = (request.tile.index, request.spp);
        let most = if self.ended[tile] { 0 } else { self.counts.most(asked) };
        assert!(samples <= most, "tile {tile}: {samples} samples where {asked} were asked for");
        self.ended[tile] |= self.counts != Counts::Stored && samples < asked;
    }

    /// Asks for all tiles, the last one first, and returns their batches in the order of the grid.
    pub(super) fn ask_all(&mut self, spp: u64) -> Round {
        let last_first: Vec<usize> = (0..self.tiles.len()).rev().collect();
        let mut batches = self.ask(&last_first, spp);
        batches.reverse();
        batches
    }
}
