//! `tune --keep`: the picture of the last step, and what was found.

use super::pictures::Judged;
use crate::output::ERROR_SCALE;
use noisefloor::Rgb;
use noisefloor_cli::files::write_json;
use noisefloor_cli::folder::{Earlier, Folder};
use noisefloor_cli::refuse;
use noisefloor_image::maps::{Canvas, NOISE_SCALE, draw_field};
use noisefloor_image::{RenderLayers, SampleFacts, write_exr};
use serde::Serialize;
use std::path::PathBuf;

const REPORT: &str = "tune.json";
const FILES: &[&str] = &[REPORT, "image.exr", "image.png", "report.json"];

/// The folder.
pub struct Keep(Folder);

impl Keep {
    pub fn claim(path: PathBuf, earlier: Earlier) -> anyhow::Result<Self> {
        let folder = Folder::claim(path)?;
        if let (Earlier::Keep, Some(file)) = (earlier, folder.first_of(FILES)) {
            refuse!(
                "{}: holds {file} of an earlier run; --force overwrites it, --keep names another folder",
                folder.path().display()
            );
        }
        Ok(Self(folder))
    }

    /// Writes the pictures of a step, and what was found up to it.
    pub fn write(&self, judged: &Judged, report: &impl Serialize) -> anyhow::Result<()> {
        let path = |name: &str| self.0.path().join(name);
        let Judged { size: (width, height), mean, denoised, display, map, spp, .. } = judged;
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
        write_json(&path(REPORT), report)
    }
}
