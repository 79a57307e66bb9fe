//! What is known of each tile: stops.csv.

use noisefloor::{Session, Stop, StopReason, Tile, criterion::OpenFor};
use noisefloor_image::maps::{ColourScale, TileMark};
use serde::Serialize;
use std::collections::BTreeMap;

/// A tile's stop, or its state now if it is still open.
pub(super) struct TileState {
    pub(super) stop: Stop,
    pub(super) open: bool,
    open_for: Option<OpenFor>,
    /// What the denoised picture has lost there.
    lost: Option<f64>,
}

/// One line of stops.csv.
#[derive(Serialize)]
pub(super) struct StopRow {
    tile: usize,
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    spp: u64,
    probability: Option<f32>,
    reason: String,
    /// What keeps it from being done, or has kept it until a limit.
    open_for: Option<OpenFor>,
    unfamiliar: bool,
    /// With a denoiser: by the estimate when the tile was last judged.
    jods_lost: Option<f64>,
}

/// All tiles, in their order.
pub(super) fn states(session: &Session) -> Vec<TileState> {
    let stops: BTreeMap<usize, Stop> = session.stops().map(|s| (s.tile.index, s)).collect();
    let state = |tile: Tile| {
        let (stop, verdict) = (stops.get(&tile.index), session.verdict(tile.index));
        let so_far = || {
            let stop = Stop::new(tile, session.film().spp(tile.index), StopReason::Cancelled);
            verdict.map_or(stop, |verdict| stop.with_verdict(&verdict))
        };
        let lost = verdict.and_then(|verdict| verdict.lost).filter(|lost| lost.is_finite());
        let open_for = session.open_for(tile.index);
        TileState { stop: stop.copied().unwrap_or_else(so_far), open: stop.is_none(), open_for, lost }
    };
    session.film().grid().tiles().map(state).collect()
}

impl TileState {
    /// Why it stopped; `open` if it has not.
    pub(super) fn reason(&self) -> String {
        if self.open { "open".into() } else { self.stop.reason.to_string() }
    }

    /// Whether no later run would add samples: the criterion is satisfied, or there are no more.
    pub(super) fn is_final(&self) -> bool {
        let reason = self.stop.reason;
        !self.open && (reason.is_final() || reason == StopReason::SourceExhausted)
    }

    pub(super) fn row(&self) -> StopRow {
        let Stop { tile: Tile { index, x, y, width, height }, spp, probability, unfamiliar, .. } = self.stop;
        let (tile, reason) = (index, self.reason());
        let (open_for, jods_lost) = (self.open_for, self.lost);
        StopRow { tile, x, y, width, height, spp, probability, reason, open_for, unfamiliar, jods_lost }
    }

    fn mark(&self) -> TileMark {
        TileMark {
            tile: self.stop.tile,
            value: self.stop.spp as f64,
            label: format!("{}{}", self.stop.spp, if self.open { "+" } else { "" }),
            unfamiliar: self.stop.unfamiliar,
            frame: self.open_for.and_then(open_for_colour),
        }
    }
}

/// Colour and name of what keeps a tile open, in maps as on the live page; `None` of noise.
pub fn open_for_colour(why: OpenFor) -> Option<([u8; 3], &'static str)> {
    let colour = match why {
        OpenFor::Exposure => [90, 170, 255],
        OpenFor::UnmetLight => [255, 210, 40],
        OpenFor::FewSamples => [120, 230, 120],
        OpenFor::Doubt => [255, 90, 90],
        _ => return None,
    };
    Some((colour, why.name()))
}

/// Samples of each tile, and the scale from the least to the most.
pub(super) fn marks(tiles: &[TileState]) -> (Vec<TileMark>, ColourScale) {
    let spp = || tiles.iter().map(|tile| tile.stop.spp.max(1) as f64);
    let (low, high) = (spp().fold(f64::INFINITY, f64::min), spp().fold(1.0, f64::max));
    let (title, colours) = ("samples\nper pixel", colorous::VIRIDIS);
    let scale = ColourScale { title, low, high, log: true, colours, landmark: None };
    (tiles.iter().map(TileState::mark).collect(), scale)
}
