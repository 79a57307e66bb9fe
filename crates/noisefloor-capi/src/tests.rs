//! The functions, called as C calls them.

use crate::check::*;
use crate::eyes::*;
use crate::files::*;
use crate::oracle::*;
use crate::params::*;
use crate::push::*;
use crate::results::*;
use crate::session::*;
use crate::status::*;
use crate::tone::*;
use crate::tune::*;
use noisefloor::display::{ToneCurve, parse_cube};
use noisefloor::tune::{Excess, Knob, Look, PicturePair, Search};
use noisefloor::{Oracle, Params, Rgb, Session, Tile, ToneMapping, criterion::CriterionError};
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::{null, null_mut};

mod background;
mod denoise;
#[cfg(target_os = "linux")]
mod memory;
mod wasm;

const WIDTH: usize = 96;
const HEIGHT: usize = 80;
const EDGE: usize = 32;
const PIXELS: usize = WIDTH * HEIGHT;

fn message() -> String {
    // SAFETY: text of this library, read before the next call.
    unsafe { CStr::from_ptr(nf_last_error()) }.to_str().unwrap().to_owned()
}

#[track_caller]
fn ok(status: NfStatus) {
    assert_eq!(status, NfStatus::Ok, "{}", message());
}

fn params() -> NfParams {
    NfParams { tile: EDGE as u32, max_spp: 400, ..NfParams::default() }
}

/// A handle that is freed in the end. Handles may go from thread to thread.
struct Handle(*mut NfSession);
// SAFETY: sessions stand behind a lock; the tests free them when all threads have ended.
unsafe impl Sync for Handle {}
// SAFETY: as above.
unsafe impl Send for Handle {}

impl Drop for Handle {
    fn drop(&mut self) {
        nf_session_free(self.0);
    }
}

fn bundled() -> *mut NfOracle {
    let mut oracle = null_mut();
    // SAFETY: a pointer to a variable of this function.
    ok(unsafe { nf_oracle_bundled(0.95, &mut oracle) });
    oracle
}

fn session(params: &NfParams) -> Handle {
    let (oracle, mut session) = (bundled(), null_mut());
    // SAFETY: a pointer to a variable of this function, and a handle that was just made.
    ok(unsafe { nf_session_new(WIDTH, HEIGHT, oracle, params, &mut session) });
    ok(nf_oracle_free(oracle)); // the session does not need it
    Handle(session)
}

