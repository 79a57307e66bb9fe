//! Verdicts as a table or as JSON.

use noisefloor::{
    Oracle, People,
    criterion::{ExpectedThreshold, OpenFor},
};
use noisefloor_cli::say::{NotSaid, say, say_json};
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
pub(super) struct Row {
    pub(super) tile: usize,
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) probability: f32,
    pub(super) converged: bool,
    /// Where people are expected to stop seeing noise, in samples per pixel.
    pub(super) threshold: Option<ExpectedThreshold>,
    /// Samples per pixel at which the tile should be converged; null if that is out of sight.
    pub(super) expected_spp: Option<u64>,
    /// Whether its texture is unlike any that the model has been tested on, which lowers P.
    pub(super) unfamiliar: bool,
    /// What keeps it from being converged; null if nothing does.
    pub(super) open_for: Option<OpenFor>,
    /// Whether the pictures differ there by more than noise: it is not judged then, and P is 0.
    pub(super) unlike: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    image: &'a Path,
    spp: f64,
    model: String,
    people: People,
    converged_tiles: usize,
    unfamiliar_tiles: usize,
    tiles: &'a [Row],
}

/// Says what the verdicts are on a picture with that many samples per pixel.
pub(super) fn say_all(
    image: &Path,
    spp: f64,
    oracle: &Oracle,
    rows: &[Row],
    json: bool,
) -> anyhow::Result<()> {
    let report = Report {
        image,
        spp,
        model: oracle.model().digest(),
        people: oracle.people(),
        converged_tiles: rows.iter().filter(|r| r.converged).count(),
        unfamiliar_tiles: rows.iter().filter(|r| r.unfamiliar).count(),
        tiles: rows,
    };
    if json {
        say_json(&report)?
    } else {
        say_table(&report)?
    }
    Ok(())
}

fn say_table(report: &Report<'_>) -> Result<(), NotSaid> {
    // Both in the same words: where so many people see none any more
    let stop = format!("{} see none at spp", report.people);
    say!("tile     x     y   size       P  verdict    {stop:>24}  10…90 % see none at spp")?;
    for row in report.tiles {
        let verdict = match row {
            Row { unlike: true, .. } => "not judged",
            Row { converged: true, .. } => "converged",
            Row { open_for: Some(OpenFor::UnmetLight | OpenFor::FewSamples), .. } => "light?",
            _ => "noise seen",
        };
        let expected = row.expected_spp.filter(|_| !row.converged).map_or(String::new(), |n| n.to_string());
        let size = format!("{}×{}", row.width, row.height);
        let range = row.threshold.map_or(String::new(), |t| format!("{}…{}", t.low, t.high));
        say!(
            "{:4} {:5} {:5} {size:>8} {:6.3}  {verdict:10} {expected:>24}  {range:>23}{}",
            row.tile,
            row.x,
            row.y,
            row.probability,
            if row.unfamiliar { "  unfamiliar" } else { "" }
        )?;
    }
    say!(
        "{} of {} tiles converged at {} spp: {} of people see no noise there",
        report.converged_tiles,
        report.tiles.len(),
        report.spp,
        report.people
    )?;
    let lacks = |row: &&Row| matches!(row.open_for, Some(OpenFor::UnmetLight | OpenFor::FewSamples));
    let unmet = report.tiles.iter().filter(lacks).count();
    if unmet > 0 {
        say!(
            "tiles whose noise is not seen, but which are likely to lack light that few samples or none have met: {unmet} (light?)"
        )?;
    }
    if report.unfamiliar_tiles > 0 {
        say!(
            "tiles with texture or light unlike any that the model was tested on: {}; their P is lower, as it is less certain",
            report.unfamiliar_tiles
        )?;
    }
    Ok(())
}

/// A tile, and how bad it is.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Place {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) probability: Option<f32>,
    /// Of denoised pictures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) jods_lost: Option<f64>,
}

/// What was found of a picture.
#[derive(Serialize)]
pub(super) struct Judged {
    pub(super) tiles: usize,
    pub(super) converged_tiles: usize,
    pub(super) worst: Option<Place>,
}

impl Judged {
    /// Of all tiles, and whether each has converged.
    pub(super) fn new(tiles: impl Iterator<Item = (bool, Place)>) -> Self {
        let tiles: Vec<_> = tiles.collect();
        let good =
            |place: &Place| place.jods_lost.map_or(f64::from(place.probability.unwrap_or(0.0)), |lost| -lost);
        let order =
            |a: &&(bool, Place), b: &&(bool, Place)| a.0.cmp(&b.0).then(good(&a.1).total_cmp(&good(&b.1)));
        Self {
            tiles: tiles.len(),
            converged_tiles: tiles.iter().filter(|(converged, _)| *converged).count(),
            worst: tiles.iter().min_by(order).map(|(_, place)| *place),
        }
    }

    pub(super) fn is_converged(&self) -> bool {
        self.converged_tiles == self.tiles
    }
}
