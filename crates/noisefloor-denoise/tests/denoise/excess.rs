//! Two denoised pictures are two halves: what they are likely to lack is what a session of their halves says.

use crate::kit::{SIZE, Simple, noisy};
use noisefloor::tune::PicturePair;
use noisefloor::{
    Film, Params, Rgb, Schedule, Session, Tile, Viewing, criterion::OpenFor, display::Display, tile::TileGrid,
};
use noisefloor_denoise::{DenoisedError, DenoisedQuality, jods_lost_unmet};

/// Both have so many that what nothing has met is not looked for any more.
const SPP: u64 = 50;
const LIMIT: f64 = 0.3;

/// Both halves, with one find of this light in a sample of the first, at the wall.
fn halves(light: f32) -> [Vec<Rgb>; 2] {
    let mut halves = [1, 2].map(|seed| noisy(seed, 0.001));
    halves[0][100 * SIZE.0 + 90] = [light / SPP as f32; 3];
    halves
}

fn params() -> Params {
    Params::default().with_tile(64)
}

fn pair_of(halves: &[Vec<Rgb>; 2]) -> PicturePair {
    PicturePair::new(SIZE, halves.clone(), SPP as f64).unwrap()
}

/// Tiles that lose more than the limit by light that they are likely to lack.
fn lacking(halves: &[Vec<Rgb>; 2]) -> Vec<usize> {
    let by_light = |display: &Display, film: &Film| {
        let lost = jods_lost_unmet(film, display, &Viewing::default());
        Ok(lost.into_iter().map(|(tile, lost, _)| (tile, lost)).collect())
    };
    let lost = pair_of(halves).look_by(&params(), None, by_light).unwrap().squares;
    lost.iter().filter(|(_, lost)| *lost > LIMIT).map(|(tile, _)| tile.index).collect()
}

#[test]
fn two_pictures_lack_what_a_session_of_their_halves_says() {
    for (light, held) in [(1.5, false), (300.0, false), (1.5e5, true), (1.5e6, true)] {
        let halves = halves(light);
        let params = params().with_min_spp(2 * SPP).with_schedule(Schedule::Growing { step: SPP });
        let criterion = DenoisedQuality::new(Simple::Flat(0.3), LIMIT);
        let mut session = Session::new(SIZE.0, SIZE.1, criterion, params.clone()).unwrap();
        for half in &halves {
            for tile in TileGrid::new(SIZE.0, SIZE.1, params.tile).unwrap().tiles() {
                let pixels: Vec<Rgb> = tile.rows(SIZE.0).flatten().map(|i| half[i]).collect();
                session.push(tile.index, SPP, &pixels).unwrap();
            }
        }
        session.judge().unwrap();
        let lacks =
            |tile: &usize| matches!(session.open_for(*tile), Some(OpenFor::UnmetLight | OpenFor::FewSamples));
        let unmet: Vec<usize> = (0..6).filter(lacks).collect();
        let found = lacking(&halves);
        assert_eq!(found, unmet, "{light}");
        assert_eq!(!unmet.is_empty(), held, "{light}");
    }
}

/// A denoiser that takes a find for noise makes the same of both pictures with it as without.
#[test]
fn light_that_one_picture_has_met_keeps_a_setting_from_being_found() {
    let flat = [0.3, 0.3001].map(|grey| Simple::Flat(grey).of(&noisy(1, 0.0)));
    let excess = |halves: [Vec<Rgb>; 2]| {
        let denoised = flat.each_ref().map(Vec::as_slice);
        DenoisedError::look(&pair_of(&halves), denoised, LIMIT, &params(), None).unwrap().1
    };
    let on_the_wall = |tile: &Tile| tile.x >= 96;
    let worst = |light: f32, exchanged: bool| {
        let [a, b] = halves(light);
        let found = excess(if exchanged { [b, a] } else { [a, b] });
        found
            .squares
            .iter()
            .filter(|(tile, _)| on_the_wall(tile))
            .map(|(_, ratio)| *ratio)
            .fold(0.0, f64::max)
    };
    let (without, with) = (worst(1.5, false), worst(1.5e5, false));
    assert!(without < 1.0 && with > 1.0, "{without}, {with}");
    assert_eq!(with, worst(1.5e5, true));
}
