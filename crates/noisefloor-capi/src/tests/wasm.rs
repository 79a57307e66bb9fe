//! The package for JavaScript, whose module `js/build.sh` has built: its own tests, what it makes of
//! sessions that ran here, and the example in a browser.

use super::*;
use noisefloor_testkit::{Noise, Requirement, require};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

fn js() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("js")
}

/// Node and the module, or which is missing.
fn package() -> Option<()> {
    let runs = Command::new("node").arg("--version").output().is_ok_and(|output| output.status.success());
    let found = if !runs {
        Err("no node runs")
    } else if !js().join("noisefloor.wasm").exists() {
        Err("noisefloor.wasm is not built (crates/noisefloor-capi/js/build.sh)")
    } else {
        Ok(())
    };
    require(Requirement::Wasm, found)
}

/// Runs a file of tests, which must pass.
fn node(folder: &Path, file: &str, environment: &[(&str, &Path)]) -> String {
    let mut node = Command::new("node");
    node.args(["--expose-gc", "--test", "--test-reporter=spec", file]).current_dir(folder);
    let output = node.envs(environment.iter().copied()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{said}{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "the tests in JavaScript failed; what they said is above");
    said
}

#[test]
fn the_package_keeps_its_promises_in_node() {
    let Some(()) = package() else { return };
    node(&js(), "test/noisefloor.test.mjs", &[]);
    node(&js(), "test/tone.test.mjs", &[]);
    node(&js(), "test/background.test.mjs", &[]);
}

/// What a session was told, and what it said: sizes and options, then pushes (1), running means (2) and
/// verdicts (3).
struct Transcript(Vec<u8>);

impl Transcript {
    fn words(&mut self, words: &[u32]) {
        self.0.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    }

    fn text(&mut self, text: &str) {
        self.words(&[text.len() as u32]);
        self.0.extend(text.as_bytes());
    }

    fn floats(&mut self, floats: &[f32]) {
        self.words(&[floats.len() as u32]);
        self.0.extend(floats.iter().flat_map(|float| float.to_le_bytes()));
    }

    fn states(&mut self, states: &[NfTileState]) {
        for state in states {
            self.words(&[state.spp as u32, state.reason, state.probability.to_bits()]);
        }
    }
}

/// A session of random shape and options, with random light, pushed in random portions until it is done.
/// Its options are written as JavaScript has them.
fn record(seed: u64, transcript: &mut Transcript) {
    let mut noise = Noise::keyed(&[54, seed]);
    let mut between = |low: usize, high: usize| low + noise.below(high - low + 1);
    let (width, height, tile) = (between(20, 90), between(20, 90), between(16, 64) as u32);
    let (step, consecutive) = (between(2, 40) as u64, between(1, 2) as u32);
    let schedule = between(0, 2) as u32;
    let (min_spp, max_spp) = (between(20, 100) as u64, between(300, 900) as u64);
    let (srgb, running, holes) = (between(0, 1) == 1, between(0, 2) == 0, between(0, 3) == 0);
    let people = [0.5_f32, 0.75, 0.9375][between(0, 2)]; // the same in one precision and the other
    let audience_slope = [0.5, 1.0, 2.0][between(0, 2)];
    let viewing = [c"desk", c"phone", c"ppd=47,peak=300"][between(0, 2)];
    let exposure = [0.5_f32, 2.0][between(0, 1)];
    let params = NfParams {
        tile,
        schedule,
        step,
        min_spp,
        max_spp,
        consecutive,
        audience_slope,
        viewing: viewing.as_ptr(),
        tone_mapping: if srgb { NF_TONE_SRGB } else { NF_TONE_REINHARD },
        exposure: if srgb { exposure } else { 1.0 },
        ..NfParams::default()
    };
    let tone =
        if srgb { format!("{{\"curve\": \"linear\", \"exposure\": {exposure}}}") } else { "{}".into() };
    let schedule = ["every", "spaced", "growing"][schedule as usize];
    transcript.words(&[width as u32, height as u32]);
    transcript.text(&format!(
        "{{\"tile\": {tile}, \"schedule\": \"{schedule}\", \"step\": {step}, \"minSpp\": {min_spp}, \
          \"maxSpp\": {max_spp}, \"consecutive\": {consecutive}, \"people\": {people}, \"toneMapping\": {tone}, \
          \"audience\": {{\"slope\": {audience_slope}, \"offset\": 0}}, \"viewing\": {viewing:?}}}"
    ));

    // A slope of light with an edge in it, and noise of its own strength
    let (light, strength) = (0.1 + noise.uniform(), 0.2 + 2.0 * noise.uniform());
    let radiance = |x: usize, y: usize| {
        light * (0.2 + x as f64 / width as f64) * if (x + 2 * y) % 50 < 20 { 0.3 } else { 1.0 }
    };
    let (mut oracle, mut session) = (null_mut(), null_mut());
    // SAFETY: pointers to variables of this function, and handles that were just made.
    unsafe {
        ok(nf_oracle_bundled(people, &mut oracle));
        let made = nf_session_new(width, height, oracle, &params, &mut session);
        ok(made);
        nf_oracle_free(oracle);
    }
    let session = Handle(session);
    let mut sums = vec![(0, Vec::new()); states(&session).len()];
    while open(&session) > 0 {
        for NfRequest { tile, spp, .. } in requests(&session) {
            let spp = (spp / (1 + noise.below(3) as u64)).max(1);
            let mut mean = Vec::new();
            for pixel in 0..tile.width * tile.height {
                let (x, y) = (tile.x + pixel % tile.width, tile.y + pixel / tile.width);
                let hole = holes && noise.below(500) == 0;
                for _ in 0..3 {
                    let sample = radiance(x, y) * (1.0 + strength * noise.normal() / (spp as f64).sqrt());
                    mean.push(if hole { f32::NAN } else { sample.max(0.0) as f32 });
                }
            }
            let floats = mean.len();
            let status = if running && !holes {
                let (total, sum): &mut (u64, Vec<f64>) = &mut sums[tile.index];
                *total += spp;
                sum.resize(floats, 0.0);
                sum.iter_mut().zip(&mean).for_each(|(sum, &new)| *sum += f64::from(new) * spp as f64);
                let mean: Vec<f32> = sum.iter().map(|sum| (sum / *total as f64) as f32).collect();
                transcript.words(&[2, tile.index as u32, *total as u32]);
                transcript.floats(&mean);
                // SAFETY: a living handle, and an array of the size given.
                unsafe { nf_session_push_running(session.0, tile.index, *total, mean.as_ptr(), floats) }
            } else {
                transcript.words(&[1, tile.index as u32, spp as u32]);
                transcript.floats(&mean);
                // SAFETY: as above.
                unsafe { nf_session_push(session.0, tile.index, spp, mean.as_ptr(), floats) }
            };
            ok(status);
        }
        // SAFETY: a living handle, and NULL where it is allowed.
        ok(unsafe { nf_session_judge(session.0, null_mut()) });
        transcript.words(&[3]);
        transcript.states(&states(&session));
    }
    transcript.words(&[0]);
}

/// Logarithms come from another library there, so P may differ by 10⁻⁵. With a P that near to the threshold
/// a stop could differ, too; none of these seeds has one.
#[test]
fn random_sessions_stop_in_node_where_they_stop_here() {
    let Some(()) = package() else { return };
    let mut transcript = Transcript(Vec::new());
    (0..40).for_each(|seed| record(seed, &mut transcript));
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(&transcript.0).unwrap();
    let said = node(&js(), "test/native.test.mjs", &[("TRANSCRIPT", file.path())]);
    assert!(said.contains("40 sessions"), "{said}");
}

/// three.js and three-gpu-pathtracer from npm, in Chromium, without a GPU.
#[test]
fn the_example_stops_in_a_browser() {
    let Some(()) = package() else { return };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/10-three-gpu-pathtracer");
    let found = if !Path::new("/usr/bin/chromium").exists() {
        Err("no /usr/bin/chromium (apt-get install chromium)".to_owned())
    } else if !folder.join("node_modules").exists() {
        Err("no packages (npm ci --ignore-scripts in examples/10-three-gpu-pathtracer)".to_owned())
    } else {
        Ok(())
    };
    let Some(()) = require(Requirement::Browser, found) else { return };
    node(&folder, "test.mjs", &[]);
}
