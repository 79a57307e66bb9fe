use crate::kit::{command, fail, json, run, said_json, stderr, succeed, text, wait_for};
use noisefloor_image::{read_exr, read_facts};
use noisefloor_testkit::Noise;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tempfile::tempdir;

/// Of 12 tiles: some stop early, some late, and one round has several tasks.
pub(crate) const SCENE: &str =
    "cornell-box --size 128x96 --tile 32 --batch 40 --max-spp 160 --seed 5 --threads 1";

pub(crate) fn render(out: &Path, scene: &str) {
    let args = ["render", "--quiet", "--out", text(out)];
    succeed(&args.into_iter().chain(scene.split(' ')).collect::<Vec<_>>());
}

pub(crate) fn plan(dir: &Path, more: &[&str], scene: &str) {
    let args = [&["farm", "plan", text(dir), "--tasks", "4"], more, &["--"]].concat();
    succeed(&args.into_iter().chain(scene.split(' ')).collect::<Vec<_>>());
}

/// The same picture and the same stops.
pub(crate) fn assert_same(one: &Path, other: &Path) {
    let read = |dir: &Path| read_exr(dir.join("image.exr")).unwrap().pixels;
    assert!(read(one) == read(other), "{} and {} differ", one.display(), other.display());
    let stops = |dir: &Path| fs::read_to_string(dir.join("stops.csv")).unwrap();
    assert_eq!(stops(one), stops(other));
    assert_eq!(json(&other.join("report.json"))["complete"], true);
}

pub(crate) fn shards(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "nfs"));
    paths.retain(|path| !path.file_name().unwrap().to_string_lossy().starts_with('.'));
    paths.sort();
    paths
}

fn coordinator(dir: &Path) -> Child {
    let mut command = command(&["farm", "run", text(dir), "--local", "2"]);
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Coordinators killed at any moment, and one of their tasks with the first of them, lose nothing; while one
/// works, another is refused.
#[test]
fn killed_farms_give_the_picture_of_one_machine() {
    let folder = tempdir().unwrap();
    let (one, dir) = (folder.path().join("one"), folder.path().join("farm"));
    render(&one, SCENE);
    plan(&dir, &["--keep-shards"], SCENE);
    let mut random = Noise::new(1);
    for kill in 0..4 {
        let mut first = coordinator(&dir);
        if kill == 0 {
            // Once it has tasks, it has the lock
            let id = first.id();
            let tasks = || {
                let children = fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap();
                (!children.trim().is_empty()).then_some(children)
            };
            wait_for("a task", tasks);
            fail(&["farm", "plan", text(&dir)], &["another noisefloor plans or merges in this folder"]);
            // A task dies with its coordinator
            let children = wait_for("a task", tasks);
            let killed = Command::new("kill").arg("-9").args(children.split_whitespace()).status().unwrap();
            assert!(killed.success(), "{children}");
        }
        std::thread::sleep(Duration::from_millis(50 + random.below(250) as u64));
        first.kill().unwrap();
        first.wait().unwrap();
    }
    let done = coordinator(&dir).wait_with_output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let frame = dir.join("frame");
    assert_same(&one, &frame);
    let status = succeed(&["farm", "status", text(&dir)]);
    assert!(status.contains("frame: done") && status.contains("done in"), "{status}");
    assert!(shards(&frame.join("shards")).is_empty() && !frame.join("checkpoint.nfc").exists());

    // The shards alone give the same, in any order; without one of them, it is known what is missing
    let mut kept = shards(&frame.join("merged"));
    kept.sort_by_cached_key(|_| random.bits());
    let merge = |kept: &[PathBuf], out: &Path| {
        run(&[&["farm", "merge", "--out", text(out)], &kept.iter().map(|p| text(p)).collect::<Vec<_>>()[..]]
            .concat())
    };
    let merged = folder.path().join("merged");
    let output = merge(&kept, &merged);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_same(&one, &merged);
    // Scene and renderer are those of the render, whatever the folder is called
    for key in ["scene", "source", "seed", "job", "render"] {
        let said = |dir: &Path| json(&dir.join("report.json"))[key].clone();
        assert_eq!(said(&merged), said(&one), "{key}");
    }
    let facts = |dir: &Path| read_facts(dir.join("image.exr")).unwrap();
    assert_eq!(facts(&merged), facts(&one));
    kept.sort();
    let partial = folder.path().join("partial");
    let output = merge(&kept[..kept.len() - 1], &partial);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("no shard has tile"), "{}", stderr(&output));
    let rest = ["render", "--resume", "--quiet", "--out", text(&partial)];
    succeed(&rest.into_iter().chain(SCENE.split(' ')).collect::<Vec<_>>());
    assert_same(&one, &partial);
}

