//! Samples by blocks.

use super::*;
use noisefloor::source::BlockRequest;

/// The most blocks that a tile of these tests has.
const MOST: usize = 4;

fn by_blocks() -> NfParams {
    NfParams { blocks: 16, ..params() }
}

/// What the session asks of the blocks of a tile.
fn ask(session: &Handle, tile: usize, spp: u64) -> (NfBlocks, Vec<NfBlockSamples>) {
    let (mut layout, mut blocks) = (NfBlocks::default(), vec![NfBlockSamples::default(); MOST]);
    // SAFETY: a living handle, and an array of the size given.
    let status = unsafe {
        nf_session_block_request(session.0, tile, spp, &mut layout, blocks.as_mut_ptr(), blocks.len())
    };
    assert_eq!(status, NfStatus::Ok, "{}", message());
    blocks.truncate(layout.columns * layout.rows);
    (layout, blocks)
}

fn give(session: &Handle, tile: usize, spp: u64, blocks: &[NfBlockSamples], mean: &[f32]) -> NfStatus {
    // SAFETY: a living handle, and arrays of the sizes given.
    unsafe {
        let (mean, floats) = (mean.as_ptr(), mean.len());
        nf_session_push_blocks(session.0, tile, spp, blocks.as_ptr(), blocks.len(), mean, floats)
    }
}

/// A grey wall that is noisy only in the left half of a tile, by the samples that each pixel got.
fn wall(tile: Tile, of_pixel: impl Fn(usize, usize) -> NfBlockSamples) -> Vec<f32> {
    let pixel = |i: usize| {
        let (column, row) = (i % tile.width, i / tile.width);
        let NfBlockSamples { first, spp } = of_pixel(column, row);
        let part = Tile { width: 1, height: 1, ..tile };
        let noise = if column < 16 {
            render(Tile { index: 8192 * tile.index + i, ..part }, first, spp)[0]
        } else {
            0.5
        };
        [noise; 3]
    };
    (0..tile.pixels()).flat_map(pixel).collect()
}

fn of_c(tile: Tile, (layout, blocks): &(NfBlocks, Vec<NfBlockSamples>)) -> Vec<f32> {
    wall(tile, |column, row| blocks[row / layout.edge * layout.columns + column / layout.edge])
}

fn of_rust(request: &BlockRequest) -> Vec<f32> {
    wall(request.tile, |column, row| {
        let samples = request.at(column, row);
        NfBlockSamples { first: samples.first, spp: samples.spp }
    })
}

/// One round with blocks, then verdicts.
fn block_round(session: &Handle) {
    for request in requests(session) {
        let asked = ask(session, request.tile.index, request.spp);
        let mean = of_c(tile(request.tile), &asked);
        assert_eq!(
            give(session, request.tile.index, request.spp, &asked.1, &mean),
            NfStatus::Ok,
            "{}",
            message()
        );
    }
    // SAFETY: a living handle, and NULL where it is allowed.
    assert_eq!(unsafe { nf_session_judge(session.0, null_mut()) }, NfStatus::Ok, "{}", message());
}

/// A session whose blocks have shares, after the first verdicts.
fn with_shares() -> Handle {
    let session = session(&by_blocks());
    while states(&session)[0].probability.is_nan() {
        block_round(&session);
    }
    session
}

#[test]
fn blocks_of_c_get_what_those_of_rust_get() {
    let rust = Params { tile: EDGE, max_spp: 400, blocks: 16, ..Params::default() };
    let mut expected = Session::new(WIDTH, HEIGHT, Oracle::bundled(), rust).unwrap();
    let session = session(&by_blocks());
    while !expected.is_done() {
        for request in expected.requests() {
            let request = expected.block_request(&request).unwrap();
            let (layout, blocks) = ask(&session, request.tile.index, request.spp);
            let got: Vec<_> = blocks.iter().map(|b| (b.first, b.spp)).collect();
            assert_eq!(got, request.blocks.iter().map(|b| (b.first, b.spp)).collect::<Vec<_>>());
            let rows = request.tile.height / 16; // 1 at the bottom of the picture, elsewhere 2
            assert_eq!(layout, NfBlocks { edge: 16, columns: 2, rows });
            expected.push_blocks(&request, of_rust(&request).as_chunks().0).unwrap();
        }
        expected.judge().unwrap();
        block_round(&session);
    }
    assert_eq!(image(&session), expected.film().image().as_flattened());
    for (state, stop) in states(&session).iter().zip(expected.stops()) {
        assert_eq!((state.spp, Some(state.probability)), (stop.spp, stop.probability));
        assert_ne!(state.reason, NF_REASON_OPEN);
        assert_eq!((state.spp_least, state.spp_most), expected.film().spp_range(stop.tile.index));
        assert!(state.spp_least < state.spp && state.spp < state.spp_most, "{state:?}");
    }
}

