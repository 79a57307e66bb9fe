use crate::explore::table;
use crate::kit::{Running, film, levels, stack};
use noisefloor::{Oracle, People, descriptor::Descriptor, evidence::Evidence};
use noisefloor_eyes::Eyes;
use noisefloor_learn::{Corpora, TrainParams, describe_corpora, predict, score, train};
use noisefloor_pages::calibrate::{CalibrateServer, CalibrateSetup};
use noisefloor_pages::http::Exposure;
use noisefloor_study::analysis::{AnalysisOptions, CorpusThreshold, analyse, files::write};
use noisefloor_study::explore::ExploreSetup;
use noisefloor_study::simulated::{Public, SimulatedObserver};
use noisefloor_study::{StackView, Study, StudyEvent, Trial, store};
use noisefloor_testkit::{Requirement, require};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use tempfile::TempDir;

/// Levels of the stacks that the browser is shown.
const LEVELS: usize = 8;

pub(crate) fn study(protocol: &str, extra: &str, tables: &str) -> (TempDir, Arc<Study>) {
    let dir = tempfile::tempdir().unwrap();
    // A forced choice takes two seconds: few tiles
    let size = if protocol == "forced-choice" { (256, 128) } else { (384, 256) };
    stack(&dir.path().join("wall"), size, &levels(LEVELS, 2.0));
    let mut text = format!(
        "protocol = \"{protocol}\"\ndatabase = \"answers.sqlite\"\ntile = 128\ntrials = 1\n\
         interval-ms = 60\n{extra}\n"
    );
    for (code, title, consent) in [
        ("en", "Noise in rendered pictures", "You take part of your own will, and may stop at any time."),
        (
            "fr",
            "Le bruit des images de synthèse",
            "Vous participez de votre plein gré et pouvez arrêter à tout moment.",
        ),
    ] {
        text += &format!("[text.{code}]\ntitle = \"{title}\"\nconsent = \"{consent}\"\n");
        text += "debriefing = \"This was about noise.\"\n";
    }
    text += "[[stack]]\nname = \"wall\"\nfolder = \"wall\"\n";
    if protocol == "validation" {
        text += "stops = \"stops.csv\"\n";
        let rows: String = (0..6).map(|tile| format!("{tile},300\n")).collect();
        std::fs::write(dir.path().join("stops.csv"), format!("tile,spp\n{rows}")).unwrap();
    }
    text += "[screening]\ncatch = 0\n";
    text += tables;
    std::fs::write(dir.path().join("study.toml"), text).unwrap();
    let study = Arc::new(Study::open(dir.path().join("study.toml")).unwrap());
    (dir, study)
}

/// Tables of a study that people come to by links.
const INVITED: &str = r#"
[participants]
links-only = true
id-parameters = ["PROLIFIC_PID"]
completion-code = "COMPLETE-77"
completion-url = "https://example.org/done"
screened-out-url = "https://example.org/screened-out"

[[question]]
id = "age"
kind = "number"
range = [18, 120]
text = { en = "Your age", fr = "Votre âge" }

[[question]]
id = "glasses"
kind = "choice"
optional = true
text = { en = "Do you wear glasses?", fr = "Portez-vous des lunettes ?" }
option = [
    { id = "yes", text = { en = "yes", fr = "oui" } },
    { id = "no", text = { en = "no", fr = "non" } },
]
"#;

