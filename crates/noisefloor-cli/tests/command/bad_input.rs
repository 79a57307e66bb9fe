use crate::kit::{FILES, fail, grey_exr, succeed, text, tiny};
use std::path::Path;
use tempfile::{TempDir, tempdir};

/// A folder with pictures, right and wrong.
struct Case {
    folder: TempDir,
}

impl Case {
    fn new() -> Self {
        let case = Self { folder: tempdir().unwrap() };
        grey_exr(&case.path("a.exr"), (32, 32), 1, 0.4);
        grey_exr(&case.path("b.exr"), (32, 32), 2, 0.4);
        grey_exr(&case.path("small.exr"), (32, 16), 3, 0.4);
        grey_exr(&case.path("nan.exr"), (32, 32), 4, f32::NAN);
        std::fs::write(case.path("text.exr"), "not a picture\n").unwrap();
        case
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }

    /// Judges one picture against another, which must fail.
    fn judge(&self, image: &str, against: &str, more: &[&str], words: &[&str]) {
        let (image, against) = (self.path(image), self.path(against));
        let mut args = vec!["judge", text(&image), "--against", text(&against), "--tile", "32"];
        args.extend(more);
        fail(&args, words);
    }
}

const SPP: [&str; 4] = ["--spp", "16", "--spp", "16"];

#[test]
fn pictures() {
    let case = Case::new();
    case.judge("a.exr", "absent.exr", &SPP, &["absent.exr"]);
    case.judge("absent.exr", "a.exr", &SPP, &["absent.exr"]);
    case.judge("text.exr", "b.exr", &SPP, &["text.exr", "EXR"]);
    case.judge("nan.exr", "b.exr", &SPP, &["nan.exr", "(0, 0)", "finite"]);
    case.judge("a.exr", "nan.exr", &SPP, &["nan.exr", "finite"]);
    case.judge("a.exr", "small.exr", &SPP, &["small.exr", "32×32", "32×16"]);
    case.judge("a.exr", "a.exr", &SPP, &["identical"]);
    case.judge("a.exr", ".", &SPP, &["folder"]);
    case.judge("a.exr", "b.exr", &["--spp", "0", "--spp", "16"], &["a.exr", "positive", "0"]);
    case.judge("a.exr", "b.exr", &["--spp", "16", "--spp", "nan"], &["b.exr", "positive"]);
    case.judge("a.exr", "b.exr", &["--spp", "16"], &["--spp", "1 given for 2"]);
    case.judge("a.exr", "b.exr", &["--spp", "16", "--spp", "16", "--spp", "16"], &["3 given for 2"]);
    case.judge("a.exr", "b.exr", &["--spp", "16", "--spp", "16", "--nested"], &["the same picture"]);
    case.judge("a.exr", "b.exr", &["--spp", "16", "--spp", "16", "--threshold", "1"], &["threshold"]);

    let (a, b) = (case.path("a.exr"), case.path("b.exr"));
    fail(
        &["judge", text(&a), "--spp", "9", "--against", text(&b), "--spp", "9", "--tile", "0"],
        &["tile", "16…512"],
    );
    fail(&["judge", text(&a), "--spp", "9"], &["a.exr", "one picture", "another seed"]);
    fail(&["judge", text(&a), "--against", text(&b)], &["a.exr", "--spp"]);
    let garbage = case.path("text.exr");
    fail(&["judge", text(&garbage), "--against", text(&b)], &["text.exr: is something else, not an OpenEXR"]);
    let below = a.join("heat.png");
    let args = ["--heat-map", text(&below)];
    case.judge("a.exr", "b.exr", &[&SPP[..], &args].concat(), &["heat.png"]);
}

