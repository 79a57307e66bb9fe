//! The search for a renderer's own setting.

use crate::border;
use crate::handle;
use crate::oracle::NfOracle;
use crate::params::NfParams;
use crate::status::{Failure, NfStatus, guard, set_last_warnings};
use noisefloor::stills::StillError;
use noisefloor::tune::{Ending, Excess, Knob, KnobError, Look, Looked, PairError, PicturePair, Search};
use noisefloor::{Params, Rgb, tile::check_image};
use noisefloor_denoise::DenoisedError;
use std::sync::{Mutex, PoisonError};

/// The search goes on.
pub const NF_SEARCH_SEARCHING: u32 = 0;
/// One picture with this setting shows nothing that should not be seen.
pub const NF_SEARCH_FOUND: u32 = 1;
/// Even the finest setting is not enough.
pub const NF_SEARCH_AT_FINEST: u32 = 2;
/// Settings down to the finest give the same pictures: the renderer ignores the setting, or reaches another limit first.
pub const NF_SEARCH_UNCHANGED: u32 = 3;
/// More samples do not make it better: what is wrong is no noise, few samples find the light, or the pictures are not independent.
pub const NF_SEARCH_NOT_FALLING: u32 = 4;

/// Finer settings leave as much, since the pixels that make it have the most samples that the renderer takes.
pub const NF_SEARCH_CAPPED: u32 = 5;

/// The search for the setting of a renderer at which nobody sees noise: its noise threshold, or samples per pixel.
pub struct NfSearch(Mutex<Asked>);

/// And whether it was asked since it was told.
struct Asked {
    search: Search,
    asked: bool,
}

impl handle::Handle for NfSearch {
    const NAME: &str = "search";
}

/// What to do next in a search, or how it ended.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct NfSearchStep {
    /// One of NF_SEARCH_...
    pub ending: u32,
    /// While searching: what two pictures are to be rendered with, each with a seed of its own, the same seeds in
    /// every step.
    pub each: f64,
    /// While searching: one picture with this setting is as good as the mean of the two, if noise follows the setting. At
    /// NF_SEARCH_FOUND: the setting that is enough.
    pub setting: f64,
}

/// How far the mean of two pictures is from what may be seen, in its worst place.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct NfExcess {
    /// What is wrong over what may be wrong: 1 or less passes. Infinite where it cannot be told.
    pub ratio: f64,
    /// The worst place, a column and a row.
    pub x: u32,
    pub y: u32,
    /// A number that follows from the pictures, by which settings without effect are noticed; 0 if it is not known.
    pub pictures: u64,
    /// The same ratio of one picture whose threshold is finer by the root of two: that of the mean where the samples of pixels
    /// follow the threshold, and at most 1.41 times that where they do not. 0 if it is not known: then only pictures that were
    /// rendered speak for a setting.
    pub alone: f64,
    /// The ratio below which no finer threshold gets, since the pixels that make it have the most samples that the renderer
    /// takes; 0 if it is not known. nf_excess cannot know.
    pub floor: f64,
}

impl From<KnobError> for Failure {
    fn from(error: KnobError) -> Self {
        Self::new(NfStatus::Argument, error.to_string())
    }
}

/// Searches a noise threshold, such as from 0.2 down to 0.001. The caller frees it with nf_search_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_search_of_threshold(
    coarsest: f64,
    finest: f64,
    search: *mut *mut NfSearch,
) -> NfStatus {
    // SAFETY: promised by the caller.
    guard(|| unsafe { give(search, Knob::Threshold { coarsest, finest }) })
}

/// Searches samples per pixel, such as from 16 to 4096. The caller frees it with nf_search_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_search_of_samples(least: u64, most: u64, search: *mut *mut NfSearch) -> NfStatus {
    // SAFETY: promised by the caller.
    guard(|| unsafe { give(search, Knob::Samples { least, most }) })
}

/// # Safety
/// As [`handle::give`].
unsafe fn give(place: *mut *mut NfSearch, knob: Knob) -> Result<(), Failure> {
    // SAFETY: as for this function.
    unsafe {
        handle::give(place, || {
            let search = Search::new(knob)?;
            Ok(NfSearch(Mutex::new(Asked { search, asked: false })))
        })
    }
}

