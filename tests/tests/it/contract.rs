use crate::kit::{Altered, Synthetic};
use noisefloor::{
    Batch, Counts, ProgressiveSource, Repeats, Request, SourceError, SourceInfo, Tile, Unit,
    source::{FirstHits, PixelNoise, Reference},
};
use noisefloor_image::{RenderLayers, StackSource, write_exr};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
use noisefloor_testkit::{Noise, broken_promise, check_reference, check_source};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};

const SIZE: (usize, usize) = (48, 40);

fn synthetic() -> Synthetic {
    Synthetic::new(SIZE.0, SIZE.1)
}

#[test]
fn the_path_tracer_keeps_it() {
    for name in ["cornell-box", "courtyard", "glass-spheres"] {
        check_source(|| {
            let options = RenderOptions { seed: 5, ..RenderOptions::default() };
            Ptwne::new(scenes::by_name(name).unwrap(), SIZE.0, SIZE.1, options).unwrap()
        });
    }
}

#[test]
fn its_reference_is_free_of_noise_to_the_oracle() {
    for name in ["cornell-box", "courtyard", "glass-spheres"] {
        let make = |seed| {
            let options = RenderOptions { seed, ..RenderOptions::default() };
            Ptwne::new(scenes::by_name(name).unwrap(), SIZE.0, SIZE.1, options).unwrap()
        };
        check_reference(make, |source| source.reference().map(Some));
    }
}

/// What is said of a source whose reference is this picture.
fn referred(reference: impl Fn(u64) -> Reference + Clone + 'static) -> String {
    outcome(|| {
        let make = |seed| {
            let reference = reference.clone();
            Altered::reference(synthetic(), move || Some(reference(seed)))
        };
        check_reference(make, |source| Ok(source.render_reference()));
    })
}

/// Noise of a deviation of 10 %, which is 4.3/255 on the screen, is noticed; a twentieth of it is not.
#[test]
fn noise_in_a_reference_is_noticed() {
    let said = |deviation: f64| {
        referred(move |seed| {
            let mut noise = Noise::new(seed);
            let mut value = || 0.5 + 0.5 * deviation * 12f64.sqrt() * (noise.uniform() - 0.5);
            Reference::new(SIZE, (0..SIZE.0 * SIZE.1).map(|_| [value() as f32; 3]).collect())
        })
    };
    assert!(said(0.1).contains("noise that the oracle sees"));
    assert_eq!(said(0.005), "kept");
}

#[test]
fn synthetic_sources_keep_it() {
    check_source(synthetic);
    check_source(|| Synthetic { aims: false, ..synthetic() });
    check_source(|| Synthetic { store: 100, ..synthetic() });
    check_source(|| Synthetic::flat(SIZE.0, SIZE.1, |_, _| 0.3));
    check_source(|| Synthetic::new(1, 1));
}

/// Batches of uneven size, as they are and as the running means they add up to.
#[test]
fn stacks_on_disk_keep_it() {
    let (batches, means) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (width, height) = SIZE;
    let tile = Tile { index: 0, x: 0, y: 0, width, height };
    let (mut source, mut sum) = (synthetic(), vec![[0.0f64; 3]; width * height]);
    let ends = [20u64, 60, 100, 140, 180];
    for (i, last) in ends.into_iter().enumerate() {
        let first = if i == 0 { 0 } else { ends[i - 1] };
        let request = Request::new(tile, first, last - first);
        let batch = source.sample(&[request]).unwrap().remove(0);
        for (sum, value) in sum.iter_mut().flatten().zip(batch.mean.iter().flatten()) {
            *sum += f64::from(*value) * (last - first) as f64;
        }
        let mean: Vec<_> = sum.iter().map(|p| p.map(|c| (c / last as f64) as f32)).collect();
        let name = format!("batch_{first:05}_{last:05}.exr");
        write_exr(batches.path().join(name), &RenderLayers::rgb(width, height, &batch.mean)).unwrap();
        let name = format!("{last:05}.exr");
        write_exr(means.path().join(name), &RenderLayers::rgb(width, height, &mean)).unwrap();
    }
    check_source(|| StackSource::open(batches.path()).unwrap());
    check_source(|| StackSource::open(means.path()).unwrap());
}