#[test]
fn models() {
    let case = Case::new();
    let good = include_bytes!("../../../noisefloor/models/human.nfm");
    let write = |name: &str, change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = good.to_vec();
        change(&mut bytes);
        std::fs::write(case.path(name), bytes).unwrap();
        case.path(name)
    };
    let damaged = write("damaged.nfm", &|b| b[100] ^= 1);
    let cut = write("cut.nfm", &|b| b.truncate(b.len() / 2));
    let newer = write("newer.nfm", &|b| b[8] = 99);
    let huge = write("huge.nfm", &|b| b[12..20].fill(0xff));
    let models: [(&Path, &[&str]); 6] = [
        (&damaged, &["damaged.nfm", "damaged"]),
        (&cut, &["cut.nfm", "damaged"]),
        (&newer, &["newer.nfm", "version 99", "update"]),
        (&huge, &["huge.nfm", "limit"]),
        (&case.path("text.exr"), &["text.exr", "not a noisefloor model"]),
        (&case.path("absent.nfm"), &["absent.nfm"]),
    ];
    let out = case.path("out");
    for (model, words) in models {
        fail(&["inspect", text(model)], words);
        fail(&tiny(text(&out), &["--model", text(model)]), words);
        case.judge("a.exr", "b.exr", &[&SPP[..], &["--model", text(model)]].concat(), words);
    }
    assert!(!out.exists(), "a folder was made for a render that could not begin");
}

#[test]
fn options() {
    let case = Case::new();
    let (out, truth) = (case.path("out"), case.path("small.exr"));
    let bad: [(&[&str], &[&str]); 30] = [
        (&["no-such-scene"], &["no-such-scene", "noisefloor scenes"]),
        (&["--tile", "0"], &["tile", "16…512"]),
        (&["--tile", "513"], &["513", "16…512"]),
        (&["--size", "64"], &["64"]),
        (&["--size", "0x64"], &["0×64"]),
        (&["--size", "99999x99999"], &["65536"]),
        (&["--threads", "0"], &["--threads"]),
        (&["--batch", "1"], &["at least 2"]),
        (&["--batch", "-3"], &["-3"]),
        (&["--max-spp", "0"], &["samples per pixel"]),
        (&["--min-spp", "300"], &["300"]),
        (&["--consecutive", "0"], &["at least one"]),
        (&["--criterion", "spp:0"], &["spp:0"]),
        (&["--criterion", "spp"], &["spp:1000"]),
        (&["--criterion", "psychic"], &["spp:"]),
        (&["--spp", "100"], &["--criterion spp:100"]),
        (&["--threads", "100000"], &["--threads", "1…1024"]),
        (&["--exposure", "2", "--key", "0.2"], &["--exposure", "--key"]),
        (&["--exposure", "0"], &["exposure of Reinhard"]),
        (&["--tone-mapping", "srgb", "--key", "0.2"], &["--key", "--tone-mapping reinhard"]),
        (&["--tone-mapping", "srgb", "--white", "2"], &["--white", "--tone-mapping reinhard"]),
        (&["--size", "64x64", "--no-mis", "--source", "exr"], &["--no-mis", "--source exr"]),
        (&["--audience", "bats"], &["observers"]),
        (&["--audience", "nan,0"], &["finite"]),
        (&["--time", "0"], &["above 0"]),
        (&["--threshold", "nan"], &["threshold"]),
        (&["--key", "0"], &["key"]),
        (&["--max-depth", "0"], &["max_depth"]),
        (&["--against", text(&truth)], &["small.exr", "32×16", "64×64"]),
        (&["--against", "absent.exr"], &["absent.exr"]),
    ];
    for (args, words) in bad {
        let mut all = tiny(text(&out), args);
        // An option given twice would be refused for that
        if let Some(at) =
            all.iter().position(|a| args[0].starts_with("--") && *a == args[0]).filter(|&at| at < 9)
        {
            all.drain(at..at + 2);
        }
        fail(&all, words);
    }
    fail(&["paint"], &["paint"]);
    fail(&["inspect", "--sigma", "1"], &["--sigma"]);
}

#[test]
fn folders_that_cannot_be_written() {
    // Below a file there is no folder, for root neither
    let case = Case::new();
    let below = case.path("a.exr").join("out");
    fail(&tiny(text(&below), &[]), &["a.exr", "--out"]);
    // A file in the place of an output
    let out = case.path("out");
    std::fs::create_dir_all(out.join("timeline.csv")).unwrap();
    fail(&tiny(text(&out), &[]), &["timeline.csv"]);
}

