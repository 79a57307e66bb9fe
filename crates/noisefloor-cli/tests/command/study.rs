use crate::kit::{column, fail, run, succeed, text};
use noisefloor_denoise::OIDN;
use noisefloor_image::{Picture, read_picture};
use noisefloor_sidecar::find;
use noisefloor_testkit::{Requirement, require};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const LEVELS: [u64; 5] = [1, 2, 4, 8, 16];

/// A stack of 32×32 pixels, and what else is asked for.
fn stack(out: &Path, more: &[&str]) -> Vec<String> {
    let levels = LEVELS.map(|level| level.to_string()).join(",");
    let args = ["study", "stack", "cornell-box", "--size", "32x32", "--levels", &levels, "--out", text(out)];
    args.iter().chain(more).map(|&arg| arg.to_owned()).collect()
}

fn level(folder: &Path, spp: u64) -> Vec<[f32; 3]> {
    match read_picture(folder.join(format!("{spp:05}.exr"))).unwrap() {
        Picture::Linear(image) if (image.width, image.height) == (32, 32) => image.pixels,
        other => panic!("{spp}: {other:?}"),
    }
}

/// Every level is what `render` makes of as many samples.
#[test]
fn a_stack_holds_what_renders_hold() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("stack");
    assert!(succeed(&stack(&out, &[])).contains("written to"));
    // The levels, and the hidden lock
    assert_eq!(fs::read_dir(&out).unwrap().count(), LEVELS.len() + 1);
    let rendered = folder.path().join("render");
    let render = ["render", "cornell-box", "--size", "32x32", "--tile", "32", "--criterion", "spp:8"];
    // Levels between those rendered are synthesised, which takes noise that falls as that of independent samples
    let more = ["--sampler", "independent", "--max-spp", "8", "--quiet", "--out", text(&rendered)];
    succeed(&[&render[..], &more].concat());
    let Picture::Linear(image) = read_picture(rendered.join("image.exr")).unwrap() else {
        panic!("an EXR is linear")
    };
    let differ = image.pixels.iter().zip(level(&out, 8)).flat_map(|(a, b)| [0, 1, 2].map(|c| (a[c], b[c])));
    for (a, b) in differ {
        assert!((a - b).abs() <= 1e-5 * a.abs().max(1.0), "{a} {b}");
    }
    let other = folder.path().join("other");
    fail(&stack(&other, &["--levels", "4,4"]), &["at least two levels"]);
}

/// All levels but the reference pass through the program; what it does wrong is said, and leaves no level
/// that did not pass.
#[test]
#[cfg(unix)]
fn levels_are_denoised_by_any_program() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, denoised, failed] = ["plain", "denoised", "failed"].map(|name| folder.path().join(name));
    succeed(&stack(&plain, &[]));
    // It is given the picture of 1 sample first, and answers with that of 16 always
    let clean = plain.join("00016.exr");
    let program =
        format!("sh -c 'test -s \"$1\" && /bin/cp \"$0\" \"$2.exr\"' '{}' {{in}} {{out}}", text(&clean));
    succeed(&stack(&denoised, &["--denoise", &program]));
    for spp in LEVELS {
        assert_eq!(level(&denoised, spp), level(&plain, 16), "{spp}");
    }
    let copy = "sh -c '/bin/cp \"$0\" \"$1.exr\"' {in} {out}";
    let copied = folder.path().join("copied");
    succeed(&stack(&copied, &["--denoise", copy]));
    for spp in LEVELS {
        assert_eq!(level(&copied, spp), level(&plain, spp), "{spp}");
    }

    let small = folder.path().join("small");
    let mut args = stack(&small, &[]);
    args[4] = "16x16".into();
    succeed(&args);
    let resized =
        format!("sh -c '/bin/cp \"$0\" \"$1.exr\"' '{}' {{out}} {{in}}", text(&small.join("00001.exr")));
    for (program, words) in [
        ("cp {in} out.exr", &["{out} is missing"][..]),
        ("cp {in} {out}.exr {spp}", &["{spp} is not a placeholder", "{in} {out}"]),
        ("sh -c 'echo no memory; exit 3' {in} {out}", &["exit status: 3", "no memory"]),
        ("sh -c : {in} {out}", &["it wrote no file"]),
        (resized.as_str(), &["16×16", "given one of 32×32"]),
    ] {
        fail(&stack(&failed, &["--denoise", program]), words);
    }
    // Nothing but the hidden lock
    let mut left = fs::read_dir(&failed).into_iter().flatten().map(|file| file.unwrap().file_name());
    assert!(left.all(|name| name == ".noisefloor.lock"));
}

