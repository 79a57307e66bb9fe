use crate::kit::{SIZE, Simple, noisy};
use noisefloor::Rgb;
use noisefloor_denoise::{
    AuxiliaryPictures, DenoiseError, DenoisePasses, Denoiser, MirrorMean, NoisyPicture,
};

/// As lopsided as can be: each pixel takes over half of what became of the one before it, row by row.
struct Smears {
    calls: usize,
}

impl Denoiser for Smears {
    fn name(&self) -> String {
        "smears".into()
    }

    fn wants(&self) -> AuxiliaryPictures {
        AuxiliaryPictures { albedo: true, normal: true }
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        self.calls += 1;
        assert!(picture.fits());
        let mut made = picture.radiance.to_vec();
        for row in made.chunks_exact_mut(picture.size.0) {
            for x in 1..row.len() {
                row[x] = std::array::from_fn(|c| 0.5 * (row[x][c] + row[x - 1][c]));
            }
        }
        // Guides that did not travel with the picture would show
        for (i, pixel) in made.iter_mut().enumerate() {
            pixel[1] += picture.albedo.map_or(0.0, |albedo| albedo[i][1] - picture.radiance[i][1]);
            pixel[2] += picture.normal.map_or(0.0, |normal| normal[i][2] - picture.radiance[i][2]);
        }
        Ok(made)
    }
}

fn across(plane: &[Rgb]) -> Vec<Rgb> {
    plane.chunks_exact(SIZE.0).flat_map(|row| row.iter().rev()).copied().collect()
}

fn down(plane: &[Rgb]) -> Vec<Rgb> {
    plane.chunks_exact(SIZE.0).rev().flatten().copied().collect()
}

fn largest_difference(a: &[Rgb], b: &[Rgb]) -> f32 {
    let apart = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs());
    assert_eq!(a.len(), b.len());
    apart.fold(0.0, f32::max)
}

/// Of a denoiser that sees left and right, the mean sees none: a mirrored picture becomes the mirrored mean. Sums of
/// four numbers below 2 in double precision round to the same float but for the last bit.
#[test]
fn the_mean_of_a_mirrored_picture_is_the_mirrored_mean() {
    let picture = noisy(3, 0.2);
    let denoise = |passes, picture: &[Rgb]| {
        let guided =
            NoisyPicture { albedo: Some(picture), normal: Some(picture), ..NoisyPicture::new(SIZE, picture) };
        MirrorMean::new(Smears { calls: 0 }, passes).denoise(&guided).unwrap()
    };
    let made = denoise(DenoisePasses::Four, &picture);
    for mirror in [across, down, |plane: &[Rgb]| across(&down(plane))] {
        let off = largest_difference(&denoise(DenoisePasses::Four, &mirror(&picture)), &mirror(&made));
        assert!(off < 1e-6, "{off}");
    }
    // One pass is lopsided
    let alone = denoise(DenoisePasses::One, &picture);
    assert!(largest_difference(&denoise(DenoisePasses::One, &across(&picture)), &across(&alone)) > 0.1);
}

/// The mean of a smear to the left and one to the right, by hand.
#[test]
fn it_is_the_mean_of_all_passes() {
    let row: Vec<Rgb> = [8.0, 0.0, 4.0].map(|value| [value; 3]).to_vec();
    let mut four = MirrorMean::new(Smears { calls: 0 }, DenoisePasses::Four);
    let made = four.denoise(&NoisyPicture::new((3, 1), &row)).unwrap();
    // 8, 4, 4 and, from the right, 5, 2, 4
    assert_eq!(made, [6.5, 3.0, 4.0].map(|value| [value; 3]));
    assert_eq!(four.name(), "smears, mean of 4 mirror images");
}

#[test]
fn what_a_denoiser_keeps_is_kept() {
    let picture = noisy(4, 0.1);
    for passes in [DenoisePasses::One, DenoisePasses::Four] {
        let mut keeps = MirrorMean::new(Simple::Nothing, passes);
        assert!(keeps.denoise(&NoisyPicture::new(SIZE, &picture)).unwrap() == picture, "{passes:?}");
        let grey = vec![[0.3; 3]; SIZE.0 * SIZE.1];
        let mut smears = MirrorMean::new(Smears { calls: 0 }, passes);
        assert!(smears.denoise(&NoisyPicture::new(SIZE, &grey)).unwrap() == grey, "{passes:?}");
        assert_eq!(DenoisePasses::new(passes.count()), Some(passes));
    }
    assert_eq!([0, 2, 3, 8].map(DenoisePasses::new), [None; 4]);
}

#[test]
fn pictures_of_another_size_are_refused() {
    let picture = noisy(5, 0.1);
    let mut four = MirrorMean::new(Simple::Short, DenoisePasses::Four);
    assert!(matches!(four.denoise(&NoisyPicture::new(SIZE, &picture)), Err(DenoiseError::Pixels { .. })));
    let mut four = MirrorMean::new(Simple::Nothing, DenoisePasses::Four);
    let odd = NoisyPicture::new((SIZE.0, 3), &picture);
    assert!(matches!(four.denoise(&odd), Err(DenoiseError::Pixels { .. })));
    let guide = vec![[0.5; 3]; 7];
    let odd = NoisyPicture { albedo: Some(&guide), ..NoisyPicture::new(SIZE, &picture) };
    assert!(matches!(four.denoise(&odd), Err(DenoiseError::Pixels { .. })));
}
