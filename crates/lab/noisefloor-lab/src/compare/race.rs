//! One run that all criteria watch: each sees the same samples, and takes those of a tile until it stops it.
//! Those that want samples of their own get them between two steps of that run.

use super::costs::Costs;
use super::denoising::AfterDenoising;
use super::quality::{Eye, Quality, Yardstick};
use crate::advance::{Advance, Watch};
use crate::error::LabError;
use noisefloor::{
    Batch, Film, Params, ProgressiveSource, Request, Rgb, Schedule, Session, StoppingCriterion, Tile,
    TileGrid,
    session::Interruption,
    source::{Reference, Sequence},
};
use noisefloor_denoise::Denoiser;
use noisefloor_vision::VisionModel;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// A criterion that watches the run.
pub struct Entrant {
    /// As it was asked for: `cycles:0.01`.
    pub spec: String,
    /// What it is one of: `cycles`. Entrants of one family differ only in their constant.
    pub family: String,
    session: Session<Box<dyn StoppingCriterion + Send>>,
    /// Whether it is given samples of its own.
    apart: bool,
    /// Seconds in the source for samples of its own.
    own_seconds: f64,
    pub criterion_seconds: f64,
}

impl Entrant {
    /// A criterion that is about to watch a run of that size. `spec` is how it was asked for.
    ///
    /// With verdicts that are [spaced](Schedule::Spaced) for each tile by its need, it does not watch: it renders as a driver would, from the same source.
    pub fn new(
        spec: String,
        criterion: Box<dyn StoppingCriterion + Send>,
        (width, height): (usize, usize),
        params: &Params,
    ) -> Result<Self, LabError> {
        let family = spec.split(':').next().unwrap_or_default().to_owned();
        let session = Session::new(width, height, criterion, params.clone())?;
        let apart = matches!(params.schedule, Schedule::Spaced { .. });
        Ok(Self { spec, family, session, apart, own_seconds: 0.0, criterion_seconds: 0.0 })
    }

    /// Its picture: each tile as it was when it stopped.
    pub fn film(&self) -> &Film {
        self.session.film()
    }

    /// What is likely to be wrong with the samples that it saw.
    pub(super) fn warnings(&self) -> Vec<String> {
        self.session.warnings().iter().map(ToString::to_string).collect()
    }

    /// What it calls itself, with its constant.
    pub fn name(&self) -> String {
        self.session.criterion().name()
    }

    /// Tiles that it was satisfied with, before a limit came.
    pub fn converged(&self) -> usize {
        self.session.stops().filter(|s| s.reason.is_satisfied()).count()
    }

    /// Takes the next samples of its own, as a [`Driver`](noisefloor::Driver) does, and judges once all tiles
    /// have what they need; `false` if the source has no more.
    fn sample_apart(&mut self, source: &mut dyn ProgressiveSource) -> Result<bool, LabError> {
        let requests = self.session.next_batches();
        let began = Instant::now();
        let batches = source.sample(&requests)?;
        self.own_seconds += began.elapsed().as_secs_f64();
        for Batch { tile, spp, mean, .. } in batches {
            if spp == 0 {
                return Ok(false);
            }
            self.session.push(tile.index, spp, &mean)?;
        }
        if self.session.is_round_complete() {
            self.judge()?;
        }
        Ok(true)
    }

    fn judge(&mut self) -> Result<(), LabError> {
        let began = Instant::now();
        self.session.judge()?;
        self.criterion_seconds += began.elapsed().as_secs_f64();
        Ok(())
    }
}

pub(super) struct Race {
    pub(super) entrants: Vec<Entrant>,
    /// Uniform sampling, by increasing samples.
    pub(super) curve: Vec<CurvePoint>,
    /// Seconds that one more sample of each pixel of a tile costs, tile by tile.
    pub(super) tile_seconds: Vec<f64>,
    pub(super) cancelled: bool,
}

