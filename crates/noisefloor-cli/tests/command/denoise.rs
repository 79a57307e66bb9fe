use crate::kit::{FILES, column, fail, json, run, stderr, succeed, text, tiny};
use noisefloor_denoise::OIDN;
use noisefloor_image::read_exr;
use noisefloor_sidecar::find;
use noisefloor_testkit::{Requirement, require};
use tempfile::tempdir;

#[test]
fn options_that_have_no_say_are_refused() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    for more in [
        &["--denoise", "oidn", "--model", "m.nfm"][..],
        &["--denoise", "oidn", "--criterion", "spp:100"],
        &["--denoise", "blur"],
        &["--lost", "0.1"],
        &["--denoise", "oidn", "--lost", "0"],
    ] {
        fail(&tiny(out, more), &["--"]);
    }
}

#[test]
fn without_the_denoiser_it_says_how_to_install_it() {
    let folder = tempdir().unwrap();
    let mut command = crate::kit::command(&tiny(text(folder.path()), &["--denoise", "oidn"]));
    command.env("XDG_CACHE_HOME", folder.path()).env_remove(OIDN.variable());
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = stderr(&output);
    assert!(said.contains("doctor --install oidn") && said.lines().count() == 1, "{said}");
}

#[test]
fn the_denoised_picture_and_its_error_are_written() {
    if require(Requirement::Renderers, find(&OIDN)).is_none() {
        return;
    }
    let folder = tempdir().unwrap();
    let (out, noisy) = (folder.path().join("out"), folder.path().join("noisy"));
    succeed(&tiny(text(&out), &["--denoise", "oidn", "--lost", "0.5"]));
    for file in FILES.iter().chain(&["image-denoised.exr", "image-denoised.png", "denoised-error.png"]) {
        assert!(out.join(file).exists(), "{file}");
    }
    let spp: Vec<u64> = column(&out.join("stops.csv"), "spp").iter().map(|n| n.parse().unwrap()).collect();
    assert!(spp.iter().all(|n| [16, 32, 48, 64, 96, 144, 200].contains(n)), "{spp:?}");
    let report = &json(&out.join("report.json"))["denoised"];
    assert!(report["denoiser"].as_str().unwrap().contains("Open Image Denoise"));
    assert!(report["verdicts"].as_u64() > Some(0) && report["seconds"].as_f64() > Some(0.0));
    assert!(report["spp_without"].as_f64().unwrap() > *spp.iter().max().unwrap() as f64 / 4.0);

    // It is nearer to a converged picture than what it was made from
    let many = ["render", "--size", "64x64", "--criterion", "spp:2000", "--seed", "5", "--quiet", "--out"];
    succeed(&many.into_iter().chain([text(&noisy)]).collect::<Vec<_>>());
    let read = |path: &std::path::Path, name: &str| read_exr(path.join(name)).unwrap().pixels;
    let truth = read(&noisy, "image.exr");
    let error = |name: &str| -> f32 {
        let squares =
            read(&out, name).into_iter().zip(&truth).map(|(p, t)| (p[1].min(4.0) - t[1].min(4.0)).powi(2));
        squares.sum()
    };
    let (denoised, rendered) = (error("image-denoised.exr"), error("image.exr"));
    assert!(denoised < 0.7 * rendered, "{denoised} and {rendered}");

    let said = run(&["doctor"]);
    assert!(String::from_utf8(said.stdout).unwrap().lines().any(|line| line.starts_with("oidn ")));
}
