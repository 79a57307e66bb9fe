//! The visible difference of a residual in a tile, beside that of whole pictures.
#![allow(missing_docs, reason = "tests")]

use allocation_counter::measure;
use noisefloor_vision::{
    OpponentChannel, ResidualPatch, ResidualPixels, Viewing, VisionDetail, VisionError, VisionModel,
    VisionWorkspace, rescaled,
};
use std::ops::Range;

type Pixels = Vec<[f32; 3]>;

/// A picture with edges and colours, and noise for it.
fn pictures(width: usize, height: usize, amount: f32) -> (Pixels, Pixels) {
    let mut state = 7u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        amount * ((state >> 40) as f32 / (1 << 23) as f32 - 1.0)
    };
    let pixel = |i: usize| {
        let (x, y) = (i % width, i / width);
        let wall = 0.4 + 0.2 * ((x * y) as f32 / 900.0).sin();
        [wall, 0.9 * wall, if (x / 21 + y / 17) % 2 == 0 { 0.3 } else { 0.6 }]
    };
    let area = 0..width * height;
    (area.clone().map(pixel).collect(), area.map(|_| [noise(), noise(), noise()]).collect())
}

/// A part of pixels of this width.
fn cut(pixels: &[[f32; 3]], width: usize, columns: Range<usize>, rows: Range<usize>) -> Pixels {
    rows.flat_map(|y| pixels[y * width..][columns.clone()].iter().copied()).collect()
}

fn map(
    model: &VisionModel,
    pixels: ResidualPixels<'_>,
    size: (usize, usize),
    part: (Range<usize>, Range<usize>),
    detail: VisionDetail,
) -> Vec<f32> {
    let patch = ResidualPatch { pixels, size, columns: part.0, rows: part.1 };
    let mut workspace = VisionWorkspace::default();
    let mut found = model.residual(&patch, detail, &mut workspace).expect("a patch");
    found.map().rows().flatten().copied().collect()
}

/// A picture and its residual, in planes of red, green and blue.
struct Planar([[Vec<f32>; 3]; 2]);

impl Planar {
    fn new(picture: &Pixels, residual: &Pixels) -> Self {
        Self([picture, residual].map(|of| [0, 1, 2].map(|c| of.iter().map(|pixel| pixel[c]).collect())))
    }

    fn pixels(&self) -> ResidualPixels<'_> {
        let [picture, residual] = self.0.each_ref().map(|planes| planes.each_ref().map(Vec::as_slice));
        ResidualPixels::Rgb { picture, residual }
    }
}

/// A patch of all of a picture.
fn whole(planar: &Planar, size: (usize, usize)) -> ResidualPatch<'_> {
    ResidualPatch { pixels: planar.pixels(), size, columns: 0..size.0, rows: 0..size.1 }
}

/// Root mean square of the difference beside that of `b`.
fn off(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let sum = |values: &mut dyn Iterator<Item = f32>| values.map(|v| f64::from(v).powi(2)).sum::<f64>();
    (sum(&mut a.iter().zip(b).map(|(a, b)| a - b)) / sum(&mut b.iter().copied())).sqrt()
}

#[test]
fn a_part_is_the_part_of_the_whole() {
    let model = VisionModel::new(&Viewing::default());
    for (width, height) in [(160, 160), (151, 97)] {
        let (picture, residual) = pictures(width, height, 0.05);
        let planar = Planar::new(&picture, &residual);
        let pixels = planar.pixels();
        let colour = VisionDetail { chromatic_below: 15.0, frequencies: (1.0, 15.0) };
        for (detail, step) in [(VisionDetail::FULL, 1), (VisionDetail::FAST, 1), (colour, 2)] {
            let whole = map(&model, pixels, (width, height), (0..width, 0..height), detail);
            for (columns, rows) in [(16..144, 16..80), (0..32, 64..96), (33..34, 0..1)] {
                let part = map(&model, pixels, (width, height), (columns.clone(), rows.clone()), detail);
                let (columns, rows) = (
                    columns.start / step..columns.end.div_ceil(step),
                    rows.start / step..rows.end.div_ceil(step),
                );
                let stride = width.div_ceil(step);
                let expected: Vec<f32> =
                    rows.flat_map(|y| whole[y * stride..][columns.clone()].to_vec()).collect();
                assert!(part == expected, "{columns:?} of {width}×{height}");
            }
        }
    }
}