/// A shard of rubbish, and one that was cut short, are put aside and rendered again.
#[test]
fn rubbish_is_named_and_rendered_again() {
    let folder = tempdir().unwrap();
    let (one, dir) = (folder.path().join("one"), folder.path().join("farm"));
    render(&one, SCENE);
    plan(&dir, &[], SCENE);
    let place = dir.join("frame/shards");
    let task = |index: &str| succeed(&["farm", "task", text(&dir), "1", index]);
    task("0");
    task("1");
    let there = shards(&place);
    assert_eq!(there.len(), 2);
    let half = fs::read(&there[0]).unwrap();
    fs::write(&there[0], &half[..half.len() / 2]).unwrap();
    fs::write(&there[1], "a task of another program").unwrap();
    let output = run(&["farm", "run", text(&dir), "--local", "1", "--quiet"]);
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    for word in [
        "00000.nfs: it is damaged: it is cut short",
        "00001.nfs: it is not a shard",
        "00001.nfs.bad was put aside",
    ] {
        assert!(said.contains(word), "{word}: {said}");
    }
    assert!(place.join("0001-00001.nfs.bad").exists());
    assert_same(&one, &dir.join("frame"));
}

/// What cannot work ends, and says what to do.
#[test]
fn what_is_wrong_with_a_farm_is_said() {
    let folder = tempdir().unwrap();
    let dir = folder.path().join("farm");
    fail(&["farm", "run", text(&dir), "--local", "1"], &["no farm was planned", "farm plan DIR"]);
    fail(&["farm", "plan", text(&dir), "--", "bulb", "--out", "x"], &["--out", "leave it out"]);
    fail(&["farm", "plan", text(&dir), "--tasks", "5000", "--", "bulb"], &["--tasks", "1…1000"]);
    fail(&["farm", "plan", text(&dir), "--", "bulb", "--criterion", "variance:0.1"], &["oracle"]);
    fail(
        &["farm", "merge", text(&folder.path().join("absent.nfs")), "--out", "x"],
        &["none of these files is a shard"],
    );

    // The scene is edited after the plan: three rounds bring nothing
    let scene = folder.path().join("scene.xml");
    let xml = "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"sphere\"/>\
               <emitter type=\"constant\"/></scene>";
    fs::write(&scene, xml).unwrap();
    plan(&dir, &[], &format!("{} --size 32x32 --tile 32", text(&scene)));
    fail(&["farm", "plan", text(&dir), "--", "bulb"], &["planned here already"]);
    fs::write(&scene, xml.replace("sphere", "cube")).unwrap();
    let output = run(&["farm", "run", text(&dir), "--local", "1", "--quiet"]);
    let said = stderr(&output);
    assert!(
        output.status.code() == Some(1) && said.contains("3 rounds in a row brought no samples"),
        "{said}"
    );
    let log = fs::read_to_string(dir.join("log/0001-0.log")).unwrap();
    assert!(log.contains("scene.xml` has changed") && log.contains("restore it"), "{log}");
    // Mended, it goes on
    fs::write(&scene, xml).unwrap();
    succeed(&["farm", "run", text(&dir), "--local", "1", "--quiet"]);
    assert_eq!(json(&dir.join("frame/report.json"))["complete"], true);
}