/// What `check_source` says of a source.
fn verdict<S: ProgressiveSource>(make: impl Fn() -> S) -> String {
    broken_promise(make).unwrap_or_else(|| "kept".into())
}

/// What a check says that panics if it has something to say.
fn outcome(check: impl FnOnce()) -> String {
    let Err(panic) = catch_unwind(AssertUnwindSafe(check)) else { return "kept".into() };
    let text = panic.downcast_ref::<String>().cloned();
    text.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned())).unwrap_or_default()
}

/// Other samples of the same tile.
fn cut(request: &Request, first: u64, spp: u64) -> Request {
    Request::new(request.tile, first, spp).in_sequence(request.sequence)
}

fn broken(change: impl FnMut(&[Request], &mut Vec<Batch>) + Copy + 'static) -> String {
    verdict(|| Altered::batches(synthetic(), change))
}

/// The contract notices; otherwise keeping it means nothing.
#[test]
fn broken_promises_are_noticed() {
    let said = |said: String, expected: &str| assert!(said.contains(expected), "{said:?}, not {expected:?}");
    said(broken(|_, _| ()), "kept");
    said(broken(|_, b| drop(b.pop())), "the number of batches");
    said(broken(|_, b| b.reverse()), "order of the requests");
    said(broken(|_, b| b.iter_mut().for_each(|b| b.mean.truncate(7))), "number of values in a batch");
    said(broken(|_, b| b.iter_mut().for_each(|b| b.spp = 0)), "number of values in a batch of 0");
    said(broken(|_, b| b.iter_mut().for_each(|b| b.spp += 1)), "17 samples where 16 were asked for");

    // The first samples over and over
    let again = |r: &[Request], b: &mut Vec<Batch>| {
        let restart: Vec<_> = r.iter().map(|r| cut(r, 0, r.spp)).collect();
        *b = synthetic().sample(&restart).unwrap();
    };
    let verdict_again = broken(again);
    assert!(verdict_again.contains("how requests are cut"), "{verdict_again}");

    // Random numbers that follow from the call, not from the sample: right but for cuts
    let by_call = |r: &[Request], b: &mut Vec<Batch>| {
        let seed = 100 + r.first().map_or(0, |r| r.first * 1000 + r.spp);
        *b = Synthetic { seed, ..synthetic() }.sample(r).unwrap();
    };
    said(broken(by_call), "how requests are cut");
    said(broken(|r, b| b.iter_mut().for_each(|b| b.mean[0][0] *= r.len() as f32)), "alone");

    // Random numbers numbered from the tile's corner
    let from_corner = |r: &[Request], b: &mut Vec<Batch>| {
        let moved: Vec<_> =
            r.iter().map(|r| Request::new(Tile { x: 0, y: 0, ..r.tile }, r.first, r.spp)).collect();
        *b = synthetic().sample(&moved).unwrap();
        b.iter_mut().zip(r).for_each(|(b, r)| b.tile = r.tile);
    };
    said(broken(from_corner), "tiles have the same noise");
}

/// Random numbers that follow from the call, not from the sample; then the batch is changed.
fn by_call(repeats: Repeats, change: impl Fn(&Request, &mut Batch) + Copy + 'static) -> String {
    verdict(move || {
        let mut calls = 0;
        Altered::batches(Synthetic { repeats, ..synthetic() }, move |requests, batches| {
            calls += 1;
            *batches = Synthetic { seed: 100 + calls, ..synthetic() }.sample(requests).unwrap();
            requests.iter().zip(batches).for_each(|(request, batch)| change(request, batch));
        })
    })
}

