use crate::kit::usable;
use noisefloor::{ProgressiveSource, Repeats, Request, Rgb, SourceError, Tile, TileGrid};
use noisefloor_image::{RenderLayers, write_exr};
use noisefloor_mitsuba::{RENDERER, Variant, notes, open_as};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
use noisefloor_sidecar::{Job, Sidecar};
use noisefloor_testkit::{Requirement, check_silence, check_source, require};
#[cfg(target_os = "linux")]
use noisefloor_testkit::{is_running, resident_kib};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

const CORNELL_BOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures/cornell-box.xml");
const SIZE: (usize, usize) = (48, 40);

fn open(scene: impl Into<PathBuf>, size: (usize, usize), variant: Variant) -> Sidecar {
    let mut job = Job::new(scene);
    (job.seed, job.size) = (7, Some(size));
    open_as(&job, variant).unwrap_or_else(|e| panic!("{e}"))
}

/// The wavefront, where Mitsuba can compile it: `doctor --install` does not install libLLVM.
fn wavefront() -> Option<Variant> {
    let missing = notes().into_iter().next();
    require(Requirement::Llvm, missing.map_or(Ok(Variant::Llvm), Err))
}

fn variants() -> Vec<Variant> {
    wavefront().into_iter().chain([Variant::Scalar]).collect()
}

#[test]
fn the_wavefront_keeps_the_contract() {
    if !usable(&RENDERER) || wavefront().is_none() {
        return;
    }
    let make = || open(CORNELL_BOX, SIZE, Variant::Llvm);
    let source = make();
    assert_eq!(source.info().repeats, Repeats::Samples, "{:?}", source.warnings());
    check_source(make);
    check_silence(make(), 80);
}

#[test]
fn crop_windows_keep_the_contract() {
    if !usable(&RENDERER) {
        return;
    }
    let make = || open(CORNELL_BOX, SIZE, Variant::Scalar);
    assert_eq!(make().info().repeats, Repeats::Calls);
    check_source(make);
    check_silence(make(), 80);
}

/// The same scene by two renderers: tile by tile the same mean. Each z exceeds 6 with p = 2e-9, and 24 are
/// looked at; the sources are seeded.
#[test]
fn it_renders_what_our_renderer_does() {
    if !usable(&RENDERER) {
        return;
    }
    let options = RenderOptions { seed: 3, max_depth: 65, ..RenderOptions::default() };
    let ours = Ptwne::new(scenes::by_name("cornell-box").unwrap(), SIZE.0, SIZE.1, options).unwrap();
    let expected = moments(ours);
    for variant in variants() {
        for (tile, (a, b)) in moments(open(CORNELL_BOX, SIZE, variant)).iter().zip(&expected).enumerate() {
            for c in 0..3 {
                let z = (a[c].0 - b[c].0) / (a[c].1 + b[c].1).sqrt();
                assert!(z.abs() < 6.0, "{variant:?}, tile {tile}, channel {c}: {a:?} and {b:?}, z = {z}");
            }
        }
    }
}

/// Mean of each tile and channel over 64 batches of 16 samples, and the variance of that mean.
fn moments(mut source: impl ProgressiveSource) -> Vec<[(f64, f64); 3]> {
    const BATCHES: u64 = 64;
    let tiles = TileGrid::new(SIZE.0, SIZE.1, 32).unwrap();
    let mut sums = vec![[(0.0, 0.0); 3]; tiles.len()];
    for batch in 0..BATCHES {
        let requests: Vec<_> = tiles.tiles().map(|tile| Request::new(tile, 16 * batch, 16)).collect();
        for (batch, sums) in source.sample(&requests).unwrap().iter().zip(&mut sums) {
            for (c, sum) in sums.iter_mut().enumerate() {
                let mean = batch.mean.iter().map(|p| f64::from(p[c])).sum::<f64>() / batch.mean.len() as f64;
                *sum = (sum.0 + mean, sum.1 + mean * mean);
            }
        }
    }
    let n = BATCHES as f64;
    let moments = |(sum, squares): (f64, f64)| (sum / n, (squares / n - (sum / n).powi(2)) / (n - 1.0));
    sums.into_iter().map(|tile| tile.map(moments)).collect()
}

