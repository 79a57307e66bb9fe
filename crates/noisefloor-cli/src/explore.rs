//! `noisefloor explore`.

use crate::args::ExploreArgs;
use crate::train::read_table_file;
use anyhow::Context;
use noisefloor_study::explore::{ExploreServer, ExploreSetup};
use noisefloor_study::{Exposure, interrupted};
use tokio::runtime::Builder;

pub fn run(args: &ExploreArgs) -> anyhow::Result<()> {
    let oracle = args.oracle.load()?;
    let setup = ExploreSetup {
        model: oracle.model().clone(),
        threshold: oracle.threshold(),
        audience: args.audience,
        tile: args.tile,
        database: args.database.clone(),
        table: args.table.as_deref().map(read_table_file).transpose()?,
        pictures: args.images.clone(),
    };
    let runtime = Builder::new_multi_thread().enable_all().build().context("no threads for the server")?;
    runtime.block_on(async {
        let explorer = ExploreServer::bind(setup, args.listen, &Exposure::named(&args.allow_host)).await?;
        println!("look at http://{}; Ctrl-C ends", explorer.address());
        println!("disagreements are kept in {}", args.database.display());
        explorer.run(interrupted()).await?;
        Ok(())
    })
}