/// A language written from right to left: the English texts, with those that the test reads in Arabic.
fn arabic() -> String {
    let mut text = include_str!("../../../../noisefloor-pages/pages/languages/en.toml").to_owned();
    for (english, arabic) in [
        ("name = \"English\"", "name = \"العربية\""),
        ("direction = \"ltr\"", "direction = \"rtl\""),
        ("\"Begin\"", "\"ابدأ\""),
        ("\"Before you begin\"", "\"قبل أن تبدأ\""),
        ("\"I have read this, and I take part.\"", "\"قرأت هذا وأشارك.\""),
        ("\"Go on\"", "\"متابعة\""),
        ("\"Practice {n} of {of}\"", "\"تدريب {n} من {of}\""),
        ("\"Reference\"", "\"المرجع\""),
        ("\"Click where it differs\"", "\"انقر حيث تختلف\""),
        ("\"I see no difference\"", "\"لا أرى فرقًا\""),
        ("\"Undo\"", "\"تراجع\""),
        ("\"Pause\"", "\"استراحة\""),
        ("\"Distance\"", "\"المسافة\""),
        ("\"From your eyes to the screen, in centimetres\"", "\"من عينيك إلى الشاشة بالسنتيمتر\""),
    ] {
        assert!(text.contains(english), "{english}");
        text = text.replacen(english, arabic, 1);
    }
    text
}

/// Whether the pages can be tested, with further programs.
pub(crate) fn browser(programs: &[&str]) -> Option<()> {
    // nginx knows -v alone, and openssl a word
    let installed = |program: &str| {
        ["--version", "-v", "version"]
            .iter()
            .any(|how| Command::new(program).arg(how).output().is_ok_and(|output| output.status.success()))
    };
    let modules = Path::new(env!("CARGO_MANIFEST_DIR")).join("browser/node_modules/playwright-core");
    let missing: Vec<&str> = [
        (installed("node"), "node"),
        (Path::new("/usr/bin/chromium").exists(), "/usr/bin/chromium (apt-get install chromium)"),
        (
            modules.exists(),
            "playwright-core (npm ci --ignore-scripts in crates/lab/noisefloor-study/browser)",
        ),
    ]
    .into_iter()
    .chain(programs.iter().map(|program| (installed(program), *program)))
    .filter(|(there, _)| !there)
    .map(|(_, name)| name)
    .collect();
    let found = if missing.is_empty() { Ok(()) } else { Err(format!("missing: {}", missing.join(", "))) };
    require(Requirement::Browser, found)
}

/// Runs a file of the browser's tests, which must pass, in a Chromium of its own.
pub(crate) fn run(file: &str, environment: &[(&str, &str)]) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("browser");
    let mut node = Command::new("node");
    node.args(["--test", "--test-reporter=spec", file]).current_dir(folder).envs(environment.iter().copied());
    let output = node.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{said}{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "the browser's tests failed; what they said is above");
}

/// Whole sessions by mouse and by keyboard alone, in two sizes and languages: browser/test.mjs. What was
/// clicked is what the analysis finds.
#[test]
fn observers_use_the_pages_in_a_browser() {
    if browser(&[]).is_none() {
        return;
    }
    let studies = [
        ("ACQUISITION", study("acquisition", "repeats = 1\ngroups = [\"painters\", \"programmers\"]", "")),
        ("VALIDATION", study("validation", "", "")),
        ("FORCED", study("forced-choice", "", "")),
    ];
    let servers: Vec<Running> = studies.iter().map(|(_, (_, study))| Running::start(study.clone())).collect();
    let urls: Vec<(&str, &str)> =
        studies.iter().zip(&servers).map(|((name, _), server)| (*name, server.url.as_str())).collect();
    run("test.mjs", &urls);

    // What was clicked: two observers left the six tiles at levels 1 to 6 (by mouse) and at 2 (by keyboard).
    let study = &studies[0].1.1;
    let report = analyse(study, AnalysisOptions { keep_excluded: true, seed: 1, simulated: false }).unwrap();
    let finished: Vec<_> = report.observers.iter().filter(|o| o.finished).collect();
    assert_eq!(finished.len(), 2, "{:?}", report.observers);
    let records = store::read_all(&study.database, &study.design()).unwrap();
    let replayed = noisefloor_study::analysis::observers::replay_all(study, &records).unwrap();
    let mut stops: Vec<Vec<u32>> = replayed
        .iter()
        .filter(|o| o.stage == noisefloor_study::Stage::Finished)
        .map(|o| (0..6).map(|t| o.stops[&(0, t)][0]).collect())
        .collect();
    stops.sort();
    assert_eq!(stops, [vec![1, 2, 3, 4, 5, 6], vec![2; 6]]);
    let conditions = replayed[0].conditions.unwrap();
    assert!((conditions.pixels_per_mm - 324.0 / 85.6).abs() < 1e-9 && conditions.distance_mm == 600.0);
}

