//! `render --watch`: a page with the picture so far.

use super::saving::Pace;
use crate::job::WatchPage;
use crate::output::Output;
use noisefloor::{Rgb, Session, criterion::OpenFor, driver::Progress};
use noisefloor_cli::say::{note, one_line};
use noisefloor_image::maps::Canvas;
use noisefloor_pages::http::Exposure;
use noisefloor_pages::watch::{LiveRender, LiveState, LiveTile, WatchServer};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest edge of the picture on the page, in pixels; larger ones are reduced.
const EDGE: usize = 2048;
const PAUSE: Duration = Duration::from_secs(1);

/// A page that is being served.
pub struct Page {
    live: Arc<LiveRender>,
    state: LiveState,
    /// Whether there is no picture yet: whoever opens the page should not wait for one.
    blank: bool,
    pace: Pace,
}

impl Page {
    pub fn serve(page: &WatchPage, output: &Output, quiet: bool) -> anyhow::Result<Self> {
        let live = Arc::new(LiveRender::default());
        let bound = WatchServer::start(Arc::clone(&live), page.address, &Exposure::named(&page.hosts))?;
        if !quiet {
            match bound.ip().is_unspecified() {
                false => note!("watch it at http://{bound}"),
                true => note!(
                    "watch it at http://127.0.0.1:{port}, and elsewhere at port {port} of this machine's address",
                    port = bound.port()
                ),
            }
        }
        let state = LiveState::new(&output.about.scene, &output.about.source);
        Ok(Self { live, state, blank: true, pace: Pace::of_view(PAUSE) })
    }

    pub fn show(&mut self, session: &Session, progress: &Progress) {
        self.state.seconds = progress.now.seconds;
        self.state.eta_seconds = progress.eta_seconds;
        let wanted = self.live.is_watched() || self.blank;
        self.publish(session, wanted && self.pace.is_due());
    }

    /// Shows the end, if somebody watches: the page stays until the command is done.
    pub fn close(&mut self, session: &Session) {
        self.state.over = true;
        self.state.eta_seconds = None;
        self.publish(session, self.live.is_watched());
    }

    fn publish(&mut self, session: &Session, draw: bool) {
        let film = session.film();
        let tile = |tile: noisefloor::Tile| {
            let probability = session.verdict(tile.index).and_then(|verdict| verdict.probability);
            let (spp, open) = (film.spp(tile.index), session.is_open(tile.index));
            let open_for = session.open_for(tile.index).map(OpenFor::name);
            let noisefloor::Tile { x, y, width, height, .. } = tile;
            LiveTile { x, y, width, height, spp, probability, open, open_for }
        };
        (self.state.width, self.state.height) = (film.grid().width(), film.grid().height());
        self.state.tiles = film.grid().tiles().map(tile).collect();
        let began = Instant::now();
        let picture = draw.then(|| reduced(session).to_png());
        match picture.transpose() {
            Ok(picture) => self.live.publish(&self.state, picture),
            Err(error) => note!("warning: no picture for the page: {}", one_line(&error.into())),
        }
        if draw {
            self.blank = false;
            self.pace.pause_after(began.elapsed());
        }
    }
}

/// The picture as displayed, every so many pixels averaged to one.
fn reduced(session: &Session) -> Canvas {
    let film = session.film();
    let grid = film.grid();
    let step = grid.width().max(grid.height()).div_ceil(EDGE);
    let (width, height) = (grid.width().div_ceil(step), grid.height().div_ceil(step));
    let display = session.display_so_far();
    let mean = |pixel: usize| -> Rgb {
        let (left, top) = (pixel % width * step, pixel / width * step);
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for y in top..(top + step).min(grid.height()) {
            for x in left..(left + step).min(grid.width()) {
                let radiance = film.pixel(grid.index_at(x, y), y * grid.width() + x);
                sum = std::array::from_fn(|c| sum[c] + radiance[c]);
                count += 1.0;
            }
        }
        sum.map(|c| c / count)
    };
    Canvas::of_pixels(width, height, |pixel| display.encode(mean(pixel)))
}
