use noisefloor::Rgb;
use noisefloor_denoise::{DenoiseError, Denoiser, NoisyPicture};
use noisefloor_testkit::{Noise, bilateral};

pub(crate) const SIZE: (usize, usize) = (192, 128);

/// Grey stripes of two widths in the left third, a plain wall in the others.
pub(crate) fn truth() -> Vec<Rgb> {
    let at = |i: usize| {
        let (x, y) = (i % SIZE.0, i / SIZE.0);
        let stripes = 0.03 * ((x % 4) as f32 - 1.5) + 0.04 * ((y % 16) as f32 / 8.0 - 1.0);
        [0.3 + if x < 64 { stripes } else { 0.0 }; 3]
    };
    (0..SIZE.0 * SIZE.1).map(at).collect()
}

/// The truth with grey noise of this standard deviation.
pub(crate) fn noisy(seed: u64, deviation: f32) -> Vec<Rgb> {
    let mut noise = Noise::new(seed);
    let add = |p: Rgb| {
        let noise = deviation * noise.normal() as f32;
        p.map(|c| c + noise)
    };
    truth().into_iter().map(add).collect()
}

/// What a test's denoiser does.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Simple {
    /// Nothing.
    Nothing,
    /// All becomes one grey.
    Flat(f32),
    /// The bilateral filter of the test kit.
    Bilateral(f32),
    /// It returns a pixel too few.
    Short,
    /// It fails.
    Fails,
}

impl Denoiser for Simple {
    fn name(&self) -> String {
        format!("{self:?}")
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        match *self {
            Self::Nothing => Ok(picture.radiance.to_vec()),
            Self::Flat(grey) => Ok(vec![[grey; 3]; picture.radiance.len()]),
            Self::Bilateral(range) => Ok(bilateral(picture.size, picture.radiance, range)),
            Self::Short => Ok(picture.radiance[1..].to_vec()),
            Self::Fails => Err(DenoiseError::Failed { name: self.name(), cause: "out of order".into() }),
        }
    }
}

impl Simple {
    pub(crate) fn of(mut self, pixels: &[Rgb]) -> Vec<Rgb> {
        self.denoise(&NoisyPicture::new(SIZE, pixels)).unwrap()
    }
}
