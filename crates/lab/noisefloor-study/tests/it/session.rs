use crate::kit::{Folder, levels, public};
use noisefloor_pages::viewing::{Conditions, ViewingProblem};
use noisefloor_study::simulated::{Behaviour, run};
use noisefloor_study::{
    CatchKind, Choice, Haste, ParticipantSession, Plan, Stage, StudyEvent, Trial, TrialOutcome, TrialRole,
    TrialTiming, grids,
};
use std::collections::BTreeMap;

fn conditions() -> Conditions {
    let events = public(1, &[1.0, 1.0]).draw(0).arrive("en", &[]);
    let Some(StudyEvent::Conditions(conditions)) = events.last() else { panic!("arrives otherwise") };
    *conditions
}

fn timing(ms: f64) -> TrialTiming {
    TrialTiming { onset: 1, ms, intervals: Vec::new(), frames: None }
}

fn step(trial: u32, tile: u32, level: u32) -> StudyEvent {
    StudyEvent::Step { trial, tile, level, at: Some([3, 4]), ms: 900.0 }
}

fn done(trial: u32) -> StudyEvent {
    StudyEvent::Done { trial, timing: timing(900.0) }
}

fn begun(protocol: &str, extra: &str) -> (Folder, ParticipantSession) {
    let folder = Folder::new(protocol, &["wall", "door"], &levels(6, 2.0), extra);
    let study = folder.study();
    let mut session = ParticipantSession::new(study.clone(), grids(&study), Plan::draw(&study, 5));
    session.apply(&StudyEvent::Consent { language: "en".into() }).unwrap();
    session.apply(&StudyEvent::Conditions(conditions())).unwrap();
    (folder, session)
}

/// Both tiles of noisy pairs are clicked once; identical pairs are left alone.
fn answer(session: &mut ParticipantSession) {
    let Some(Trial::Acquisition { number, identical, .. }) = session.trial() else { panic!("another trial") };
    for tile in 0..2 {
        if !identical {
            session.apply(&step(number, tile, 1)).unwrap();
        }
    }
    session.apply(&done(number)).unwrap();
}

#[test]
fn each_pair_is_shown_twice_between_practice_and_catch_trials() {
    let (_folder, mut session) = begun("acquisition", "");
    assert_eq!((session.progress(), session.ordinal()), ((0, 8), (1, 2)));
    let (mut shown, mut roles) = (Vec::new(), Vec::new());
    while let Some(Trial::Acquisition { number, practice, stack, levels, identical }) = session.trial() {
        let role = session.role().unwrap();
        assert_eq!((practice, levels), (number < 2, vec![0, 0]));
        assert_eq!(practice, role == TrialRole::Practice);
        if role == TrialRole::Data {
            assert!(!identical);
            shown.push(stack);
        } else {
            roles.push((role, identical));
        }
        answer(&mut session);
    }
    shown.sort_unstable();
    assert_eq!(shown, [0, 0, 1, 1]);
    let catch = (TrialRole::Catch(CatchKind::Identical), true);
    assert_eq!(roles, [(TrialRole::Practice, false), (TrialRole::Practice, true), catch, catch]);
    assert_eq!(
        (session.stage(), session.progress(), session.haste()),
        (Stage::Finished, (8, 8), Haste { trials: 6, hasty: 0 })
    );
    let caught = |o: &&TrialOutcome| matches!(o, TrialOutcome::Caught { passed: true, .. });
    assert_eq!(session.outcomes().iter().filter(caught).count(), 2);
    let stops =
        |o: &&TrialOutcome| matches!(o, TrialOutcome::Stops { levels, clicks: 2, .. } if levels == &[1, 1]);
    assert_eq!(session.outcomes().iter().filter(stops).count(), 4);
}

