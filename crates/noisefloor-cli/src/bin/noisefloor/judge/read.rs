//! Pictures that can be judged, and what is said of them.

use anyhow::Context;
use noisefloor::stills::{Still, StillWarning};
use noisefloor_cli::say::note;
use noisefloor_image::{ReadOptions, read_facts, read_still_with, read_unread};
use std::path::{Path, PathBuf};

/// A picture that can be judged; errors name it.
pub(super) fn read((path, spp): &(PathBuf, Option<f64>), options: &ReadOptions) -> anyhow::Result<Still> {
    let still = read_still_with(path, *spp, options)?;
    if let (Some(typed), Some(said)) = (spp, read_facts(path)?.spp())
        && *typed != said as f64
    {
        note!(
            "note: {} says that it has {said} samples per pixel; --spp {typed} overrides it",
            path.display()
        );
    }
    warn_unread(path, options)?;
    still.check().with_context(|| format!("{}", path.display()))?;
    Ok(still)
}

/// Says what is not read of a picture.
pub fn warn_unread(path: &Path, options: &ReadOptions) -> anyhow::Result<()> {
    for what in read_unread(path, options)?.warnings() {
        note!("warning: {}: {what}", path.display());
    }
    Ok(())
}

/// Says what is likely wrong with two pictures.
pub(super) fn warn_of(warnings: &[StillWarning]) {
    for what in warnings {
        note!("warning: {what}");
    }
}