#[test]
fn a_renderer_may_ignore_blocks() {
    let session = session(&by_blocks());
    while open(&session) > 0 {
        round(&session, 2);
    }
    for state in states(&session) {
        assert_eq!((state.spp_least, state.spp_most), (state.spp, state.spp));
    }
}

#[test]
fn shares_are_kept_in_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = CString::new(folder.path().join("session.nfc").to_str().unwrap()).unwrap();
    let (whole, other) = (with_shares(), session(&by_blocks()));
    // SAFETY: living handles, and text.
    unsafe {
        assert_eq!(nf_session_save(whole.0, c"wall".as_ptr(), path.as_ptr()), NfStatus::Ok, "{}", message());
        let without = session(&params());
        assert_eq!(nf_session_resume(without.0, c"wall".as_ptr(), path.as_ptr()), NfStatus::Checkpoint);
        let status = nf_session_resume(other.0, c"wall".as_ptr(), path.as_ptr());
        assert_eq!(status, NfStatus::Ok, "{}", message());
    }
    let asked = ask(&whole, 0, 50);
    assert!(asked.1[0].spp > asked.1[1].spp, "{asked:?}");
    assert_eq!(ask(&other, 0, 50), asked);
}

#[test]
fn blocks_that_were_not_asked_for_are_refused() {
    use NfStatus::{Batch, NullPointer, Size};
    let session = with_shares();
    let before = (states(&session), image(&session));
    let s = session.0;
    let (mut layout, mut room) = (NfBlocks::default(), [NfBlockSamples::default(); MOST]);
    let (asked, mean) = (ask(&session, 0, 50).1, [0.5_f32; 3 * EDGE * EDGE]);
    // SAFETY: null pointers are checked for; all others lead to variables of this function.
    unsafe {
        let mut request = |tile, spp, capacity| {
            nf_session_block_request(s, tile, spp, &mut layout, room.as_mut_ptr(), capacity)
        };
        assert_eq!([request(9, 50, MOST), request(0, 0, MOST)], [Batch; 2]);
        assert_eq!([request(0, 50, 0), request(0, 50, MOST - 1)], [Size; 2]);
        assert_eq!(message(), "blocks has 3 elements, and at least 4 are needed");
        assert_eq!((layout, room), (NfBlocks::default(), [NfBlockSamples::default(); MOST]));
        let nowhere = [
            nf_session_block_request(s, 0, 50, null_mut(), room.as_mut_ptr(), MOST),
            nf_session_block_request(s, 0, 50, &mut layout, null_mut(), MOST),
            nf_session_push_blocks(s, 0, 50, null(), MOST, mean.as_ptr(), mean.len()),
            nf_session_push_blocks(s, 0, 50, asked.as_ptr(), MOST, null(), mean.len()),
        ];
        assert_eq!(nowhere, [NullPointer; 4]);
    }
    assert_eq!(give(&session, 0, 50, &asked[..3], &mean), Size);
    assert_eq!(give(&session, 0, 50, &asked, &mean[3..]), Size);
    assert_eq!(give(&session, 9, 50, &asked, &mean), Batch);
    for (spp, counts) in [(50, [50; MOST]), (50, [0; MOST]), (50, [u64::MAX; MOST]), (0, [0; MOST])] {
        let blocks = counts.map(|spp| NfBlockSamples { first: 0, spp });
        assert_eq!(give(&session, 0, spp, &blocks, &mean), Batch, "{counts:?}");
    }
    assert_eq!(give(&session, 0, 51, &asked, &mean), Batch);
    assert!(message().contains("of tile 0 has"), "{}", message());
    assert_eq!((states(&session), image(&session)), before, "a failure changes nothing");
    assert_eq!(give(&session, 0, 50, &asked, &mean), NfStatus::Ok);
}

#[test]
fn what_is_not_finite_is_no_sample_of_a_block() {
    let session = session(&by_blocks());
    let blocks = ask(&session, 0, 8).1;
    let mut mean = [0.5_f32; 3 * EDGE * EDGE];
    (mean[0], mean[4]) = (f32::NAN, f32::INFINITY);
    assert_eq!(give(&session, 0, 8, &blocks, &mean), NfStatus::Ok);
    let picture = image(&session);
    assert_eq!((&picture[..6], &picture[6..9]), (&[0.0; 6][..], &[0.5; 3][..]));
}

#[test]
fn sessions_without_blocks_have_none() {
    let session = session(&params());
    let (mut layout, mut room) = (NfBlocks::default(), [NfBlockSamples { first: 0, spp: 8 }; MOST]);
    // SAFETY: a living handle, and variables of this function.
    let status = unsafe { nf_session_block_request(session.0, 0, 8, &mut layout, room.as_mut_ptr(), MOST) };
    assert_eq!((status, layout), (NfStatus::Unavailable, NfBlocks::default()));
    assert_eq!(give(&session, 0, 8, &room, &[0.5; 3 * EDGE * EDGE]), NfStatus::Unavailable);
    assert!(message().contains("NfParams.blocks is 0"), "{}", message());
    assert_eq!(states(&session)[0].spp, 0);
}
