//! Denoised pictures made elsewhere.

use super::job::{DenoisedJudge, JudgeJob};
use super::read::{read, warn_of};
use super::report::{Judged, Place};
use anyhow::{Context, bail};
use noisefloor::{
    Rgb, Tile, TileGrid, Viewing,
    criterion::OpenFor,
    evidence::{Evidence, Samples},
    stills::{SnapshotPair, Still},
};
use noisefloor_cli::say::{note, say, say_json};
use noisefloor_denoise::{DenoisedError, DenoisedHalves, ESTIMATE_ERRS_BY, jods_lost_unmet};
use noisefloor_image::maps::{Canvas, draw_field};
use noisefloor_image::{ReadOptions, check_writable};
use noisefloor_vision::{VisionModel, VisionWorkspace};
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Row {
    tile: usize,
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    jods_lost: f64,
    converged: bool,
    open_for: Option<OpenFor>,
}

#[derive(Serialize)]
struct Report<'a> {
    images: Vec<&'a Path>,
    denoised: &'a [PathBuf; 2],
    limit: f64,
    converged_tiles: usize,
    tiles: &'a [Row],
}

pub(super) fn run(job: &JudgeJob, by: &DenoisedJudge, says: bool) -> anyhow::Result<Judged> {
    job.noise_map.iter().try_for_each(check_writable)?;
    let options = ReadOptions { viewing: job.viewing, layer: job.layer.clone(), ..ReadOptions::default() };
    let [against] = job.against.as_slice() else { bail!("--denoised compares two halves") };
    let [a, b] = [read(&job.image, &options)?, read(against, &options)?];
    let denoised = |path, of| denoised(path, of, &job.viewing);
    let [da, db] = [denoised(&by.made[0], &a)?, denoised(&by.made[1], &b)?];
    if da == db {
        bail!(
            "{} and {} are identical: each has to be made from its own half, by a denoiser that looks at it",
            by.made[0].display(),
            by.made[1].display()
        );
    }
    let pair = SnapshotPair::new(Evidence::Halves, &a, &[&b], job.tone.clone(), job.samples)?;
    if pair.samples() == Samples::Nested {
        bail!(
            "--denoised needs two halves that share no samples, and these are snapshots of one rendering: \
             the later one contains the earlier one. Render one with another seed and denoise it again; \
             --independent overrides what was found"
        );
    }
    warn_of(&pair.notice(TileGrid::new(a.size.0, a.size.1, job.tile)?)?.warnings);
    if a.spp.max(b.spp) > 2.0 * a.spp.min(b.spp) {
        note!(
            "note: one picture has more than twice the samples of the other ({} and {}): \
             the verdict is on the mean of the two denoised pictures, and the worse one dominates it",
            a.spp,
            b.spp
        );
    }
    let size = a.size;
    let halves = DenoisedHalves { size, noisy: [&a.pixels, &b.pixels], denoised: [&da, &db] };
    let error = DenoisedError::new(&halves, pair.display())?;
    let film = pair.film(TileGrid::new(size.0, size.1, job.tile)?);
    let unmet = film.map_or_else(Vec::new, |film| jods_lost_unmet(&film, pair.display(), &job.viewing));
    let rows = judge(job, by.lost, &error, &unmet)?;
    if says {
        say_all(job, by, &rows)?;
    }
    if let Some(path) = &job.noise_map {
        let shown: Vec<Rgb> = error.shown().iter().map(|&shown| [shown; 3]).collect();
        let map = error.map_of_jods_lost(&VisionModel::new(&job.viewing))?;
        draw_field(&Canvas::of_picture(size.0, &shown), &map, &crate::output::ERROR_SCALE).save(path)?;
    }
    let place = |row: &Row| {
        let Row { x, y, width, height, jods_lost, .. } = *row;
        (row.converged, Place { x, y, width, height, probability: None, jods_lost: Some(jods_lost) })
    };
    Ok(Judged::new(rows.iter().map(place)))
}

/// What a denoiser has made of a picture.
fn denoised(path: &Path, of: &Still, viewing: &Viewing) -> anyhow::Result<Vec<Rgb>> {
    let options = ReadOptions { viewing: *viewing, ..ReadOptions::default() };
    let still = read(&(path.to_owned(), Some(of.spp)), &options)?;
    of.fits(&still)
        .with_context(|| format!("{} beside the picture that it was made from", path.display()))?;
    Ok(still.pixels)
}

/// `unmet` has what each tile would lose by light that it is likely to lack, if the pictures tell.
fn judge(
    job: &JudgeJob,
    limit: f64,
    error: &DenoisedError,
    unmet: &[(Tile, f64, OpenFor)],
) -> anyhow::Result<Vec<Row>> {
    let grid = TileGrid::new(error.size().0, error.size().1, job.tile)?;
    let (eyes, mut room) = (VisionModel::new(&job.viewing), VisionWorkspace::default());
    let mut row = |tile: Tile| {
        let jods_lost = error.jods_lost(tile, &eyes, &mut room)?;
        let Tile { index, x, y, width, height } = tile;
        let enough = jods_lost * ESTIMATE_ERRS_BY <= limit;
        let lacking = unmet.get(index).filter(|(_, lost, _)| *lost > limit).map(|(.., kind)| *kind);
        let open_for = if enough { lacking } else { Some(OpenFor::Noise) };
        Ok(Row { tile: index, x, y, width, height, jods_lost, converged: open_for.is_none(), open_for })
    };
    grid.tiles().map(&mut row).collect()
}

fn say_all(job: &JudgeJob, by: &DenoisedJudge, rows: &[Row]) -> anyhow::Result<()> {
    let converged_tiles = rows.iter().filter(|row| row.converged).count();
    if job.json {
        return say_json(&Report {
            images: std::iter::once(&job.image).chain(&job.against).map(|(path, _)| path.as_path()).collect(),
            denoised: &by.made,
            limit: by.lost,
            converged_tiles,
            tiles: rows,
        });
    }
    say!("tile     x     y   size  JOD lost  verdict")?;
    for Row { tile, x, y, width, height, jods_lost, open_for, .. } in rows {
        let verdict = match open_for {
            None => "converged",
            Some(OpenFor::Noise) => "error seen",
            Some(_) => "light?",
        };
        say!("{tile:4} {x:5} {y:5} {:>8} {jods_lost:8.3}  {verdict}", format!("{width}×{height}"))?;
    }
    say!(
        "{converged_tiles} of {} denoised tiles have lost at most {} JOD: 19 of 20 with an estimate of up to {:.3}",
        rows.len(),
        by.lost,
        by.lost / ESTIMATE_ERRS_BY
    )?;
    let missing = rows.iter().filter(|row| !matches!(row.open_for, None | Some(OpenFor::Noise))).count();
    if missing > 0 {
        say!(
            "{missing} would pass, but are likely to lack light that only one of the pictures has met, or neither: render more"
        )?;
    }
    Ok(say!("the limit is the vision model's: nobody has been asked about denoised tiles")?)
}
