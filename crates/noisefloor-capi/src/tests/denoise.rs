//! Sessions that judge what a function of C makes of the samples.

use super::*;
use crate::denoise::*;
use noisefloor::{Schedule, Verdict};
use noisefloor_denoise::{
    DEFAULT_JODS_LOST, DenoiseError, DenoisePasses, DenoisedQuality, Denoiser, MirrorMean, NoisyPicture,
};
use std::cell::{Cell, RefCell};

/// Half of the difference from the mean of its row is taken from each pixel: the picture of `render` is a wall.
fn rows(width: usize, noisy: &[Rgb]) -> Vec<Rgb> {
    let mean = |row: &[Rgb], c: usize| row.iter().map(|p| p[c]).sum::<f32>() / width as f32;
    let calmer = |row: &[Rgb]| -> Vec<Rgb> {
        let mean = [0, 1, 2].map(|c| mean(row, c));
        row.iter().map(|p| [0, 1, 2].map(|c| 0.5 * (p[c] + mean[c]))).collect()
    };
    noisy.chunks_exact(width).flat_map(calmer).collect()
}

struct Rows;

impl Denoiser for Rows {
    fn name(&self) -> String {
        "rows".to_owned()
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        Ok(rows(picture.size.0, picture.radiance))
    }
}

/// What `user` of [`denoise`] leads to.
#[derive(Default)]
struct Told {
    calls: Cell<usize>,
    /// First float of albedo and normal.
    hits: RefCell<Vec<[f32; 2]>>,
    returns: i32,
    writes: Option<f32>,
    /// Used from inside, with this outcome.
    session: Cell<Option<*mut NfSession>>,
    status: Cell<Option<NfStatus>>,
}

unsafe extern "C" fn denoise(
    user: *mut c_void,
    width: u32,
    height: u32,
    noisy: *const f32,
    albedo: *const f32,
    normal: *const f32,
    denoised: *mut f32,
) -> i32 {
    let floats = 3 * (width * height) as usize;
    // SAFETY: what the header promises, and `user` is a `Told`.
    let (told, noisy, out) = unsafe {
        (
            &*user.cast::<Told>(),
            std::slice::from_raw_parts(noisy, floats),
            std::slice::from_raw_parts_mut(denoised, floats),
        )
    };
    told.calls.set(told.calls.get() + 1);
    if !albedo.is_null() && !normal.is_null() {
        // SAFETY: as many floats as the picture has.
        told.hits.borrow_mut().push(unsafe { [*albedo, *normal] });
    }
    if let Some(session) = told.session.get() {
        let mut open = 0;
        // SAFETY: a living handle, and a variable of this function.
        told.status.set(Some(unsafe { nf_session_open_tiles(session, &mut open) }));
    }
    out.copy_from_slice(rows(width as usize, noisy.as_chunks().0).as_flattened());
    if let Some(value) = told.writes {
        out[0] = value;
    }
    told.returns
}

fn seldom() -> NfParams {
    NfParams { schedule: NF_SCHEDULE_GROWING, step: 16, min_spp: 16, ..params() }
}

fn denoised_session(told: &Told, hits: Option<&[Vec<f32>; 4]>) -> Handle {
    let mut session = null_mut();
    let pictures = hits.map(|hits| hits.each_ref().map(|picture| picture.as_ptr()));
    let first_hits = pictures.as_ref().map_or(null(), |pictures| pictures.as_ptr());
    let user = std::ptr::from_ref(told).cast_mut().cast();
    // SAFETY: arrays of the sizes given, and a function of the right kind.
    ok(unsafe {
        nf_session_new_denoised(
            WIDTH,
            HEIGHT,
            Some(denoise),
            user,
            DEFAULT_JODS_LOST,
            first_hits,
            3 * PIXELS,
            1,
            &seldom(),
            &mut session,
        )
    });
    Handle(session)
}

fn jods_lost(session: &Handle) -> Vec<f64> {
    // SAFETY: a living handle, and an array of the size given.
    unsafe {
        let mut lost = vec![0.0; nf_session_tile_count(session.0)];
        ok(nf_session_jods_lost(session.0, lost.as_mut_ptr(), lost.len()));
        lost
    }
}

fn spp(session: &Handle) -> Vec<u64> {
    states(session).iter().map(|state| state.spp).collect()
}