/// People who come by links, who fail the practice, or who read from right to left, and the experimenter's
/// page: browser/invited.test.mjs.
#[test]
fn invited_people_use_the_pages_in_a_browser() {
    if browser(&[]).is_none() {
        return;
    }
    let (_invited_dir, invited) = study("validation", "minutes = 7\nbreak-every = 2", INVITED);
    let open = INVITED.replace("links-only = true", "");
    let (_strict_dir, strict) = study("validation", "", &format!("practice-attempts = 1\n{open}"));
    // Its languages lie beside its file
    let (dir, _) = study("acquisition", "repeats = 1", "");
    std::fs::create_dir(dir.path().join("languages")).unwrap();
    std::fs::write(dir.path().join("languages/ar.toml"), arabic()).unwrap();
    let file = dir.path().join("study.toml");
    let texts = "languages = \"languages\"\n[text.ar]\ntitle = \"الضوضاء في الصور\"\n\
        instructions = \"اجلس كما تجلس عادة.\"\nconsent = \"أشارك بإرادتي، ويمكنني التوقف في أي وقت.\"\n";
    let text = std::fs::read_to_string(&file).unwrap().replacen("[text.en]", &format!("{texts}[text.en]"), 1);
    std::fs::write(&file, text).unwrap();
    let arabic = Arc::new(Study::open(&file).unwrap());

    let servers = [&invited, &strict, &arabic].map(|study| Running::start(study.clone()));
    let links = store::make_links(&invited.database, &invited.design(), 1).unwrap();
    let (url, experimenter) = (&servers[0].url, &servers[0].experimenter);
    let invited =
        serde_json::json!({ "url": url, "link": links[0], "experimenter": experimenter }).to_string();
    let (strict, arabic) = (servers[1].url.as_str(), servers[2].url.as_str());
    run("invited.test.mjs", &[("INVITED", &invited), ("STRICT", strict), ("ARABIC", arabic)]);
}

/// Loops of frames, whose dropped frames are counted: browser/film.test.mjs.
#[test]
fn loops_of_frames_play_in_a_browser() {
    if browser(&[]).is_none() {
        return;
    }
    let studies = ["acquisition", "forced-choice"].map(|protocol| {
        let dir = tempfile::tempdir().unwrap();
        film(&dir.path().join("wall"), (128, 64), &levels(5, 4.0), 6);
        let text = format!(
            "protocol = \"{protocol}\"\ndatabase = \"answers.sqlite\"\ntile = 64\nrepeats = 1\ntrials = 1\n\
             interval-ms = 700\n[text.en]\ntitle = \"Film\"\nconsent = \"I take part.\"\n\
             [[stack]]\nname = \"wall\"\nfolder = \"wall\"\nfps = 24\n[screening]\ncatch = 0\n"
        );
        std::fs::write(dir.path().join("study.toml"), text).unwrap();
        let study = Arc::new(Study::open(dir.path().join("study.toml")).unwrap());
        (dir, study)
    });
    let servers = studies.each_ref().map(|(_, study)| Running::start(study.clone()));
    run("film.test.mjs", &[("FILM", &servers[0].url), ("FILM_FORCED", &servers[1].url)]);
}