/// What to render next, or how the search ended. The same until nf_search_tell.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_search_next(search: *const NfSearch, step: *mut NfSearchStep) -> NfStatus {
    guard(|| {
        let search = handle::get(search)?;
        let next = {
            let mut asked = search.0.lock().unwrap_or_else(PoisonError::into_inner);
            let next = asked.search.next();
            asked.asked = next.is_some();
            next.ok_or_else(|| asked.search.ending())
        };
        let over = |ending| NfSearchStep { ending, ..NfSearchStep::default() };
        let next = match next {
            Ok(Look { each, setting, .. }) => NfSearchStep { ending: NF_SEARCH_SEARCHING, each, setting },
            Err(Some(Ending::Found { setting, .. })) => NfSearchStep { setting, ..over(NF_SEARCH_FOUND) },
            Err(Some(Ending::AtFinest { .. })) => over(NF_SEARCH_AT_FINEST),
            Err(Some(Ending::Unchanged)) => over(NF_SEARCH_UNCHANGED),
            Err(Some(Ending::NotFalling { .. })) => over(NF_SEARCH_NOT_FALLING),
            Err(Some(Ending::Capped { .. })) => over(NF_SEARCH_CAPPED),
            Err(other) => unreachable!("C has no number for {other:?}"),
        };
        // SAFETY: promised by the caller.
        unsafe { border::write(step, next, "step") }
    })
}

/// Says what was found of the two pictures that nf_search_next asked for, once. NF_STATUS_ARGUMENT if it has not asked since, and
/// for ratios that are negative or not a number.
#[unsafe(no_mangle)]
pub extern "C" fn nf_search_tell(search: *const NfSearch, excess: NfExcess) -> NfStatus {
    guard(|| {
        let NfExcess { ratio, x, y, pictures, alone, floor } = excess;
        for (name, value) in [("ratio", ratio), ("alone", alone), ("floor", floor)] {
            if value.is_nan() || value < 0.0 {
                let what = "0 or more, or infinite where it cannot be told";
                return Err(Failure::new(
                    NfStatus::Argument,
                    format!("excess.{name} must be {what}, not {value}"),
                ));
            }
        }
        let place = Some((x as usize, y as usize));
        let alone = (alone > 0.0).then_some(alone);
        let search = handle::get(search)?;
        let mut asked = search.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !std::mem::take(&mut asked.asked) {
            let what = "nf_search_tell answers nf_search_next, once; after the end there is nothing to tell";
            return Err(Failure::new(NfStatus::Argument, what.to_owned()));
        }
        let mut told = Excess::new(ratio);
        (told.place, told.pictures, told.alone, told.floor) = (place, pictures, alone, floor);
        asked.search.tell(told, &[]);
        Ok(())
    })
}

/// Frees a search. NULL is ignored, a second time is NF_STATUS_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn nf_search_free(search: *mut NfSearch) -> NfStatus {
    guard(|| handle::free(search))
}

/// How far the noise of the mean of two pictures is from what people do not see, where it is worst. a and b are
/// linear radiance, floats = 3 * width * height values each, rendered with the same setting and different seeds. Of
/// params, display and audience count; params may be NULL for the defaults. NF_STATUS_ARGUMENT if the pictures are
/// the same, not finite, negative, or no two of one view with one exposure; nf_last_warnings has what is only likely to be
/// wrong with them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_excess(
    oracle: *const NfOracle,
    params: *const NfParams,
    width: u32,
    height: u32,
    a: *const f32,
    b: *const f32,
    floats: usize,
    excess: *mut NfExcess,
) -> NfStatus {
    guard(|| {
        let oracle = handle::get(oracle)?;
        // SAFETY: promised by the caller.
        let (params, [a, b]) = unsafe { pictures(params, (width, height), [a, b], floats) }?;
        let size = (width as usize, height as usize);
        let pair = PicturePair::new(size, [a, b], UNKNOWN_SPP).map_err(unfit)?;
        let looked = pair.look(&oracle.0, &params, None);
        // SAFETY: promised by the caller.
        unsafe { write(excess, looked) }
    })
}

