use crate::kit::{Folder, Running, levels, public};
use noisefloor::{Batch, ProgressiveSource, Repeats, Request, SourceError, SourceInfo};
use noisefloor_study::analysis::raw::{DICTIONARY, responses, write_raw};
use noisefloor_study::analysis::{AnalysisOptions, analyse};
use noisefloor_study::simulated::drive;
use noisefloor_study::{AnswerStore, NewSession, Plan, StoreError, render_stack, store};
use std::collections::BTreeMap;
use std::fs;

/// Every response of three sessions is in the table, with all its columns described, and no code.
#[test]
fn raw_data_are_complete_and_name_nobody() {
    let folder = Folder::new("forced-choice", &["wall"], &levels(16, 1.5), "trials = 3");
    let study = folder.study();
    let server = Running::start(study.clone());
    let codes: Vec<String> = (0..3)
        .map(|seed| drive(&server.url, "", &mut public(1, &[100.0, 300.0]).draw(seed), |_| ()).unwrap())
        .collect();
    let records = store::read_all(&study.database, &study.design()).unwrap();
    // Four of practice, six of data, ten catch trials
    assert_eq!(responses(&study, &records).unwrap().len(), 3 * (4 + 6 + 10));
    let options = AnalysisOptions { keep_excluded: false, seed: 1, simulated: true };
    let report = analyse(&study, options).unwrap();
    let out = folder.dir.path().join("data");
    write_raw(&out, &study, &records, &report).unwrap();
    let mut csv = csv::Reader::from_path(out.join("responses.csv")).unwrap();
    let described: Vec<&str> = DICTIONARY.iter().map(|(name, _)| *name).collect();
    assert_eq!(csv.headers().unwrap().iter().collect::<Vec<_>>(), described);
    assert_eq!(csv.records().count(), 60);
    let participants = fs::read_to_string(out.join("participants.tsv")).unwrap();
    assert_eq!(participants.lines().count(), 4);
    assert!(participants.contains(&records[1].seed.to_string()), "seeds are exact");
    for file in ["dataset_description.json", "participants.json", "task-forcedchoice_beh.json", "design.json"]
    {
        assert!(serde_json::from_slice::<serde_json::Value>(&fs::read(out.join(file)).unwrap()).is_ok());
    }
    let own = fs::read_to_string(out.join("sub-002/beh/sub-002_task-forcedchoice_beh.tsv")).unwrap();
    assert_eq!(own.lines().count(), 21);
    for text in [participants, own, fs::read_to_string(out.join("responses.csv")).unwrap()] {
        assert!(codes.iter().all(|code| !text.contains(code)));
    }
}

/// A wall of noise: sample i of a pixel is i plus a value of the pixel, so that every mean is known.
struct Wall;

impl ProgressiveSource for Wall {
    fn info(&self) -> SourceInfo {
        SourceInfo::new("wall", 80, 70).with_repeats(Repeats::Samples)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let mean = |r: &Request| r.first as f32 + 0.5 * (r.spp as f32 - 1.0);
        let batch = |r: &Request| Batch::new(r.tile, r.spp, vec![[mean(r); 3]; r.tile.pixels()]);
        Ok(requests.iter().map(batch).collect())
    }
}

/// Each level is the mean of its first samples: of 0 to n − 1 that is (n − 1)/2. A stopped render keeps what
/// is done.
#[test]
fn a_stack_is_rendered_in_one_go() {
    let dir = tempfile::tempdir().unwrap();
    let levels = [1, 4, 100, 130];
    render_stack(&mut Wall, &levels, dir.path(), |_, _| true, Ok).unwrap();
    for level in levels {
        let path = dir.path().join(format!("{level:05}.exr"));
        let noisefloor_image::Picture::Linear(image) = noisefloor_image::read_picture(&path).unwrap() else {
            panic!("an EXR is linear")
        };
        assert_eq!((image.width, image.height), (80, 70));
        let expected = 0.5 * (level as f32 - 1.0);
        assert!(image.pixels.iter().flatten().all(|c| (c - expected).abs() < 1e-3), "{level}");
    }
    let stopped = tempfile::tempdir().unwrap();
    render_stack(&mut Wall, &levels, stopped.path(), |level, _| level < 100, Ok).unwrap();
    assert_eq!(fs::read_dir(stopped.path()).unwrap().count(), 2);
    assert!(render_stack(&mut Wall, &[4, 4], dir.path(), |_, _| true, Ok).is_err());
}

/// A copy made while observers answer is whole, belongs to the study, and can be served in place of the
/// original.
#[test]
fn a_copy_made_while_serving_can_be_restored() {
    let folder = Folder::new("acquisition", &["wall"], &levels(10, 1.8), "");
    let study = folder.study();
    let server = Running::start(study.clone());
    let code = drive(&server.url, "", &mut public(1, &[60.0, 90.0]).draw(1), |_| ()).unwrap();
    let copy = folder.dir.path().join("copy.sqlite");
    store::back_up(&study.database, &study.design(), &copy).unwrap();
    assert!(store::back_up(&study.database, &study.design(), &copy).is_err(), "copies are not overwritten");
    drive(&server.url, "", &mut public(1, &[60.0, 90.0]).draw(2), |_| ()).unwrap();
    drop(server);
    let original = store::read_one(&study.database, &study.design(), &code).unwrap();
    for entry in fs::read_dir(folder.dir.path()).unwrap() {
        let path = entry.unwrap().path();
        if path.file_name().unwrap().to_str().unwrap().starts_with("answers.sqlite") {
            drop(fs::remove_file(path));
        }
    }
    fs::rename(&copy, &study.database).unwrap();
    let restored = store::read_all(&study.database, &study.design()).unwrap();
    assert_eq!((restored.len(), &restored[0]), (1, &original));
    let server = Running::start(study.clone());
    drive(&server.url, "", &mut public(1, &[60.0, 90.0]).draw(3), |_| ()).unwrap();
    assert_eq!(store::read_all(&study.database, &study.design()).unwrap().len(), 2);
}

/// A link begins one session; used again, it leads to the same one; an unknown one is refused.
#[test]
fn links_begin_one_session_each() {
    let folder = Folder::new("acquisition", &["wall"], &levels(6, 2.0), "");
    let study = folder.study();
    let links = store::make_links(&study.database, &study.design(), 2).unwrap();
    let answers = AnswerStore::open(&study.database, &study.design()).unwrap();
    let begin = |code: &str, link: &str| {
        let (code, link, plan) = (code.to_owned(), Some(link.to_owned()), Plan::draw(&study, 1));
        let (group, ids) = (String::new(), BTreeMap::new());
        let session = NewSession { code, seed: 1, plan, group, simulated: false, ids, link };
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        runtime.block_on(answers.begin(session))
    };
    assert_eq!(begin("A", &links[0]).unwrap(), "A");
    assert_eq!(begin("B", &links[0]).unwrap(), "A");
    assert_eq!(begin("C", &links[1]).unwrap(), "C");
    assert!(matches!(begin("D", "0"), Err(StoreError::NoLink)));
    assert_eq!(store::read_all(&study.database, &study.design()).unwrap().len(), 2);
    // What was erased does not begin again
    store::erase_one(&study.database, &study.design(), "A").unwrap();
    assert!(matches!(begin("E", &links[0]), Err(StoreError::NoLink)));
    assert_eq!(begin("F", &links[1]).unwrap(), "C");
}