#[test]
fn a_halo_of_16_pixels_is_nearly_the_whole_picture() {
    let model = VisionModel::new(&Viewing::default());
    let edge = 256;
    let (picture, residual) = pictures(edge, edge, 0.03);
    let inner = 64..192;
    let colour = VisionDetail { frequencies: (1.0, 15.0), ..VisionDetail::FULL };
    for detail in [colour, VisionDetail::FAST] {
        let planar = Planar::new(&picture, &residual);
        let pixels = planar.pixels();
        let whole = map(&model, pixels, (edge, edge), (inner.clone(), inner.clone()), detail);
        let mut last = f64::MAX;
        for halo in [8, 16, 32] {
            let around = inner.start - halo..inner.end + halo;
            let [picture, residual] =
                [&picture, &residual].map(|pixels| cut(pixels, edge, around.clone(), around.clone()));
            let planar = Planar::new(&picture, &residual);
            let pixels = planar.pixels();
            let part = map(
                &model,
                pixels,
                (around.len(), around.len()),
                (halo..halo + 128, halo..halo + 128),
                detail,
            );
            let error = off(&part, &whole);
            let mean = part.iter().sum::<f32>() / whole.iter().sum::<f32>();
            println!("halo {halo}: {:.2} % off, mean {:.2} %", 100.0 * error, 100.0 * (mean - 1.0));
            assert!(error < last, "a wider halo is no worse");
            assert!(
                halo < 16 || (error < 0.01 && (mean - 1.0).abs() < 0.005),
                "halo {halo}: {error}, {mean}"
            );
            last = error;
        }
    }
}

#[test]
fn differences_are_those_that_the_metric_pools() {
    // A channel and band at a time: the root mean square of a band in an otherwise empty residual decides the
    // JOD
    let model = VisionModel::new(&Viewing::default());
    let size = (128, 128);
    let (picture, residual) = pictures(size.0, size.1, 0.05);
    let planar = Planar::new(&picture, &residual);
    let pixels = planar.pixels();
    let patch = ResidualPatch { pixels, size, columns: 0..128, rows: 0..128 };
    let mut workspace = VisionWorkspace::default();
    let found = model.residual(&patch, VisionDetail::FULL, &mut workspace).unwrap();
    let channels = [OpponentChannel::Achromatic, OpponentChannel::RedGreen, OpponentChannel::YellowViolet];
    let fourth = |channel| -> f64 { found.bands(channel).map(|band| band.pooled(2.0).powi(4)).sum() };
    let all: f64 = channels.into_iter().map(fourth).sum();
    // Mantiuk et al. 2024, §3.7
    let jod = 10.0 - 0.043_956_939 * (0.577_918_29 * all.powf(0.25)).powf(0.930_204_27);
    let test: Pixels =
        picture.iter().zip(&residual).map(|(p, r)| std::array::from_fn(|i| p[i] + r[i])).collect();
    let whole = model.compare(&test, &picture, size, &mut VisionWorkspace::default()).unwrap().jod();
    assert!((jod - whole).abs() < 0.02, "{jod} and {whole}");
}

#[test]
fn another_contrast_needs_no_new_bands() {
    let model = VisionModel::new(&Viewing::default());
    let size = (128, 128);
    let (picture, residual) = pictures(size.0, size.1, 0.06);
    let colour = VisionDetail { chromatic_below: 15.0, frequencies: (1.0, 15.0) };
    let values =
        |band: noisefloor_vision::DifferenceBand<'_>| band.rows().flatten().copied().collect::<Vec<f32>>();
    let (mut workspace, mut other) = (VisionWorkspace::default(), VisionWorkspace::default());
    let planar = Planar::new(&picture, &residual);
    for detail in [VisionDetail::FAST, colour] {
        let mut found = model.residual(&whole(&planar, size), detail, &mut workspace).unwrap();
        assert!(off(&values(found.map_at(1.0)), &values(found.map())) < 1e-6);
        // Four times and sixteen times the samples; the picture masks nearly as before
        for contrast in [0.5, 0.25] {
            let less: Pixels = residual.iter().map(|p| p.map(|v| v * contrast)).collect();
            let mut again =
                model.residual(&whole(&Planar::new(&picture, &less), size), detail, &mut other).unwrap();
            let (expected, exact) = (values(found.map_at(contrast)), values(again.map()));
            let (error, mean) =
                (off(&expected, &exact), expected.iter().sum::<f32>() / exact.iter().sum::<f32>());
            println!("contrast {contrast}: {:.1} % off, mean ×{mean:.3}", 100.0 * error);
            assert!(error < 0.25 && (mean - 1.0).abs() < 0.25, "contrast {contrast}: {error}, {mean}");
        }
        let map = values(found.map());
        assert!(values(found.map_at(0.0)).iter().all(|&d| d < 1e-9));
        assert_eq!(map, values(found.map()));
    }
}

