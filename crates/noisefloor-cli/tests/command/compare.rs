use crate::kit::{column, fail, json, succeed, text, words};
use noisefloor_denoise::OIDN;
use noisefloor_sidecar::find;
use noisefloor_testkit::{Requirement, require};
use tempfile::tempdir;

fn small<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let small = "compare cornell-box --size 64x64 --tile 32 --max-spp 200 --reference-spp 256 --out";
    [words(small).as_slice(), &[out], more].concat()
}

/// Criteria watch one run: a fixed number of samples is a point of the uniform curve, and what stops
/// earlier costs less.
#[test]
fn a_fixed_number_of_samples_lies_on_the_curve_of_uniform_sampling() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    let said = succeed(&small(out, &["--criteria", "spp:50,spp:200,oracle,cycles:1"]));
    assert!(said.contains("cornell-box") && said.contains("index.html"), "{said}");
    let scene = folder.path().join("cornell-box");
    let files = "curve.csv tiles.csv by-samples.svg by-seconds.svg reference.exr";
    let pictures =
        "reference.json reference.png spp-50.png oracle.png cycles-1.png crop-worst.png crop-disputed.png";
    for file in [words(files), words(pictures)].concat() {
        assert!(scene.join(file).is_file(), "{file}");
    }

    let numbers = |file: &str, name: &str| -> Vec<f64> {
        column(&folder.path().join(file), name).iter().map(|n| n.parse().unwrap()).collect()
    };
    let (spp, error) = (numbers("cornell-box/curve.csv", "spp"), numbers("cornell-box/curve.csv", "rel_mse"));
    assert_eq!((spp[0], spp.last()), (50.0, Some(&200.0)));
    // Of independent samples, with a reference that has noise of its own: a quarter, about.
    assert!(error[0] / error[error.len() - 1] > 2.0, "{error:?}");
    let runs = |name: &str| numbers("runs.csv", name);
    // A verdict comes after a whole batch: 100 samples.
    assert_eq!((runs("spp_mean")[0], runs("spp_mean")[1]), (100.0, 200.0));
    assert_eq!((runs("spp_most")[1], runs("tiles_converged")[1]), (200.0, 4.0));
    let at = |samples: f64| error[spp.iter().position(|s| *s == samples).unwrap()];
    assert_eq!((runs("rel_mse")[0], runs("rel_mse")[1]), (at(100.0), at(200.0)));
    let seconds = runs("source_seconds");
    assert!((seconds[1] / seconds[0] - 2.0).abs() < 1e-9, "{seconds:?}");
    // By definition, uniform sampling is as good as uniform sampling.
    let ratio = |name: &str| column(&folder.path().join("runs.csv"), name)[0].parse::<f64>().unwrap();
    assert!((ratio("uniform_over_this") - 1.0).abs() < 1e-9);
    // In time, all but for what the criterion took
    let share = seconds[0] / (seconds[0] + ratio("criterion_seconds"));
    assert!((ratio("uniform_over_this_seconds") / share - 1.0).abs() < 1e-9, "{share}");

    // One file that needs no other, and asks nobody for anything.
    let page = std::fs::read_to_string(folder.path().join("index.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && page.contains("<svg") && page.contains("oracle"));
    assert!(!page.contains("src=\"http") && !page.contains("href=") && !page.contains("<script"));
}

/// The oracle with options of `render` is what that would have rendered.
#[test]
fn an_oracle_that_renders_by_itself_is_that_of_a_render() {
    let folder = tempdir().unwrap();
    let spec = "oracle:schedule=spaced:batch=40:min-spp=40";
    succeed(&small(text(folder.path()), &["--criteria", &format!("oracle,{spec},spp:200"), "--batch", "40"]));
    let runs = |name: &str| column(&folder.path().join("runs.csv"), name);
    assert_eq!(runs("criterion")[1], spec);
    let number = |name: &str, row: usize| runs(name)[row].parse::<f64>().unwrap();
    let out = folder.path().join("render");
    let same =
        ["render", "cornell-box", "--size", "64x64", "--tile", "32", "--max-spp", "200", "--batch", "40"];
    let more = ["--min-spp", "40", "--key", "0.18", "--out", text(&out), "--quiet"];
    succeed(&[&same[..], &more].concat());
    let rendered = json(&out.join("report.json"))["samples"].as_f64().unwrap() / 4096.0;
    // The same source, seed and verdicts: the very samples of the render
    assert_eq!(number("spp_mean", 1), rendered, "{:?}", runs("spp_mean"));
    assert!(number("source_seconds", 1) > 0.0);
}

/// The reference is kept and used again; with more samples wanted, it is rendered on to what one go would
/// have given.
#[test]
fn a_reference_is_rendered_on() {
    let folder = tempdir().unwrap();
    let render = |out: &str, spp: &str| {
        let out = folder.path().join(out);
        let small =
            ["compare", "cornell-box", "--size", "32x32", "--tile", "32", "--max-spp", "20", "--quiet"];
        let more = ["--criteria", "spp:20", "--reference-spp", spp, "--force", "--out", text(&out)];
        succeed(&[&small[..], &more].concat());
        let image = noisefloor_image::read_exr(out.join("cornell-box/reference.exr")).unwrap();
        (image.pixels, json(&out.join("cornell-box/reference.json"))["spp"].as_u64())
    };
    let first = render("a", "128");
    assert_eq!(first.1, Some(128));
    assert!(render("a", "64") == first, "more samples are there than are wanted");
    let (on, spp) = render("a", "256");
    assert_eq!(spp, Some(256));
    let at_once = render("b", "256").0;
    for (a, b) in on.iter().flatten().zip(at_once.iter().flatten()) {
        assert!((a - b).abs() <= 1e-6 * b.abs().max(1e-3), "{a} {b}");
    }
}

#[test]
fn what_is_wrong_is_said_before_anything_is_rendered() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    fail(&small(out, &["--criteria", "cycles:0"]), &["cycles", "above 0"]);
    fail(&small(out, &["--criteria", "magic"]), &["magic", "dammertz"]);
    fail(&small(out, &["--batch", "1"]), &["--batch", "2"]);
    fail(&small(out, &["--criteria", "oracle:often"]), &["often", "batch=100"]);
    fail(&small(out, &["glass-spheres", "--reference", "a.exr"]), &["--reference", "2"]);
    fail(&small(out, &["--reference", "nowhere.exr"]), &["nowhere.exr"]);
    assert!(!folder.path().join("cornell-box/reference.exr").exists());
}