/// What a path of one segment sees is light alone; the panel of the Cornell box is in its upper half.
#[test]
fn depth_and_size_are_those_asked_for() {
    if !usable(&RENDERER) {
        return;
    }
    for variant in variants() {
        let mut job = Job::new(CORNELL_BOX);
        (job.size, job.max_depth) = (Some((33, 31)), Some(1));
        let mut source = open_as(&job, variant).unwrap();
        assert_eq!((source.info().width, source.info().height), (33, 31));
        let half = |index, y, height| Request::new(Tile { index, x: 0, y, width: 33, height }, 0, 16);
        let batches = source.sample(&[half(0, 0, 15), half(1, 15, 16)]).unwrap();
        let light = |i: usize| batches[i].mean.iter().flatten().filter(|&&c| c > 0.0).count();
        assert!(light(0) > 0 && light(1) == 0, "{variant:?}: {} {}", light(0), light(1));
        drop(source);
        // Without wishes, those of the file
        let source = open_as(&Job::new(CORNELL_BOX), variant).unwrap();
        assert_eq!((source.info().width, source.info().height), (512, 512));
    }
}

/// A mirror shows the wall behind the camera, and a pane both walls by the shares that Fresnel's equations give; so do their
/// normals. A mask shows what is behind it by its opacity. In 256 pixels of 64 rays each, a share has a standard error of
/// 0.004 at most.
#[test]
fn first_hits_are_those_behind_glass_and_in_mirrors() {
    if !usable(&RENDERER) {
        return;
    }
    let Some(variant) = wavefront() else { return };
    let folder = tempfile::tempdir().unwrap();
    let hits = |name: &str, surface: &str| {
        let scene = folder.path().join(name);
        let wall = |place: &str, colour: &str| {
            format!(
                r#"<shape type="rectangle"><transform name="to_world"><scale value="20"/>{place}</transform>
                <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="{colour}"/></bsdf></bsdf></shape>"#
            )
        };
        let (ahead, behind) = (
            wall(r#"<rotate y="1" angle="-45"/>"#, "0.8, 0.4, 0.2"),
            wall(r#"<translate z="9"/>"#, "0.1, 0.5, 0.9"),
        );
        let text = format!(
            r#"<scene version="3.0.0"><integrator type="path"/><sensor type="perspective"><float name="fov" value="1"/>
            <transform name="to_world"><lookat origin="0, 0, 2" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
            {ahead}{behind}<shape type="rectangle"><transform name="to_world"><translate z="1"/></transform>{surface}</shape>
            <emitter type="constant"/></scene>"#
        );
        std::fs::write(&scene, text).unwrap();
        let hits = open(&scene, (16, 16), variant).first_hits(0, 64).unwrap().unwrap();
        [hits.albedo, hits.normal]
            .map(|plane| [0, 1, 2].map(|c| plane.iter().map(|p| p[c]).sum::<f32>() / 256.0))
    };
    let near = |found: [Rgb; 2], expected: [Rgb; 2]| {
        let apart = found.as_flattened().iter().zip(expected.as_flattened()).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f32::max) < 0.02, "{found:?}, not {expected:?}");
    };
    let (ahead, behind, slope) = ([0.8, 0.4, 0.2], [0.1, 0.5, 0.9], std::f32::consts::FRAC_1_SQRT_2);
    let both =
        |share: f32, a: Rgb, b: Rgb| -> Rgb { std::array::from_fn(|c| (1.0 - share) * a[c] + share * b[c]) };
    let conductor = r#"<bsdf type="conductor"><string name="material" value="none"/></bsdf>"#;
    near(hits("mirror.xml", conductor), [behind, [0.0, 0.0, -1.0]]);
    // A twenty-fifth is reflected at each boundary, 0.0769 with what goes to and fro
    let pane = r#"<bsdf type="thindielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>"#;
    let (share, turned) = (0.0769, [-slope, 0.0, slope]);
    near(hits("pane.xml", pane), [both(share, ahead, behind), both(share, turned, [0.0, 0.0, -1.0])]);
    let mask = r#"<bsdf type="mask"><float name="opacity" value="0.25"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0, 0, 1"/></bsdf></bsdf>"#;
    near(hits("mask.xml", mask), [both(0.25, ahead, [0.0, 0.0, 1.0]), both(0.25, turned, [0.0, 0.0, 1.0])]);
}