#[test]
fn corpora() {
    let case = Case::new();
    let (folder, model) = (case.folder.path(), case.path("model.nfm"));
    let train = |more: &[&str], words: &[&str]| {
        let mut args = vec!["train", "--out", text(&model)];
        args.extend(more);
        fail(&args, words);
        let mut args = vec!["evaluate"];
        args.extend(more);
        fail(&args, words);
        assert!(!model.exists());
    };
    train(&["--corpus", text(folder)], &["thresholds.csv"]);
    train(&["--corpus", "absent"], &["absent"]);
    train(&["--table", "absent.csv"], &["absent.csv"]);
    train(&[], &["--corpus"]);
    train(&["--corpus", text(folder), "--table", "x.csv"], &["--table"]);
    train(&["--corpus", text(folder), "--c", "0"], &["positive"]);
    let table = case.path("text.exr");
    train(&["--table", text(&table)], &["text.exr", "line 1"]);
    fail(&["evaluate", "--table", text(&table), "--threshold", "0"], &["--threshold"]);
}

/// What a failed run leaves of an earlier one's files: every byte.
#[test]
fn earlier_files_stay_when_a_run_cannot_begin() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    succeed(&tiny(out, &["--criterion", "spp:100"]));
    let read = || FILES.map(|name| std::fs::read(folder.path().join(name)).unwrap());
    let before = read();
    for (bad, said) in [
        (&["no-such-scene"][..], "no-such-scene"),
        (&["--model", "absent.nfm"], "absent.nfm"),
        (&["--against", "absent.exr"], "absent.exr"),
        (&["--consecutive", "0"], "at least one"),
        (&["--tile", "0"], "16…512"),
        (&["--autosave", "nan"], "--autosave"),
    ] {
        fail(&[&["render", "--quiet", "--size", "64x64", "--force", "--out", out], bad].concat(), &[said]);
        for ((name, before), after) in FILES.iter().zip(&before).zip(read()) {
            assert!(*before == after, "{name} was touched by a run that failed: {bad:?}");
        }
    }
}

/// Before the work, and not after it.
#[test]
fn a_model_that_cannot_be_written_is_not_trained() {
    let corpora = crate::learn::Corpora::new();
    let out = corpora.paths[0].join("thresholds.csv/my.nfm");
    let mut args = corpora.args("train");
    args.extend(["--out", text(&out)]);
    fail(&args, &["my.nfm"]);
}

/// Scene files that are absent, of no known kind, or wrong: said with file and line.
#[test]
fn scene_files() {
    let case = Case::new();
    let render = |name: &str, words: &[&str]| {
        let (scene, out) = (case.path(name), case.path("out"));
        fail(&["render", text(&scene), "--out", text(&out)], words);
    };
    std::fs::write(case.path("cut.xml"), "<scene version=\"3.0.0\">\n  <shape type=\"cube\">\n").unwrap();
    std::fs::write(case.path("odd.xml"), "<scene version=\"3.0.0\">\n<shape type=\"teapot\"/>\n</scene>")
        .unwrap();
    std::fs::write(case.path("cut.glb"), "glTF").unwrap();
    render("absent.xml", &["absent.xml"]);
    render("a.txt", &["a.txt", ".gltf, .glb, .pbrt or .xml"]);
    render("cut.xml", &["cut.xml", "line"]);
    render("odd.xml", &["odd.xml"]);
    render("cut.glb", &["cut.glb"]);
    fail(&["render", "--clamp", "0", "--out", text(&case.path("out"))], &["clamp"]);
}

