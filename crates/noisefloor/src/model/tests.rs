use super::file::{FORMAT, ModelFile};
use super::*;
use crate::people::Unknown;
use crate::svm::{Line, Machine, Platt, Scaler, Svm};
use proptest::prelude::*;

/// A model that goes by the first number of the default descriptor alone.
pub(crate) fn small() -> Model {
    let descriptor = Descriptor::default();
    let n = descriptor.dimensions();
    let mut weights = vec![0.0; n];
    weights[0] = -1.0;
    let classifier = Classifier {
        scaler: Scaler::identity(n),
        machine: Machine::Line(Line { weights, bias: 0.0 }),
        platt: Platt { a: -2.0, b: 0.0 },
    };
    let parts = ModelParts {
        viewing: Viewing::default(),
        descriptor,
        evidence: Evidence::Halves,
        tone_mapping: ToneMapping::default(),
        classifier,
        familiarity: None,
        spread: Some(Spread { scenes: 0.4, people: 0.5 }),
        audience: Audience::TRAINED,
        record: TrainingRecord::default(),
    };
    Model::new(parts).unwrap()
}

/// The same with some parts changed.
pub(crate) fn changed(model: Model, change: impl FnOnce(&mut ModelParts)) -> Result<Model, ModelError> {
    let mut parts = model.into_parts();
    change(&mut parts);
    Model::new(parts)
}

fn file() -> Vec<u8> {
    let mut bytes = Vec::new();
    small().write(&mut bytes).unwrap();
    bytes
}

#[test]
fn survives_the_file() {
    let model = Model::read(&file()[..]).unwrap();
    assert_eq!(model, small());
    assert_eq!(model.digest(), small().digest());
}

#[test]
fn files_keep_measured_colours_of_a_display() {
    let viewing = "desk,primaries=p3,white=d50".parse().unwrap();
    let model = changed(small(), |m| m.viewing = viewing).unwrap();
    let mut bytes = Vec::new();
    model.write(&mut bytes).unwrap();
    assert_eq!(Model::read(&bytes[..]).unwrap().viewing(), viewing);
}

/// Nobody has said when they stop seeing noise in a film: thresholds are those of stills.
#[test]
fn models_are_of_stills() {
    let film = changed(small(), |m| m.viewing = "desk,fps=24".parse().unwrap());
    assert!(matches!(film, Err(ModelError::Invalid(why)) if why.contains("films")));
}

#[cfg(feature = "bundled-model")]
#[test]
fn the_bundled_model_is_whole_small_and_scored() {
    let model = Model::bundled();
    assert_eq!(model.evidence(), Evidence::Halves);
    assert!(model.record().leave_one_scene_out.is_some_and(|s| s.zones == 167));
}

/// Of what is unfamiliar, thresholds scatter more: twice as far as what is familiar by [`UNFAMILIAR`], half of the way there by
/// half of it.
#[test]
fn thresholds_scatter_more_where_a_tile_is_unfamiliar() {
    let zones = vec![vec![0.5; small().descriptor().texture().len()]];
    let familiarity = Familiarity { zones, reach: 0.1 };
    let cautious = changed(small(), |m| m.familiarity = Some(familiarity)).unwrap();
    let mut tile = vec![0.5; small().descriptor().dimensions()];
    assert!(!cautious.judge(&tile).unfamiliar && !small().judge(&tile).unfamiliar);
    assert_eq!(cautious.judge(&tile), small().judge(&tile));

    let spread = small().spread().unwrap();
    for (beyond, share) in [(0.21, 1.0), (-0.06, 0.5)] {
        tile[1] += beyond;
        let (careful, careless) = (cautious.judge(&tile), small().judge(&tile));
        assert!(careful.unfamiliar && !careless.unfamiliar);
        assert_eq!(careful.probability_without_penalty, careless.probability);
        let odds = (f64::from(careless.mean_observer) / (1.0 - f64::from(careless.mean_observer))).ln();
        let texture = (super::familiarity::UNFAMILIAR * share).powi(2);
        let expected = spread.share(odds, Unknown { texture, ..Unknown::default() }) as f32;
        assert!((careful.probability - expected).abs() < 1e-3, "{careful:?} {expected}");
    }
}

#[test]
fn the_model_for_references_is_whole() {
    let model = Model::read(&include_bytes!("../../models/human-reference.nfm")[..]).unwrap();
    assert_eq!((model.evidence(), model.record().scenes.len()), (Evidence::Reference, 9));
}

#[cfg(feature = "bundled-model")]
#[test]
fn clean_tiles_are_converged_and_noisy_ones_are_not_whatever_the_picture() {
    let model = Model::bundled();
    // From no texture at all, ln 2, to a checkerboard of black and white, ln 128; from black to white
    for (textured, lit) in (0..=17).flat_map(|textured| (0..=6).map(move |lit| (textured, lit))) {
        let (texture, light) = (0.693 + 0.25 * textured as f32, 0.002f32.ln() * (1.0 - lit as f32 / 6.0));
        let p = |noise: f32| model.judge(&[noise, texture, light, noise, light]).probability;
        // From no noise, at the floor, to a hundred times too much
        let path: Vec<f32> = (0..=81).map(|i| p(-3.5 + 0.1 * i as f32)).collect();
        assert!(path[0] > 0.99 && path[81] < 0.01, "{texture} {light}: {path:?}");
        assert!(path.windows(2).all(|w| w[1] <= w[0] + 1e-6), "{texture} {light}: {path:?}");
    }
}

