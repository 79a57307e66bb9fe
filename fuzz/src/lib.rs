//! Fuzz targets, one for each parser of bytes from outside.
//!
//! A target takes any bytes and must return: no panic, no abort, no endless loop, no memory beyond what the
//! bytes pay for. Checksums and lengths around the bytes are repaired first, so that mutants get past them:
//! `containers`, `shards` and `pictures` do so. Every target has seeds, small valid inputs.
//!
//! - `cargo test -p noisefloor-fuzz` runs the seeds, all inputs that ever failed (`found/TARGET/*`), and a
//!   half a second of mutants of each target. It needs nothing but Rust; CI does it with a tenth of a second.
//!   `NOISEFLOOR_FUZZ_SECONDS=200` sets another time.
//! - `fuzz/run TARGET` runs libFuzzer, which is led by coverage, on stable Rust (it needs a C++ compiler).
//!   `fuzz/run --all SECONDS` runs all targets in turn.

mod containers;
mod files;
mod pictures;
mod scenes;
mod shards;
mod texts;

/// A parser to fuzz.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name on the command line, and of its folder of inputs.
    pub name: &'static str,
    /// Parses the bytes, uses what it gets a little, and says whether they were valid.
    pub run: fn(&[u8]) -> bool,
    /// Small inputs, of which the first is valid at least.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All targets.
pub const TARGETS: &[Target] = &[
    Target { name: "model", run: containers::model, seeds: containers::model_seeds },
    Target { name: "checkpoint", run: containers::checkpoint, seeds: containers::checkpoint_seeds },
    Target { name: "shard", run: shards::shard, seeds: shards::shard_seeds },
    Target { name: "exr", run: pictures::exr, seeds: pictures::exr_seeds },
    Target { name: "pfm", run: pictures::pfm, seeds: pictures::pfm_seeds },
    Target { name: "png", run: pictures::png, seeds: pictures::png_seeds },
    Target { name: "gltf", run: scenes::gltf, seeds: scenes::gltf_seeds },
    Target { name: "glb", run: scenes::glb, seeds: scenes::glb_seeds },
    Target { name: "xml", run: scenes::xml, seeds: scenes::xml_seeds },
    Target { name: "pbrt", run: scenes::pbrt, seeds: scenes::pbrt_seeds },
    Target { name: "spectrum", run: scenes::spectrum, seeds: scenes::spectrum_seeds },
    Target { name: "texture", run: scenes::texture, seeds: scenes::texture_seeds },
    Target { name: "ply", run: scenes::ply, seeds: scenes::ply_seeds },
    Target { name: "obj", run: scenes::obj, seeds: scenes::obj_seeds },
    Target { name: "serialized", run: scenes::serialized, seeds: scenes::serialized_seeds },
    Target { name: "table", run: texts::table, seeds: texts::table_seeds },
    Target { name: "cube", run: texts::cube, seeds: texts::cube_seeds },
    Target { name: "wire", run: texts::wire, seeds: texts::wire_seeds },
    Target { name: "eyes", run: texts::eyes, seeds: texts::eyes_seeds },
    Target { name: "study", run: texts::study, seeds: texts::study_seeds },
];

/// The target of a name.
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}
