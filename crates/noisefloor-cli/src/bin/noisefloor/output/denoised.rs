//! image-denoised.exr, image-denoised.png, denoised-error.png, albedo.exr and normal.exr, and what is said
//! of them.

use noisefloor::{Rgb, Session, StoppingCriterion, source::FirstHits};
use noisefloor_cli::say::{NotSaid, say};
use noisefloor_denoise::{Denoiser, Guides, NoisyPicture, compose, spp_without_denoising, stops_err_by};
use noisefloor_image::maps::{Canvas, ColourScale, draw_field};
use noisefloor_image::{RenderLayers, write_exr};
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Samples of a picture from which light that is seldom met is hardly ever missed: the chance to have met nothing of light that
/// one in 250,000 finds is then 2·10⁻⁴.
const MANY: u64 = 1 << 21;

/// The picture that people look at, where it is denoised.
pub const DENOISED: &str = "image-denoised.exr";

pub struct Denoised {
    denoiser: Box<dyn Denoiser>,
    /// Albedo and normals of both halves together, and whether they are clean.
    guide: Option<(FirstHits, bool)>,
    give_up: Arc<AtomicBool>,
    /// JODs that a tile may lose.
    lost: f64,
    /// What the picture would need without, once it has been denoised, and the seconds that that took.
    spp_without: Option<f64>,
    picture_seconds: f64,
}

/// What report.json says of it.
#[derive(Serialize)]
pub(super) struct DenoisedReport {
    denoiser: String,
    /// Whether the source gave it albedo and normals, and whether these are clean.
    guided: bool,
    clean: bool,
    /// Seconds for the picture itself.
    picture_seconds: f64,
    /// Just-objectionable differences lost, by the estimate when a tile was last judged: the most of any
    /// tile.
    jods_lost: Option<f64>,
    /// Tiles that are shown as rendered, since their noise has lost less than what the denoiser makes of them.
    undenoised_tiles: usize,
    /// Samples per pixel that the picture would need without denoising, on average, to lose as little as is
    /// allowed; null if that is out of sight for a tile.
    spp_without: Option<f64>,
}

impl Denoised {
    /// The denoiser gives a call up once `give_up` is set.
    pub fn new(
        denoiser: impl Denoiser + 'static,
        guides: Option<&Guides>,
        give_up: Arc<AtomicBool>,
        lost: f64,
    ) -> Self {
        let guide = guides.map(|guides| (guides.together(), guides.is_clean()));
        Self { denoiser: Box::new(denoiser), guide, give_up, lost, spp_without: None, picture_seconds: 0.0 }
    }

    /// Set by whoever wants the denoiser to give up.
    pub fn give_up(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.give_up)
    }

    pub(super) fn is_given_up(&self) -> bool {
        self.give_up.load(Ordering::Relaxed)
    }

    pub(super) fn report(&self, session: &Session) -> DenoisedReport {
        let verdicts = || (0..session.film().grid().len()).filter_map(|tile| session.verdict(tile));
        let lost = verdicts().filter_map(|verdict| verdict.lost).filter(|lost| lost.is_finite());
        DenoisedReport {
            denoiser: self.denoiser.name(),
            guided: self.guide.is_some(),
            clean: self.guide.as_ref().is_some_and(|(_, clean)| *clean),
            picture_seconds: self.picture_seconds,
            jods_lost: lost.max_by(f64::total_cmp),
            undenoised_tiles: verdicts().filter(|verdict| verdict.undenoised).count(),
            spp_without: self.spp_without,
        }
    }
}

/// JODs lost, from nothing that people see to what three of four do.
pub const ERROR_SCALE: ColourScale = ColourScale {
    title: "error left\nJODs lost",
    low: 0.01,
    high: 1.0,
    log: true,
    colours: colorous::INFERNO,
    landmark: None,
};

impl Denoised {
    /// Denoises the picture, and writes it with the map of its error into a folder.
    pub(super) fn write(&mut self, session: &Session, folder: &Path) -> anyhow::Result<()> {
        let (width, height) = session.film().grid().size();
        let began = Instant::now();
        let (noisy, wants) = (session.film().image(), self.denoiser.wants());
        let picture = NoisyPicture::new((width, height), &noisy);
        let picture = match &self.guide {
            Some((guide, clean)) => picture.guided(guide, *clean, wants),
            None => picture,
        };
        let mut image = self.denoiser.denoise(&picture)?;
        compose(session, &noisy, &mut image);
        let display = session.display_so_far();
        let encoded: Vec<Rgb> = image.iter().map(|&p| display.encode(p)).collect();
        let viewing = session.params().viewing;
        self.spp_without = spp_without_denoising(session.film(), &display, &image, viewing, self.lost);
        self.picture_seconds = began.elapsed().as_secs_f64();
        write_exr(folder.join(DENOISED), &RenderLayers::rgb(width, height, &image))?;
        if let Some((guide, _)) = &self.guide {
            write_exr(folder.join("albedo.exr"), &RenderLayers::rgb(width, height, &guide.albedo))?;
            write_exr(folder.join("normal.exr"), &RenderLayers::rgb(width, height, &guide.normal))?;
        }
        let shown = Canvas::of_picture(width, &encoded);
        shown.save(folder.join("image-denoised.png"))?;
        if let Some(map) = session.criterion().map_of_jods_lost() {
            draw_field(&shown, map, &ERROR_SCALE).save(folder.join("denoised-error.png"))?;
        }
        Ok(())
    }

    pub(super) fn say(&self, session: &Session) -> Result<(), NotSaid> {
        let DenoisedReport {
            denoiser,
            guided,
            clean,
            picture_seconds,
            jods_lost,
            undenoised_tiles,
            spp_without,
        } = self.report(session);
        let grid = session.film().grid();
        let spp = session.film().total_samples() as f64 / (grid.width() * grid.height()) as f64;
        let without = spp_without.map_or_else(
            || "out of sight without".to_owned(),
            |spp| format!("about {spp:.0} without, as estimated from the same halves"),
        );
        let with = match (guided, clean) {
            (_, true) => " with clean albedo and normals",
            (true, false) => " with albedo and normals",
            (false, false) => "",
        };
        say!("{spp:.0} spp denoised by {denoiser}{with}; {without}")?;
        let samples = session.film().total_samples();
        if samples < MANY {
            say!(
                "of light that one in {samples} samples meets, these may have met none: it is missing then"
            )?;
        }
        if undenoised_tiles > 0 {
            say!(
                "{undenoised_tiles} of {} tiles are shown as rendered: the denoiser takes away more than their noise",
                grid.len()
            )?;
        }
        if let Some(lost) = jods_lost {
            let errs = stops_err_by(grid.len());
            say!(
                "the worst tile has lost {lost:.3} JOD, \
                 by an estimate that 19 of 20 tiles exceed by less than ×{errs}; \
                 nobody has been asked about denoised tiles"
            )?;
        }
        say!("to denoise the picture itself took {picture_seconds:.1} s")
    }
}