/// A grey wall with noise that shrinks as it should, the same for the same samples.
fn render(tile: Tile, first: u64, spp: u64) -> Vec<f32> {
    let noise = |i: usize| {
        let mut key = (tile.index as u64) << 40 | first << 20 | i as u64;
        key = (key ^ key >> 31).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        key = (key ^ key >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (key >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    (0..3 * tile.pixels()).map(|i| 0.5 + 0.4 * noise(i) / (spp as f32).sqrt()).collect()
}

fn tile(t: NfTile) -> Tile {
    Tile { index: t.index, x: t.x, y: t.y, width: t.width, height: t.height }
}

fn requests(session: &Handle) -> Vec<NfRequest> {
    // SAFETY: a living handle, and arrays of the sizes given.
    unsafe {
        let mut all = vec![NfRequest::default(); nf_session_tile_count(session.0)];
        let mut count = 99;
        ok(nf_session_requests(session.0, all.as_mut_ptr(), all.len(), &mut count));
        all.truncate(count);
        all
    }
}

fn push(session: &Handle, request: &NfRequest) {
    let mean = render(tile(request.tile), request.first, request.spp);
    // SAFETY: a living handle, and an array of the size given.
    ok(unsafe { nf_session_push(session.0, request.tile.index, request.spp, mean.as_ptr(), mean.len()) });
}

/// Pushes from this many threads, then judges.
fn round(session: &Handle, threads: usize) {
    let wanted = requests(session);
    std::thread::scope(|scope| {
        for part in wanted.chunks(wanted.len().div_ceil(threads).max(1)) {
            scope.spawn(move || part.iter().for_each(|request| push(session, request)));
        }
    });
    // SAFETY: a living handle, and NULL where it is allowed.
    ok(unsafe { nf_session_judge(session.0, null_mut()) });
}

fn states(session: &Handle) -> Vec<NfTileState> {
    // SAFETY: a living handle, and an array of the size given.
    unsafe {
        let mut states = vec![NfTileState::default(); nf_session_tile_count(session.0)];
        ok(nf_session_states(session.0, states.as_mut_ptr(), states.len()));
        states
    }
}

fn image(session: &Handle) -> Vec<f32> {
    let mut image = vec![f32::NAN; 3 * PIXELS];
    // SAFETY: a living handle, and an array of the size given.
    ok(unsafe { nf_session_image(session.0, image.as_mut_ptr(), image.len()) });
    image
}

fn open(session: &Handle) -> usize {
    let mut open = 99;
    // SAFETY: a living handle, and a variable of this function.
    ok(unsafe { nf_session_open_tiles(session.0, &mut open) });
    open
}

/// The same round in Rust.
fn round_in_rust<C: noisefloor::StoppingCriterion>(session: &mut Session<C>) {
    for request in session.requests() {
        let mean = render(request.tile, request.first, request.spp);
        session.push(request.tile.index, request.spp, mean.as_chunks().0).unwrap();
    }
    session.judge().unwrap();
}

#[test]
fn stops_and_picture_are_those_of_rust_whatever_the_number_of_threads() {
    // A frame of a film, to see that viewing conditions are read
    let viewing = Params::default().viewing.with_frames_per_second(Some(24.0)).unwrap();
    let rust = Params::default().with_tile(EDGE).with_max_spp(400).with_viewing(viewing);
    let mut expected = Session::new(WIDTH, HEIGHT, Oracle::bundled(), rust).unwrap();
    while !expected.is_done() {
        round_in_rust(&mut expected);
    }
    for threads in [1, 5] {
        let session = session(&NfParams { viewing: c"desk,fps=24".as_ptr(), ..params() });
        while open(&session) > 0 {
            round(&session, threads);
        }
        assert!(requests(&session).is_empty());
        assert_eq!(image(&session), expected.film().image().as_flattened());
        for (state, stop) in states(&session).iter().zip(expected.stops()) {
            assert_eq!((state.spp, Some(state.probability)), (stop.spp, stop.probability));
            assert_ne!(state.reason, NF_REASON_OPEN);
        }
        let mut map = vec![0.0; PIXELS];
        // SAFETY: a living handle, and an array of the size given.
        ok(unsafe { nf_session_visible_noise(session.0, map.as_mut_ptr(), PIXELS) });
        assert_eq!(Some(map), expected.visible_noise());
    }
}

#[test]
fn tiles_of_a_whole_picture_are_cut_out() {
    let (cut, whole) = (session(&params()), session(&params()));
    // RGBA, each pixel another colour
    let frame: Vec<f32> = (0..4 * PIXELS).map(|i| (i % 1013) as f32 / 1013.0).collect();
    for request in requests(&cut) {
        let (t, index) = (tile(request.tile), request.tile.index);
        let pixel = |p: usize| -> Rgb { [frame[4 * p], frame[4 * p + 1], frame[4 * p + 2]] };
        let mean: Vec<f32> = t.rows(WIDTH).flatten().flat_map(pixel).collect();
        // SAFETY: living handles, and arrays of the sizes given.
        unsafe {
            ok(nf_session_push(cut.0, index, 8, mean.as_ptr(), mean.len()));
            ok(nf_session_push_image(whole.0, index, 8, frame.as_ptr(), frame.len(), 4));
            // Of a running mean with twice the samples, the other half is new
            ok(nf_session_push_running(cut.0, index, 16, mean.as_ptr(), mean.len()));
            assert_eq!(nf_session_push_running(cut.0, index, 16, mean.as_ptr(), mean.len()), NfStatus::Batch);
        }
    }
    let expected: Vec<f32> = frame.chunks(4).flat_map(|p| p[..3].to_vec()).collect();
    assert_eq!(image(&whole), expected);
    let far = image(&cut).iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(far < 1e-6, "{far}");
}

/// Whether its checkpoint was a file or stood in memory.
#[test]
fn a_resumed_session_ends_as_the_uninterrupted_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = CString::new(folder.path().join("session.nfc").to_str().unwrap()).unwrap();
    let whole = session(&params());
    round(&whole, 1);
    let (job, mut size) = (c"wall".as_ptr(), 0);
    // SAFETY: living handles, text, and arrays of the sizes given.
    unsafe {
        ok(nf_session_save(whole.0, job, path.as_ptr()));
        let [other, restored] = [session(&params()), session(&params())];
        assert_eq!(nf_session_resume(other.0, c"hall".as_ptr(), path.as_ptr()), NfStatus::Checkpoint);
        assert!(message().contains("its job is wall, not hall"), "{}", message());
        assert_eq!(states(&other)[0].spp, 0, "a failure changes nothing");
        ok(nf_session_resume(other.0, job, path.as_ptr()));
        assert_eq!(nf_session_resume(other.0, job, c"/nowhere/at/all".as_ptr()), NfStatus::Io);

        let saved = std::fs::read(folder.path().join("session.nfc")).unwrap();
        ok(nf_session_checkpoint(whole.0, job, null_mut(), 0, &mut size));
        assert_eq!(size, saved.len());
        let mut bytes = vec![0; size];
        let short = nf_session_checkpoint(whole.0, job, bytes.as_mut_ptr(), size - 1, &mut size);
        assert_eq!(short, NfStatus::Size, "{}", message());
        ok(nf_session_checkpoint(whole.0, job, bytes.as_mut_ptr(), bytes.len(), &mut size));
        assert!(bytes == saved);
        let cut = nf_session_restore(restored.0, job, bytes.as_ptr(), size - 1);
        assert_eq!(cut, NfStatus::Checkpoint, "{}", message());
        assert_eq!(states(&restored)[0].spp, 0, "a failure changes nothing");
        ok(nf_session_restore(restored.0, job, bytes.as_ptr(), size));
        for session in [&whole, &other, &restored] {
            while open(session) > 0 {
                round(session, 2);
            }
        }
        for resumed in [&other, &restored] {
            assert_eq!(states(&whole), states(resumed));
            assert_eq!(image(&whole), image(resumed));
        }
        let lost = CString::new(folder.path().join("no/such/folder").to_str().unwrap()).unwrap();
        assert_eq!(nf_session_save(whole.0, job, lost.as_ptr()), NfStatus::Io);
    }
}

/// Of the session that resumes, and of the one that was saved.
#[test]
fn shared_pixels_stay_shared_after_a_resume() {
    let folder = tempfile::tempdir().unwrap();
    let path = CString::new(folder.path().join("session.nfc").to_str().unwrap()).unwrap();
    for [saved, resuming] in [[false, false], [true, false], [false, true]] {
        let [one, other] = [saved, resuming].map(|shared| {
            let session = session(&params());
            ok(nf_session_share_pixels(session.0, shared));
            session
        });
        // SAFETY: living handles, and text.
        unsafe {
            ok(nf_session_save(one.0, c"wall".as_ptr(), path.as_ptr()));
            ok(nf_session_resume(other.0, c"wall".as_ptr(), path.as_ptr()));
        }
        let resumed = crate::handle::get(other.0.cast_const()).ok().unwrap();
        let shares = resumed.lock().ok().unwrap().pixels() == noisefloor::source::PixelNoise::Shared;
        assert_eq!(shares, saved || resuming);
    }
}

/// A `.cube` file and a table make the verdicts that they make in Rust, of sessions and of pairs of pictures.
#[test]
fn tone_mappings_of_ones_own_judge_as_in_rust() {
    let text = "LUT_1D_SIZE 3\nLUT_3D_SIZE 2\n0 0 0\n.3 .4 .5\n1 1 1\n\
                0 0 0\n1 0 0\n0 1 0\n1 .9 0\n0 0 .8\n1 0 1\n0 1 1\n1 1 1\n";
    let table: Vec<f32> = (0..81).map(|i| ((i / 3 % 3) as f32 / 2.0).powf(0.5)).collect();
    let lut = parse_cube(text.as_bytes()).unwrap().into_tone_curve("log2:-6,3".parse().unwrap());
    let made = ToneCurve::of_table(3, 0.01, 4.0, table.as_chunks().0.to_vec()).unwrap();
    let mut found = Vec::new();
    for (by_cube, curve) in [(true, lut), (false, made)] {
        let mut tone = null_mut();
        // SAFETY: text and an array of the sizes given, and a variable of this function.
        ok(unsafe {
            if by_cube {
                nf_tone_of_cube(text.as_ptr().cast(), text.len(), c"log2:-6,3".as_ptr(), &mut tone)
            } else {
                nf_tone_of_table(0.01, 4.0, table.as_ptr(), table.len(), 3, &mut tone)
            }
        });
        let shown = NfParams { tone, exposure: 0.7, ..params() };
        let rust = Params::default().with_tile(EDGE).with_max_spp(400);
        let rust = rust.with_tone_mapping(ToneMapping::Custom { exposure: 0.7, curve });

        let mut expected = Session::new(WIDTH, HEIGHT, Oracle::bundled(), rust.clone()).unwrap();
        let by_c = session(&shown);
        for _ in 0..3 {
            round_in_rust(&mut expected);
            round(&by_c, 1);
        }
        let p = |tile| expected.verdict(tile).and_then(|verdict| verdict.probability).unwrap();
        let probabilities: Vec<f32> = states(&by_c).iter().map(|state| state.probability).collect();
        assert_eq!(probabilities, (0..probabilities.len()).map(p).collect::<Vec<_>>());

        let whole = Tile { index: 0, x: 0, y: 0, width: WIDTH, height: HEIGHT };
        let (a, b) = (render(whole, 0, 16), render(whole, 1, 16));
        let pixels = [&a, &b].map(|picture| picture.as_chunks().0.to_vec());
        let pair = PicturePair::new((WIDTH, HEIGHT), pixels, 128.0).unwrap();
        let in_rust = pair.look(&Oracle::bundled(), &rust.with_tile(64), None).unwrap().excess;
        let (oracle, mut excess) = (bundled(), NfExcess::default());
        // SAFETY: living handles, arrays of the sizes given, and variables of this function.
        unsafe {
            let (width, height) = (WIDTH as u32, HEIGHT as u32);
            ok(nf_excess(oracle, &shown, width, height, a.as_ptr(), b.as_ptr(), a.len(), &mut excess));
            ok(nf_oracle_free(oracle));
        }
        assert_eq!(excess.ratio, in_rust.ratio);
        found.push(excess.ratio);

        assert_eq!((nf_tone_free(tone), nf_tone_free(tone)), (NfStatus::Ok, NfStatus::Handle));
        round(&by_c, 1); // the session does not need it any more
        let (oracle, mut late) = (bundled(), null_mut());
        // SAFETY: a pointer to a variable of this function, and a handle that was just made.
        unsafe {
            let status = nf_session_new(WIDTH, HEIGHT, oracle, &shown, &mut late);
            assert!(status == NfStatus::Handle && message().contains("tone"), "{}", message());
            ok(nf_oracle_free(oracle));
        }
    }
    assert!(found[0] != found[1] && found.iter().all(|ratio| *ratio > 0.0), "both show the same: {found:?}");
    let broken = |text: &str, input: *const c_char| {
        let mut tone = null_mut();
        // SAFETY: text of the size given, and a variable of this function.
        let status = unsafe { nf_tone_of_cube(text.as_ptr().cast(), text.len(), input, &mut tone) };
        (status, tone.is_null(), message())
    };
    let (status, none, said) = broken("LUT_1D_SIZE 2\n0 0 0\n", null());
    assert!(status == NfStatus::Argument && none && said.contains("asks for 2"), "{said}");
    let (status, none, said) = broken(text, c"log3:1,2".as_ptr());
    assert!(status == NfStatus::Argument && none && said.contains("no input of a LUT"), "{said}");
    let (status, none, said) = broken("LUT_1D_SIZE 2\n0 0 0\n255 255 255\n", null());
    assert!(status == NfStatus::Argument && none && said.contains("entry 1 is 255"), "{said}");
    use NfStatus::{Argument, Size};
    for (toe, top, edge, entry, status, said) in [
        (0.0, 4.0, 2, 0.5, Argument, "0 < toe < top"),
        (0.01, f32::INFINITY, 2, 0.5, Argument, "0 < toe < top"),
        (0.01, 4.0, 1, 0.5, Argument, "2 to 65 entries"),
        (0.01, 4.0, 3, 0.5, Size, "instead of 81"),
        (0.01, 4.0, 2, 255.0, Argument, "is 255"),
    ] {
        let (table, mut tone) = ([entry; 24], null_mut());
        // SAFETY: a table of the size given, and a variable of this function.
        let found = unsafe { nf_tone_of_table(toe, top, table.as_ptr(), table.len(), edge, &mut tone) };
        assert!(found == status && tone.is_null() && message().contains(said), "{}", message());
    }
}

/// What `judge` notices of two pictures, a search is told, too.
#[test]
fn pictures_that_are_unlike_each_other_are_noticed() {
    let whole = Tile { index: 0, x: 0, y: 0, width: WIDTH, height: HEIGHT };
    let (one, other) = (render(whole, 0, 1 << 16), render(whole, 1, 1 << 16));
    let (oracle, mut excess) = (bundled(), NfExcess::default());
    let mut compare = |change: fn(f32) -> f32, both: bool| {
        let b: Vec<f32> = other.iter().map(|&c| change(c)).collect();
        let a: Vec<f32> = if both { one.iter().map(|&c| change(c)).collect() } else { one.clone() };
        // SAFETY: a living handle, arrays of the sizes given, and a variable of this function.
        let status = unsafe {
            let (width, height) = (WIDTH as u32, HEIGHT as u32);
            nf_excess(oracle, null(), width, height, a.as_ptr(), b.as_ptr(), a.len(), &mut excess)
        };
        // SAFETY: text of the library's, which lasts until the next such call.
        let warnings = unsafe { CStr::from_ptr(nf_last_warnings()) }.to_str().unwrap().to_owned();
        (status, warnings)
    };
    assert_eq!(compare(|c| c, false), (NfStatus::Ok, String::new()));
    let (status, warnings) = compare(|c| 1.5 * c, false);
    assert!(status == NfStatus::Ok && warnings.contains("times as bright"), "{warnings}");
    assert_eq!(compare(|c| 8.0 * c, false), (NfStatus::Argument, String::new()));
    assert!(message().contains("differ in brightness"), "{}", message());
    assert_eq!(compare(|c| c - 2.0, true).0, NfStatus::Argument);
    assert!(message().contains("negative"), "{}", message());
    ok(nf_oracle_free(oracle));
}

#[test]
fn every_pointer_may_be_null_and_none_is_followed_then() {
    use NfStatus::NullPointer;
    let session = session(&params());
    let (s, mut n) = (session.0, 0);
    let mean = [0.5_f32; 3 * EDGE * EDGE];
    // SAFETY: null pointers are checked for; all others lead to variables of this function.
    unsafe {
        assert_eq!((nf_oracle_free(null_mut()), nf_session_free(null_mut())), (NfStatus::Ok, NfStatus::Ok));
        assert_eq!(nf_session_tile_count(null()), 0);
        let mut oracle = null_mut();
        let made = [
            nf_params_default(null_mut()),
            nf_oracle_bundled(0.95, null_mut()),
            nf_oracle_load(null(), 0.9, &mut oracle),
            nf_session_new(8, 8, null(), null(), &mut null_mut()),
        ];
        assert_eq!(made, [NullPointer; 4]);
        assert!(oracle.is_null());
        let without_session = [
            nf_session_tile(null(), 0, &mut NfTile::default()),
            nf_session_requests(null(), null_mut(), 0, &mut n),
            nf_session_push(null(), 0, 1, mean.as_ptr(), mean.len()),
            nf_session_push_running(null(), 0, 1, mean.as_ptr(), mean.len()),
            nf_session_push_image(null(), 0, 1, mean.as_ptr(), mean.len(), 3),
            nf_session_judge(null(), &mut n),
            nf_session_open_tiles(null(), &mut n),
            nf_session_states(null(), null_mut(), 0),
            nf_session_close_all(null(), NF_REASON_CANCELLED),
            nf_session_expected_samples(null(), &mut 0),
            nf_session_image(null(), null_mut(), 0),
            nf_session_visible_noise(null(), null_mut(), 0),
            nf_session_save(null(), c"".as_ptr(), c"".as_ptr()),
            nf_session_resume(null(), c"".as_ptr(), c"".as_ptr()),
            nf_session_checkpoint(null(), c"".as_ptr(), null_mut(), 0, &mut n),
            nf_session_restore(null(), c"".as_ptr(), null(), 0),
            nf_tone_of_cube(null(), 9, null(), &mut null_mut()),
            nf_tone_of_table(0.01, 4.0, null(), 24, 2, &mut null_mut()),
            nf_tone_of_cube(c"".as_ptr(), 0, null(), null_mut()),
        ];
        assert_eq!(without_session, [NullPointer; 19]);
        ok(nf_tone_free(null_mut()));
        let without_place = [
            nf_session_tile(s, 0, null_mut()),
            nf_session_requests(s, null_mut(), 9, &mut n),
            nf_session_requests(s, [NfRequest::default(); 9].as_mut_ptr(), 9, null_mut()),
            nf_session_push(s, 0, 1, null(), mean.len()),
            nf_session_push_running(s, 0, 1, null(), mean.len()),
            nf_session_push_image(s, 0, 1, null(), 3 * PIXELS, 3),
            nf_session_open_tiles(s, null_mut()),
            nf_session_states(s, null_mut(), 9),
            nf_session_image(s, null_mut(), 3 * PIXELS),
            nf_session_visible_noise(s, null_mut(), PIXELS),
            nf_session_save(s, null(), c"x".as_ptr()),
            nf_session_save(s, c"x".as_ptr(), null()),
            nf_session_resume(s, null(), c"x".as_ptr()),
            nf_session_resume(s, c"x".as_ptr(), null()),
            nf_session_checkpoint(s, c"x".as_ptr(), null_mut(), 0, null_mut()),
            nf_session_restore(s, c"x".as_ptr(), null(), 9),
        ];
        assert_eq!(without_place, [NullPointer; 16]);
        let odd = mean.as_ptr().cast::<u8>().add(1).cast();
        assert_eq!(nf_session_push(s, 0, 1, odd, mean.len()), NullPointer);
        assert_eq!(message(), "mean is not aligned");
    }
    assert_eq!(states(&session)[0].spp, 0);
}

#[test]
fn sizes_tiles_and_parameters_are_checked() {
    use NfStatus::{Argument, Batch, Io, Model, Size, Unavailable};
    let session = session(&params());
    let (s, mean) = (session.0, [0.5_f32; 4 * PIXELS]);
    let (whole, mut out) = (3 * EDGE * EDGE, [0.0_f32; 4]);
    // SAFETY: arrays are as long as said or longer.
    unsafe {
        for wrong in [0, 1, whole - 1, whole + 1, usize::MAX] {
            assert_eq!(nf_session_push(s, 0, 1, mean.as_ptr(), wrong), Size);
            assert_eq!(message(), format!("mean has {wrong} elements instead of {whole}"));
            assert_eq!(nf_session_push_image(s, 0, 1, mean.as_ptr(), wrong, 3), Size);
        }
        assert_eq!(nf_session_push_image(s, 0, 1, mean.as_ptr(), usize::MAX, usize::MAX), Argument);
        assert_eq!(nf_session_push(s, 9, 1, mean.as_ptr(), whole), Batch);
        assert_eq!(nf_session_push(s, usize::MAX, 1, mean.as_ptr(), whole), Batch);
        assert_eq!(nf_session_push(s, 0, 0, mean.as_ptr(), whole), Batch);
        assert_eq!(nf_session_states(s, [NfTileState::default(); 8].as_mut_ptr(), 8), Size);
        assert_eq!(nf_session_tile(s, 9, &mut NfTile::default()), Batch);
        // Arrays may be longer than they need to be
        let (mut states, mut requests) = ([NfTileState::default(); 12], [NfRequest::default(); 12]);
        ok(nf_session_states(s, states.as_mut_ptr(), 12));
        ok(nf_session_requests(s, requests.as_mut_ptr(), 12, &mut 0));
        assert_eq!(nf_session_requests(s, [NfRequest::default(); 8].as_mut_ptr(), 8, &mut 0), Size);
        assert_eq!(nf_session_image(s, out.as_mut_ptr(), 4), Size);
        assert_eq!(nf_session_visible_noise(s, out.as_mut_ptr(), 4), Size);
        let mut map = vec![0.0; PIXELS];
        assert_eq!(nf_session_visible_noise(s, map.as_mut_ptr(), PIXELS), Unavailable);
        assert_eq!(nf_session_expected_samples(s, &mut 0), Unavailable);
        for wrong in [NF_REASON_OPEN, NF_REASON_CONVERGED, NF_REASON_MAX_SPP, 99] {
            assert_eq!(nf_session_close_all(s, wrong), Argument);
        }

        let mut oracle = null_mut();
        assert_eq!(nf_oracle_bundled(1.5, &mut oracle), Argument);
        assert_eq!(nf_oracle_load(c"/nowhere/at/all".as_ptr(), 0.9, &mut oracle), Io);
        assert_eq!(nf_oracle_load(c"/".as_ptr(), 0.9, &mut oracle), Io);
        assert_eq!(nf_oracle_load(c"\xff".as_ptr(), 0.9, &mut oracle), Argument);
        let here = CString::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src/tests.rs")).unwrap();
        assert_eq!(nf_oracle_load(here.as_ptr(), 0.9, &mut oracle), Model);
        assert!(oracle.is_null());
        ok(nf_oracle_bundled(0.95, &mut oracle));
        let new =
            |size: usize, params: &NfParams| nf_session_new(size, size, oracle, params, &mut null_mut());
        let ok = params();
        assert_eq!(new(0, &ok), Size);
        assert_eq!(new(usize::MAX, &ok), Size);
        assert_eq!(new(64, &NfParams { tile: 0, ..ok }), Size);
        assert_eq!(new(64, &NfParams { schedule: 3, ..ok }), Argument);
        assert_eq!(new(64, &NfParams { tone_mapping: 7, ..ok }), Argument);
        assert_eq!(new(64, &NfParams { key: f32::NAN, ..ok }), Argument);
        assert_eq!(new(64, &NfParams { step: 1, ..ok }), Argument);
        assert_eq!(new(64, &NfParams { viewing: c"moon".as_ptr(), ..ok }), Argument);
        assert_eq!(new(64, &NfParams { viewing: c"desk,fps=4".as_ptr(), ..ok }), Argument);
        assert!(message().contains("10…1000 frames per second"), "{}", message());
        nf_oracle_free(oracle);
    }
}

#[test]
fn a_caller_can_end_all_tiles() {
    let session = session(&params());
    round(&session, 1);
    ok(nf_session_close_all(session.0, NF_REASON_TIME_LIMIT));
    assert_eq!(open(&session), 0);
    assert!(states(&session).iter().any(|state| state.reason == NF_REASON_TIME_LIMIT));
}

/// Nothing is followed: not what was freed, nor what is no session, nor what no call has given.
#[test]
fn handles_that_are_wrong_are_errors() {
    let living = session(&params());
    let (oracle, mut count) = (bundled(), 0);
    // SAFETY: pointers to variables of this function.
    unsafe {
        assert_eq!(nf_session_judge(oracle.cast(), &mut count), NfStatus::Handle);
        assert_eq!(message(), "session is a handle of something else");
        assert_eq!(nf_session_new(8, 8, living.0.cast(), null(), &mut null_mut()), NfStatus::Handle);
        let mut local = 0_u64;
        assert_eq!(nf_session_judge((&raw mut local).cast(), &mut count), NfStatus::Handle);
        assert_eq!(nf_session_tile_count(oracle.cast()), 0);
    }
    assert_eq!(nf_session_free(oracle.cast()), NfStatus::Handle);
    assert_eq!((nf_oracle_free(oracle), nf_oracle_free(oracle)), (NfStatus::Ok, NfStatus::Handle));
    assert_eq!(message(), "oracle is no handle of this library, or was freed");
    assert_eq!(open(&living), 9);
}

/// A session that is freed while others work on it ends when they have.
#[test]
fn freeing_beside_other_calls_is_safe() {
    for _ in 0..20 {
        let session = session(&params());
        let handle = &session;
        std::thread::scope(|threads| {
            for tile in 0..4 {
                threads.spawn(move || {
                    let mean = [0.5_f32; 3 * EDGE * EDGE];
                    for _ in 0..50 {
                        // SAFETY: an array of the size given.
                        let status = unsafe { nf_session_push(handle.0, tile, 1, mean.as_ptr(), mean.len()) };
                        assert!(matches!(status, NfStatus::Ok | NfStatus::Handle), "{status:?}");
                    }
                });
            }
            threads.spawn(move || ok(nf_session_free(handle.0)));
        });
    }
}

/// Pushes two batches to every tile, and returns how the verdict ends.
fn fed_with(session: &Handle, value: impl Fn(usize, Vec<f32>) -> Vec<f32>) -> NfStatus {
    for batch in 0..2 {
        for request in requests(session) {
            let (tile, mean) =
                (tile(request.tile), value(batch, render(tile(request.tile), batch as u64, 50)));
            // SAFETY: a living handle, and an array of the size given.
            ok(unsafe { nf_session_push(session.0, tile.index, 50, mean.as_ptr(), mean.len()) });
        }
    }
    // SAFETY: a living handle.
    unsafe { nf_session_judge(session.0, null_mut()) }
}

/// What `noisefloor calibrate` has measured is what parameters take.
#[test]
fn eyes_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("eyes.toml");
    let person = noisefloor_eyes::Person {
        name: "anna".to_owned(),
        factor: 1.4,
        interval: [1.2, 1.65],
        scatter: 0.3,
        answers: 38,
        date: "2026-11-24".to_owned(),
        model: "a digest".to_owned(),
        display: noisefloor_eyes::SeenDisplay {
            pixels_per_degree: 44.0,
            distance_mm: 600.0,
            gamma: 2.2,
            ambient: "dim".to_owned(),
        },
    };
    noisefloor_eyes::Eyes::keep(&path, person).unwrap();
    let (mut slope, mut viewing) = (0.0, [0; 200]);
    let mut read = |path: &std::path::Path, bytes: usize| {
        let path = CString::new(path.to_str().unwrap()).unwrap();
        // SAFETY: variables of this function.
        unsafe { nf_eyes(path.as_ptr(), &mut slope, viewing.as_mut_ptr(), bytes) }
    };
    assert_eq!(read(&folder.path().join("absent"), 200), NfStatus::Io);
    assert_eq!(read(&path, 0), NfStatus::Size);
    ok(read(&path, 200));
    let used = session(&NfParams { audience_slope: slope, viewing: viewing.as_ptr(), ..params() });
    assert_eq!(slope, 1.4);
    drop(used);
    // SAFETY: text that was written above.
    assert!(unsafe { CStr::from_ptr(viewing.as_ptr()) }.to_str().unwrap().starts_with("ppd=44,"));
    std::fs::write(&path, "colour = 1").unwrap();
    let path = CString::new(path.to_str().unwrap()).unwrap();
    // SAFETY: variables of this function.
    let status = unsafe { nf_eyes(path.as_ptr(), &mut slope, viewing.as_mut_ptr(), 200) };
    assert_eq!(status, NfStatus::Argument);
    assert!(message().contains("noisefloor calibrate"), "{}", message());
}

/// What is certain is noticed by the next verdict; what is likely is text.
#[test]
fn wrong_samples_are_a_status_or_a_warning() {
    let bytes = session(&params());
    let rounded = |_, mean: Vec<f32>| mean.iter().map(|c| (255.0 * c).round() / 255.0).collect();
    assert_eq!(fed_with(&bytes, rounded), NfStatus::Fault);
    assert!(message().contains("of 8 bits"), "{}", message());

    let constant = session(&params());
    ok(fed_with(&constant, |_, mean| vec![0.25; mean.len()]));
    let (mut counts, mut text) = (NfSampleCounts::default(), [0; 400]);
    // SAFETY: a living handle, and variables of this function.
    unsafe {
        ok(nf_session_sample_counts(constant.0, &mut counts));
        assert_eq!(counts, NfSampleCounts { rejected: 0, negative: 0, warnings: 1 });
        ok(nf_session_warning(constant.0, 0, text.as_mut_ptr(), text.len()));
        assert!(CStr::from_ptr(text.as_ptr()).to_str().unwrap().contains("is 0.25"));
        ok(nf_session_warning(constant.0, 0, text.as_mut_ptr(), 6));
        assert_eq!(CStr::from_ptr(text.as_ptr()), c"every");
        assert_eq!(nf_session_warning(constant.0, 1, text.as_mut_ptr(), text.len()), NfStatus::Argument);
    }

    let dark = session(&params());
    let lit = |_, mean: Vec<f32>| {
        mean.chunks(3).flat_map(|p| if p[0] < 0.47 { [-0.001; 3] } else { [p[0]; 3] }).collect()
    };
    ok(fed_with(&dark, lit));
    // SAFETY: a living handle, and a variable of this function.
    ok(unsafe { nf_session_sample_counts(dark.0, &mut counts) });
    assert!(counts.negative > 0 && counts.negative.is_multiple_of(50), "{counts:?}");
}

/// As a renderer of C is: `user` says what it does wrong.
unsafe extern "C" fn rendered(user: *mut c_void, of: NfTile, first: u64, spp: u64, mean: *mut f32) -> i32 {
    // SAFETY: the test gives a number.
    let wrong = unsafe { *user.cast::<u64>() };
    if wrong == 2 {
        return 5;
    }
    let mut sum = vec![0.0; 3 * tile(of).pixels()];
    for sample in first..first + spp {
        let sample = if wrong == 1 { sample - first } else { sample };
        sum.iter_mut().zip(render(tile(of), sample, 1)).for_each(|(sum, new)| *sum += new / spp as f32);
    }
    // SAFETY: there is room for as many.
    unsafe { mean.copy_from_nonoverlapping(sum.as_ptr(), sum.len()) };
    0
}

#[test]
fn renderers_are_checked() {
    let check = |mut wrong: u64, repeats| {
        // SAFETY: the function's own number.
        unsafe { nf_check(Some(rendered), (&raw mut wrong).cast(), 48, 40, repeats, false) }
    };
    assert_eq!((check(0, true), check(0, false)), (NfStatus::Ok, NfStatus::Ok), "{}", message());
    assert_eq!(check(1, true), NfStatus::Fault);
    assert!(message().contains("how requests are cut"), "{}", message());
    assert_eq!(check(2, false), NfStatus::Fault);
    assert!(message().contains("it returned 5"), "{}", message());
    // SAFETY: nothing is called.
    assert_eq!(unsafe { nf_check(None, null_mut(), 48, 40, false, false) }, NfStatus::NullPointer);
}

#[test]
fn a_panic_is_a_status_and_breaks_only_its_session() {
    let (broken, whole) = (session(&params()), session(&params()));
    let inside = crate::handle::get(broken.0.cast_const()).ok().unwrap();
    let status = guard(|| {
        let _locked = inside.lock()?;
        panic!("tile {} is odd", 7)
    });
    assert_eq!(status, NfStatus::Internal);
    assert_eq!(message(), "noisefloor made a mistake: tile 7 is odd");
    // SAFETY: living handles.
    unsafe {
        assert_eq!(nf_session_judge(broken.0, null_mut()), NfStatus::Internal);
        ok(nf_session_judge(whole.0, null_mut()));
    }
    assert_eq!(guard(|| panic!()), NfStatus::Internal);
}

#[test]
fn a_model_that_does_not_fit_says_so() {
    let failure = Failure::from(CriterionError::NoReference("the oracle".into()));
    assert_eq!(failure.status, NfStatus::Criterion);
    assert!(failure.message.contains("needs a ray-traced reference"), "{}", failure.message);
}

#[test]
fn messages_belong_to_their_thread() {
    assert_eq!(guard(|| Err(Failure::new(NfStatus::Argument, "here\0!"))), NfStatus::Argument);
    std::thread::scope(|scope| {
        scope.spawn(|| assert_eq!(message(), ""));
    });
    assert_eq!(message(), "here?!");
    // SAFETY: text of this library.
    assert_eq!(unsafe { CStr::from_ptr(nf_version()) }.to_str(), Ok(env!("CARGO_PKG_VERSION")));
}

/// The settings that a search of C asks for are those of Rust's, told the same: of a renderer that gets nowhere near what may be
/// seen, since its samples do not help, since nobody knows why, or since its pixels have the most; and of one that gets there.
#[test]
fn what_is_known_of_one_picture_is_told() {
    for (alone, floor, falling, ends) in [
        (1.5, 0.0, false, NF_SEARCH_NOT_FALLING),
        (0.0, 0.0, false, NF_SEARCH_NOT_FALLING),
        (1.5, 1.2, false, NF_SEARCH_CAPPED),
        (0.0, 0.0, true, NF_SEARCH_FOUND),
    ] {
        let mut rust = Search::new(Knob::Threshold { coarsest: 0.2, finest: 0.0001 }).unwrap();
        let (mut search, mut step) = (null_mut(), NfSearchStep::default());
        // SAFETY: living handles.
        unsafe {
            ok(nf_search_of_threshold(0.2, 0.0001, &mut search));
            loop {
                ok(nf_search_next(search, &mut step));
                let Some(Look { each, setting, .. }) = rust.next() else { break };
                assert_eq!((step.ending, step.each, step.setting), (NF_SEARCH_SEARCHING, each, setting));
                let pictures = each.to_bits();
                let ratio = if falling { 70.0 * each } else { 1.5 };
                let told = NfExcess { ratio, alone, floor, pictures, ..NfExcess::default() };
                for wrong in [f64::NAN, -1.0] {
                    assert_eq!(nf_search_tell(search, NfExcess { ratio: wrong, ..told }), NfStatus::Argument);
                    assert_eq!(nf_search_tell(search, NfExcess { alone: wrong, ..told }), NfStatus::Argument);
                }
                ok(nf_search_tell(search, told));
                assert_eq!(nf_search_tell(search, told), NfStatus::Argument, "once");
                let mut told = Excess::new(ratio);
                (told.pictures, told.alone, told.floor) = (pictures, (alone > 0.0).then_some(alone), floor);
                rust.tell(told, &[]);
            }
            assert_eq!(nf_search_tell(search, NfExcess::default()), NfStatus::Argument);
            assert_eq!((nf_search_free(search), nf_search_free(search)), (NfStatus::Ok, NfStatus::Handle));
        }
        assert_eq!(step.ending, ends, "{:?}", rust.ending());
    }
}

/// As they were rendered, and behind a denoiser that removes nine tenths of the noise.
#[test]
fn pictures_are_compared() {
    let (width, height) = (WIDTH as u32, HEIGHT as u32);
    let whole = Tile { index: 0, x: 0, y: 0, width: WIDTH, height: HEIGHT };
    let pictures = [0, 1].map(|first| render(whole, first, 16));
    let blurred =
        [0, 1].map(|i: usize| pictures[i].iter().map(|v| 0.5 + 0.1 * (v - 0.5)).collect::<Vec<_>>());
    let ([a, b], [da, db]) =
        ([0, 1].map(|i: usize| pictures[i].as_ptr()), [0, 1].map(|i: usize| blurred[i].as_ptr()));
    let floats = 3 * PIXELS;
    let by_srgb = NfParams { tone_mapping: NF_TONE_SRGB, ..params() };
    let (oracle, mut search, mut excess) = (bundled(), null_mut(), NfExcess::default());
    // SAFETY: living handles, and arrays of the size given.
    unsafe {
        assert_eq!(nf_search_of_threshold(0.1, 0.2, &mut search), NfStatus::Argument);
        assert_eq!(nf_search_of_samples(1, 2, &mut search), NfStatus::Argument);
        ok(nf_excess(oracle, &by_srgb, width, height, a, b, floats, &mut excess));
        assert!(excess.x < width && excess.y < height && excess.pictures != 0 && excess.ratio > 0.0);
        let denoised = |lost: f64, excess: &mut NfExcess| {
            nf_excess_denoised(lost, &by_srgb, width, height, a, b, da, db, floats, excess)
        };
        let mut other = NfExcess::default();
        assert_eq!((denoised(0.3, &mut excess), denoised(0.6, &mut other)), (NfStatus::Ok, NfStatus::Ok));
        assert!(
            (excess.ratio / other.ratio - 2.0).abs() < 1e-9 && excess.ratio > 0.0,
            "{excess:?} {other:?}"
        );
        assert_eq!(denoised(f64::NAN, &mut other), NfStatus::Argument);
        let same = nf_excess(oracle, null(), width, height, a, a, floats, &mut other);
        assert_eq!(same, NfStatus::Argument);
        assert!(message().contains("identical"), "{}", message());
        assert_eq!(
            nf_excess(oracle, null(), width, height, a, null(), floats, &mut other),
            NfStatus::NullPointer
        );
        assert_eq!(nf_excess(oracle, null(), 0, height, a, a, floats, &mut other), NfStatus::Size);
        assert_eq!(nf_excess(oracle, null(), width, height, a, a, floats - 3, &mut other), NfStatus::Size);
        ok(nf_oracle_free(oracle));
    }
}
