use super::descriptors::{luminance_pair, mask_pair};
use noisefloor::descriptor::NoiseMask;
use noisefloor_image::{RenderLayers, write_exr, write_png};
use noisefloor_learn::Origin;
use noisefloor_learn::{Corpora, TableError, describe_pairs};
use noisefloor_testkit::Noise;
use std::path::Path;

const EDGE: usize = 24;
const SPP: [u32; 4] = [10, 20, 100, 400];

/// One zone of 24×24 pixels: grey, with white noise that falls as that of nested running means.
fn corpus(dir: &Path) {
    let mut noise = Noise::new(11);
    std::fs::create_dir(dir.join("Wall")).unwrap();
    let (mut sums, mut before) = ([0.0; EDGE * EDGE], 0);
    for spp in SPP {
        let rgb: Vec<u8> = sums
            .iter_mut()
            .flat_map(|sum| {
                *sum += f64::from(spp - before).sqrt() * 150.0 * noise.normal();
                [(128.0 + *sum / f64::from(spp)).round().clamp(0.0, 255.0) as u8; 3]
            })
            .collect();
        write_png(dir.join("Wall").join(format!("{spp:05}.png")), EDGE, EDGE, &rgb).unwrap();
        before = spp;
    }
    let header = "scene,renderer,zone,x,y,width,height,human_spp,first_spp,last_spp";
    std::fs::write(
        dir.join("thresholds.csv"),
        format!("{header}\nWall,test,0,0,0,{EDGE},{EDGE},150,10,500\n"),
    )
    .unwrap();
}

#[test]
fn a_pair_is_the_noisy_centre_and_the_most_converged_one() {
    let folder = tempfile::tempdir().unwrap();
    corpus(folder.path());
    let folders = [folder.path().to_owned()];
    let describe = |descriptor, edge| describe_pairs(Corpora::new(&folders), descriptor, edge, 20, |_, _| ());
    let luminances = luminance_pair(16);
    let table = describe(&luminances, 16).unwrap();
    let levels = &table.zones[0].levels;

    // Equal steps up to the most converged image, and the images below it
    let synthesised: Vec<_> = levels.iter().filter(|l| l.origin == Origin::Synthesised).collect();
    let spp: Vec<f64> = synthesised.iter().map(|l| l.spp).collect();
    assert_eq!(spp, (1..=20).map(|k| f64::from(20 * k)).collect::<Vec<_>>());
    let real: Vec<_> = levels.iter().filter(|l| l.origin == Origin::Real).collect();
    assert_eq!(real.iter().map(|l| l.spp).collect::<Vec<_>>(), [10.0, 20.0, 100.0]);

    // The reference is the centre of the last image, in all of them
    let last = noisefloor_image::read_picture(folder.path().join("Wall/00400.png")).unwrap();
    let noisefloor_image::Picture::Display(last) = last else { panic!("a PNG") };
    for level in levels {
        for (i, value) in level.descriptor[256..].iter().enumerate() {
            let pixel = last.pixels[(4 + i / 16) * EDGE + 4 + i % 16];
            assert!((value - pixel[0]).abs() < 1e-6);
        }
    }

    // Noise of known strength: 150/255 a sample, less that of the reference. 256 pixels leave 4.4 % of
    // chance, rounding less
    for level in synthesised.iter().chain(&real) {
        let (shown, reference) = level.descriptor.split_at(256);
        let squares: f32 = shown.iter().zip(reference).map(|(a, b)| (a - b) * (a - b)).sum();
        let known = 150.0 / 255.0 * (1.0 / level.spp - 1.0 / 400.0).max(0.0).sqrt();
        assert!((f64::from((squares / 256.0).sqrt()) - known).abs() <= 0.2 * known + 1e-6, "{}", level.spp);
    }

    // The masks of the same
    let masks = mask_pair(NoiseMask::default(), 16);
    let masks = describe(&masks, 16).unwrap();
    let converged = masks.zones[0].levels.last().unwrap();
    assert_eq!(converged.descriptor[..256], converged.descriptor[256..]);
    assert_ne!(masks.digest(), table.digest());
    let error = describe(&luminance_pair(32), 32).unwrap_err();
    assert!(
        matches!(error, TableError::Descriptor { .. }) && error.to_string().contains("Wall, zone 0"),
        "{error}"
    );
}

#[test]
fn a_scene_with_a_reference_is_held_against_it() {
    let folder = tempfile::tempdir().unwrap();
    corpus(folder.path());
    let folders = [folder.path().to_owned()];
    let describe = || describe_pairs(Corpora::new(&folders), &luminance_pair(16), 16, 20, |_, _| ());
    let alone = describe().unwrap();

    // 0.5 of linear light is 0.7354 on an sRGB display (IEC 61966-2-1)
    let reference = |edge: usize| {
        let pixels = vec![[0.5; 3]; edge * edge];
        let layers = RenderLayers::rgb(edge, edge, &pixels);
        write_exr(folder.path().join("Wall/reference.exr"), &layers).unwrap();
        describe()
    };
    let table = reference(EDGE).unwrap();
    for (level, alone) in table.zones[0].levels.iter().zip(&alone.zones[0].levels) {
        // But for the rounding of a mean of two pictures
        let same =
            level.descriptor.iter().zip(&alone.descriptor).take(256).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(same, "the picture is the same");
        for value in &level.descriptor[256..] {
            assert!((value - 0.735_357).abs() < 1e-5, "{value}");
        }
    }
    for edge in [EDGE - 1, EDGE + 20] {
        let error = reference(edge).unwrap_err().to_string();
        assert!(error.contains("Wall") && error.contains("reference.exr"), "{error}");
    }
}
