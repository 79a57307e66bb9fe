//! What went wrong once, or could, where two features meet: every combination of criterion, exposure and display, cut
//! anywhere. Faults of one feature are tested beside its code.

use crate::kit::{Altered, Bilateral, Synthetic};
use noisefloor::{
    Driver, Event, Oracle, Params, ProgressiveSource, Rgb, Schedule, StopReason, StoppingCriterion,
    ToneMapping, Viewing,
    checkpoint::Checkpoint,
    display::{Display, ToneCurve},
    watch::Warning,
};
use noisefloor_denoise::DenoisedQuality;
use std::sync::atomic::Ordering;

type New = fn() -> Box<dyn StoppingCriterion + Send>;

fn oracle() -> Box<dyn StoppingCriterion + Send> {
    Box::new(Oracle::bundled())
}

fn denoised() -> Box<dyn StoppingCriterion + Send> {
    Box::new(DenoisedQuality::new(Bilateral, 0.5))
}

/// A picture whose light comes late: its exposure moves after the first verdicts, and judged tiles are judged again.
fn source() -> impl ProgressiveSource {
    let (mut synthetic, radiance) =
        (Synthetic::new(64, 40), |x: usize, y: usize| 0.02 + 0.001 * (x + y) as f32);
    (synthetic.radiance, synthetic.noise) = (radiance, |x, _| 0.1 + 0.01 * x as f32);
    Altered::batches(synthetic, |requests, batches| {
        for (request, batch) in requests.iter().zip(batches) {
            // One lamp of 64 times the radiance, in one sample of 32
            let lit = (request.first..request.first + request.spp).filter(|n| n % 32 == 31).count() as f32;
            let lamp = 64.0 * 0.02 * lit / request.spp as f32;
            let at =
                |i: usize| (request.tile.x + i % request.tile.width, request.tile.y + i / request.tile.width);
            let lamps = batch.mean.iter_mut().enumerate().filter(|&(i, _)| at(i).0 > 48 && at(i).1 < 12);
            lamps.for_each(|(_, p)| *p = p.map(|c| c + lamp));
        }
    })
}

fn params(tone_mapping: ToneMapping, viewing: Viewing, consecutive: u32) -> Params {
    let schedule = Schedule::Growing { step: 16 };
    let params = Params::default().with_tile(32).with_schedule(schedule).with_min_spp(16).with_max_spp(640);
    params.with_tone_mapping(tone_mapping).with_viewing(viewing).with_consecutive(consecutive)
}

/// What came out of a render.
#[derive(PartialEq)]
struct Outcome {
    stops: Vec<(u64, StopReason)>,
    image: Vec<Rgb>,
    exposure: Option<f32>,
    warnings: Vec<Warning>,
}

/// Renders on from a checkpoint for so many batches; the next checkpoint, whether it is done, and what came out.
fn render(criterion: New, params: &Params, from: Option<&[u8]>, batches: usize) -> (Vec<u8>, bool, Outcome) {
    let mut driver = Driver::new(source(), criterion(), params.clone()).unwrap();
    if let Some(bytes) = from {
        driver = driver.resume("job", Checkpoint::read(bytes).unwrap()).unwrap();
    }
    let (cancel, mut left) = (driver.cancel_flag(), batches);
    let run = driver.run(|_, event| {
        if matches!(event, Event::BatchDone(_)) {
            left = left.saturating_sub(1);
            cancel.store(left == 0, Ordering::Relaxed);
        }
    });
    run.unwrap();
    let mut bytes = Vec::new();
    driver.session().checkpoint("job").unwrap().write(&mut bytes).unwrap();
    let session = driver.session();
    let outcome = Outcome {
        stops: session.stops().map(|stop| (stop.spp, stop.reason)).collect(),
        image: session.film().image(),
        exposure: session.display().map(Display::exposure),
        warnings: session.warnings().to_vec(),
    };
    (bytes, outcome.stops.iter().all(|(_, reason)| reason.is_final()), outcome)
}

/// Two verdicts in a row, halves that are denoised, exposures that move, curves of one's own, frames of films: cut after
/// every batch, all end as if they had not been. (A stop that was forgotten, a verdict in a row that was counted twice, and
/// an exposure that began anew have each been seen.)
#[test]
fn cut_after_every_batch_all_crossings_end_as_if_they_had_not_been() {
    let still = Viewing::default();
    let film = still.with_frames_per_second(Some(24.0)).unwrap();
    let curve = ToneCurve::new(b"root", |exposed| exposed.map(|c| c.max(0.0).sqrt().min(1.0)));
    let own = ToneMapping::Custom { exposure: 2.0, curve };
    let reinhard = Params::default().tone_mapping;
    let crossings: [(New, ToneMapping, Viewing, u32); 6] = [
        (oracle, reinhard.clone(), still, 1),
        (oracle, reinhard.clone(), film, 2),
        (oracle, own.clone(), still, 2),
        (denoised, reinhard.clone(), still, 2),
        (denoised, reinhard, film, 1),
        (denoised, own, film, 2),
    ];
    for (i, (criterion, tone, viewing, consecutive)) in crossings.into_iter().enumerate() {
        let params = params(tone, viewing, consecutive);
        let (_, done, whole) = render(criterion, &params, None, usize::MAX);
        assert!(done, "crossing {i}");
        let (mut cut, mut batches) = (render(criterion, &params, None, 1), 1);
        while !cut.1 {
            cut = render(criterion, &params, Some(&cut.0), 1);
            batches += 1;
            assert!(batches < 100, "crossing {i} makes no way");
        }
        assert!(batches > 1 && cut.2 == whole, "crossing {i}, cut {batches} times");
    }
}