/// Two builds on one farm would mix their samples: the plan knows who made it.
#[test]
fn another_build_is_refused() {
    let folder = tempdir().unwrap();
    let dir = folder.path().join("farm");
    plan(&dir, &[], "bulb --size 32x32 --tile 32 --criterion spp:20");
    let path = dir.join("farm.json");
    let mut kept = json(&path);
    let program = kept["job"]["program"].as_str().unwrap().to_owned();
    assert_eq!(program, blake3::hash(&fs::read(env!("CARGO_BIN_EXE_noisefloor")).unwrap()).to_hex().as_str());
    kept["job"]["program"] = "0".repeat(64).into();
    fs::write(&path, kept.to_string()).unwrap();
    fail(&["farm", "run", text(&dir), "--local", "1"], &["another build", "plan the farm anew"]);
    fail(&["farm", "task", text(&dir), "1", "0"], &["another build"]);
    kept["job"]["program"] = program.into();
    fs::write(&path, kept.to_string()).unwrap();
    succeed(&["farm", "run", text(&dir), "--local", "1", "--quiet"]);
}

/// A finished picture is the farm's only if it is of the farm's job: it is compared, always.
#[test]
fn a_finished_render_of_another_job_is_not_the_farms() {
    const JOB: &str = "bulb --size 32x32 --tile 16 --criterion spp:20 --threads 1 --seed 3";
    const OTHER: &str = "cornell-box --size 32x32 --tile 16 --criterion spp:20 --threads 1";
    let folder = tempdir().unwrap();
    let [before, after, own] = ["before", "after", "own"].map(|name| folder.path().join(name));
    let foreign = |dir: &Path| fs::read(dir.join("frame/image.exr")).unwrap();

    // There before the plan: it is refused, and left alone
    render(&before.join("frame"), OTHER);
    let picture = foreign(&before);
    let words: Vec<&str> = ["farm", "plan", text(&before), "--"].into_iter().chain(JOB.split(' ')).collect();
    fail(&words, &["holds a render already", "move it away"]);
    assert!(foreign(&before) == picture);

    // Put there after it, by the same scene with another seed
    plan(&after, &[], JOB);
    render(&after.join("frame"), &JOB.replace("--seed 3", "--seed 4"));
    fail(&["farm", "run", text(&after), "--local", "1"], &["a picture of another job", "move it away"]);
    fs::remove_file(after.join("frame/report.json")).unwrap();
    succeed(&["farm", "run", text(&after), "--local", "1", "--quiet"]);
    assert_eq!(json(&after.join("frame/report.json"))["seed"], 3);

    // The job's own, finished by `render`
    plan(&own, &[], JOB);
    render(&own.join("frame"), JOB);
    let picture = foreign(&own);
    let said = succeed(&["farm", "run", text(&own), "--local", "1"]);
    assert!(said.contains("frame: done") && foreign(&own) == picture, "{said}");
    assert_same(&after.join("frame"), &own.join("frame"));
}

/// Neither a pipe among the shards nor a number that no plan has can hold a farm up.
#[test]
fn pipes_and_huge_numbers_hold_nothing_up() {
    let folder = tempdir().unwrap();
    let dir = folder.path().join("farm");
    plan(&dir, &[], "bulb --size 32x32 --tile 16 --criterion spp:20 --threads 1");
    let pipe = dir.join("frame/shards/.nfs");
    let named = dir.join("frame/shards/a.nfs");
    assert!(Command::new("mkfifo").args([&pipe, &named]).status().unwrap().success());

    // Numbers that would keep a task busy for years
    let round = dir.join("round.json");
    let right = fs::read_to_string(&round).unwrap();
    let mut huge: serde_json::Value = serde_json::from_str(&right).unwrap();
    huge["tasks"][0]["batches"][0][2] = 1_000_000_000_000_000u64.into();
    fs::write(&round, huge.to_string()).unwrap();
    fail(&["farm", "task", text(&dir), "1", "0"], &["1000000000000000 samples", "plan the farm anew"]);
    fs::write(&round, right).unwrap();
    let farm = dir.join("farm.json");
    let right = fs::read_to_string(&farm).unwrap();
    let mut huge: serde_json::Value = serde_json::from_str(&right).unwrap();
    huge["frames"] = "0-2147483647".into();
    fs::write(&farm, huge.to_string()).unwrap();
    fail(&["farm", "run", text(&dir), "--local", "1"], &["farm.json", "more than 1000000 frames"]);
    fs::write(&farm, right).unwrap();

    let mut run = coordinator(&dir);
    let done = wait_for("the end of the farm", || run.try_wait().unwrap());
    assert!(done.success());
    assert!(pipe.exists() && dir.join("frame/shards/a.nfs.bad").exists());
    assert_eq!(json(&dir.join("frame/report.json"))["complete"], true);
}

