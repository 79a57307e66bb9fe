//! Makes a forest of one tree, loads it and renders it: `forest FOLDER TREES [SPP]`. Prints what that takes, for
//! pbrt's format and Mitsuba's: `forest.pbrt`, `forest.xml` and `tree.ply` are in the folder.

#![expect(clippy::print_stdout, reason = "a table for people")]

use noisefloor::{ProgressiveSource, Request, TileGrid};
use noisefloor_ptwne::{Ptwne, RenderOptions};
use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

/// Triangles that are leaves, and edge of the picture in pixels.
const LEAVES: usize = 3000;
const EDGE: usize = 256;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder, trees, rest @ ..] = args.as_slice() else {
        return Err("forest FOLDER TREES [SPP]".into());
    };
    let (folder, trees) = (Path::new(folder), trees.parse()?);
    let spp = rest.first().map_or(Ok(4), |spp| spp.parse())?;
    std::fs::write(folder.join("tree.ply"), tree()?)?;
    std::fs::write(folder.join("forest.xml"), mitsuba(&placed(trees))?)?;

    std::fs::write(folder.join("forest.pbrt"), pbrt(&placed(trees))?)?;
    // The one that takes less first: only peaks are known
    for file in ["forest.pbrt", "forest.xml"] {
        measure(&folder.join(file), spp)?;
    }
    Ok(())
}

fn measure(path: &Path, spp: u64) -> Result<(), Box<dyn Error>> {
    let start = Instant::now();
    let scene = noisefloor_scenefile::load(path)?.scene;
    let seconds = start.elapsed().as_secs_f64();
    println!("{}: {} surfaces, {} instances", path.display(), scene.surfaces(), scene.instances());
    println!("  loaded in {seconds:.2} s, {} kB of geometry", scene.geometry_bytes() / 1000);
    println!("  peak memory so far {} kB", peak());

    let mut source = Ptwne::new(scene, EDGE, EDGE, RenderOptions::default())?;
    let requests: Vec<Request> =
        TileGrid::new(EDGE, EDGE, 64)?.tiles().map(|tile| Request::new(tile, 0, spp)).collect();
    let start = Instant::now();
    let batches = source.sample(&requests)?;
    let seconds = start.elapsed().as_secs_f64() / spp as f64;
    let sum: f64 = batches.iter().flat_map(|batch| batch.mean.as_flattened()).map(|x| f64::from(*x)).sum();
    println!("  {seconds:.3} s for each sample per pixel of {EDGE}×{EDGE} pixels");
    println!("  mean radiance {:.4}", sum / (3 * EDGE * EDGE) as f64);
    Ok(())
}

/// The most memory that the process has had, in kB; 0 where Linux does not say.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    line.trim().trim_end_matches(" kB").parse().unwrap_or(0)
}

/// A tree of height 6: a trunk of eight sides, and leaves in an ellipsoid.
fn tree() -> Result<String, std::fmt::Error> {
    let mut random = fastrand::Rng::with_seed(1);
    let (mut vertices, mut faces) = (String::new(), String::new());
    for i in 0..8 {
        let (sin, cos) = (i as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
        writeln!(vertices, "{} 0 {}\n{} 4 {}", 0.25 * cos, 0.25 * sin, 0.1 * cos, 0.1 * sin)?;
        let (a, b) = (2 * i, 2 * ((i + 1) % 8));
        writeln!(faces, "3 {a} {} {b}\n3 {b} {} {}", a + 1, a + 1, b + 1)?;
    }
    for leaf in 0..LEAVES {
        let mut one = || 2.0 * random.f32() - 1.0;
        let at = loop {
            let p = [one(), one(), one()];
            if p.iter().map(|x| x * x).sum::<f32>() < 1.0 {
                break [1.6 * p[0], 4.0 + 2.0 * p[1], 1.6 * p[2]];
            }
        };
        for _ in 0..3 {
            writeln!(vertices, "{} {} {}", at[0] + 0.2 * one(), at[1] + 0.2 * one(), at[2] + 0.2 * one())?;
        }
        let first = 16 + 3 * leaf;
        writeln!(faces, "3 {first} {} {}", first + 1, first + 2)?;
    }
    Ok(format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}",
        16 + 3 * LEAVES,
        16 + LEAVES
    ))
}