/// A stack whose last picture's name says nothing, and a picture of another size, on the page of `explore`:
/// browser/explore.test.mjs.
#[test]
fn pictures_are_explored_in_a_browser() {
    if browser(&[]).is_none() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("hall");
    stack(&folder, (384, 256), &[50, 3000, 25_600, 51_200]);
    std::fs::rename(folder.join("51200.png"), folder.join("last.png")).unwrap();
    stack(&dir.path().join("other"), (64, 64), &[50]);
    let files: Vec<PathBuf> =
        ["00050.png", "03000.png", "25600.png", "last.png"].iter().map(|name| folder.join(name)).collect();
    let files =
        serde_json::json!({ "stack": files, "other": dir.path().join("other/00050.png") }).to_string();
    let server = Running::explorer(ExploreSetup {
        table: Some(table()),
        ..ExploreSetup::new(dir.path().join("explore.sqlite"))
    });
    run("explore.test.mjs", &[("EXPLORER", &server.url), ("STACK", &files)]);
}

/// Whole calibrations, with keys alone, by somebody who looks at the pixels and by somebody who does not:
/// browser/calibrate.test.mjs.
#[test]
fn eyes_are_calibrated_in_a_browser() {
    if browser(&[]).is_none() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("eyes.toml");
    let serve = |seed| {
        let file = file.clone();
        let keep = move |person| match Eyes::keep(&file, person) {
            Ok(()) => Ok(file.display().to_string()),
            Err(error) => Err(error.to_string()),
        };
        let setup = CalibrateSetup {
            oracle: Oracle::bundled(),
            name: "anna".to_owned(),
            date: "2026-11-24".to_owned(),
            seed,
            keep: Box::new(keep),
        };
        let here = "127.0.0.1:0".parse().unwrap();
        let server = CalibrateServer::bind(setup, here, &Exposure::default()).unwrap();
        let address = format!("http://{}", server.address());
        // It ends when it has found something, or with the test
        std::thread::spawn(|| server.run());
        address
    };
    let (looking, guessing) = (serve(1), serve(2));
    run("calibrate.test.mjs", &[("LOOKING", &looking), ("GUESSING", &guessing)]);
    let eyes = Eyes::read(&file).unwrap();
    let [anna] = eyes.people() else { panic!("{eyes:?}") };
    // The card is 324 CSS pixels wide, the eyes at 60 cm: 324/85.6 x 600 mm x 2 tan(1/2 degree) a degree
    assert!((anna.display.pixels_per_degree - 39.64).abs() < 0.01, "{anna:?}");
    assert!(
        anna.model == noisefloor::Model::bundled().digest() && (24..=60).contains(&anna.answers),
        "{anna:?}"
    );
    println!("{anna:?}");
}

/// Tiles that an observer clicks, in order, at one showing of a stack.
fn clicks(observer: &mut SimulatedObserver, stack: u32, stacks: &[StackView]) -> Vec<u32> {
    let tiles = (stacks[0].width / stacks[0].tile) * (stacks[0].height / stacks[0].tile);
    let trial =
        Trial::Acquisition { number: 1, practice: false, stack, levels: vec![0; tiles], identical: false };
    let events = observer.respond(&trial, stacks);
    let tile = |event: &StudyEvent| match event {
        StudyEvent::Step { tile, .. } => Some(*tile),
        _ => None,
    };
    events.iter().filter_map(tile).collect()
}