#[test]
fn stops_are_those_of_rust_and_go_on_after_a_resume() {
    let rust = Params::default().with_tile(EDGE).with_max_spp(400).with_min_spp(16);
    let rust = rust.with_schedule(Schedule::Growing { step: 16 });
    let quality = DenoisedQuality::new(Rows, DEFAULT_JODS_LOST);
    let mut expected = Session::new(WIDTH, HEIGHT, quality, rust).unwrap();
    while !expected.is_done() {
        round_in_rust(&mut expected);
    }
    let verdicts: Vec<Verdict> =
        expected.film().grid().tiles().map(|t| expected.verdict(t.index).unwrap()).collect();
    let expected: Vec<u64> = expected.stops().map(|stop| stop.spp).collect();
    assert!(expected.iter().any(|spp| *spp > 16) && expected.iter().all(|spp| *spp < 400), "{expected:?}");

    let told = Told::default();
    let session = denoised_session(&told, None);
    assert!(jods_lost(&session).iter().all(|lost| lost.is_nan()));
    while open(&session) > 0 {
        round(&session, 1);
    }
    assert_eq!(spp(&session), expected);
    assert_eq!(jods_lost(&session), verdicts.iter().map(|v| v.lost.unwrap()).collect::<Vec<_>>());
    let mut undenoised = vec![true; expected.len()];
    // SAFETY: a living handle, and an array of the size given.
    let status = unsafe { nf_session_undenoised(session.0, undenoised.as_mut_ptr(), undenoised.len()) };
    assert_eq!((status, undenoised), (NfStatus::Ok, verdicts.iter().map(|v| v.undenoised).collect()));
    // Two halves a verdict
    assert!(told.calls.get() > 0 && told.calls.get().is_multiple_of(2), "{:?}", told.calls);

    let (told, again) = (Told::default(), Told::default());
    let first = denoised_session(&told, None);
    round(&first, 1);
    let (mut bytes, mut size) = (vec![0; 1 << 20], 0);
    let second = denoised_session(&again, None);
    // SAFETY: living handles, arrays of the sizes given.
    unsafe {
        let (at, room) = (bytes.as_mut_ptr(), bytes.len());
        ok(nf_session_checkpoint(first.0, c"wall".as_ptr(), at, room, &mut size));
        ok(nf_session_restore(second.0, c"wall".as_ptr(), bytes.as_ptr(), size));
    }
    let same = jods_lost(&first).into_iter().zip(jods_lost(&second));
    assert!(same.into_iter().all(|(a, b)| a.to_bits() == b.to_bits()));
    while open(&second) > 0 {
        round(&second, 1);
    }
    assert_eq!(spp(&second), expected);
}

#[test]
fn albedo_and_normals_are_handed_on() {
    let told = Told::default();
    let hits = [1.0, 2.0, 3.0, 4.0].map(|value| vec![value; 3 * PIXELS]);
    let session = denoised_session(&told, Some(&hits));
    while told.calls.get() == 0 {
        round(&session, 1);
    }
    assert_eq!(told.hits.borrow()[..2], [[1.0, 2.0], [3.0, 4.0]]);
}

#[test]
fn what_a_denoiser_does_wrong_is_a_status() {
    let failing = |told: Told| {
        let session = denoised_session(&told, None);
        told.session.set(told.session.get().map(|_| session.0));
        // Until the first verdict, which needs both halves
        let status = loop {
            requests(&session).iter().for_each(|request| push(&session, request));
            // SAFETY: a living handle, and NULL where it is allowed.
            let status = unsafe { nf_session_judge(session.0, null_mut()) };
            if told.calls.get() > 0 {
                break status;
            }
        };
        (status, message(), open(&session), told.status.get())
    };
    for (told, text) in [
        (Told { returns: 7, ..Told::default() }, "returned 7"),
        (Told { writes: Some(f32::NAN), ..Told::default() }, "not finite"),
    ] {
        let (status, said, open, _) = failing(told);
        assert_eq!((status, open), (NfStatus::Criterion, 9), "{said}");
        assert!(said.contains(text), "{said}");
    }
    // One that uses its session does not wait for itself
    let (status, said, _, inside) = failing(Told { session: Cell::new(Some(null_mut())), ..Told::default() });
    assert_eq!((status, inside), (NfStatus::Ok, Some(NfStatus::Argument)), "{said}");

    let (mut session, user) = (null_mut(), null_mut());
    let mut make = |denoise: NfDenoise, lost: f64, hits: &[*const f32], floats| {
        let hits = if hits.is_empty() { null() } else { hits.as_ptr() };
        // SAFETY: arrays of the sizes given.
        unsafe {
            nf_session_new_denoised(WIDTH, HEIGHT, denoise, user, lost, hits, floats, 1, null(), &mut session)
        }
    };
    assert_eq!(make(None, 0.3, &[], 0), NfStatus::NullPointer);
    assert_eq!(make(Some(denoise), 0.0, &[], 0), NfStatus::Argument);
    assert_eq!(make(Some(denoise), f64::NAN, &[], 0), NfStatus::Argument);
    assert_eq!(make(Some(denoise), 0.3, &[null(); 4], 3 * PIXELS), NfStatus::NullPointer);
    let picture = vec![f32::INFINITY; 3 * PIXELS];
    assert_eq!(make(Some(denoise), 0.3, &[picture.as_ptr(); 4], 3 * PIXELS - 3), NfStatus::Size);
    assert_eq!(make(Some(denoise), 0.3, &[picture.as_ptr(); 4], 3 * PIXELS), NfStatus::Argument);
    ok(make(Some(denoise), 0.3, &[], 0));
    ok(nf_session_free(session));

    let noisy = super::session(&params());
    let mut lost = [0.0; 9];
    // SAFETY: a living handle, and an array of the size given.
    let status = unsafe { nf_session_jods_lost(noisy.0, lost.as_mut_ptr(), noisy_tiles(&noisy)) };
    assert_eq!(status, NfStatus::Unavailable);
}

