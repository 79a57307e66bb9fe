//! `noisefloor-lab explore`.

use anyhow::Context;
use noisefloor_cli::say::say;
use noisefloor_pages::http::{Exposure, interrupted};
use noisefloor_study::explore::{ExploreServer, ExploreSetup};
use std::net::SocketAddr;
use tokio::runtime::Builder;

pub fn run((setup, listen, exposure): (ExploreSetup, SocketAddr, Exposure)) -> anyhow::Result<()> {
    let database = setup.database.clone();
    let runtime = Builder::new_multi_thread().enable_all().build().context("no threads for the server")?;
    runtime.block_on(async {
        let explorer = ExploreServer::bind(setup, listen, &exposure).await?;
        say!("open http://{} in a browser; Ctrl-C ends the server", explorer.address())?;
        say!("disagreements are stored in {}", database.display())?;
        explorer.run(interrupted()).await?;
        Ok(())
    })
}