#[test]
fn practice_has_to_be_passed() {
    let (_folder, mut session) = begun("acquisition", "");
    // Nothing clicked in the noisy pair: another round, and another; then the session ends
    for round in 1..=3 {
        assert_eq!((session.practice_rounds(), session.ordinal()), (round, (1, 2)));
        for _ in 0..2 {
            let number = session.progress().0;
            session.apply(&done(number)).unwrap();
        }
    }
    assert_eq!((session.stage(), session.trial(), session.outcomes().len()), (Stage::ScreenedOut, None, 0));
    // Passed in the second round: on to the data
    let (_folder, mut session) = begun("acquisition", "");
    for number in 0..2 {
        session.apply(&done(number)).unwrap();
    }
    for _ in 0..2 {
        answer(&mut session);
    }
    assert_eq!((session.stage(), session.ordinal()), (Stage::Trials, (1, 6)));
    assert_ne!(session.role(), Some(TrialRole::Practice));
}

#[test]
fn answers_too_soon_after_onset_are_refused() {
    let (_folder, mut session) = begun("validation", "");
    for bad in [timing(86.0), timing(165.0), timing(f64::NAN), timing(1e12)] {
        let event = StudyEvent::Answer { trial: 0, choice: Choice::Identical, timing: bad };
        assert!(session.apply(&event).is_err());
    }
    assert_eq!(session.progress().0, 0);
    let event = StudyEvent::Answer { trial: 0, choice: Choice::Identical, timing: timing(301.0) };
    session.apply(&event).unwrap();
    let (_folder, mut session) = begun("acquisition", "");
    assert!(session.apply(&StudyEvent::Step { trial: 0, tile: 0, level: 1, at: None, ms: 90.0 }).is_err());
}

#[test]
fn steps_are_reversible_and_one_at_a_time() {
    let (_folder, mut session) = begun("acquisition", "");
    for level in [1, 2, 1, 0, 1] {
        session.apply(&step(0, 0, level)).unwrap();
    }
    let events = session.events();
    for wrong in [step(0, 0, 3), step(0, 0, 1), step(0, 2, 1), step(0, 0, u32::MAX), step(1, 0, 2)] {
        assert!(session.apply(&wrong).is_err(), "{wrong:?}");
    }
    let first = StudyEvent::Answer { trial: 0, choice: Choice::First, timing: timing(900.0) };
    assert!(session.apply(&first).is_err());
    assert!(matches!(session.trial(), Some(Trial::Acquisition { levels, .. }) if levels == [1, 0]));
    assert_eq!(session.events(), events);
    // To the end of the stack and no further.
    for level in 2..=5 {
        session.apply(&step(0, 0, level)).unwrap();
    }
    assert!(session.apply(&step(0, 0, 6)).is_err());
}

#[test]
fn nothing_is_shown_before_consent_or_while_paused() {
    let folder = Folder::new("acquisition", &["wall"], &levels(4, 2.0), "");
    let study = folder.study();
    let mut session = ParticipantSession::new(study.clone(), grids(&study), Plan::draw(&study, 5));
    assert_eq!(session.trial(), None);
    assert!(session.apply(&StudyEvent::Conditions(conditions())).is_err());
    assert!(session.apply(&step(0, 0, 1)).is_err());
    let consent = |language: &str| StudyEvent::Consent { language: language.into() };
    assert!(session.apply(&consent("fr")).is_err(), "the study has no French");
    session.apply(&consent("en")).unwrap();
    assert!(session.apply(&consent("en")).is_err());
    for (name, bad) in [
        ("zoomed", Conditions { zoom: 1.5, ..conditions() }),
        ("NaN", Conditions { distance_mm: f64::NAN, ..conditions() }),
        ("depth", Conditions { colour_depth: 16, ..conditions() }),
    ] {
        assert!(session.apply(&StudyEvent::Conditions(bad)).is_err(), "{name}");
    }
    session.apply(&StudyEvent::Conditions(conditions())).unwrap();
    assert!(session.apply(&StudyEvent::Resume).is_err());
    session.apply(&StudyEvent::Pause).unwrap();
    assert!(session.apply(&StudyEvent::Pause).is_err());
    assert!(session.apply(&step(0, 0, 1)).is_err());
    session.apply(&StudyEvent::Resume).unwrap();
    session.apply(&step(0, 0, 1)).unwrap();
}

