//! Models and checkpoints: the bytes are the payload, of a checkpoint after its length and before the film; magic,
//! version, lengths and checksums are right.

use crate::files::{HEADER, content, framed};
use noisefloor::{Checkpoint, FixedSpp, Model, Params, Session};

/// What the checkpoints belong to.
const JOB: &str = "a job";

pub(crate) fn model(payload: &[u8]) -> bool {
    thread_local!(static HEAD: Vec<u8> = small_model());
    let Ok(model) = HEAD.with(|head| Model::read(framed(head, payload).as_slice())) else { return false };
    // What can be read can be used, and written so that it reads back
    let mut again = Vec::new();
    model.write(&mut again).expect("a model that was read can be written");
    assert_eq!(Model::read(again.as_slice()).expect("and read again").digest(), model.digest());
    true
}

pub(crate) fn model_seeds() -> Vec<Vec<u8>> {
    vec![small_model().split_off(HEADER)]
}

/// The bundled model with few familiar zones, so that mutants differ in what matters.
fn small_model() -> Vec<u8> {
    let mut parts = Model::bundled().into_parts();
    if let Some(familiarity) = &mut parts.familiarity {
        familiarity.zones.truncate(3);
    }
    let mut bytes = Vec::new();
    Model::new(parts).and_then(|model| model.write(&mut bytes)).expect("a part of a model is a model");
    bytes
}

pub(crate) fn checkpoint(bytes: &[u8]) -> bool {
    thread_local!(static HEAD: Vec<u8> = kept(&session()));
    let Some((length, rest)) = bytes.split_first_chunk() else { return false };
    let (payload, film) = rest.split_at(usize::from(u16::from_le_bytes(*length)).min(rest.len()));
    let whole = HEAD.with(|head| [&framed(head, payload), film, blake3::hash(film).as_bytes()].concat());
    let Ok(checkpoint) = Checkpoint::read(whole.as_slice()) else { return false };
    let Ok(mut session) = fresh().resume(JOB, checkpoint) else { return false };
    // A session that resumes can go on
    let requests = session.requests();
    for request in requests {
        let grey = vec![[0.5; 3]; request.tile.pixels()];
        if session.push(request.tile.index, request.spp, &grey).is_err() {
            return false;
        }
    }
    session.judge().is_ok()
}

pub(crate) fn checkpoint_seeds() -> Vec<Vec<u8>> {
    let seed = |whole: Vec<u8>| {
        let payload = content(&whole);
        let film = &whole[HEADER + payload.len()..whole.len() - 32];
        [&(payload.len() as u16).to_le_bytes(), payload, film].concat()
    };
    vec![seed(kept(&fresh())), seed(kept(&session()))]
}

fn fresh() -> Session<FixedSpp> {
    let params = Params::default().with_tile(16);
    Session::new(20, 16, FixedSpp(1000), params).expect("a small picture")
}

/// With samples in both halves of both tiles.
fn session() -> Session<FixedSpp> {
    let mut session = fresh();
    for round in 0..2 {
        for request in session.requests() {
            let value = |i: usize| [(i + round) as f32 / 400.0; 3];
            let mean: Vec<_> = (0..request.tile.pixels()).map(value).collect();
            session.push(request.tile.index, request.spp, &mean).expect("finite samples");
        }
        session.judge().expect("a count needs no evidence");
    }
    session
}

fn kept(session: &Session<FixedSpp>) -> Vec<u8> {
    let mut bytes = Vec::new();
    session.checkpoint(JOB).and_then(|kept| kept.write(&mut bytes)).expect("memory takes all");
    bytes
}