/// Simulated observers, with thresholds, a slope, lapses and a bias, click through the real pages in
/// Chromium; what the server kept, the analysis takes apart: the known thresholds lie within its intervals;
/// and of its corpus a model is trained that predicts them.
// Long: one study, from the first page to the model
#[test]
fn simulated_observers_drive_the_pages_and_a_model_learns_from_them() {
    const OBSERVERS: u64 = 8;
    if browser(&[]).is_none() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let levels = levels(14, 1.45);
    let mut text = "protocol = \"acquisition\"\ndatabase = \"answers.sqlite\"\ntile = 64\n\
        [text.en]\ntitle = \"Walls\"\nconsent = \"I take part.\"\n"
        .to_owned();
    for name in ["wall", "door"] {
        stack(&dir.path().join(name), (128, 128), &levels);
        text += &format!("[[stack]]\nname = \"{name}\"\nfolder = \"{name}\"\n");
    }
    text += "[screening]\ncatch = 0\n";
    std::fs::write(dir.path().join("study.toml"), text).unwrap();
    let study = Arc::new(Study::open(dir.path().join("study.toml")).unwrap());

    // What each observer does at each of the two showings of each stack, by src/simulated.
    let thresholds = vec![vec![100.0, 140.0, 200.0, 280.0], vec![120.0, 160.0, 220.0, 260.0]];
    let public = Public { between: 0.25, within: 0.1, lapse: 0.01, bias: 0.1, ..Public::of(thresholds) };
    let view = StackView { width: 128, height: 128, tile: 64, levels: levels.clone(), frames: 1, fps: None };
    let views = [view.clone(), view];
    let decisions: Vec<Vec<Vec<Vec<u32>>>> = (0..OBSERVERS)
        .map(|seed| {
            let mut observer = public.draw(100 + seed);
            let mut showings = |stack| (0..2).map(|_| clicks(&mut observer, stack, &views)).collect();
            vec![showings(0), showings(1)]
        })
        .collect();
    let file = dir.path().join("decisions.json");
    std::fs::write(&file, serde_json::to_string(&decisions).unwrap()).unwrap();
    let server = Running::start(study.clone());
    run("simulated.test.mjs", &[("SIMULATED", &server.url), ("DECISIONS", file.to_str().unwrap())]);

    // Everything that was decided was clicked, and is what was kept.
    let records = store::read_all(&study.database, &study.design()).unwrap();
    let steps = |event: &&noisefloor_study::Envelope| matches!(event.event, StudyEvent::Step { .. });
    let kept: usize = records.iter().map(|r| r.events.iter().filter(steps).count()).sum();
    // And the four tiles of the noisy practice
    let practice = 4 * OBSERVERS as usize;
    assert_eq!(kept, practice + decisions.iter().flatten().flatten().flatten().count());

    // The thresholds that the observers were made of, bias included, lie within the intervals.
    let report = analyse(&study, AnalysisOptions { keep_excluded: true, seed: 1, simulated: false }).unwrap();
    assert_eq!((report.observers.len() as u64, report.tiles.len()), (OBSERVERS, 8));
    let (mut level95, mut means) = (0, 0.0);
    for (i, tile) in report.tiles.iter().enumerate() {
        let truth = public.quantile(i / 4, i % 4, 0.95) * public.bias.exp();
        let (low, high) = tile.level95_low.zip(tile.level95_high).unwrap();
        level95 += usize::from((low..=high).contains(&truth));
        means += (tile.median / (public.thresholds[i / 4][i % 4] * public.bias.exp())).ln() / 8.0;
        println!("tile {i}: {truth:.0} in {low:.0} to {high:.0}? median {:.0}", tile.median);
    }
    // Of 8 intervals that hold the truth in 92 of 100 cases at least, three or more miss it 2 times in 100;
    // the draw is seeded.
    assert!(level95 >= 6, "{level95} of 8");
    // Eight observers of scale 0.27: their median is known to 0.27·2/√8 = 0.19, times 3.
    assert!(f64::abs(means) < 0.57, "{means}");

    // Of the corpus, a model. Two scenes do not show how light counts, so only the noise of the tile is weighed.
    let out = dir.path().join("out");
    write(&out, &study, &report, CorpusThreshold::Level95).unwrap();
    let table = describe_corpora(
        Corpora::new(&[out.join("corpus")]),
        &Descriptor::visible(),
        Evidence::Halves,
        |_, _| (),
    )
    .unwrap();
    assert_eq!((table.groups().len(), table.zones.len()), (2, 8));
    let params = TrainParams { weighed: Some(vec!["visible_noise".into()]), ..TrainParams::default() };
    let model = train(&table, &params, "simulated".into(), None).unwrap();
    let learned: Vec<_> =
        table.zones.iter().map(|z| predict(|raw| model.judge(raw), People::DEFAULT, z)).collect();
    let scores = score(learned.iter());
    println!("{scores:?}");
    assert!(scores.error_factor < 1.6, "{scores:?}");
}