/// The protocol for denoised pictures, rehearsed: a denoised stack, the study file of that page, simulated
/// observers, and their analysis.
#[test]
fn a_denoised_stack_goes_through_a_whole_study() {
    let folder = tempfile::tempdir().unwrap();
    let design = include_str!("../../../../docs/studies/denoised.toml");
    let file = folder.path().join("denoised.toml");
    fs::write(&file, design).unwrap();
    // Where nothing is rendered the file is still read, and names the folder that is missing
    fail(&["study", "simulate", text(&file)], &["stacks/denoised-cornell-box"]);
    if require(Requirement::Renderers, find(&OIDN)).is_none() {
        return;
    }
    let [plain, name] = ["plain", "stacks/denoised-cornell-box"].map(|name| folder.path().join(name));
    succeed(&stack(&plain, &[]));
    succeed(&stack(&name, &["--denoise", "oidn"]));
    let error = |folder: &Path, spp: u64| -> f32 {
        let pairs = level(folder, spp).into_iter().zip(level(&plain, 16));
        pairs.map(|(p, t)| (p[1].min(1.0) - t[1].min(1.0)).powi(2)).sum()
    };
    assert!(error(&name, 2) < 0.7 * error(&plain, 2), "{} {}", error(&name, 2), error(&plain, 2));
    assert_eq!(level(&name, 16), level(&plain, 16), "the reference is as rendered");

    fs::rename(&plain, folder.path().join("stacks/denoised-arcade")).unwrap();
    let said = succeed(&["study", "simulate", text(&file), "--observers", "2"]);
    assert!(said.contains("which should find:"), "{said}");
    let out = folder.path().join("out");
    let said = succeed(&["study", "analyse", text(&file), "--simulated", "--out", text(&out)]);
    assert!(said.contains("2 simulated observers") && said.contains("denoised-cornell-box"), "{said}");
}

/// A study of a stack just rendered, with simulated observers who have answered.
struct Answered {
    dir: TempDir,
    file: PathBuf,
}

impl Answered {
    fn new(observers: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        succeed(&stack(&dir.path().join("box"), &[]));
        let file = dir.path().join("study.toml");
        let design = "protocol = \"acquisition\"\ndatabase = \"answers.sqlite\"\ntile = 16\nrepeats = 1\n\
            [text.en]\ntitle = \"A box\"\nconsent = \"I take part.\"\n\
            [[stack]]\nname = \"box\"\nfolder = \"box\"\n";
        fs::write(&file, design).unwrap();
        let said = succeed(&["study", "simulate", text(&file), "--observers", observers]);
        assert!(said.contains("which should find:"), "{said}");
        Self { dir, file }
    }

    /// The table of all responses of simulated observers.
    fn responses(&self) -> PathBuf {
        let out = self.dir.path().join("data");
        succeed(&["study", "data", text(&self.file), "--simulated", "--out", text(&out)]);
        out.join("responses.csv")
    }
}

#[test]
fn links_are_printed_once_each() {
    let study = Answered::new("1");
    let url = "https://study.example.org/noise/";
    let print = || succeed(&["study", "links", text(&study.file), "--count", "3", "--url", url]);
    let said = print() + &print();
    let links: HashSet<&str> = said.lines().collect();
    assert_eq!((said.lines().count(), links.len()), (6, 6));
    assert!(links.iter().all(|link| link.starts_with("https://study.example.org/noise/?link=")), "{said}");
}

/// Raw data name every response and no return code, and leave simulated observers out unless asked for.
#[test]
fn data_are_written_for_others() {
    let study = Answered::new("3");
    let responses = study.responses();
    let participants: HashSet<String> = column(&responses, "participant").into_iter().collect();
    assert_eq!(participants.len(), 3);
    let out = study.dir.path().join("data");
    for name in ["dataset_description.json", "participants.tsv", "design.json"] {
        assert!(out.join(name).exists(), "{name}");
    }
    let people = study.dir.path().join("people");
    fail(&["study", "data", text(&study.file), "--out", text(&people)], &["no answers"]);
}

/// What was erased since the copy, or lost, is there again.
#[test]
fn a_copy_is_restored_as_the_guide_says() {
    let study = Answered::new("2");
    let before = fs::read(study.responses()).unwrap();
    let copy = study.dir.path().join("copy.sqlite");
    succeed(&["study", "backup", text(&study.file), text(&copy)]);
    fail(&["study", "backup", text(&study.file), text(&copy)], &["copy.sqlite"]);
    succeed(&["study", "simulate", text(&study.file), "--observers", "1", "--seed", "9"]);
    assert_ne!(fs::read(study.responses()).unwrap(), before);

    for name in ["answers.sqlite", "answers.sqlite-wal", "answers.sqlite-shm"] {
        drop(fs::remove_file(study.dir.path().join(name)));
    }
    fs::rename(&copy, study.dir.path().join("answers.sqlite")).unwrap();
    assert_eq!(fs::read(study.responses()).unwrap(), before);
    let elsewhere = study.dir.path().join("no/such/folder/copy.sqlite");
    assert!(!run(&["study", "backup", text(&study.file), text(&elsewhere)]).status.success());
}
