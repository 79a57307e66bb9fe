//! `noisefloor-lab explore`.

use clap::Args;
use noisefloor::{Audience, tile::DEFAULT_TILE};
use noisefloor_cli::options::eyes::{EyesArgs, Seen};
use noisefloor_cli::options::layer::LayerArgs;
use noisefloor_cli::options::oracle::OracleArgs;
use noisefloor_cli::options::values;
use noisefloor_cli::options::viewing::ViewingArgs;
use noisefloor_pages::http::Exposure;
use noisefloor_study::explore::ExploreSetup;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Judge pictures of your own in the browser, disagree, and retrain.
///
/// Drop renderings of one view on the page, or name them here: two with different seeds, snapshots of one
/// rendering, or a picture and its converged reference (PNG, EXR or PFM). The page shows what `judge` says
/// of each tile, maps of visible noise and of the JODs lost, and the predicted samples; the share of people and the audience follow a slider.
/// A click on a tile says that the verdict is wrong. It is stored in the database before it is
/// acknowledged; `train --disagreements` learns from it, and so does the page itself with --table.
///
/// The server is for this machine: nothing leaves it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor-lab explore                                         then drop pictures on http://127.0.0.1:8438
  noisefloor-lab explore 00100.png 00400.png 01600.png           a stack, named by its samples per pixel
  noisefloor-lab explore a_256spp.exr b_256spp.exr --table fixtures/human-table.csv      and retrain on the page
  noisefloor-lab train --table fixtures/human-table.csv --disagreements explore.sqlite --out mine.nfm")]
pub struct ExploreArgs {
    /// Pictures to begin with. EXRs of `render` say how many samples per pixel they have, and so do names
    /// such as 00100.png or hall_64spp.exr; otherwise the page asks.
    #[arg(value_name = "IMAGE")]
    images: Vec<PathBuf>,
    #[command(flatten)]
    layer: LayerArgs,
    #[command(flatten)]
    oracle: OracleArgs,
    #[command(flatten)]
    viewing: ViewingArgs,
    /// For whom: `observers`, `art-students`, a factor on samples, or a,b for T' = a T + b [default: see --eyes].
    #[arg(long, value_name = "WHO", value_parser = values::audience)]
    audience: Option<Audience>,
    #[command(flatten)]
    eyes: EyesArgs,
    /// Tile edge in pixels, 16…512.
    #[arg(long, default_value_t = DEFAULT_TILE, value_name = "PIXELS", value_parser = values::edge)]
    tile: usize,
    /// Database of disagreements; created if it does not exist.
    #[arg(long, default_value = "explore.sqlite", value_name = "FILE")]
    database: PathBuf,
    /// Table of human thresholds that the page retrains on, such as the project's fixtures/human-table.csv,
    /// or one that `train --save-table` wrote. Without it, the page cannot retrain.
    #[arg(long, value_name = "FILE.csv")]
    table: Option<PathBuf>,
    /// Address and port to listen on; port 0 picks a free one. Pictures travel unencrypted: use it only in
    /// a network that you trust.
    #[arg(long, default_value = "127.0.0.1:8438", value_name = "IP:PORT")]
    listen: SocketAddr,
    /// Another name of this machine that browsers may use. Repeat for more.
    #[arg(long, value_name = "HOST")]
    allow_host: Vec<String>,
}

impl ExploreArgs {
    /// What to serve, and where.
    pub fn check(self) -> anyhow::Result<(ExploreSetup, SocketAddr, Exposure)> {
        let Seen { oracle, viewing, audience } =
            self.eyes.look(&self.oracle, &self.viewing, self.audience)?;
        let setup = ExploreSetup {
            model: oracle.model().clone(),
            people: oracle.people(),
            audience,
            viewing,
            tile: self.tile,
            database: self.database,
            table: self.table.as_deref().map(crate::learning::read_table_file).transpose()?,
            layer: self.layer.layer,
            pictures: self.images,
        };
        Ok((setup, self.listen, Exposure::named(&self.allow_host)))
    }
}
