//! `tune --keep`: the picture of the last step, and what was found.

use super::job::Row;
use super::pictures::Judged;
use crate::output::ERROR_SCALE;
use anyhow::{Context, bail};
use noisefloor::{Rgb, source::SourceIdentity, tune::Looked};
use noisefloor_cli::files::write_json;
use noisefloor_cli::folder::{Earlier, Folder};
use noisefloor_cli::refuse;
use noisefloor_image::maps::{Canvas, NOISE_SCALE, draw_field};
use noisefloor_image::{RenderLayers, SampleFacts, write_exr};
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::PathBuf;

const REPORT: &str = "tune.json";
const FILES: &[&str] = &[REPORT, "image.exr", "image.png", "report.json"];

pub struct Keep(Folder);

/// What tune.json says of an earlier search.
#[derive(Deserialize)]
pub struct KeptSearch {
    identity: Vec<SourceIdentity>,
    #[serde(default)]
    pub frames: Vec<i32>,
    pub steps: Vec<Row>,
}

impl Keep {
    pub fn claim(path: PathBuf, earlier: Earlier) -> anyhow::Result<Self> {
        let folder = Folder::claim(path)?;
        if let (Earlier::Keep, Some(file)) = (earlier, folder.first_of(FILES)) {
            refuse!(
                "{}: holds {file} of an earlier run; --resume goes on with a search, --force overwrites it, \
                 --keep names another folder",
                folder.path().display()
            );
        }
        Ok(Self(folder))
    }

    /// The search that is resumed, if there is one.
    pub fn earlier(&self, identity: &[SourceIdentity]) -> anyhow::Result<Option<KeptSearch>> {
        let path = self.0.path().join(REPORT);
        let report = match std::fs::read(&path) {
            Ok(report) => report,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).with_context(|| path.display().to_string()),
        };
        let kept: KeptSearch = serde_json::from_slice(&report)
            .with_context(|| format!("{}: no search that can be resumed", path.display()))?;
        if kept.identity.len() != identity.len() {
            bail!("{}: the search is of other frames; --force begins anew", path.display());
        }
        // Frames are in the order in which they were typed
        if let Some(change) =
            identity.iter().zip(&kept.identity).find_map(|(now, kept)| now.change_since(kept))
        {
            bail!("{}: the search cannot be resumed: {change}; --force begins anew", path.display());
        }
        Ok(Some(kept))
    }

    /// Writes what was found so far.
    pub fn write_report(&self, report: &impl Serialize) -> anyhow::Result<()> {
        write_json(&self.0.path().join(REPORT), report)
    }

    /// Writes the pictures of a step.
    pub fn write_pictures(&self, judged: &Judged) -> anyhow::Result<()> {
        let path = |name: &str| self.0.path().join(name);
        let Judged { looked, size: (width, height), mean, denoised, spp } = judged;
        let Looked { display, map, .. } = looked;
        let spp = spp.map(|spp| spp as u64);
        let facts = SampleFacts { samples: spp.map(|spp| (spp, spp)), origin: None };
        let layers = RenderLayers { facts: Some(&facts), ..RenderLayers::rgb(*width, *height, mean) };
        write_exr(path("image.exr"), &layers)?;
        let shown = |pixels: &[Rgb]| {
            let encoded: Vec<Rgb> = pixels.iter().map(|&pixel| display.encode(pixel)).collect();
            Canvas::of_picture(*width, &encoded)
        };
        shown(mean).save(path("image.png"))?;
        match denoised {
            Some(denoised) => {
                write_exr(path("image-denoised.exr"), &RenderLayers::rgb(*width, *height, denoised))?;
                let shown = shown(denoised);
                shown.save(path("image-denoised.png"))?;
                draw_field(&shown, map, &ERROR_SCALE).save(path("denoised-error.png"))?;
            }
            None => draw_field(&shown(mean), map, &NOISE_SCALE).save(path("noise.png"))?,
        }
        Ok(())
    }
}