/// A crop shows the same part of the scene at any size, as in the built-in renderer: here the upper right
/// quarter, which a lamp fills.
#[test]
fn crops_show_the_same_part_at_any_size() {
    if !usable(&RENDERER) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("crop.xml");
    let text = r#"<scene version="3.0.0"><integrator type="path"/><sensor type="orthographic">
        <transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="48"/>
        <integer name="crop_offset_x" value="32"/><integer name="crop_offset_y" value="0"/>
        <integer name="crop_width" value="32"/><integer name="crop_height" value="24"/></film></sensor>
        <shape type="rectangle"><transform name="to_world"><scale x="0.5" y="0.375"/>
        <translate x="0.5" y="0.375"/></transform>
        <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape></scene>"#;
    std::fs::write(&scene, text).unwrap();
    for size in [(32, 24), (16, 12), (96, 72)] {
        let mut source = open(&scene, size, Variant::Scalar);
        assert_eq!(source.info().width, size.0);
        let tile = Tile { index: 0, x: 0, y: 0, width: size.0, height: size.1 };
        let mean = source.sample(&[Request::new(tile, 0, 16)]).unwrap().remove(0).mean;
        assert!(
            mean.iter().all(|p| (p[0] - 1.0).abs() < 1e-3),
            "{size:?}: {:?}",
            mean.iter().min_by(|a, b| a[0].total_cmp(&b[0]))
        );
    }
}

/// A plane under a sky, seen from infinity: what a pixel gets follows from its random numbers alone, not from
/// its place.
fn plane(folder: &Path) -> PathBuf {
    let (width, height) = (32, 16);
    let at = |i: usize| (i as f32).mul_add(0.37, 1.0).sin().mul_add(0.4, 1.0);
    let sky: Vec<Rgb> = (0..width * height).map(|i| [at(i), at(i * 7), at(i * 13)]).collect();
    write_exr(folder.join("sky.exr"), &RenderLayers::rgb(width, height, &sky)).unwrap();
    let scene = folder.join("plane.xml");
    let text = r#"<scene version="3.0.0">
        <integrator type="path"><integer name="max_depth" value="2"/></integrator>
        <sensor type="orthographic">
            <transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
        </sensor>
        <shape type="rectangle">
            <transform name="to_world"><scale value="4"/></transform>
            <bsdf type="diffuse"/>
        </shape>
        <emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>
    </scene>"#;
    std::fs::write(&scene, text).unwrap();
    scene
}

fn request(index: usize, (x, y): (usize, usize), (width, height): (usize, usize), first: u64) -> Request {
    Request::new(Tile { index, x, y, width, height }, first, 1)
}

fn values(source: &mut Sidecar, request: Request) -> Vec<[u32; 3]> {
    source.sample(&[request]).unwrap().remove(0).mean.iter().map(|p| p.map(f32::to_bits)).collect()
}

/// The trap of the scalar variant: it numbers streams seed × area + pixel, so that windows of different areas
/// share streams under equal or neighbouring seeds. Where two pixels share a stream they get the same value
/// to the bit, and by chance three channels never do.
#[test]
fn no_two_pixels_or_batches_share_random_numbers() {
    if !usable(&RENDERER) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = plane(folder.path());

    // The test can fail: two processes whose first request is of one index start with the same streams,
    // wherever the tile is
    let mut one = open(&scene, (128, 128), Variant::Scalar);
    let mut other = open(&scene, (128, 128), Variant::Scalar);
    let same = values(&mut one, request(3, (0, 0), (16, 16), 0))
        == values(&mut other, request(3, (64, 32), (16, 16), 0));
    assert!(
        same,
        "the value of a pixel does not follow from its random numbers alone: this test shows nothing"
    );

    for variant in variants() {
        let mut source = open(&scene, (128, 128), variant);
        let mut seen = HashSet::new();
        let mut pixels = 0;
        let places = [(0, 0), (64, 0)];
        let sizes = [(16, 16), (32, 16), (16, 32), (32, 32), (24, 16), (7, 5), (1, 1), (64, 64), (33, 31)];
        for first in 0..50 {
            let values =
                values(&mut source, request(0, places[first % 2], sizes[first % sizes.len()], first as u64));
            pixels += values.len();
            seen.extend(values);
        }
        let shared = pixels - seen.len();
        assert!(
            shared == 0,
            "{variant:?}: {shared} of {pixels} pixels share their random numbers with another"
        );
    }
}

/// A restart begins with other streams than the process before it began with.
#[test]
fn a_new_process_does_not_repeat_the_old_one() {
    if !usable(&RENDERER) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = plane(folder.path());
    for variant in variants() {
        let begin = |first| values(&mut open(&scene, (32, 32), variant), request(0, (0, 0), (32, 32), first));
        let (start, again, later) = (begin(0), begin(0), begin(1));
        assert!(start == again, "{variant:?}: another picture the second time");
        let old: HashSet<_> = start.into_iter().collect();
        assert!(!later.iter().any(|value| old.contains(value)), "{variant:?}: the first streams come again");
    }
}