#[test]
fn who_promises_less_is_held_to_less_and_no_less() {
    let said = |said: String, expected: &str| assert!(said.contains(expected), "{said:?}, not {expected:?}");
    said(by_call(Repeats::Samples, |_, _| ()), "how requests are cut");
    said(by_call(Repeats::Calls, |_, _| ()), "kept");
    said(by_call(Repeats::Nothing, |_, _| ()), "kept");

    // Small batches a little darker; half of the samples they claim; all the noise in a tenth of the pixels
    // of a batch
    let dark = |r: &Request, b: &mut Batch| {
        b.mean.iter_mut().flatten().for_each(|c| *c *= if r.spp == 8 { 0.97 } else { 1.0 })
    };
    said(by_call(Repeats::Calls, dark), "the mean of 32 samples depends on how requests are cut");
    let few = |r: &Request, b: &mut Batch| {
        if r.spp == 8 {
            let fewer = cut(r, 10_000 + r.first, 4);
            b.mean = synthetic().sample(&[fewer]).unwrap().remove(0).mean;
        }
    };
    said(by_call(Repeats::Nothing, few), "the noise of 32 samples depends on how requests are cut");
    // Every other batch is the one before, which a renderer does that forgets to change its seed
    let twice = |r: &Request, b: &mut Batch| {
        let first = r.first / (2 * r.spp) * (2 * r.spp);
        b.mean = synthetic().sample(&[cut(r, first, r.spp)]).unwrap().remove(0).mean;
    };
    said(by_call(Repeats::Calls, twice), "correlated");
}

/// Gives more samples than asked for, in some tiles.
fn late(counts: Counts, over: u64) -> String {
    verdict(move || {
        let source = Synthetic { counts, repeats: Repeats::Nothing, ..synthetic() };
        Altered::batches(source, move |requests, batches| {
            let more = |r: &Request| cut(r, r.first, r.spp + over * ((r.first + r.tile.index as u64) % 7));
            *batches = synthetic().sample(&requests.iter().map(more).collect::<Vec<_>>()).unwrap();
        })
    })
}

#[test]
fn late_renderers_give_more_if_they_say_so() {
    assert_eq!(late(Counts::More, 1), "kept");
    assert!(late(Counts::Asked, 1).contains("samples where 16 were asked for"));
}

/// Neighbouring pixels of a batch share their noise, which is no fault of a source that says so: of a Markov chain,
/// or of lines of light.
#[test]
fn pixels_may_share_noise_if_they_say_so() {
    let shared = |unit: Unit, pixels: PixelNoise| {
        verdict(move || {
            let source = Synthetic { repeats: Repeats::Calls, unit, pixels, ..synthetic() };
            Altered::batches(source, |requests, batches| {
                for (r, batch) in requests.iter().zip(batches) {
                    let mut noise = Noise::keyed(&[r.first, r.tile.index as u64, r.spp]);
                    let rows: Vec<f64> = (0..r.tile.height).map(|_| noise.uniform() - 0.5).collect();
                    let noise = |i: usize| rows[i / r.tile.width / 8] / (r.spp as f64).sqrt();
                    batch.mean = (0..r.tile.pixels()).map(|i| [0.5 + noise(i) as f32; 3]).collect();
                }
            })
        })
    };
    assert_eq!(shared(Unit::MutationsPerPixel, PixelNoise::Independent), "kept");
    assert_eq!(shared(Unit::SamplesPerPixel, PixelNoise::Shared), "kept");
}