fn noisy_tiles(session: &Handle) -> usize {
    nf_session_tile_count(session.0)
}

/// The mean of four passes is that of Rust, albedo and normals go with the picture, and mistakes are told.
#[test]
fn the_mean_of_mirror_images_is_that_of_rust() {
    let noisy: Vec<f32> = (0..3 * PIXELS).map(|i| (i * 37 % 101) as f32 / 101.0).collect();
    let mut expected = MirrorMean::new(Rows, DenoisePasses::Four);
    let expected = expected.denoise(&NoisyPicture::new((WIDTH, HEIGHT), noisy.as_chunks().0)).unwrap();

    let told = Told::default();
    let mean = |passes, albedo: *const f32, normal: *const f32, floats, made: &mut Vec<f32>| {
        let user = std::ptr::from_ref(&told).cast_mut().cast();
        let (noisy, made) = (noisy.as_ptr(), made.as_mut_ptr());
        // SAFETY: arrays of at least the size given, and a function of the right kind.
        unsafe {
            nf_mirror_mean(WIDTH, HEIGHT, Some(denoise), user, passes, noisy, albedo, normal, made, floats)
        }
    };
    let mut made = vec![0.0; 3 * PIXELS];
    ok(mean(4, null(), null(), 3 * PIXELS, &mut made));
    assert!(made == expected.as_flattened());
    assert!(told.calls.get() == 4 && told.hits.borrow().is_empty());

    // The first pixel that a pass sees is another corner each time
    let plane = |add: usize| -> Vec<f32> { (0..3 * PIXELS).map(|i| (i / 3 + add) as f32).collect() };
    let (albedo, normal) = (plane(0), plane(1000));
    ok(mean(4, albedo.as_ptr(), normal.as_ptr(), 3 * PIXELS, &mut made));
    let corners = [0, WIDTH - 1, PIXELS - WIDTH, PIXELS - 1];
    assert_eq!(*told.hits.borrow(), corners.map(|corner| [corner as f32, (corner + 1000) as f32]));

    assert_eq!(mean(3, null(), null(), 3 * PIXELS, &mut made), NfStatus::Argument);
    assert!(message().contains("1 or 4"), "{}", message());
    assert_eq!(mean(4, null(), null(), 3 * PIXELS - 3, &mut made), NfStatus::Size);
    let fails = Told { returns: 3, ..Told::default() };
    let user = std::ptr::from_ref(&fails).cast_mut().cast();
    let (noisy, made) = (noisy.as_ptr(), made.as_mut_ptr());
    // SAFETY: as above.
    let status = unsafe {
        nf_mirror_mean(WIDTH, HEIGHT, Some(denoise), user, 4, noisy, null(), null(), made, 3 * PIXELS)
    };
    assert_eq!(status, NfStatus::Criterion);
    assert!(message().contains("it returned 3"), "{}", message());
}

#[test]
fn first_hits_are_clean_where_both_halves_agree() {
    let plane = |noise: f32| -> Vec<f32> {
        (0..3 * PIXELS).map(|i| 0.5 + if i % 2 == 0 { noise } else { -noise }).collect()
    };
    let clean = |pictures: [&Vec<f32>; 4], floats| {
        let (pictures, mut clean) = (pictures.map(|picture| picture.as_ptr()), false);
        // SAFETY: arrays of at least the size given.
        let status = unsafe { nf_first_hits_are_clean(WIDTH, HEIGHT, pictures.as_ptr(), floats, &mut clean) };
        (status, clean)
    };
    let (plain, noisy) = (plane(0.0), plane(0.3));
    assert_eq!(clean([&plain; 4], 3 * PIXELS), (NfStatus::Ok, true));
    // What both share is no noise
    assert_eq!(clean([&noisy; 4], 3 * PIXELS), (NfStatus::Ok, true));
    assert_eq!(clean([&plain, &plain, &plain, &noisy], 3 * PIXELS), (NfStatus::Ok, false));
    assert_eq!(clean([&noisy, &plain, &plain, &plain], 3 * PIXELS), (NfStatus::Ok, false));
    assert_eq!(clean([&plain; 4], 3 * PIXELS - 1).0, NfStatus::Size);
}