#[test]
fn explore_begins_with_pictures_it_can_read_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("text.png"), "text").unwrap();
    std::fs::write(at("text.sqlite"), "a text that is no database, and longer than its header would be")
        .unwrap();
    let database = at("new.sqlite");
    let explore = |more: &[&str], words: &[&str]| {
        fail(&[&["explore", "--listen", "127.0.0.1:0", "--database", text(&database)], more].concat(), words);
    };
    explore(&[text(&at("absent.png"))], &["absent.png"]);
    explore(&[text(&at("text.png"))], &["text.png", "PNG"]);
    explore(&["--table", text(&at("text.png"))], &["text.png", "table"]);
    explore(&["--model", text(&at("text.png"))], &["text.png", "model"]);
    explore(&["--threshold", "1"], &["threshold"]);
    assert!(!database.exists());
    let other = at("text.sqlite");
    fail(&["explore", "--listen", "127.0.0.1:0", "--database", text(&other)], &["text.sqlite", "database"]);
}

/// Names of files are bytes: a scene whose name is not UTF-8 renders as any other.
#[test]
#[cfg(target_os = "linux")]
fn a_scene_may_have_any_name() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let xml = "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"sphere\"/>\
               <emitter type=\"constant\"/></scene>";
    let latin = folder.path().join(std::ffi::OsStr::from_bytes(b"sc\xe9ne.xml"));
    let plain = folder.path().join("plain.xml");
    let pixels = [&latin, &plain].map(|scene| {
        std::fs::write(scene, xml).unwrap();
        let out = folder.path().join("out");
        let args =
            ["render", "--size", "16x16", "--tile", "16", "--criterion", "spp:4", "--quiet", "--force"];
        let output = crate::kit::command(&args).arg("--out").arg(&out).arg(scene).output().unwrap();
        assert!(output.status.success(), "{}", crate::kit::stderr(&output));
        noisefloor_image::read_exr(out.join("image.exr")).unwrap().pixels
    });
    assert!(pixels[0] == pixels[1]);
}

/// What was meant is said, where it is likely.
#[test]
fn near_misses_are_recognised() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("a.exr");
    crate::kit::grey_exr(&picture, (8, 8), 1, 0.4);
    fail(&["inspect", text(&picture)], &["a.exr", "is a picture", "`noisefloor judge`"]);
    fail(&["render", "cornel-box"], &["did you mean cornell-box?"]);
    let output = crate::kit::run(&["render", "xyzzy"]);
    assert!(!crate::kit::stderr(&output).contains("did you mean"));
    let plan = folder.path().join("farm");
    fail(
        &["farm", "plan", text(&plan), "--", text(folder.path()), "--source", "exr"],
        &["--source exr` plays them"],
    );
}

/// Completions offer files only where files are meant.
#[test]
fn names_are_not_completed_as_files() {
    let script = succeed(&["completions", "zsh"]);
    for option in ["--source", "--criterion", "--viewing", "--install"] {
        let lines: Vec<&str> = script.lines().filter(|line| line.contains(&format!("'{option}="))).collect();
        assert!(
            !lines.is_empty() && lines.iter().all(|line| !line.contains("_files")),
            "{option}: {lines:?}"
        );
    }
}

/// Files of other programs, and words of other commands, are answered with what to type.
#[test]
fn what_is_elsewhere_is_said() {
    let folder = tempfile::tempdir().unwrap();
    for (name, words) in [
        ("shot.blend", "--source cycles"),
        ("shot.BLEND", "--source cycles"),
        ("chair.obj", ".glb"),
        ("set.usd", ".blend for --source cycles"),
        ("hall.lxs", "--source luxcore"),
        ("hall.cfg", "--source luxcore"),
        ("shot.ass", "command: PROGRAM"),
        ("a.exr", "noisefloor judge"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, "x").unwrap();
        fail(&["render", text(&path)], &[name, words]);
        fail(&["tune", text(&path)], &[name, words]);
    }
    fail(&["render", "--samples", "64"], &["--criterion spp:64"]);
    fail(&["render", "--spp", "64"], &["--criterion spp:64"]);
    fail(&["tune", "--spp", "64"], &["--knob samples", "--criterion spp:64"]);
    fail(&["tune", "--samples", "64"], &["--knob samples"]);
    // Blender's renderer by the name of the program; there is no such file
    fail(&["render", "--source", "blender", "absent.blend"], &["Cycles"]);
}