/// A picture filtered by three pixels in a row.
#[test]
fn pixel_filters_have_to_be_announced() {
    let filtered = |pixels: PixelNoise| {
        verdict(move || {
            let source = Synthetic { repeats: Repeats::Calls, pixels, ..synthetic() };
            Altered::batches(source, |requests, batches| {
                let mut sharp = Synthetic { repeats: Repeats::Calls, ..synthetic() };
                *batches = sharp.sample(requests).unwrap();
                for batch in batches {
                    let (width, mean) = (batch.tile.width, batch.mean.clone());
                    for (i, pixel) in batch.mean.iter_mut().enumerate() {
                        let row = i / width * width;
                        let at = |x: usize| mean[row + x.min(width - 1)];
                        let (before, after) = (at((i - row).saturating_sub(1)), at(i - row + 1));
                        *pixel = std::array::from_fn(|c| (before[c] + mean[i][c] + after[c]) / 3.0);
                    }
                }
            })
        })
    };
    let said = filtered(PixelNoise::Independent);
    assert!(said.contains("neighbouring pixels have noise in common"), "{said}");
    assert_eq!(filtered(PixelNoise::Shared), "kept");
}

/// A playback of running means that forgets to take the difference.
struct Running {
    source: Synthetic,
}

impl ProgressiveSource for Running {
    fn info(&self) -> SourceInfo {
        self.source.info()
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let all = |r: &Request| cut(r, 0, r.first + 20);
        let mut batches = self.source.sample(&requests.iter().map(all).collect::<Vec<_>>())?;
        batches.iter_mut().for_each(|b| b.spp = 20);
        Ok(batches)
    }
}

#[test]
fn playbacks_and_references_that_break_it_are_noticed() {
    let running = verdict(|| Running { source: Synthetic { counts: Counts::Stored, ..synthetic() } });
    assert!(running.contains("successive batches are correlated"), "{running}");

    let reference = |width: usize, value: f32| {
        referred(move |_| Reference::new((width, SIZE.1), vec![[value; 3]; width * SIZE.1]))
    };
    assert_eq!(reference(SIZE.0, 0.5), "kept");
    assert!(reference(SIZE.0 + 1, 0.5).contains("image's size"));
    assert!(reference(SIZE.0, f32::NAN).contains("finite"));

    let calls = std::cell::Cell::new(0);
    let unsteady = verdict(|| {
        calls.set(calls.get() + 1);
        Synthetic { seed: calls.get(), ..synthetic() }
    });
    assert!(unsteady.contains("second time"), "{unsteady}");
}

#[test]
fn first_hits_that_break_it_are_noticed() {
    // What the albedo is of an index and a pixel
    let said = |albedo: fn(u64, u64) -> f64| {
        verdict(move || {
            Altered::first_hits(synthetic(), move |index| {
                let (width, height) = SIZE;
                let albedo =
                    (0..(width * height) as u64).map(|pixel| [albedo(index, pixel) as f32; 3]).collect();
                Some(FirstHits::new((width, height), albedo, vec![[0.0, 0.6, 0.8]; width * height]))
            })
        })
    };
    assert_eq!(said(|_, _| 0.5), "kept");
    assert_eq!(said(|index, pixel| Noise::keyed(&[index, pixel]).uniform()), "kept");
    assert!(said(|_, _| 1.5).contains("outside of 0 to 1"));
    let two = said(|index, pixel| Noise::keyed(&[index / 2, pixel]).uniform());
    assert!(two.contains("correlated"), "two pictures for four indices: {two}");
    // Each has half of its noise in common with another
    let shared = said(|index, pixel| {
        0.5 * Noise::keyed(&[index, pixel]).uniform() + 0.5 * Noise::keyed(&[9, index / 2, pixel]).uniform()
    });
    assert!(shared.contains("correlated"), "{shared}");
    let calls = said(|_, pixel| {
        static CALLS: AtomicU64 = AtomicU64::new(0);
        Noise::keyed(&[CALLS.fetch_add(1, Ordering::Relaxed), pixel]).uniform()
    });
    assert!(calls.contains("differ the second time"), "{calls}");
    let small = verdict(|| {
        let pixels = vec![[0.0; 3]; SIZE.0];
        let hits = FirstHits::new((SIZE.0, 1), pixels.clone(), pixels);
        Altered::first_hits(synthetic(), move |_| Some(hits.clone()))
    });
    assert!(small.contains("image's size"), "{small}");
}
