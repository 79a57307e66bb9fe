use crate::kit::{Folder, levels, public};
use noisefloor_study::simulated::run;
use noisefloor_study::{
    Choice, Conditions, ParticipantSession, Stage, StudyEvent, Trial, TrialOutcome, grids,
};

fn conditions() -> Conditions {
    let mut observer = public(1, &[1.0, 1.0]).draw(0);
    let [_, StudyEvent::Conditions(conditions)] = ({
        let _ = &mut observer;
        observer.arrive("en")
    }) else {
        panic!("arrives otherwise")
    };
    conditions
}

fn begun(protocol: &str) -> (Folder, ParticipantSession) {
    let folder = Folder::new(protocol, &["wall", "door"], &levels(6, 2.0), "");
    let study = folder.study();
    let mut session = ParticipantSession::new(study.clone(), grids(&study), 5);
    session.apply(&StudyEvent::Consent { language: "en".into() }).unwrap();
    session.apply(&StudyEvent::Conditions(conditions())).unwrap();
    (folder, session)
}

#[test]
fn each_pair_is_shown_twice_and_practice_does_not_count() {
    let (_folder, mut session) = begun("acquisition");
    let mut shown = Vec::new();
    while let Some(Trial::Acquisition { number, practice, stack, levels }) = session.trial() {
        assert_eq!((practice, levels), (number == 0, vec![0, 0]));
        if !practice {
            shown.push(stack);
        }
        session.apply(&StudyEvent::Step { trial: number, tile: 1, level: 1 }).unwrap();
        session.apply(&StudyEvent::Done { trial: number }).unwrap();
    }
    shown.sort_unstable();
    assert_eq!(shown, [0, 0, 1, 1]);
    assert_eq!((session.stage(), session.progress(), session.outcomes().len()), (Stage::Finished, (5, 5), 4));
    assert!(
        session
            .outcomes()
            .iter()
            .all(|o| matches!(o, TrialOutcome::Stops { levels, clicks: 1, .. } if levels == &[0, 1]))
    );
    let repeats: Vec<u32> = session
        .outcomes()
        .iter()
        .map(|o| if let TrialOutcome::Stops { repeat, .. } = o { *repeat } else { 9 })
        .collect();
    assert_eq!((repeats.iter().filter(|r| **r == 0).count(), repeats.iter().max()), (2, Some(&1)));
}

#[test]
fn steps_are_reversible_and_one_at_a_time() {
    let (_folder, mut session) = begun("acquisition");
    let step = |tile, level| StudyEvent::Step { trial: 0, tile, level };
    for level in [1, 2, 1, 0, 1] {
        session.apply(&step(0, level)).unwrap();
    }
    let events = session.events();
    for wrong in [
        step(0, 3),
        step(0, 1),
        step(2, 1),
        step(0, u32::MAX),
        StudyEvent::Step { trial: 1, tile: 0, level: 2 },
    ] {
        assert!(session.apply(&wrong).is_err(), "{wrong:?}");
    }
    assert!(session.apply(&StudyEvent::Answer { trial: 0, choice: Choice::First }).is_err());
    assert!(matches!(session.trial(), Some(Trial::Acquisition { levels, .. }) if levels == [1, 0]));
    assert_eq!(session.events(), events);
    // To the end of the stack and no further.
    for level in 2..=5 {
        session.apply(&step(0, level)).unwrap();
    }
    assert!(session.apply(&step(0, 6)).is_err());
}

#[test]
fn nothing_is_shown_before_consent_or_while_paused() {
    let folder = Folder::new("acquisition", &["wall"], &levels(4, 2.0), "");
    let study = folder.study();
    let mut session = ParticipantSession::new(study.clone(), grids(&study), 5);
    assert_eq!(session.trial(), None);
    assert!(session.apply(&StudyEvent::Conditions(conditions())).is_err());
    assert!(session.apply(&StudyEvent::Step { trial: 0, tile: 0, level: 1 }).is_err());
    assert!(
        session.apply(&StudyEvent::Consent { language: "fr".into() }).is_err(),
        "the study has no French"
    );
    session.apply(&StudyEvent::Consent { language: "en".into() }).unwrap();
    assert!(session.apply(&StudyEvent::Consent { language: "en".into() }).is_err());
    for (name, bad) in [
        ("zoomed", Conditions { zoom: 1.5, ..conditions() }),
        ("ratio", Conditions { pixel_ratio: 1.25, ..conditions() }),
        ("NaN", Conditions { distance_mm: f64::NAN, ..conditions() }),
        ("depth", Conditions { colour_depth: 16, ..conditions() }),
    ] {
        assert!(session.apply(&StudyEvent::Conditions(bad)).is_err(), "{name}");
    }
    session.apply(&StudyEvent::Conditions(conditions())).unwrap();
    assert!(session.apply(&StudyEvent::Resume).is_err());
    session.apply(&StudyEvent::Pause).unwrap();
    assert!(session.apply(&StudyEvent::Pause).is_err());
    assert!(session.apply(&StudyEvent::Step { trial: 0, tile: 0, level: 1 }).is_err());
    session.apply(&StudyEvent::Resume).unwrap();
    session.apply(&StudyEvent::Step { trial: 0, tile: 0, level: 1 }).unwrap();
}

/// The same seed gives the same trials, another seed others; references are at the left as often as not.
#[test]
fn order_depends_on_the_seed_alone() {
    let folder = Folder::new("validation", &["wall", "door"], &levels(6, 2.0), "repeats = 10");
    let study = folder.study();
    let answered = |seed| {
        let mut session = ParticipantSession::new(study.clone(), grids(&study), seed);
        run(&mut session, &mut public(2, &[40.0, 40.0]).draw(1)).unwrap();
        format!("{:?}", session.outcomes())
    };
    assert_eq!(answered(3), answered(3));
    assert_ne!(answered(3), answered(4));
}

/// 600 mm, 3.78 pixels a mm: 2·600·tan(½°)·3.78 = 39.58 pixels a degree.
#[test]
fn visual_angle_has_a_known_value() {
    assert!((conditions().pixels_per_degree() - 39.58).abs() < 0.01);
}