#[test]
fn each_fault_has_its_error() {
    let read = |bytes: &[u8]| Model::read(bytes).unwrap_err();
    assert!(matches!(read(b""), ModelError::Foreign));
    assert!(matches!(read(b"\x89PNG\r\n\x1a\n and so on"), ModelError::Foreign));
    let whole = file();
    assert!(matches!(read(&whole[..20]), ModelError::Damaged(_)));
    assert!(matches!(read(&whole[..whole.len() - 1]), ModelError::Damaged(_)));
    assert!(matches!(read(&[&whole[..], b"x"].concat()), ModelError::Damaged(_)));
    let mut newer = whole.clone();
    newer[8] = VERSION as u8 + 1;
    assert!(matches!(read(&newer), ModelError::Newer { found } if found == VERSION + 1));
    newer[8] = 2;
    assert!(matches!(read(&newer), ModelError::Older { found: 2 }));
    let mut oversized = whole.clone();
    oversized[19] = 0xff;
    assert!(matches!(read(&oversized), ModelError::Oversized(_)));
}

#[test]
fn contradictions_are_refused() {
    let fails = |change: fn(&mut ModelParts)| changed(small(), change).unwrap_err();
    let line = |m: &mut ModelParts, weights: Vec<f32>, bias: f32| {
        m.classifier.machine = Machine::Line(Line { weights, bias })
    };
    let svm = |m: &mut ModelParts, gamma: f32, numbers: usize| {
        let vectors = vec![0.0; numbers];
        m.classifier.machine = Machine::Svm(Svm { gamma, rho: 0.0, coefficients: vec![1.0], vectors });
    };
    let n = small().descriptor().dimensions();
    let broken = [
        changed(small(), |m| line(m, vec![0.0; n], f32::NAN)),
        changed(small(), |m| line(m, vec![0.0; n - 1], 0.0)),
        changed(small(), |m| svm(m, 0.0, n)),
        changed(small(), |m| svm(m, 1.0, n - 1)),
        changed(small(), |m| m.spread = Some(Spread { scenes: 0.0, people: 0.5 })),
        changed(small(), |m| m.spread = Some(Spread { scenes: 0.3, people: f64::NAN })),
    ];
    assert!(broken.into_iter().all(|model| matches!(model, Err(ModelError::Invalid(_)))));
    assert!(changed(small(), |m| svm(m, 1.0, n)).is_ok());
    assert!(matches!(fails(|m| m.classifier.scaler.mean.clear()), ModelError::Invalid(_)));
    let n = small().descriptor().texture().len();
    let known = |zone: Vec<f32>, reach| Some(Familiarity { zones: vec![zone], reach });
    let none = Some(Familiarity { zones: vec![], reach: 1.0 });
    let short = known(vec![0.0; n - 1], 1.0);
    for familiarity in [none, short, known(vec![0.0; n], -1.0), known(vec![f32::NAN; n], 1.0)] {
        let error = changed(small(), |m| m.familiarity = familiarity).unwrap_err();
        assert!(matches!(error, ModelError::Invalid(_)));
    }
}

/// What a file says about its descriptor is not taken on trust.
#[test]
fn a_descriptor_that_is_not_here_is_refused() {
    let small = small();
    let read = |change: fn(&mut ModelFile<'_>)| {
        let mut file = small.file();
        change(&mut file);
        let mut bytes = Vec::new();
        FORMAT.write(&file, &mut bytes).unwrap();
        Model::read(&bytes[..]).unwrap_err()
    };
    assert!(matches!(read(|f| f.descriptor_version = 99), ModelError::Descriptor { needed: 99, .. }));
    let unknown = read(|f| f.descriptor.name = "tea-leaves".into());
    assert!(
        unknown.to_string().contains("tea-leaves") && unknown.to_string().contains("visible"),
        "{unknown}"
    );
    let empty = read(|f| f.descriptor.parameters.clear());
    assert!(empty.to_string().contains("window"), "{empty}");
}

proptest! {
    #[test]
    fn no_damaged_byte_goes_unnoticed(at in 0usize..4000, flip in 1u8..) {
        let mut bytes = file();
        let at = at % bytes.len();
        bytes[at] ^= flip;
        prop_assert!(Model::read(&bytes[..]).is_err());
    }

    #[test]
    fn noise_is_never_a_model(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let framed = [&FORMAT.magic[..], &bytes].concat();
        prop_assert!(Model::read(&framed[..]).is_err());
        prop_assert!(Model::read(&bytes[..]).is_err());
    }
}