/// A tree in its place.
struct Placed {
    x: f32,
    z: f32,
    /// In degrees around y.
    angle: f32,
    size: f32,
}

/// That many trees, four units apart on average.
fn placed(trees: usize) -> Vec<Placed> {
    let mut random = fastrand::Rng::with_seed(2);
    let edge = 4.0 * (trees as f32).sqrt();
    let mut one = || random.f32();
    let mut tree = |_| {
        let (x, z) = (edge * (one() - 0.5), edge * (one() - 0.5));
        Placed { x, z, angle: 360.0 * one(), size: 0.7 + 0.6 * one() }
    };
    (0..trees).map(&mut tree).collect()
}

fn mitsuba(trees: &[Placed]) -> Result<String, std::fmt::Error> {
    let edge = 4.0 * (trees.len() as f32).sqrt();
    let mut text = format!(
        r#"<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="6"/></integrator>
<sensor type="perspective"><float name="fov" value="45"/><transform name="to_world">
<lookat origin="0, {high}, {back}" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="{EDGE}"/><integer name="height" value="{EDGE}"/>
<rfilter type="box"/></film></sensor>
<emitter type="constant"><rgb name="radiance" value="0.5, 0.6, 0.8"/></emitter>
<emitter type="directional"><vector name="direction" value="-0.4, -0.8, -0.3"/>
<rgb name="irradiance" value="3, 2.8, 2.5"/></emitter>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="{edge}"/></transform>
<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.3, 0.25, 0.2"/></bsdf></bsdf></shape>
<shape type="shapegroup" id="tree"><shape type="ply"><string name="filename" value="tree.ply"/>
<boolean name="face_normals" value="true"/>
<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.2, 0.4, 0.15"/></bsdf></bsdf>
</shape></shape>
"#,
        high = 0.3 * edge + 4.0,
        back = 0.6 * edge + 8.0,
    );
    for Placed { x, z, angle, size } in trees {
        writeln!(
            text,
            r#"<shape type="instance"><ref id="tree"/><transform name="to_world"><rotate y="1" angle="{angle}"/>
<scale value="{size}"/><translate x="{x}" z="{z}"/></transform></shape>"#
        )?;
    }
    Ok(text + "</scene>\n")
}

fn pbrt(trees: &[Placed]) -> Result<String, std::fmt::Error> {
    let edge = 4.0 * (trees.len() as f32).sqrt();
    let mut text = format!(
        r#"LookAt 0 {high} {back} 0 0 0 0 1 0 Camera "perspective" "float fov" 45
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.8]
LightSource "distant" "point3 from" [0.4 0.8 0.3] "point3 to" [0 0 0] "rgb L" [3 2.8 2.5]
Material "diffuse" "rgb reflectance" [0.3 0.25 0.2]
Shape "bilinearmesh" "point3 P" [-{edge} 0 {edge} {edge} 0 {edge} -{edge} 0 -{edge} {edge} 0 -{edge}]
ObjectBegin "tree" Material "diffuse" "rgb reflectance" [0.2 0.4 0.15]
Shape "plymesh" "string filename" "tree.ply" ObjectEnd
"#,
        high = 0.3 * edge + 4.0,
        back = 0.6 * edge + 8.0,
    );
    for Placed { x, z, angle, size } in trees {
        writeln!(
            text,
            r#"AttributeBegin Translate {x} 0 {z} Scale {size} {size} {size} Rotate {angle} 0 1 0
ObjectInstance "tree" AttributeEnd"#
        )?;
    }
    Ok(text)
}
