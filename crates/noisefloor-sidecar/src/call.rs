//! One request and its reply, checked.

use crate::error::SidecarCause;
use crate::message::{Hello, Sampled, Status};
use crate::process::{Failure, Process};
use noisefloor::{Batch, Counts, Request, Rgb, SourceInfo, text::printable, tile::check_image};
use serde::de::DeserializeOwned;
use std::time::Duration;

/// Bytes of a pixel on the wire.
const PIXEL: usize = 12;
/// Longest name that a renderer may give itself, in characters.
const NAME: usize = 200;

/// The tile to blame, if there is one, and the cause.
pub(crate) type Blame = (Option<usize>, SidecarCause);

/// A reply with its header parsed and the length of its payload within the limit.
pub(crate) struct Reply<T> {
    pub(crate) header: T,
    pub(crate) payload: Vec<u8>,
}

/// Sends a request and returns its reply, whose payload has at most `most_pixels` pixels.
pub(crate) fn ask<T: DeserializeOwned>(
    process: &mut Process,
    header: Vec<u8>,
    payload: Vec<u8>,
    most_pixels: usize,
    timeout: Duration,
) -> Result<Reply<T>, Blame> {
    let wrong = |what: String| (None, SidecarCause::Wrong { what: printable(&what).into_owned() });
    let frame =
        process.call(header, payload, most_pixels * PIXEL, timeout).map_err(|failure| match failure {
            Failure::Ended(status) => (None, SidecarCause::Died { status }),
            Failure::Silent => (None, SidecarCause::Silent { limit: timeout }),
            Failure::GivenUp => (None, SidecarCause::GivenUp),
            Failure::Garbled(error) => wrong(error.to_string()),
        })?;
    let status: Status = serde_json::from_slice(&frame.header).map_err(|e| wrong(e.to_string()))?;
    if !status.ok {
        process.hear_out();
        let said = status.error.unwrap_or_else(|| "it refused without giving a reason".to_owned());
        return Err((status.tile, SidecarCause::Refused(printable(&said).into_owned())));
    }
    let header = serde_json::from_slice(&frame.header).map_err(|e| wrong(e.to_string()))?;
    Ok(Reply { header, payload: frame.payload })
}

/// What a renderer says of itself.
#[derive(Debug)]
pub(crate) struct Described {
    pub(crate) info: SourceInfo,
    /// Samples that it takes before it can stop, over all pixels of a tile.
    pub(crate) late: u64,
    /// What the user should know.
    pub(crate) warnings: Vec<String>,
}

/// What the renderer says of itself, checked.
pub(crate) fn describe(hello: Hello) -> Result<Described, Blame> {
    let Hello { name, width, height, unit, repeats, late, stratified, warnings } = hello;
    let wrong = |what: String| (None, SidecarCause::Wrong { what });
    check_image(width, height).map_err(|e| wrong(e.to_string()))?;
    let name: String = name.chars().filter(|c| !c.is_control()).take(NAME).collect();
    let name = printable(&name).into_owned();
    if name.trim().is_empty() {
        return Err(wrong("it has no name".to_owned()));
    }
    let warnings = warnings.iter().map(|warning| printable(warning).into_owned()).collect();
    let counts = if late > 0 { Counts::More } else { Counts::Asked };
    let info = SourceInfo::new(name, width, height).with_unit(unit).with_repeats(repeats);
    let info = info.with_counts(counts).with_stratified(stratified);
    Ok(Described { info, late, warnings })
}

/// Most samples per pixel that are believed where `request` asks for some, of a renderer that takes `late` samples before it
/// can stop.
pub(crate) fn most(request: &Request, late: u64) -> u64 {
    if late == 0 {
        return request.spp;
    }
    // It may have been ahead by a batch, waits for pixels without samples (four more at most), and stops late
    let overrun = late / request.tile.pixels().max(1) as u64;
    request.spp.saturating_mul(2).saturating_add(overrun.saturating_add(8))
}

/// The batches of a reply: as many as requests, none with more samples than is believed.
pub(crate) fn batches(
    requests: &[Request],
    late: u64,
    Reply { header: Sampled { samples }, payload }: Reply<Sampled>,
) -> Result<Vec<Batch>, Blame> {
    if samples.len() != requests.len() {
        let what = format!("{} sample counts for {} tiles", samples.len(), requests.len());
        return Err((None, SidecarCause::Wrong { what }));
    }
    let given = || requests.iter().zip(samples.iter().copied());
    if let Some((request, samples)) = given().find(|(request, samples)| *samples > most(request, late)) {
        let what = format!("{samples} samples where {} were requested", request.spp);
        return Err((Some(request.tile.index), SidecarCause::Wrong { what }));
    }
    exactly(&payload, given().map(|(r, n)| if n > 0 { r.tile.pixels() } else { 0 }).sum())?;
    let mut pixels = rgb(&payload);
    let batches = given().map(|(request, samples)| {
        let pixels = pixels.by_ref().take(if samples > 0 { request.tile.pixels() } else { 0 });
        Batch::new(request.tile, samples, pixels.collect())
    });
    Ok(batches.collect())
}

/// Refuses a payload of another length.
pub(crate) fn exactly(payload: &[u8], pixels: usize) -> Result<(), Blame> {
    if payload.len() == pixels * PIXEL {
        return Ok(());
    }
    let what = format!("a payload of {} bytes where {} are expected", payload.len(), pixels * PIXEL);
    Err((None, SidecarCause::Wrong { what }))
}

pub(crate) fn rgb(payload: &[u8]) -> impl Iterator<Item = Rgb> {
    let value = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap_or_default());
    payload.chunks_exact(PIXEL).map(move |p| [value(&p[..4]), value(&p[4..8]), value(&p[8..])])
}
