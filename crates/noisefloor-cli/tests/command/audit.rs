use crate::kit::{fail, json, run, said_json, stderr, succeed, text, words};
use noisefloor_image::{Picture, read_exr, read_picture};
use serde_json::Value;
use std::path::Path;
use tempfile::tempdir;

/// A Cornell box of four tiles with this many samples, and what is typed besides.
fn boxed<'a>(out: &'a Path, criterion: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let small = ["render", "--size", "64x64", "--tile", "32", "--min-spp", "4", "--criterion", criterion];
    [&small[..], &["--out", text(out)], more].concat()
}

/// A picture that was stopped far too early is found out, at once and afterwards.
#[test]
fn a_picture_stopped_too_early_fails_and_a_converged_one_passes() {
    let folder = tempdir().unwrap();
    let early = folder.path().join("early");
    let output = run(&boxed(&early, "spp:4", &["--audit", "8", "--check"]));
    let said = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!(output.status.code(), Some(3), "{said}{}", stderr(&output));
    assert!(
        said.contains("0 of 4 places keep the limit of 0.5 JOD") && said.contains("at least 0 %"),
        "{said}"
    );
    assert!(stderr(&output).contains("warning: 4 of 4 places have lost more"), "{}", stderr(&output));
    // Nobody has asked for the exit code; and a limit of one's own
    assert_eq!(run(&["audit", text(&early)]).status.code(), Some(0));
    assert!(succeed(&["audit", text(&early), "--check", "--lost", "5"]).contains("4 of 4 places"));

    // The report has the numbers, and keeps all others; the same seed draws the same places
    let report = json(&early.join("report.json"));
    assert_eq!((report["audit"]["kept"].as_u64(), report["samples"].as_u64()), (Some(4), Some(4 * 64 * 64)));
    let audit = |seed: &str| -> Value {
        let typed = ["audit", text(&early), "--places", "2", "--seed", seed, "--json"];
        let mut audit: Value = said_json(&typed);
        audit["seconds"].take();
        audit["share_of_render"].take();
        audit
    };
    assert_eq!(audit("5"), audit("5"));
    assert_ne!(audit("5")["places"][0]["jods_lost"], audit("6")["places"][0]["jods_lost"]);

    let converged = folder.path().join("converged");
    let said = succeed(&boxed(&converged, "spp:300", &["--audit", "2", "--check"]));
    assert!(said.contains("2 of 2 places keep the limit") && said.contains("at least 22 %"), "{said}");
}

/// What is audited is the file that people look at.
#[test]
fn the_picture_in_the_folder_is_looked_at() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("out");
    succeed(&boxed(&out, "spp:64", &["--quiet"]));
    let lost = |limit: &str| {
        let audit = said_json(&["audit", text(&out), "--json", "--lost", limit]);
        assert_eq!(audit["limit"].as_f64(), limit.parse().ok());
        audit["worst"].as_f64().unwrap()
    };
    let before = lost("1");
    assert!((0.1..3.0).contains(&before), "{before}");
    // Whoever paints over a picture has lost more than noise
    let path = out.join("image.exr");
    let mut image = read_exr(&path).unwrap();
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        *pixel = pixel.map(|c| c * if i / 4 % 2 == 0 { 1.5 } else { 0.5 });
    }
    let layers = noisefloor_image::RenderLayers::rgb(64, 64, &image.pixels);
    noisefloor_image::write_exr(&path, &layers).unwrap();
    assert!(matches!(read_picture(&path), Ok(Picture::Linear(_))));
    assert!(lost("1") > 2.0 * before);
}

#[test]
fn what_cannot_be_audited_says_why() {
    let folder = tempdir().unwrap();
    let (empty, out, stack) =
        (folder.path().join("empty"), folder.path().join("out"), folder.path().join("stack"));
    std::fs::create_dir(&empty).unwrap();
    fail(&["audit", text(&empty)], &["empty", "holds no render"]);
    assert!(std::fs::read_dir(&empty).unwrap().next().is_none());
    // Tiles that were cut short promise nothing
    succeed(&words(&format!("render --size 32x32 --tile 32 --max-spp 16 --quiet --out {}", text(&out))));
    fail(&["audit", text(&out)], &["no tile has stopped for its noise"]);
    // A tile that the picture does not have
    let stops = std::fs::read_to_string(out.join("stops.csv")).unwrap();
    std::fs::write(out.join("stops.csv"), stops.replace("\n0,", "\n9000,")).unwrap();
    fail(&["audit", text(&out)], &["stops.csv is not as the render wrote it"]);
    // Pictures that are played back have no other samples
    std::fs::create_dir(&stack).unwrap();
    for seed in 0..2 {
        let name = format!("batch_{:05}_{:05}.exr", 4 * seed, 4 * seed + 4);
        crate::kit::grey_exr(&stack.join(name), (32, 32), seed, 0.4);
    }
    let played = folder.path().join("played");
    succeed(&words(&format!(
        "render --source exr {} --tile 32 --criterion spp:8 --min-spp 4 --quiet --out {}",
        text(&stack),
        text(&played)
    )));
    fail(&["audit", text(&played)], &["played back"]);
}
