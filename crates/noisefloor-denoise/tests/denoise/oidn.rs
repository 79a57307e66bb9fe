use crate::kit::{SIZE, noisy, truth};
use noisefloor::{Rgb, Tile, source::FirstHits};
use noisefloor_denoise::{DenoiseError, DenoisePasses, Denoiser, MirrorMean, NoisyPicture, OIDN, Oidn};
use noisefloor_sidecar::{FilterPlan, find};
use noisefloor_testkit::{Noise, Requirement, require};
use std::num::NonZeroUsize;

fn started() -> Option<Oidn> {
    let _python = require(Requirement::Renderers, find(&OIDN))?;
    Some(Oidn::start(FilterPlan::default()).unwrap())
}

fn error(picture: &[Rgb]) -> f32 {
    picture.iter().zip(truth()).map(|(p, t)| (p[1] - t[1]).powi(2)).sum::<f32>() / picture.len() as f32
}

#[test]
fn it_denoises_and_repeats_itself() {
    let Some(mut oidn) = started() else { return };
    assert!(oidn.name().starts_with("Open Image Denoise 2."), "{}", oidn.name());
    let noisy = noisy(1, 0.05);
    let once = oidn.denoise(&NoisyPicture::new(SIZE, &noisy)).unwrap();
    assert!(error(&once) < 0.2 * error(&noisy), "{} of {}", error(&once), error(&noisy));
    assert_eq!(once, oidn.denoise(&NoisyPicture::new(SIZE, &noisy)).unwrap());
    let alone = FilterPlan { threads: NonZeroUsize::new(1), ..FilterPlan::default() };
    let other = Oidn::start(alone).unwrap().denoise(&NoisyPicture::new(SIZE, &noisy)).unwrap();
    assert!(once == other, "the number of threads changes the picture");
    // With albedo that shows the stripes, they survive
    let (albedo, normal) = (truth(), vec![[0.0, 0.0, 1.0]; noisy.len()]);
    let helped =
        NoisyPicture { albedo: Some(&albedo), normal: Some(&normal), ..NoisyPicture::new(SIZE, &noisy) };
    let with_albedo = error(&oidn.denoise(&helped).unwrap());
    assert!(with_albedo < 0.8 * error(&once));
    // All the more if it may be taken at its word
    let clean = NoisyPicture { clean: true, ..helped };
    assert!(error(&oidn.denoise(&clean).unwrap()) < 0.9 * with_albedo);
    let odd = NoisyPicture { size: (SIZE.0, 3), ..NoisyPicture::new(SIZE, &noisy) };
    assert!(matches!(oidn.denoise(&odd), Err(DenoiseError::Pixels { .. })));
}

/// A dark wall with stripes, beside a bright one, with noise in proportion.
fn dark_and_bright(seed: u64) -> Vec<Rgb> {
    let mut noise = Noise::new(seed);
    let pixel = |i: usize| {
        let (x, y) = (i % LARGE.0, i / LARGE.0);
        let wall = if x < 200 { 0.05 } else { 20.0 };
        let stripes = 1.0 + 0.3 * (((x + y) / 6 % 2) as f32);
        let shown = wall * stripes * (1.0 + 0.3 * noise.normal() as f32);
        [shown.max(0.0); 3]
    };
    (0..LARGE.0 * LARGE.1).map(pixel).collect()
}
const LARGE: (usize, usize) = (480, 400);

/// Parts differ from the whole by far less than the noise that is left in it, though they are darker or brighter than that.
#[test]
fn parts_come_out_as_in_the_whole() {
    let Some(mut oidn) = started() else { return };
    let halves = [1, 2].map(dark_and_bright);
    let pictures = halves.each_ref().map(|half| NoisyPicture::new(LARGE, half));
    let whole = oidn.denoise_both(pictures.each_ref()).unwrap();
    let place = |(x, y)| Tile { index: 0, x, y, width: 40, height: 32 };
    // On the dark wall, off the network's grid; in the corner of the bright one
    let parts = [(24, 165), (440, 368)].map(place);
    let made = oidn.denoise_parts(pictures.each_ref(), &parts).unwrap();
    for (part, [a, b]) in parts.iter().zip(&made) {
        let inside: Vec<usize> = part.rows(LARGE.0).flatten().collect();
        let [wa, wb] = whole.each_ref().map(|made| inside.iter().map(|&i| made[i]).collect::<Vec<Rgb>>());
        let apart =
            |a: &[Rgb], b: &[Rgb]| a.iter().zip(b).map(|(a, b)| (a[1] - b[1]).powi(2)).sum::<f32>().sqrt();
        let noise = apart(&wa, &wb);
        assert!(noise > 0.0 && apart(a, &wa) < 0.1 * noise, "{part:?}: {} of {noise}", apart(a, &wa));
        assert!(apart(b, &wb) < 0.1 * noise, "{part:?}: {} of {noise}", apart(b, &wb));
    }
}

/// Stripes of albedo and a curved surface, with noise in both, become clean enough to be taken at their word.
#[test]
fn it_cleans_albedo_and_normals() {
    let Some(mut oidn) = started() else { return };
    let curved: Vec<Rgb> = (0..SIZE.0 * SIZE.1)
        .map(|i| {
            let x = (i % SIZE.0) as f32 / SIZE.0 as f32 - 0.5;
            [x, 0.0, (1.0 - x * x).sqrt()]
        })
        .collect();
    let mut noise = Noise::new(8);
    let mut noisy_of = |plane: &[Rgb]| -> Vec<Rgb> {
        plane.iter().map(|p| p.map(|c| c + 0.1 * noise.normal() as f32)).collect()
    };
    let (albedo, normal) = (noisy_of(&truth()), noisy_of(&curved));
    let hits = FirstHits::new(SIZE, albedo, normal);
    let clean = oidn.prefilter(&hits).unwrap().unwrap();
    let off = |a: &[Rgb], b: &[Rgb]| -> f32 {
        let squares = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f32>() / (3 * a.len()) as f32
    };
    for (clean, noisy, truth) in
        [(&clean.albedo, &hits.albedo, &truth()), (&clean.normal, &hits.normal, &curved)]
    {
        let (left, was) = (off(clean, truth), off(noisy, truth));
        assert!(left < 0.2 * was, "{left} of {was}");
    }
}

/// It sees left and right; the mean of mirror images does not, though sides of 75 and 41 pixels are no multiples of what its
/// network takes.
#[test]
fn the_mean_of_its_mirror_images_is_symmetric() {
    let Some(mut oidn) = started() else { return };
    let size = (75, 41);
    let picture: Vec<Rgb> = noisy(5, 0.1).into_iter().take(size.0 * size.1).collect();
    let mirrored: Vec<Rgb> = picture.chunks_exact(size.0).flat_map(|row| row.iter().rev()).copied().collect();
    let mut apart = |passes| {
        let mut mean = MirrorMean::new(&mut oidn, passes);
        let made = mean.denoise(&NoisyPicture::new(size, &picture)).unwrap();
        let other = mean.denoise(&NoisyPicture::new(size, &mirrored)).unwrap();
        let rows = made.chunks_exact(size.0).zip(other.chunks_exact(size.0));
        let pixels = rows.flat_map(|(row, other)| row.iter().zip(other.iter().rev()));
        pixels.map(|(a, b)| (a[1] - b[1]).abs()).fold(0.0, f32::max)
    };
    let [alone, four] = [DenoisePasses::One, DenoisePasses::Four].map(&mut apart);
    assert!(alone > 1e-4 && four < 1e-6, "{alone} and {four}");
}