impl Race {
    /// Seconds in the source for the samples of an entrant: of its own as they were measured, of the others by
    /// what one costs.
    pub(super) fn source_seconds(&self, entrant: &Entrant) -> f64 {
        if entrant.apart {
            return entrant.own_seconds;
        }
        let costs = self.tile_seconds.iter().enumerate();
        costs.map(|(tile, seconds)| seconds * entrant.film().spp(tile) as f64).sum()
    }
}

/// Uniform sampling with that many samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Samples per pixel, everywhere.
    pub spp: u64,
    pub source_seconds: f64,
    /// How far the picture is from the converged one.
    pub quality: Quality,
    /// With a denoiser only.
    pub denoised: Option<AfterDenoising>,
}

impl CurvePoint {
    /// Its seconds are known at the end of the run.
    fn new(
        film: &Film,
        yardstick: &Yardstick,
        denoiser: &mut Option<&mut dyn Denoiser>,
    ) -> Result<Self, LabError> {
        let image = film.image();
        let denoised = match denoiser {
            Some(denoiser) => Some(AfterDenoising::of(&image, *denoiser, yardstick)?),
            None => None,
        };
        Ok(Self { spp: film.spp(0), source_seconds: 0.0, quality: yardstick.quality(&image)?, denoised })
    }
}

/// Curve points lie this far apart, as a factor on samples.
const SPACING: f64 = std::f64::consts::SQRT_2;

/// What a run is made of.
#[derive(Clone, Copy)]
pub struct Course<'a> {
    /// Tiles, tone mapping, viewing conditions and the largest number of samples.
    pub params: &'a Params,
    /// Samples per pixel between two verdicts.
    pub batch: u64,
    /// The converged picture: linear radiance, row-major, as many pixels as the source renders.
    pub reference: &'a [Rgb],
    /// How far people are from the screen, for FLIP: pixels in a degree of their view.
    pub pixels_per_degree: f64,
    /// Ends the run after the batch that is under way.
    pub cancel: &'a AtomicBool,
    pub watch: Watch<'a>,
}

impl Course<'_> {
    /// Runs until every entrant has stopped every tile, or at the largest number of samples.
    ///
    /// Each step is half a batch for every tile: sessions fill one half of their film after the other. What
    /// a tile costs is measured in the second step, where each is sampled in a call of its own, as shares
    /// of what all of them cost together in the calls after the first, which may have to start something
    /// up.
    pub(super) fn run(
        &self,
        source: &mut dyn ProgressiveSource,
        entrants: Vec<Entrant>,
        denoiser: &mut Option<&mut dyn Denoiser>,
    ) -> Result<(Race, Yardstick), LabError> {
        let info = source.info();
        let grid = TileGrid::new(info.width, info.height, self.params.tile)?;
        let mut field = Field {
            entrants,
            film: Film::without_halves(grid),
            points: [0; 2],
            costs: Costs::new(grid.len()),
        };
        field.show_converged(self.reference)?;
        let mut yardstick: Option<Yardstick> = None;
        let mut curve: Vec<CurvePoint> = Vec::new();
        let (mut done, mut cancelled) = (0u64, false);
        while done < self.params.max_spp && field.open() > 0 {
            cancelled = self.cancel.load(Ordering::Relaxed);
            let samples = (self.params.max_spp - done).min(self.batch.div_ceil(2));
            // The end of a recording, or of somebody's patience
            if cancelled || !field.step(source, samples)? {
                break;
            }
            done = field.film.spp(0);
            if yardstick.is_none() {
                yardstick = Some(self.settle(&mut field)?);
            }
            let Some(yardstick) = &yardstick else { break };
            field.judge()?;
            if !field.step_apart(source)? {
                break;
            }
            let last = curve.last().map_or(0.0, |point| point.spp as f64);
            if done as f64 >= SPACING * last {
                curve.push(CurvePoint::new(&field.film, yardstick, denoiser)?);
            }
            let detail = format!("{} criteria not satisfied yet", field.open());
            let (what, of) = ("samples per pixel", self.params.max_spp);
            (self.watch)(Advance { what, done, of, detail: &detail });
        }
        while !cancelled && field.apart() > 0 && field.step_apart(source)? {
            cancelled = self.cancel.load(Ordering::Relaxed);
        }
        let Field { mut entrants, film, costs, .. } = field;
        for entrant in &mut entrants {
            entrant.session.close_all(if cancelled { Interruption::Cancelled } else { Interruption::MaxSpp });
        }
        let yardstick = yardstick.ok_or(LabError::NoSamples)?;
        if curve.last().is_none_or(|point| point.spp < done) {
            curve.push(CurvePoint::new(&film, &yardstick, denoiser)?);
        }
        let tile_seconds = costs.tile_seconds(&grid.tiles().collect::<Vec<_>>());
        let everywhere: f64 = tile_seconds.iter().sum();
        curve.iter_mut().for_each(|point| point.source_seconds = everywhere * point.spp as f64);
        Ok((Race { entrants, curve, tile_seconds, cancelled }, yardstick))
    }

    /// All judge by one way to the screen: that of the converged picture.
    fn settle(&self, field: &mut Field) -> Result<Yardstick, LabError> {
        let display = self.params.tone_mapping.settle(self.reference);
        field.entrants.iter_mut().try_for_each(|e| e.session.set_display(display.clone()))?;
        let vision = VisionModel::new(&self.params.viewing);
        let eye = Eye { pixels_per_degree: self.pixels_per_degree, vision };
        Ok(Yardstick::new(field.film.grid(), display, self.reference.to_vec(), eye))
    }
}

