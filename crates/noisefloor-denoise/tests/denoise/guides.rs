use noisefloor::source::{Batch, FirstHits, Request, SourceInfo};
use noisefloor::{ProgressiveSource, Rgb, SourceError};
use noisefloor_denoise::{AuxiliaryPictures, DenoiseError, Denoiser, Guides, NoisyPicture};
use noisefloor_testkit::Noise;

const SIZE: (usize, usize) = (150, 70);

/// First hits of a plain wall, with noise of this deviation in the pixels that `place` names.
fn hits(seed: u64, deviation: f64, place: impl Fn(usize, usize) -> bool) -> FirstHits {
    let mut noise = Noise::new(seed);
    let (width, height) = SIZE;
    let mut plane = |level: f32| -> Vec<Rgb> {
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let pixel = |(x, y)| {
            let deviation = if place(x, y) { deviation } else { 0.0 };
            std::array::from_fn(|_| level + (deviation * noise.normal()) as f32)
        };
        places.map(pixel).collect()
    };
    let (albedo, normal) = (plane(0.5), plane(0.0));
    FirstHits::new((width, height), albedo, normal)
}

/// 0.02 in the noisiest square is the most: in squares of 1,750 pixels of six values, its estimate is right
/// within 1 % (one standard error).
#[test]
fn they_are_clean_if_the_noisiest_square_is() {
    let clean = |deviation: f64, place: fn(usize, usize) -> bool| {
        Guides::new([hits(1, deviation, place), hits(2, deviation, place)]).is_clean()
    };
    assert!(clean(0.0, |_, _| true) && clean(0.0185, |_, _| true) && !clean(0.0215, |_, _| true));
    // In one corner only: the picture on average has less
    assert!(!clean(0.0215, |x, y| x >= 100 && y >= 35) && clean(0.0185, |x, y| x >= 100 && y >= 35));
    // What is no number is not clean
    let mut odd = hits(1, 0.0, |_, _| true);
    odd.normal[7][2] = f32::NAN;
    assert!(!Guides::new([odd.clone(), odd]).is_clean());
    // Edges are few pixels
    assert!(clean(0.1, |x, _| x == 20) && !clean(0.3, |x, _| x == 20));
}

#[test]
fn the_mean_of_both_and_parts_of_them() {
    let both = [hits(1, 0.1, |_, _| true), hits(2, 0.1, |_, _| true)];
    let guides = Guides::new(both.clone());
    let together = guides.together();
    assert_eq!(together.albedo[77][1], 0.5 * (both[0].albedo[77][1] + both[1].albedo[77][1]));
    assert_eq!(together.normal[77][1], 0.5 * (both[0].normal[77][1] + both[1].normal[77][1]));
    let part = guides.part(noisefloor::Tile { index: 0, x: 3, y: 2, width: 5, height: 4 });
    let [a, _] = part.halves();
    assert_eq!((a.width, a.height, a.albedo.len(), a.normal[6]), (5, 4, 20, both[0].normal[3 * SIZE.0 + 4]));
    assert_eq!(part.is_clean(), guides.is_clean());
}

/// A source whose first hits have this noise after one ray, and that notes what it is asked for.
struct Noisy {
    deviation: f64,
    asked: Vec<(u64, u64)>,
}

impl ProgressiveSource for Noisy {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("noisy", SIZE.0, SIZE.1)
    }

    fn sample(&mut self, _: &[Request]) -> Result<Vec<Batch>, SourceError> {
        Ok(Vec::new())
    }

    fn first_hits(&mut self, index: u64, spp: u64) -> Result<Option<FirstHits>, SourceError> {
        self.asked.push((index, spp));
        Ok(Some(hits(index, self.deviation / (spp as f64).sqrt(), |_, _| true)))
    }
}

/// Takes the noise out of guides, if it is told that it can.
struct Cleans {
    can: bool,
    wants: bool,
}

impl Denoiser for Cleans {
    fn name(&self) -> String {
        "cleans".into()
    }

    fn wants(&self) -> AuxiliaryPictures {
        AuxiliaryPictures { albedo: self.wants, normal: self.wants }
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        Ok(picture.radiance.to_vec())
    }

    fn prefilter(&mut self, _: &FirstHits) -> Result<Option<FirstHits>, DenoiseError> {
        Ok(self.can.then(|| hits(9, 0.0, |_, _| true)))
    }
}

#[test]
fn a_source_takes_as_many_rays_as_it_needs() {
    let render = |deviation, denoiser: &mut Cleans| {
        let mut source = Noisy { deviation, asked: Vec::new() };
        let guides = Guides::render(&mut source, denoiser, 200).unwrap();
        (guides, source.asked)
    };
    let (mut can, mut cannot) = (Cleans { can: true, wants: true }, Cleans { can: false, wants: true });
    let (guides, asked) = render(0.1, &mut can);
    assert!(guides.unwrap().is_clean() && asked == [(0, 32), (1, 32)], "{asked:?}");
    let (guides, asked) = render(0.15, &mut can);
    assert!(guides.unwrap().is_clean() && asked[2..] == [(0, 128), (1, 128)], "{asked:?}");
    // More than is allowed would be needed: the denoiser cleans them, or they are said to be noisy
    let (guides, asked) = render(3.0, &mut can);
    assert_eq!(
        (guides.map(|g| (g.is_clean(), g.together().albedo[0])), asked.len()),
        (Some((true, [0.5; 3])), 4)
    );
    let (guides, _) = render(3.0, &mut cannot);
    assert!(!guides.unwrap().is_clean());
    // Whoever makes no use of them is not rendered any
    let (guides, asked) = render(0.1, &mut Cleans { can: true, wants: false });
    assert!(guides.is_none() && asked.is_empty());
}