#[test]
fn greys_are_pictures_without_colour() {
    let model = VisionModel::new(&Viewing::default());
    let (picture, residual) = pictures(96, 96, 0.05);
    let [grey_picture, grey_residual] =
        [&picture, &residual].map(|pixels| pixels.iter().map(|p| p[1]).collect::<Vec<f32>>());
    let [rgb_picture, rgb_residual] =
        [&grey_picture, &grey_residual].map(|greys| greys.iter().map(|&v| [v; 3]).collect::<Pixels>());
    let grey = ResidualPixels::Grey { picture: &grey_picture, residual: &grey_residual };
    let planar = Planar::new(&rgb_picture, &rgb_residual);
    let rgb = planar.pixels();
    let of = |pixels, detail| map(&model, pixels, (96, 96), (0..96, 0..96), detail);
    assert!(off(&of(grey, VisionDetail::FAST), &of(rgb, VisionDetail::FAST)) < 1e-4);
    assert!(off(&of(grey, VisionDetail::FAST), &of(rgb, VisionDetail::COLOUR)) < 1e-2);
}

#[test]
fn differences_follow_contrast() {
    // On a flat picture nothing masks: the law is exact but for the curve of the display
    let model = VisionModel::new(&"desk,eotf=linear,peak=1000".parse().unwrap());
    let size = (96, 96);
    let picture = vec![[100.0; 3]; 96 * 96];
    let (_, residual) = pictures(size.0, size.1, 6.0);
    let at = |contrast: f32| {
        let residual: Pixels = residual.iter().map(|p| p.map(|v| v * contrast)).collect();
        let planar = Planar::new(&picture, &residual);
        let pixels = planar.pixels();
        map(
            &model,
            pixels,
            size,
            (0..96, 0..96),
            VisionDetail { frequencies: (10.0, 100.0), ..VisionDetail::FAST },
        )
    };
    let full = at(1.0);
    for contrast in [0.5f32, 0.25, 0.1] {
        let expected: Vec<f32> = full.iter().map(|&d| rescaled(d, contrast)).collect();
        let error = off(&expected, &at(contrast));
        assert!(error < 0.03, "contrast {contrast}: {error}");
    }
    assert_eq!(rescaled(0.0, 0.5), 0.0);
    for d in [1e-6f32, 0.1, 3.0, 300.0] {
        assert!((rescaled(d, 1.0) / d - 1.0).abs() < 1e-4, "{d}");
        assert!((rescaled(rescaled(d, 0.3), 1.0 / 0.3) / d - 1.0).abs() < 1e-2, "{d}");
    }
    for extreme in [f32::MAX, 1e9, 0.0] {
        assert!(rescaled(extreme, extreme).is_finite());
    }
}

#[test]
fn nothing_is_allocated_for_the_next_tile() {
    let model = VisionModel::new(&Viewing::default());
    let (picture, residual) = pictures(160, 160, 0.05);
    let planar = Planar::new(&picture, &residual);
    let pixels = planar.pixels();
    let patch = ResidualPatch { pixels, size: (160, 160), columns: 16..144, rows: 16..144 };
    let mut workspace = VisionWorkspace::default();
    for detail in [VisionDetail::FULL, VisionDetail::FAST] {
        model.residual(&patch, detail, &mut workspace).unwrap();
        let used = measure(|| {
            model.residual(&patch, detail, &mut workspace).unwrap();
        });
        assert_eq!(used.count_total, 0);
    }
}