/// All entrants, and the uniform picture that they watch.
struct Field {
    entrants: Vec<Entrant>,
    film: Film,
    /// Samples per pixel of either half.
    points: [u64; 2],
    costs: Costs,
}

impl Field {
    /// Gives the converged picture to those who ask for it.
    fn show_converged(&mut self, truth: &[Rgb]) -> Result<(), LabError> {
        let grid = self.film.grid();
        let asking = self.entrants.iter_mut().filter(|e| e.session.criterion().needs().reference);
        for entrant in asking {
            let (width, height) = grid.size();
            entrant.session.set_reference(Reference::new((width, height), truth.to_vec()))?;
        }
        Ok(())
    }

    /// Entrants that are not satisfied yet.
    fn open(&self) -> usize {
        self.entrants.iter().filter(|e| !e.session.is_done()).count()
    }

    /// Those of them that want samples of their own.
    fn apart(&self) -> usize {
        self.entrants.iter().filter(|e| e.apart && !e.session.is_done()).count()
    }

    /// Gives everybody the next samples of every tile, of whichever half has fewer; `false` if the source has no more.
    fn step(&mut self, source: &mut dyn ProgressiveSource, samples: u64) -> Result<bool, LabError> {
        // As sessions ask for them: their halves in turn, each a sequence of its own
        let half = usize::from(self.points[1] < self.points[0]);
        let sequence = Sequence::new(half as u32, self.points[half]);
        let request = |tile: Tile| Request::new(tile, self.film.spp(0), samples).in_sequence(sequence);
        let requests: Vec<Request> = self.film.grid().tiles().map(request).collect();
        let batches = self.costs.sample(source, &requests)?;
        if batches.len() < requests.len() || batches.iter().any(|b| b.spp == 0) {
            return Ok(false);
        }
        self.points[half] += samples;
        for Batch { tile, spp: samples, mean, .. } in &batches {
            self.film.add(tile.index, *samples, mean)?;
            let watching = |e: &&mut Entrant| !e.apart && e.session.is_open(tile.index);
            for entrant in self.entrants.iter_mut().filter(watching) {
                entrant.session.push(tile.index, *samples, mean)?;
            }
        }
        Ok(true)
    }

    fn judge(&mut self) -> Result<(), LabError> {
        self.entrants.iter_mut().filter(|e| !e.apart).try_for_each(Entrant::judge)
    }

    /// One call to the source for each entrant that wants samples of its own; `false` if it has no more. Calls
    /// alternate with steps of the run, so that whatever else the machine does slows both alike.
    fn step_apart(&mut self, source: &mut dyn ProgressiveSource) -> Result<bool, LabError> {
        for entrant in self.entrants.iter_mut().filter(|e| e.apart && !e.session.is_done()) {
            if !entrant.sample_apart(source)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