/// Mitsuba merges meshes in an order that changes from process to process, and with it that of the lights.
#[test]
fn scenes_of_many_meshes_are_the_same_in_a_new_process() {
    if !usable(&RENDERER) {
        return;
    }
    let cube = |i: usize| {
        let (x, grey) = (i as f32 - 3.5, 0.1 * (i % 4) as f32);
        let light = if i.is_multiple_of(2) {
            format!(r#"<emitter type="area"><rgb name="radiance" value="{}"/></emitter>"#, i + 1)
        } else {
            String::new()
        };
        format!(
            r#"<shape type="cube"><transform name="to_world"><scale value="0.3"/><translate x="{x}" y="{i}"/></transform>
            <bsdf type="diffuse"><rgb name="reflectance" value="{grey}"/></bsdf>{light}</shape>"#
        )
    };
    let cubes: String = (0..8).map(cube).collect();
    let text = format!(
        r#"<scene version="3.0.0"><sensor type="perspective"><transform name="to_world">
        <lookat origin="0, 3, 12" target="0, 3, 0" up="0, 1, 0"/></transform></sensor>
        <shape type="rectangle"><transform name="to_world"><scale value="9"/><translate z="-1"/></transform></shape>
        {cubes}</scene>"#
    );
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("cubes.xml");
    std::fs::write(&scene, text).unwrap();
    let begin = || values(&mut open(&scene, (32, 32), variants()[0]), request(0, (0, 0), (32, 32), 0));
    let first = begin();
    for process in 0..4 {
        assert!(begin() == first, "process {process} has another picture");
    }
}

#[test]
fn scenes_that_cannot_be_loaded_are_errors() {
    if !usable(&RENDERER) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, text, words) in [
        ("empty.xml", "", "empty.xml"),
        ("blind.xml", r#"<scene version="3.0.0"/>"#, "no sensor"),
        (
            "lost.xml",
            r#"<scene version="3.0.0"><sensor type="perspective"/><shape type="obj"><string name="filename" value="gone.obj"/></shape></scene>"#,
            "gone.obj",
        ),
    ] {
        let scene = folder.path().join(name);
        std::fs::write(&scene, text).unwrap();
        let error = open_as(&Job::new(&scene), Variant::Scalar).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains(name), "{error}");
    }
}

/// A process that is killed from outside costs a restart, and no samples.
#[cfg(target_os = "linux")]
#[test]
fn a_killed_process_is_replaced_and_none_is_left() {
    if !usable(&RENDERER) {
        return;
    }
    let mut source = open(CORNELL_BOX, SIZE, variants()[0]);
    let tile = TileGrid::new(SIZE.0, SIZE.1, 32).unwrap().tile(0);
    let sample = |source: &mut Sidecar, first| -> Result<Vec<Rgb>, SourceError> {
        Ok(source.sample(&[Request::new(tile, first, 4)])?.remove(0).mean)
    };
    let before = sample(&mut source, 4).unwrap();
    let first = source.process_id().unwrap();
    let killed = std::process::Command::new("kill").args(["-9", &first.to_string()]).status().unwrap();
    assert!(killed.success());
    assert_eq!(sample(&mut source, 4).unwrap(), before);
    assert_eq!(source.restarts().len(), 1);
    let second = source.process_id().unwrap();
    assert!(first != second && is_running(second));
    drop(source);
    assert!(!is_running(first) && !is_running(second));
}

/// A leak of a tile's batch in every call (48 KB of means and random numbers) would be 47 MB.
#[cfg(target_os = "linux")]
#[test]
fn memory_is_flat_over_a_thousand_calls() {
    if !usable(&RENDERER) {
        return;
    }
    for variant in variants() {
        let mut source = open(CORNELL_BOX, SIZE, variant);
        let tile = TileGrid::new(SIZE.0, SIZE.1, 32).unwrap().tile(0);
        let mut call = |first| source.sample(&[Request::new(tile, first, 4)]).map(|_| ()).unwrap();
        (0..100).for_each(&mut call);
        let process = source.process_id().unwrap();
        let before = resident_kib(process);
        let mut call = |first| source.sample(&[Request::new(tile, first, 4)]).map(|_| ()).unwrap();
        (100..1100).for_each(&mut call);
        let after = resident_kib(process);
        assert!(
            after < before + 16 * 1024,
            "{variant:?}: {before} KiB before, {after} KiB after 1,000 calls"
        );
    }
}