/// As nf_excess, for pictures that are denoised: denoised_a is what a denoiser makes of a, and denoised_b of b, each
/// without a look at the other. The ratio is that of the just-objectionable differences (JOD) that the worst square of
/// 64 pixels may have lost, 1.5 times the estimate, to lost, 0.3 say. Nobody has been asked about denoised pictures: the limit
/// is a vision model's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_excess_denoised(
    lost: f64,
    params: *const NfParams,
    width: u32,
    height: u32,
    a: *const f32,
    b: *const f32,
    denoised_a: *const f32,
    denoised_b: *const f32,
    floats: usize,
    excess: *mut NfExcess,
) -> NfStatus {
    guard(|| {
        if !(lost > 0.0 && lost.is_finite()) {
            return Err(Failure::new(
                NfStatus::Argument,
                format!("lost must be a positive number, not {lost}"),
            ));
        }
        let all = [a, b, denoised_a, denoised_b];
        // SAFETY: promised by the caller.
        let (params, [a, b, da, db]) = unsafe { pictures(params, (width, height), all, floats) }?;
        let size = (width as usize, height as usize);
        let pair = PicturePair::new(size, [a, b], UNKNOWN_SPP).map_err(unfit)?;
        let looked = DenoisedError::look(&pair, [&da, &db], lost, &params, None).map(|(_, looked)| looked);
        // SAFETY: promised by the caller.
        unsafe { write(excess, looked) }
    })
}

/// Samples per pixel, which C is not asked for: they matter to audiences that are no factor.
const UNKNOWN_SPP: f64 = 128.0;
/// Edge of the tiles in which noise is described: windows are what is judged, whatever the tiles.
const TILE: usize = 64;

fn unfit(error: StillError) -> Failure {
    Failure::new(NfStatus::Argument, error.to_string())
}

fn odd(error: PairError) -> Failure {
    match error {
        PairError::Still(error) => unfit(error),
        PairError::Size(error) => error.into(),
        PairError::Criterion(error) => error.into(),
        PairError::Judge(error) => Failure::new(NfStatus::Size, error.to_string()),
        other => Failure::new(NfStatus::Criterion, other.to_string()),
    }
}

/// Parameters, and copies of pictures.
///
/// # Safety
/// As [`border::object`] and [`border::array`], of pointers that are not null.
unsafe fn pictures<const N: usize>(
    params: *const NfParams,
    (width, height): (u32, u32),
    pictures: [*const f32; N],
    floats: usize,
) -> Result<(Params, [Vec<Rgb>; N]), Failure> {
    // SAFETY: as for this function.
    let params = unsafe { NfParams::or(params, Params::default()) }?.with_tile(TILE);
    params.check()?;
    check_image(width as usize, height as usize)?;
    let wanted = 3 * width as usize * height as usize;
    let mut copies = std::array::from_fn(|_| Vec::new());
    for (copy, picture) in copies.iter_mut().zip(pictures) {
        // SAFETY: as for this function.
        *copy = unsafe { border::array(picture, floats, wanted, "a picture") }?.as_chunks().0.to_vec();
    }
    Ok((params, copies))
}

/// And keeps what the pictures say against a verdict for [`nf_last_warnings`](crate::status::nf_last_warnings).
///
/// # Safety
/// As [`border::write`].
unsafe fn write(place: *mut NfExcess, looked: Result<Looked, PairError>) -> Result<(), Failure> {
    set_last_warnings(&[]);
    let Looked { excess, warnings, .. } = looked.map_err(odd)?;
    set_last_warnings(&warnings.iter().map(ToString::to_string).collect::<Vec<_>>());
    let Excess { ratio, place: at, pictures, alone, floor, .. } = excess;
    let (x, y) = at.unwrap_or_default();
    let alone = alone.unwrap_or(0.0);
    let found = NfExcess { ratio, x: x as u32, y: y as u32, pictures, alone, floor };
    // SAFETY: as for this function.
    unsafe { border::write(place, found, "excess") }
}
