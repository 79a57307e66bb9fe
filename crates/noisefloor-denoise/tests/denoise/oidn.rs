use crate::kit::{SIZE, noisy, truth};
use noisefloor::Rgb;
use noisefloor_denoise::{DenoiseError, Denoiser, NoisyPicture, OIDN, Oidn};
use noisefloor_sidecar::{FilterPlan, find};
use noisefloor_testkit::{Requirement, require};
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
    assert!(error(&oidn.denoise(&helped).unwrap()) < 0.8 * error(&once));
    let odd = NoisyPicture { size: (SIZE.0, 3), ..NoisyPicture::new(SIZE, &noisy) };
    assert!(matches!(oidn.denoise(&odd), Err(DenoiseError::Pixels { .. })));
}