/// Conditions outside the limits keep the trials closed, also in the middle of a session, until they are
/// mended.
#[test]
fn viewing_limits_are_kept() {
    let (_folder, mut session) = begun("acquisition", "");
    let near = Conditions { distance_mm: 150.0, ..conditions() };
    session.apply(&StudyEvent::Conditions(near)).unwrap();
    assert_eq!(
        (session.stage(), session.viewing_problem(), session.trial()),
        (Stage::Conditions, Some(ViewingProblem::Distance), None)
    );
    assert!(session.apply(&step(0, 0, 1)).is_err());
    session.apply(&StudyEvent::Conditions(conditions())).unwrap();
    assert!(session.viewing_problem().is_none() && session.trial().is_some());
}

#[test]
fn questions_come_between_consent_and_conditions() {
    let folder = Folder::new("acquisition", &["wall"], &levels(4, 2.0), "");
    let text = std::fs::read_to_string(&folder.file).unwrap()
        + "[[question]]\nid = \"age\"\nkind = \"number\"\nrange = [18, 99]\ntext = { en = \"Your age\" }\n\
           [[question]]\nid = \"glasses\"\nkind = \"choice\"\noptional = true\ntext = { en = \"Glasses?\" }\n\
           option = [{ id = \"yes\", text = { en = \"yes\" } }, { id = \"no\", text = { en = \"no\" } }]\n";
    std::fs::write(&folder.file, text).unwrap();
    let study = folder.study();
    let mut session = ParticipantSession::new(study.clone(), grids(&study), Plan::draw(&study, 5));
    session.apply(&StudyEvent::Consent { language: "en".into() }).unwrap();
    assert_eq!(session.stage(), Stage::Questions);
    let answers = |pairs: &[(&str, &str)]| StudyEvent::Questions {
        answers: pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect::<BTreeMap<_, _>>(),
    };
    for wrong in [
        answers(&[]),
        answers(&[("age", "17")]),
        answers(&[("age", "NaN")]),
        answers(&[("age", "30"), ("glasses", "perhaps")]),
        answers(&[("age", "30"), ("name", "Anna")]),
    ] {
        assert!(session.apply(&wrong).is_err(), "{wrong:?}");
    }
    session.apply(&answers(&[("age", "30")])).unwrap();
    assert_eq!((session.stage(), session.answers()["age"].as_str()), (Stage::Conditions, "30"));
}

/// The same seed gives the same trials, another seed others.
#[test]
fn order_depends_on_the_seed_alone() {
    let folder = Folder::new("validation", &["wall", "door"], &levels(6, 2.0), "repeats = 10");
    let study = folder.study();
    let answered = |seed| {
        let mut session = ParticipantSession::new(study.clone(), grids(&study), Plan::draw(&study, seed));
        run(&mut session, &mut public(2, &[40.0, 40.0]).draw(1)).unwrap();
        format!("{:?}", session.outcomes())
    };
    assert_eq!(answered(3), answered(3));
    assert_ne!(answered(3), answered(4));
}

/// Who answers without looking is excluded, in every protocol, and attentive observers are not: of 60 each,
/// seeded.
#[test]
fn inattentive_observers_are_excluded() {
    use noisefloor_study::analysis::{Observer, screening};
    for (protocol, extra) in
        [("acquisition", ""), ("validation", "repeats = 3"), ("forced-choice", "trials = 8")]
    {
        let folder = Folder::new(protocol, &["wall", "door"], &levels(16, 1.5), extra);
        let study = folder.study();
        let grids = grids(&study);
        let excluded = |behaviour| {
            let broken = |seed: u64| {
                let mut session =
                    ParticipantSession::new(study.clone(), grids.clone(), Plan::draw(&study, seed));
                let public = public(2, &[120.0, 300.0]);
                run(&mut session, &mut public.draw_as(seed, behaviour)).unwrap();
                !screening::individual(&Observer::of("x", "", &session), &study).is_empty()
            };
            (0..60).filter(|seed| broken(*seed)).count()
        };
        let counts = [Behaviour::Attentive, Behaviour::StraightLiner, Behaviour::RandomClicker].map(excluded);
        println!("{protocol}: of 60 each, attentive, straight-lining and random: {counts:?} are excluded");
        assert!(counts[0] <= 3 && counts[1] >= 54 && counts[2] >= 54, "{protocol}: {counts:?}");
    }
}