/// Frames of a farm are those of `render --frames`: new noise in each, and one exposure, which the farm finds
/// in the first frame, or in those that are named, while the others wait; or which it is given. Whoever lets
/// each frame settle its own is warned.
#[test]
fn a_farm_renders_the_frames_of_a_sequence() {
    let folder = tempdir().unwrap();
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/cornell-box.xml");
    for frame in 1..=3 {
        fs::copy(fixture, folder.path().join(format!("hall.{frame}.xml"))).unwrap();
    }
    let scene = folder.path().join("hall.{frame}.xml");
    let options = ["--size", "32x32", "--tile", "32", "--batch", "8", "--criterion", "spp:16"];
    let render = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let args = ["render", "--frames", "1-3", text(&scene), "--out", text(&out), "--quiet"];
        succeed(&[&args[..], &options, more].concat());
        out
    };
    let plan = |dir: &Path, more: &[&str]| {
        let args = [&["farm", "plan", text(dir), "--frames", "1-3", "--", text(&scene)], &options[..], more];
        let output = command(&args.concat()).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        stderr(&output)
    };
    let compare = |one: &Path, farm: &Path| {
        for frame in ["0001", "0002", "0003"] {
            assert_same(&one.join(frame), &farm.join(frame));
            let [one, other] = [one, farm].map(|out| json(&out.join(frame).join("report.json")));
            assert_eq!((&one["exposure"], &one["seed"]), (&other["exposure"], &other["seed"]), "{frame}");
        }
        let picture = |frame: &str| read_exr(farm.join(frame).join("image.exr")).unwrap().pixels;
        assert!(picture("0001") != picture("0002") && picture("0002") != picture("0003"));
    };
    let shown = |dir: &Path| fs::read(dir.join("0002/image.png")).unwrap();

    for (name, more) in
        [("first", &[][..]), ("third", &["--exposure-from", "3"]), ("eased", &["--exposure-from", "1,3"])]
    {
        let (out, dir) = (render(name, more), folder.path().join(format!("farm-{name}")));
        let said = plan(&dir, more);
        assert!(!said.contains("flicker"), "{said}");
        let status = succeed(&["farm", "status", text(&dir)]);
        assert!(status.contains("0002: waits for"), "{status}");
        assert!(status.contains("0001: waits for") == (name == "third"), "{status}");
        let told = said_json(&["farm", "status", text(&dir), "--json"]);
        assert!(told["frames"][1]["waits"] == true && told["frames"][1]["spp"] == 0.0, "{told}");
        assert_eq!(told["frames"][0]["waits"], name == "third");
        // A coordinator that is started again between the rounds, and pictures as far as they are
        let task = |round: &str, task: &str| run(&["farm", "task", text(&dir), round, task]).status.success();
        assert!(task("1", "0") && task("1", "1") == (name == "eased"));
        succeed(&["farm", "merge", text(&dir)]);
        succeed(&["farm", "run", text(&dir), "--local", "2", "--quiet"]);
        compare(&out, &dir);
        assert!(shown(&out) == shown(&dir));
    }
    let (out, dir) = (folder.path().join("first"), folder.path().join("given"));
    for from in [out.join("0001"), out.clone()] {
        drop(fs::remove_dir_all(&dir));
        assert!(!plan(&dir, &["--exposure-from", text(&from)]).contains("flicker"));
        assert!(!succeed(&["farm", "status", text(&dir)]).contains("waits"));
        succeed(&["farm", "run", text(&dir), "--local", "1", "--quiet"]);
    }
    compare(&out, &dir);

    let said = plan(&folder.path().join("each"), &["--same-seed", "--exposure-from", "each"]);
    assert!(said.contains("the film flickers") && said.contains("one seed for all frames"), "{said}");
    let args = ["farm", "plan", "x", "--frames", "1-2", "--", text(&scene), "--exposure-from", "3"];
    fail(&args, &["frame 3 is not among", "output folder"]);
}
