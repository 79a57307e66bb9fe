//! Parameters of a session.

use crate::border;
use crate::handle;
use crate::status::{Failure, NfStatus, guard};
use crate::tone::NfTone;
use noisefloor::{Audience, Params, Schedule, ToneMapping, Viewing};
use std::ffi::c_char;

/// A verdict after every step samples per pixel.
pub const NF_SCHEDULE_EVERY: u32 = 0;
/// Verdicts spaced by the expected need, in multiples of step.
pub const NF_SCHEDULE_SPACED: u32 = 1;
/// A verdict whenever a tile has half as many samples more, in multiples of step.
pub const NF_SCHEDULE_GROWING: u32 = 2;

/// The photographic operator (Reinhard et al. 2002) with an exposure by the log-average of the picture.
/// Verdicts wait until every tile has samples.
pub const NF_TONE_REINHARD: u32 = 0;
/// Plain sRGB: multiply by the exposure, clamp, encode.
pub const NF_TONE_SRGB: u32 = 1;

/// Parameters of a session. Let nf_params_default fill them in, then change some.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct NfParams {
    /// Edge of a tile in pixels, 16 to 512; tiles of the last column and row have half to one and a half times
    /// as many. Default: 128.
    pub tile: u32,
    /// When tiles are judged: NF_SCHEDULE_SPACED (default), _EVERY or _GROWING.
    pub schedule: u32,
    /// The step of the schedule in samples per pixel, at least 2. Default: 8.
    pub step: u64,
    /// Fewest samples per pixel at which a tile may stop. Default: 16.
    pub min_spp: u64,
    /// Samples per pixel at which every tile stops, at least 2. Default: 10000.
    pub max_spp: u64,
    /// Verdicts in a row that must say "converged" before a tile stops, at least 1. Default: 1.
    pub consecutive: u32,
    /// How radiance is displayed: NF_TONE_REINHARD (default) or NF_TONE_SRGB. What people see depends on it.
    pub tone_mapping: u32,
    /// For NF_TONE_REINHARD: what the log-average luminance becomes, above 0. Default: 0.18.
    pub key: f32,
    /// For NF_TONE_REINHARD: smallest exposed luminance that becomes white, or 0 (default) for none.
    pub white: f32,
    /// For NF_TONE_SRGB, and with tone: factor on radiance, above 0. Default: 1.
    pub exposure: f32,
    /// Whose thresholds, as a line T' = slope * T + offset from those of the observers in the training data.
    /// slope is at least 0. Default: 1.
    pub audience_slope: f64,
    /// The offset of that line in samples per pixel. Default: 0.
    pub audience_offset: f64,
    /// On which display the picture is seen and from how far, as text such as "desk" or
    /// "ppd=60,peak=300,black=0.3,ambient=100"; "desk,fps=24" for a frame of a film whose noise is new in every
    /// frame. NULL (default) for "desk". Read by nf_session_new only.
    pub viewing: *const c_char,
    /// A tone mapping of your own, of nf_tone_of_cube or nf_tone_of_table; tone_mapping counts no more then. NULL
    /// (default) for none. Read when the parameters are.
    pub tone: *const NfTone,
}

/// Fills in the defaults.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_params_default(params: *mut NfParams) -> NfStatus {
    // SAFETY: promised by the caller.
    guard(|| unsafe { border::write(params, NfParams::default(), "params") })
}

impl Default for NfParams {
    fn default() -> Self {
        let Params { tile, schedule, min_spp, max_spp, consecutive, audience, .. } = Params::default();
        let step = schedule.step();
        let schedule = match schedule {
            Schedule::Every { .. } => NF_SCHEDULE_EVERY,
            Schedule::Spaced { .. } => NF_SCHEDULE_SPACED,
            Schedule::Growing { .. } => NF_SCHEDULE_GROWING,
            other => unreachable!("C has no number for {other:?}"),
        };
        Self {
            tile: tile as u32,
            schedule,
            step,
            min_spp,
            max_spp,
            consecutive,
            tone_mapping: NF_TONE_REINHARD,
            key: noisefloor::display::DEFAULT_KEY,
            white: 0.0,
            exposure: 1.0,
            audience_slope: audience.slope,
            audience_offset: audience.offset,
            viewing: std::ptr::null(),
            tone: std::ptr::null(),
        }
    }
}

impl NfParams {
    /// Those that a caller gives, or the defaults.
    ///
    /// # Safety
    /// As [`border::object`], if `given` is not null; and as [`Self::to_params`].
    pub(crate) unsafe fn or(given: *const Self, defaults: Params) -> Result<Params, Failure> {
        if given.is_null() {
            return Ok(defaults);
        }
        // SAFETY: as for this function.
        unsafe { border::object(given, "params")?.to_params() }
    }

    /// The same for Rust; ranges are left to be checked by the session.
    ///
    /// # Safety
    /// `viewing` is null, or leads to text.
    unsafe fn to_params(self) -> Result<Params, Failure> {
        let unknown = |what: &str, value: u32| {
            Failure::new(NfStatus::Argument, format!("{value} is no {what}: use a constant of noisefloor.h"))
        };
        let schedule = match self.schedule {
            NF_SCHEDULE_EVERY => Schedule::Every { step: self.step },
            NF_SCHEDULE_SPACED => Schedule::Spaced { step: self.step },
            NF_SCHEDULE_GROWING => Schedule::Growing { step: self.step },
            other => return Err(unknown("schedule", other)),
        };
        let white = (self.white != 0.0).then_some(self.white);
        let tone_mapping = match self.tone_mapping {
            _ if !self.tone.is_null() => {
                let curve = handle::get(self.tone)?.0.clone();
                ToneMapping::Custom { exposure: self.exposure, curve }
            }
            NF_TONE_REINHARD => ToneMapping::Reinhard { key: self.key, white },
            NF_TONE_SRGB => ToneMapping::Srgb { exposure: self.exposure },
            other => return Err(unknown("tone mapping", other)),
        };
        let viewing = if self.viewing.is_null() {
            Viewing::default()
        } else {
            // SAFETY: not null, so it leads to text.
            unsafe { border::text(self.viewing, "viewing") }?.parse()?
        };
        Ok(Params::default()
            .with_tile(self.tile as usize)
            .with_tone_mapping(tone_mapping)
            .with_viewing(viewing)
            .with_schedule(schedule)
            .with_min_spp(self.min_spp)
            .with_max_spp(self.max_spp)
            .with_consecutive(self.consecutive)
            .with_audience(Audience { slope: self.audience_slope, offset: self.audience_offset }))
    }
}