#[test]
fn bad_patches_are_refused() {
    let model = VisionModel::new(&Viewing::default());
    let mut workspace = VisionWorkspace::default();
    let (picture, residual) = pictures(32, 32, 0.05);
    let planar = Planar::new(&picture, &residual);
    let good = ResidualPatch { pixels: planar.pixels(), size: (32, 32), columns: 8..24, rows: 8..24 };
    for (columns, rows) in [(8..8, 8..24), (8..33, 8..24), (8..24, 30..40), (24..24, 8..24)] {
        let patch = ResidualPatch { columns, rows, ..good.clone() };
        assert_eq!(
            model.residual(&patch, VisionDetail::FAST, &mut workspace).unwrap_err(),
            VisionError::Region
        );
    }
    for size in [(3, 32), (32, 3), (0, 0)] {
        let patch = ResidualPatch { size, ..good.clone() };
        let (width, height) = size;
        let refused = model.residual(&patch, VisionDetail::FAST, &mut workspace).unwrap_err();
        assert_eq!(refused, VisionError::Size { width, height });
    }
    let greys = vec![0.5; 31 * 32];
    let pixels = ResidualPixels::Grey { picture: &greys, residual: &greys };
    let refused =
        model.residual(&ResidualPatch { pixels, ..good.clone() }, VisionDetail::FAST, &mut workspace);
    assert_eq!(refused.unwrap_err(), VisionError::Length { width: 32, height: 32, found: 992 });
    // No band lies between these, and none is above or below all
    for frequencies in [(3.1, 3.2), (1e9, 1e10), (0.0, 1e-9), (5.0, 1.0), (f64::NAN, f64::NAN)] {
        let detail = VisionDetail { frequencies, ..VisionDetail::FULL };
        let mut found = model.residual(&good, detail, &mut workspace).unwrap();
        assert_eq!(found.bands(OpponentChannel::Achromatic).count(), 1, "{frequencies:?}");
        assert!(found.map().pooled(4.0).is_finite());
    }
}

/// A tile of a film is a part of its frame, and a workspace does not remember it.
#[test]
fn films_have_parts_and_are_forgotten() {
    let still = VisionModel::new(&Viewing::default());
    let film = VisionModel::new(&"desk,fps=24".parse().unwrap());
    let size = (128, 96);
    let (picture, residual) = pictures(size.0, size.1, 0.05);
    let planar = Planar::new(&picture, &residual);
    let pixels = planar.pixels();
    let everywhere = (0..size.0, 0..size.1);
    let test: Pixels =
        picture.iter().zip(&residual).map(|(p, r)| std::array::from_fn(|i| p[i] + r[i])).collect();
    let mut workspace = VisionWorkspace::default();
    let jod = film.compare(&test, &picture, size, &mut workspace).unwrap().jod();
    for detail in [VisionDetail::FULL, VisionDetail::FAST] {
        let whole = map(&film, pixels, size, everywhere.clone(), detail);
        let part = map(&film, pixels, size, (32..64, 16..80), detail);
        let expected: Vec<f32> = (16..80).flat_map(|y| whole[y * size.0..][32..64].to_vec()).collect();
        assert!(part == expected);
    }

    let again = still.compare(&test, &picture, size, &mut workspace).unwrap().jod();
    assert_eq!(again, still.compare(&test, &picture, size, &mut VisionWorkspace::default()).unwrap().jod());
    // What is new in every frame is averaged out; what stands still is not
    let standing = film.compare_frame(&test, &test, &picture, size, &mut workspace).unwrap().jod();
    assert!(standing < again && standing < jod, "standing {standing}, new {jod}, a still {again}");
}

/// Noise twice as strong has four times the energy in a film, too, whatever masks it.
#[test]
fn the_energy_of_a_film_grows_as_variance_does() {
    let film = VisionModel::new(&"desk,fps=60".parse().unwrap());
    let size = (96, 96);
    let picture = vec![[0.5; 3]; size.0 * size.1];
    let (_, residual) = pictures(size.0, size.1, 0.004);
    let energy = |factor: f32| {
        let residual: Pixels = residual.iter().map(|r| r.map(|v| factor * v)).collect();
        let mut workspace = VisionWorkspace::default();
        let planar = Planar::new(&picture, &residual);
        let patch = whole(&planar, size);
        let found = film.residual(&patch, VisionDetail::FAST, &mut workspace).unwrap();
        found.contrast_energy().pooled(1.0)
    };
    let grown = energy(2.0) / energy(1.0);
    assert!((grown - 4.0).abs() < 0.04, "{grown}");
}