/// With a denoiser, every picture is looked at denoised, too, and there is a criterion on denoised halves.
#[test]
fn pictures_are_compared_denoised_too() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    fail(&small(out, &["--criteria", "denoised:0.3"]), &["denoised:0.3 needs --denoise oidn"]);
    if require(Requirement::Renderers, find(&OIDN)).is_none() {
        return;
    }
    fail(&small(out, &["--denoise", "oidn", "--criteria", "denoised:-1"]), &["denoised:-1"]);
    let job =
        ["compare", "cornell-box", "--size", "64x64", "--tile", "32", "--max-spp", "200", "--batch", "20"];
    let more =
        ["--reference-spp", "800", "--denoise", "oidn", "--criteria", "spp:20,denoised:1", "--out", out];
    let said = succeed(&[&job[..], &more].concat());
    assert!(said.lines().filter(|line| line.contains("denoised: JOD")).count() == 2, "{said}");
    let numbers = |file: &str, name: &str| -> Vec<f64> {
        column(&folder.path().join(file), name).iter().map(|n| n.parse().unwrap()).collect()
    };
    let runs = |name: &str| numbers("runs.csv", name);
    let (noisy, denoised) = (runs("cvvdp_jod_worst"), runs("denoised_jod_worst"));
    assert!(denoised[0] > noisy[0] + 0.2, "{denoised:?} after {noisy:?}");
    assert!(runs("denoised_seconds").iter().zip(runs("source_seconds")).all(|(all, source)| *all > source));
    let curve = |name: &str| numbers("cornell-box/curve.csv", name);
    let at = curve("spp").iter().position(|&spp| spp == 20.0).unwrap();
    // A film with halves rounds otherwise than one without
    let on_curve = curve("denoised_jod_worst")[at];
    assert!((on_curve - denoised[0]).abs() < 1e-3, "spp:20 lies on the curve: {on_curve}, {denoised:?}");
    let page = std::fs::read_to_string(folder.path().join("index.html")).unwrap();
    assert!(page.contains("Nobody has been asked about denoised pictures"));
}
