//! `noisefloor metrics`.

use crate::args::MetricsArgs;
use crate::judge::warn_unread;
use anyhow::{Context, anyhow, bail};
use noisefloor::{Rgb, ToneMapping, Viewing, display::Display};
use noisefloor_cli::refuse;
use noisefloor_cli::say::{NotSaid, note, say};
use noisefloor_image::maps::{Canvas, ColourScale, draw_field};
use noisefloor_image::{Picture, ReadOptions, check_writable, read_picture_with};
use noisefloor_rivals::DifferenceMap;
use noisefloor_rivals::metrics::{MetricPair, MetricScores};
use noisefloor_vision::Eotf;
use serde::Serialize;
use std::path::Path;

/// What to type for the metrics that a build leaves out.
const AGAIN: &str = "run `cargo run --release --features metrics -- metrics …`";

/// Most pixels of a picture, those of 8K: a file of a few kilobytes may claim many more.
const MOST_PIXELS: usize = 7680 * 4320;
/// Memory that the metrics take, measured at 1.6 and at 65 megapixels.
const BYTES_A_PIXEL: usize = if cfg!(feature = "metrics") { 300 } else { 120 };

#[derive(Serialize)]
struct Report<'a> {
    image: &'a Path,
    reference: &'a Path,
    width: usize,
    height: usize,
    viewing: Viewing,
    #[serde(flatten)]
    scores: MetricScores,
}

/// The scale of every map is fixed, so that maps of different pictures compare.
const JODS: ColourScale = ColourScale {
    title: "ColorVideoVDP\nJODs lost",
    low: 0.1,
    high: 10.0,
    log: true,
    colours: colorous::INFERNO,
    landmark: None,
};
/// FLIP's own colours, over the differences that noise makes.
const FLIP: ColourScale = ColourScale {
    title: "FLIP\nof at most 1",
    low: 0.0,
    high: 0.2,
    log: false,
    colours: colorous::MAGMA,
    landmark: None,
};
const BUTTERAUGLI: ColourScale = ColourScale {
    title: "butteraugli\nfrom 1: seen",
    low: 0.125,
    high: 8.0,
    log: true,
    colours: colorous::INFERNO,
    landmark: None,
};

pub fn run(job: &MetricsArgs) -> anyhow::Result<()> {
    if cfg!(not(feature = "metrics")) && (job.flip_map.is_some() || job.butteraugli_map.is_some()) {
        refuse!("this build has no FLIP and butteraugli: {AGAIN}");
    }
    let (viewing, tone) = (job.viewing.or_default(), job.tone.check()?.load()?);
    for path in [&job.map, &job.flip_map, &job.butteraugli_map].into_iter().flatten() {
        check_writable(path)?;
    }
    let options = ReadOptions { viewing, most_pixels: MOST_PIXELS, layer: job.layer.layer.clone() };
    let read = |path| read_picture_with(path, &options);
    let (image, reference) = (read(&job.image)?, read(&job.reference)?);
    let names = || format!("{} and {}", job.image.display(), job.reference.display());
    let size = image.size();
    if size != reference.size() {
        let ((w, h), (rw, rh)) = (size, reference.size());
        bail!("{}: the pictures have different sizes, {w}×{h} and {rw}×{rh}; scale or crop one", names());
    }
    let display_referred = matches!(reference, Picture::Display(_));
    if matches!(image, Picture::Display(_)) != display_referred {
        bail!("{}: one is a PNG and one is not; compare pictures of one kind", names());
    }
    if !display_referred {
        check_codes(&tone, viewing)?;
    }
    for path in [&job.image, &job.reference] {
        warn_unread(path, &options)?;
    }
    check_memory(size).with_context(names)?;
    let (image, reference) = (image.into_linear().pixels, reference.into_linear().pixels);
    let display = if display_referred { Display::SRGB } else { tone.settle(&reference) };
    let pair =
        MetricPair { size, image: &image, reference: &reference, display: &display, viewing: &viewing };
    let (scores, maps) = pair.measure().with_context(names)?;

    let shown: Vec<Rgb> = image.iter().map(|&p| display.encode(p)).collect();
    draw(job.map.as_deref(), size.0, &shown, Some(&maps.cvvdp), &JODS)?;
    draw(job.flip_map.as_deref(), size.0, &shown, maps.flip.as_ref(), &FLIP)?;
    draw(job.butteraugli_map.as_deref(), size.0, &shown, maps.butteraugli.as_ref(), &BUTTERAUGLI)?;
    if cfg!(not(feature = "metrics")) {
        note!("note: this build has no FLIP and butteraugli: {AGAIN}");
    }
    say_scores(job, size, scores)
}

/// Libraries of metrics end the program where memory ends: so it is asked for before, all at once.
fn check_memory((width, height): (usize, usize)) -> anyhow::Result<()> {
    let bytes = width * height * BYTES_A_PIXEL;
    let refused = |_| anyhow!("no memory for the metrics, {} MB; crop the pictures", bytes >> 20);
    Vec::<u8>::new().try_reserve_exact(bytes).map_err(refused)
}

/// What tone mapping makes must be what the display takes.
fn check_codes(tone: &ToneMapping, viewing: Viewing) -> anyhow::Result<()> {
    let makes_srgb = !matches!(tone, ToneMapping::Custom { .. });
    let takes_srgb = matches!(viewing.params().eotf, Eotf::Srgb | Eotf::Gamma(_));
    if makes_srgb && !takes_srgb {
        bail!(
            "--viewing {viewing}: this display takes no sRGB values, which tone mapping makes; \
             give a LUT that makes what it takes, or PNGs that hold it"
        );
    }
    Ok(())
}

fn draw(
    path: Option<&Path>,
    width: usize,
    shown: &[Rgb],
    map: Option<&DifferenceMap>,
    scale: &ColourScale,
) -> anyhow::Result<()> {
    if let (Some(path), Some(map)) = (path, map) {
        draw_field(&Canvas::of_picture(width, shown), &map.values, scale).save(path)?;
    }
    Ok(())
}

fn say_scores(
    job: &MetricsArgs,
    (width, height): (usize, usize),
    scores: MetricScores,
) -> anyhow::Result<()> {
    if job.json {
        let MetricsArgs { image, reference, viewing, .. } = job;
        let report = Report { image, reference, width, height, viewing: viewing.or_default(), scores };
        say!("{}", serde_json::to_string_pretty(&report)?)?;
        return Ok(());
    }
    let line = |name: &str, value: String, meaning: &str| -> Result<(), NotSaid> {
        say!("{name:14} {value:>9}  {meaning}")
    };
    line(
        "ColorVideoVDP",
        format!("{:.3}", scores.cvvdp_jod),
        "JOD; 10: no visible difference, 9: three of four people prefer the reference",
    )?;
    if let Some(flip) = scores.flip {
        line("FLIP", format!("{flip:.4}"), "mean, of at most 1")?;
    }
    if let (Some(largest), Some(norm)) = (scores.butteraugli, scores.butteraugli_norm3) {
        line("butteraugli", format!("{largest:.3}"), "largest; below 1 pictures look the same")?;
        line("", format!("{norm:.3}"), "3-norm")?;
    }
    line("PSNR", format!("{:.2}", scores.psnr), "dB, of display values")?;
    line("relMSE", format!("{:.3e}", scores.rel_mse), "of linear radiance")?;
    Ok(())
}
