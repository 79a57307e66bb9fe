//! Sessions that judge beside the rendering.

use super::*;
use crate::background::*;
use noisefloor::TileGrid;

fn grid() -> TileGrid {
    TileGrid::new(WIDTH, HEIGHT, EDGE).unwrap()
}

/// A pass of `render`, as an image with so many channels.
fn image(pass: u64, spp: u64, channels: usize) -> Vec<f32> {
    let mut image = vec![f32::NAN; channels * PIXELS];
    for tile in grid().tiles() {
        let mean = render(tile, 100 * pass, spp);
        for (pixel, mean) in tile.rows(WIDTH).flatten().zip(mean.chunks_exact(3)) {
            image[channels * pixel..][..3].copy_from_slice(mean);
        }
    }
    image
}

fn begin(session: &Handle, waiting: usize, when_full: u32) -> *mut NfBackground {
    let mut background = null_mut();
    // SAFETY: a living handle, and a pointer to a variable of this function.
    ok(unsafe { nf_background_begin(session.0, waiting, when_full, &mut background) });
    background
}

fn state(background: *const NfBackground) -> NfBackgroundState {
    let mut state = NfBackgroundState::default();
    // SAFETY: a pointer to a variable of this function.
    ok(unsafe { nf_background_state(background, &mut state) });
    state
}

fn push_image(background: *const NfBackground, spp: u64, image: &[f32]) -> NfStatus {
    // SAFETY: an array of the size given.
    unsafe { nf_background_push_image(background, spp, image.as_ptr(), image.len(), image.len() / PIXELS) }
}

#[test]
fn stops_are_those_of_a_session_that_waits() {
    let plain = session(&params());
    let session = session(&params());
    let background = begin(&session, 2, NF_FULL_WAIT);
    let mut passes = 0;
    for pass in 0.. {
        let mut spp = 0;
        // SAFETY: a living handle, and a pointer to a variable of this function.
        ok(unsafe { nf_session_next_pass(plain.0, &mut spp) });
        if spp == 0 {
            break;
        }
        for request in requests(&plain) {
            let mean = render(tile(request.tile), 100 * pass, spp);
            // SAFETY: a living handle, and an array of the size given.
            ok(unsafe { nf_session_push(plain.0, request.tile.index, spp, mean.as_ptr(), mean.len()) });
        }
        // SAFETY: a living handle, and NULL where it is allowed.
        ok(unsafe { nf_session_judge(plain.0, null_mut()) });
        if pass % 3 == 1 {
            for tile in grid().tiles() {
                let mean = render(tile, 100 * pass, spp);
                // SAFETY: an array of the size given.
                ok(unsafe { nf_background_push(background, tile.index, spp, mean.as_ptr(), mean.len()) });
            }
        } else {
            let image = image(pass, spp, if pass % 3 == 0 { 3 } else { 4 });
            ok(push_image(background, spp, &image));
        }
        ok(nf_background_judge(background));
        passes += 1;
    }
    ok(nf_background_finish(background));
    let tiles = grid().len();
    let expected = NfBackgroundState {
        judged: passes,
        pending: 0,
        next_pass: 0,
        spp_left: 0,
        open_tiles: 0,
        stops: tiles,
        warnings: 0,
    };
    assert_eq!(state(background), expected);
    let (mut count, mut requests) = (9, vec![NfRequest::default(); tiles]);
    // SAFETY: an array of the size given, and a pointer to a variable of this function.
    let status = unsafe { nf_background_requests(background, requests.as_mut_ptr(), tiles, &mut count) };
    assert_eq!((status, count), (NfStatus::Ok, 0));

    // SAFETY: NULL where it is allowed.
    assert_eq!(unsafe { nf_session_judge(session.0, null_mut()) }, NfStatus::Argument);
    assert!(message().contains("nf_background_end"), "{}", message());
    ok(nf_background_end(background));
    assert_eq!(nf_background_end(background), NfStatus::Handle);
    ok(nf_background_end(null_mut()));
    assert_eq!(states(&session), states(&plain));
}

#[test]
fn faults_and_wrong_calls_are_said() {
    let session = session(&params());
    let mut background = null_mut();
    // SAFETY: a living handle, and a pointer to a variable of this function.
    let status = unsafe { nf_background_begin(session.0, 1, 2, &mut background) };
    assert_eq!((status, background), (NfStatus::Argument, null_mut()));
    let background = begin(&session, 1, NF_FULL_MERGE);
    assert_eq!(push_image(background, 8, &vec![0.5; 2 * PIXELS]), NfStatus::Argument);
    ok(push_image(background, 8, &vec![f32::NAN; 3 * PIXELS]));
    ok(nf_background_judge(background));
    assert_eq!(nf_background_finish(background), NfStatus::Fault);
    assert!(message().contains("not finite"), "{}", message());
    assert_eq!(nf_background_judge(background), NfStatus::Fault);
    ok(nf_background_end(background));
    assert_eq!(requests(&session)[0].first, 0);
}

#[test]
fn running_images_are_taken_and_what_is_left_is_said() {
    let session = session(&NfParams { max_spp: 100, ..params() });
    let background = begin(&session, 4, NF_FULL_WAIT);
    assert_eq!(state(background).spp_left, 100);
    let means = [(20, image(0, 20, 3)), (50, image(1, 50, 3))];
    for (spp, mean) in &means {
        // SAFETY: an array of the size given.
        ok(unsafe { nf_background_push_running_image(background, *spp, mean.as_ptr(), mean.len(), 3) });
        ok(nf_background_judge(background));
        assert_eq!(state(background).spp_left, 100 - spp, "judged or not");
    }
    ok(nf_background_end(background));
    let far = super::image(&session).iter().zip(&means[1].1).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(far < 1e-5, "{far}");
}
