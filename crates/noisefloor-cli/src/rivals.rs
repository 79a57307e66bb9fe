//! `evaluate --rivals`: when other criteria would have stopped the pictures that people judged.
//!
//! The pictures of a corpus are stages of one rendering, too few to follow a criterion that remembers what it saw. So a rendering is
//! synthesised from them: batches of growing size, each the converged picture with noise of its own laid over it, noise that is the
//! difference of real pictures, scaled by 1/√samples. There are five or so such differences in a corpus; they take turns, with changing
//! sign. All zones of a scene are one picture, as people saw them, and each zone is a tile.

use crate::figures::{COLOURS, failed};
use crate::train::bar;
use anyhow::{Context, bail};
use noisefloor::Scores;
use noisefloor::{Params, Rgb, Schedule, Session, StopReason, StoppingCriterion, ToneMapping, srgb_decode};
use noisefloor_image::write_atomic;
use noisefloor_learn::{Corpus, Encoding, JudgedImage, JudgedZone};
use noisefloor_learn::{Prediction, group_of_scene, score};
use noisefloor_rivals::Rival;
use plotters::prelude::*;
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Samples of one stage over those of the stage before.
const GROWTH: f64 = 1.15;
/// Constants that are tried for a rival, evenly spread over its range in logarithms: of one that has to be run with each, and of one whose
/// verdicts tell what constant would do.
const CONSTANTS: (u32, u32) = (16, 400);
/// The mean of some of the samples may amplify the rounding of 8-bit pictures by no more than this.
const AMPLIFICATION: f64 = 8.0;

/// A rival on human data.
#[derive(Serialize)]
pub struct Rated {
    pub name: &'static str,
    pub title: &'static str,
    /// The constant at which it agrees with people on average, over all scenes.
    pub constant: f64,
    /// With the constant that the other scenes give.
    pub scores: Scores,
    /// Over zones without censored thresholds, samples per pixel.
    pub mean_spp: f64,
    pub scenes: Vec<SceneMean>,
    pub predictions: Vec<Prediction>,
}

/// Mean thresholds of a scene, in samples per pixel.
#[derive(Serialize)]
pub struct SceneMean {
    pub scene: String,
    pub human_spp: f64,
    pub predicted_spp: f64,
}

/// A scene as a rendering that can be followed.
struct Stack {
    zones: Vec<JudgedZone>,
    /// Edge of a zone in pixels, and zones in a row.
    edge: usize,
    columns: usize,
    /// What comes stage by stage: samples, and the mean of these samples alone for each zone.
    stages: Vec<(u32, Vec<Vec<Rgb>>)>,
}

/// Scores rivals on the corpora, the constant of each fitted on the other groups of scenes.
pub fn rate(folders: &[PathBuf], rivals: &[&'static Rival]) -> anyhow::Result<Vec<Rated>> {
    let mut zones = Vec::new();
    let mut stops: Vec<Vec<Vec<f64>>> =
        rivals.iter().map(|rival| vec![Vec::new(); constants(rival).len()]).collect();
    let scenes: Vec<(Corpus, String)> = folders
        .iter()
        .map(|folder| {
            let corpus = Corpus::open(folder)?;
            let names: Vec<String> = corpus.scenes().into_iter().map(str::to_owned).collect();
            Ok(names.into_iter().map(move |name| (corpus.clone(), name)).collect::<Vec<_>>())
        })
        .collect::<anyhow::Result<Vec<_>>>()?
        .into_iter()
        .flatten()
        .collect();
    let progress = bar((scenes.len() * rivals.len()) as u64, "rivals on scenes");
    for (corpus, scene) in &scenes {
        let stack = Stack::of(corpus, scene)?;
        for (rival, stops) in rivals.iter().zip(&mut stops) {
            progress.set_message(format!("{}, {scene}", rival.name));
            let of_scene: Vec<Vec<f64>> = if rival.tells {
                let needed = stack.follow((rival.make)(rival.range.0), false)?;
                constants(rival).into_iter().map(|constant| stack.stops(&needed, constant)).collect()
            } else {
                constants(rival)
                    .into_par_iter()
                    .map(|constant| {
                        let needed = stack.follow((rival.make)(constant), true)?;
                        Ok(stack.stops(&needed, constant))
                    })
                    .collect::<anyhow::Result<_>>()?
            };
            stops.iter_mut().zip(of_scene).for_each(|(all, new)| all.extend(new));
            progress.inc(1);
        }
        zones.extend(stack.zones);
    }
    progress.finish_and_clear();
    Ok(rivals.iter().zip(stops).map(|(rival, stops)| Rated::of(rival, &zones, &stops)).collect())
}

fn constants(rival: &Rival) -> Vec<f64> {
    let (strict, lax) = rival.range;
    let count = if rival.tells { CONSTANTS.1 } else { CONSTANTS.0 };
    let place = |i: u32| f64::from(i) / f64::from(count - 1);
    (0..count).map(|i| strict * (lax / strict).powf(place(i))).collect()
}

impl Rated {
    /// `stops` are samples per pixel: a row for each constant, a column for each zone.
    fn of(rival: &'static Rival, zones: &[JudgedZone], stops: &[Vec<f64>]) -> Self {
        let constants = constants(rival);
        let group = |zone: &JudgedZone| group_of_scene(&zone.scene).to_owned();
        let predict = |(i, zone): (usize, &JudgedZone)| {
            let others = |j: usize| group(&zones[j]) != group(zone);
            let place = unbiased(stops, zones, &others);
            Prediction {
                scene: zone.scene.clone(),
                zone: zone.zone,
                human_spp: zone.human_spp,
                predicted_spp: at(stops, i, place),
                censored: zone.censored,
                unfamiliar: false,
                images_right: 0,
                images: 0,
                probabilities: Vec::new(),
            }
        };
        let predictions: Vec<Prediction> = zones.iter().enumerate().map(predict).collect();
        let place = unbiased(stops, zones, &|_| true);
        let (low, share) = (place.floor() as usize, place.fract());
        let next = (low + 1).min(constants.len() - 1);
        Self {
            name: rival.name,
            title: rival.title,
            constant: constants[low] * (constants[next] / constants[low]).powf(share),
            scores: score(predictions.iter()),
            mean_spp: mean(predictions.iter().filter(|p| !p.censored).map(|p| p.predicted_spp)),
            scenes: scene_means(&predictions),
            predictions,
        }
    }
}

/// Mean thresholds of people and of a predictor, scene by scene; censored ones stay out.
pub fn scene_means(predictions: &[Prediction]) -> Vec<SceneMean> {
    let mut scenes: Vec<&str> = predictions.iter().map(|p| p.scene.as_str()).collect();
    scenes.dedup();
    let of = |scene: &str| {
        let known = || predictions.iter().filter(|p| p.scene == scene && !p.censored);
        SceneMean {
            scene: scene.to_owned(),
            human_spp: mean(known().map(|p| p.human_spp)),
            predicted_spp: mean(known().map(|p| p.predicted_spp)),
        }
    };
    scenes.into_iter().map(of).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    sum / count as f64
}

/// Samples at which a zone is stopped, at a place between two constants.
fn at(stops: &[Vec<f64>], zone: usize, place: f64) -> f64 {
    let (low, share) = (place.floor() as usize, place.fract());
    let next = (low + 1).min(stops.len() - 1);
    let (a, b) = (stops[low][zone], stops[next][zone]);
    a * (b / a).powf(share)
}

/// The place between constants where the mean of ln(stop/human) over the zones that count is nearest to 0: where a rival agrees with
/// people on average.
fn unbiased(stops: &[Vec<f64>], zones: &[JudgedZone], counts: &dyn Fn(usize) -> bool) -> f64 {
    let bias = |place: f64| {
        mean(
            zones
                .iter()
                .enumerate()
                .filter(|(i, zone)| !zone.censored && counts(*i))
                .map(|(i, zone)| (at(stops, i, place) / zone.human_spp).ln()),
        )
    };
    // Stops fall as constants get lax, but not always: look everywhere.
    let steps = 20 * (stops.len() - 1);
    let places = (0..=steps).map(|i| i as f64 / 20.0);
    places.min_by(|a, b| bias(*a).abs().total_cmp(&bias(*b).abs())).unwrap_or(0.0)
}

impl Stack {
    fn of(corpus: &Corpus, scene: &str) -> anyhow::Result<Self> {
        let zones: Vec<JudgedZone> = corpus.zones().iter().filter(|z| z.scene == scene).cloned().collect();
        let edge = zones[0].width;
        if zones.iter().any(|z| z.width != edge || z.height != edge) {
            bail!("{scene}: rivals need square zones of one size");
        }
        let mut levels: Vec<Vec<JudgedImage>> = zones.iter().map(|_| Vec::new()).collect();
        for level in corpus.scene_levels(scene)? {
            let level = level?;
            if let Some(i) = zones.iter().position(|z| z.zone == level.zone) {
                levels[i].push(level);
            }
        }
        let first = zones.iter().map(|z| z.first_spp).min().unwrap_or(1) as f64;
        let last = zones.iter().map(|z| z.last_spp).max().unwrap_or(1) as f64;
        let noises = levels.iter().map(|of_zone| Noise::of(of_zone)).collect::<Option<Vec<_>>>();
        let noises = noises.with_context(|| format!("{scene}: too few images to tell its noise"))?;
        let mut stages = Vec::new();
        let (mut done, mut goal) = (0u64, first / GROWTH.powi(2));
        while (done as f64) < last {
            let samples = ((goal.round() as u64).max(done + 1) - done) as u32;
            let batch = noises.iter().map(|noise| noise.batch(stages.len(), samples)).collect();
            stages.push((samples, batch));
            done += u64::from(samples);
            goal *= GROWTH;
        }
        let columns = (zones.len() as f64).sqrt().ceil() as usize;
        Ok(Self { zones, edge, columns, stages })
    }

    /// Has a criterion judge every stage. For each zone, the least constant that would have stopped it there, stage by stage: what its
    /// verdicts tell, or 0 where it stops it, if it is one that stops.
    fn follow(
        &self,
        criterion: Box<dyn StoppingCriterion + Send>,
        stops: bool,
    ) -> anyhow::Result<Vec<Vec<f64>>> {
        let size = (self.columns * self.edge, self.zones.len().div_ceil(self.columns) * self.edge);
        let params = Params {
            tile: self.edge,
            tone_mapping: ToneMapping::Srgb { exposure: 1.0 },
            // At every stage: each brings more than a step.
            schedule: Schedule::Every { step: 2 },
            max_samples: u64::from(u32::MAX),
            // A criterion that tells is asked at every stage.
            consecutive: if stops { 1 } else { u32::MAX },
            ..Params::default()
        };
        let mut session = Session::new(size.0, size.1, criterion, params)?;
        // Places of the picture that no zone fills.
        for tile in self.zones.len()..session.film().grid().len() {
            session.close(tile, StopReason::Cancelled);
        }
        let mut needed = vec![Vec::new(); self.zones.len()];
        for (samples, batch) in &self.stages {
            for (tile, mean) in batch.iter().enumerate() {
                if session.is_open(tile) {
                    session.push(tile, *samples, mean)?;
                }
            }
            session.judge()?;
            for (tile, needed) in needed.iter_mut().enumerate() {
                let told = session.verdict(tile).and_then(|v| v.probability).map(|p| 1.0 - f64::from(p));
                needed.push(match (stops, session.is_open(tile)) {
                    (true, true) => f64::INFINITY,
                    (true, false) => 0.0,
                    (false, _) => told.unwrap_or(f64::INFINITY),
                });
            }
        }
        Ok(needed)
    }

    /// Samples at which a constant stops each zone: between the first stage that it is enough for and the one before, and within what
    /// observers could choose.
    fn stops(&self, needed: &[Vec<f64>], constant: f64) -> Vec<f64> {
        let totals: Vec<u64> = self
            .stages
            .iter()
            .scan(0, |total, (samples, _)| {
                *total += u64::from(*samples);
                Some(*total)
            })
            .collect();
        let stop = |(zone, needed): (&JudgedZone, &Vec<f64>)| {
            let (first, last) = (zone.first_spp as f64, zone.last_spp as f64);
            let stage = needed.iter().position(|least| *least <= constant);
            let between = |stage: usize| ((totals[stage.saturating_sub(1)] * totals[stage]) as f64).sqrt();
            stage.map_or(last, between).clamp(first, last)
        };
        self.zones.iter().zip(needed).map(stop).collect()
    }
}

/// What the pictures of a zone say of its noise, in linear light.
struct Noise {
    converged: Vec<Rgb>,
    /// Differences from the converged picture, scaled to the variance of a single sample.
    realisations: Vec<Vec<Rgb>>,
}

impl Noise {
    /// From images by increasing samples.
    fn of(levels: &[JudgedImage]) -> Option<Self> {
        let linear = |level: &JudgedImage| -> Vec<Rgb> {
            let decode = |pixel: Rgb| match level.encoding {
                Encoding::Display => pixel.map(srgb_decode),
                Encoding::Linear => pixel,
            };
            level.patch.inner_pixels().map(decode).collect()
        };
        // Means of separate samples, and how many these are.
        let mut parts: Vec<(f64, Vec<Rgb>)> = Vec::new();
        let (mut total, mut running) = (0.0f64, Vec::new());
        for level in levels {
            let image = linear(level);
            let last = level.last as f64;
            let samples = last - total;
            if running.is_empty() {
                running.clone_from(&image);
                parts.push((last - level.first as f64, image));
            } else if level.first > 0 {
                running = mix(&running, total / last, &image, samples / last);
                parts.push((samples, image));
            } else {
                if last / samples <= AMPLIFICATION {
                    parts.push((samples, mix(&image, last / samples, &running, -total / samples)));
                }
                running = image;
            }
            total = last;
        }
        // The converged picture contains them: Var(part − converged) = σ²(1/samples − 1/total).
        let realisation = |(samples, mean): &(f64, Vec<Rgb>)| {
            let scale = (1.0 / samples - 1.0 / total).max(0.0).sqrt().recip();
            mix(mean, scale, &running, -scale)
        };
        let usable = parts.iter().filter(|(samples, _)| *samples <= 0.5 * total);
        let realisations: Vec<Vec<Rgb>> = usable.map(realisation).collect();
        (realisations.len() >= 2).then_some(Self { converged: running, realisations })
    }

    /// The mean of so many new samples; `turn` says which realisation it takes.
    fn batch(&self, turn: usize, samples: u32) -> Vec<Rgb> {
        let count = self.realisations.len();
        let sign = if (turn / count).is_multiple_of(2) { 1.0 } else { -1.0 };
        mix(&self.converged, 1.0, &self.realisations[turn % count], sign / f64::from(samples).sqrt())
    }
}

fn mix(a: &[Rgb], fa: f64, b: &[Rgb], fb: f64) -> Vec<Rgb> {
    let pixel =
        |(a, b): (&Rgb, &Rgb)| std::array::from_fn(|c| (f64::from(a[c]) * fa + f64::from(b[c]) * fb) as f32);
    a.iter().zip(b).map(pixel).collect()
}

/// Says what came out, the model's own predictions first.
pub fn print(model: &[Prediction], rated: &[Rated]) {
    let known = || model.iter().filter(|p| !p.censored);
    println!(
        "\n{:44} {:>9} {:>9} {:>7} {:>7} {:>7}",
        "who stops", "constant", "mean spp", "error", "bias", "early"
    );
    println!("{:44} {:>9} {:9.0}", "people", "", mean(known().map(|p| p.human_spp)));
    let line = |name: &str, constant: String, spp: f64, s: &Scores| {
        println!(
            "{name:44} {constant:>9} {spp:9.0} {:>7} {:>7} {:5.0} %",
            format!("×{:.2}", s.error_factor),
            format!("×{:.2}", s.bias_factor),
            100.0 * s.early_share
        );
    };
    line("the model", String::new(), mean(known().map(|p| p.predicted_spp)), &score(model.iter()));
    for r in rated {
        line(r.title, format!("{:.2e}", r.constant), r.mean_spp, &r.scores);
    }
    println!(
        "Constants are those that agree with people on average; scores are with the constant of the other scenes. Rivals follow a rendering \
         that is synthesised from the pictures (noise ∝ 1/√n)."
    );
}

/// Where the legend of the plot begins, in pixels.
const LEGEND: (i32, i32) = (758, 40);

/// Draws mean thresholds, scene by scene: people, the model, and each rival.
pub fn draw(path: &Path, model: &[Prediction], rated: &[Rated]) -> anyhow::Result<()> {
    let of_model = scene_means(model);
    let mut series: Vec<(&str, Vec<f64>)> = vec![
        ("people", of_model.iter().map(|s| s.human_spp).collect()),
        ("the model", of_model.iter().map(|s| s.predicted_spp).collect()),
    ];
    let order = |r: &Rated| -> Vec<f64> {
        let spp =
            |scene: &str| r.scenes.iter().find(|s| s.scene == scene).map_or(f64::NAN, |s| s.predicted_spp);
        of_model.iter().map(|s| spp(&s.scene)).collect()
    };
    series.extend(rated.iter().map(|r| (r.name, order(r))));
    let all = || series.iter().flat_map(|s| &s.1).copied().filter(|v| v.is_finite());
    let (low, high) = all().fold((f64::INFINITY, 1.0f64), |(l, h), v| (l.min(v), h.max(v)));

    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (900, 480)).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let letters = ("sans-serif", 14);
        let names: Vec<String> = of_model.iter().map(|s| s.scene.clone()).collect();
        let mut chart = ChartBuilder::on(&root)
            .margin(12)
            .margin_right(150)
            .x_label_area_size(40)
            .y_label_area_size(64)
            .build_cartesian_2d(-0.5..names.len() as f64 - 0.5, (low / 1.3..high * 1.3).log_scale())
            .map_err(failed)?;
        let name = |x: &f64| {
            let near = (x - x.round()).abs() < 1e-6 && *x >= 0.0;
            names.get(x.round().max(0.0) as usize).filter(|_| near).cloned().unwrap_or_default()
        };
        chart
            .configure_mesh()
            .y_desc("mean samples per pixel at the stop")
            .x_labels(2 * names.len() + 1)
            .x_label_formatter(&name)
            .y_label_formatter(&|v| format!("{v:.0}"))
            .label_style(letters)
            .axis_desc_style(letters)
            .light_line_style(WHITE)
            .disable_x_mesh()
            .draw()
            .map_err(failed)?;
        for (i, (name, values)) in series.iter().enumerate() {
            // People in black, all others in colours.
            let colour = if i == 0 { BLACK } else { COLOURS[(i - 1) % COLOURS.len()] };
            let offset = (i as f64 - series.len() as f64 / 2.0) * 0.07;
            let points = values
                .iter()
                .enumerate()
                .filter(|(_, v)| v.is_finite())
                .map(|(x, &v)| (x as f64 + offset, v));
            let drawn = match i % 3 {
                0 => chart.draw_series(points.map(|at| Circle::new(at, 5, colour.filled()).into_dyn())),
                1 => {
                    chart.draw_series(points.map(|at| TriangleMarker::new(at, 6, colour.filled()).into_dyn()))
                }
                _ => chart.draw_series(points.map(|at| Cross::new(at, 5, colour.stroke_width(2)).into_dyn())),
            };
            drawn.map_err(failed)?;
            // The legend, outside: the library's own lies over the plot.
            let at = (LEGEND.0 + 8, LEGEND.1 + 24 * i as i32);
            match i % 3 {
                0 => root.draw(&Circle::new(at, 5, colour.filled())),
                1 => root.draw(&TriangleMarker::new(at, 6, colour.filled())),
                _ => root.draw(&Cross::new(at, 5, colour.stroke_width(2))),
            }
            .map_err(failed)?;
            let text = Text::new((*name).to_owned(), (at.0 + 16, at.1 - 7), letters);
            root.draw(&text).map_err(failed)?;
        }
        root.present().map_err(failed)?;
    }
    write_atomic(path, |to| std::io::Write::write_all(to, text.as_bytes()))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(scene: &str, human_spp: f64) -> JudgedZone {
        let stack = noisefloor_learn::ZoneImages::Batches(PathBuf::new());
        JudgedZone {
            scene: scene.into(),
            renderer: String::new(),
            zone: 0,
            x: 0,
            y: 0,
            width: 16,
            height: 16,
            human_spp,
            censored: false,
            first_spp: 1,
            last_spp: 10_000,
            stack,
        }
    }

    /// Three constants stop every zone at 100, 200 and 400 samples; people want 200 in one scene and 283 in the other.
    #[test]
    fn a_constant_is_fitted_on_the_other_scenes() {
        let rival = &noisefloor_rivals::RIVALS[1];
        let zones = [zone("A", 200.0), zone("B", 200.0 * 2f64.sqrt())];
        let mut stops = vec![vec![400.0; 2], vec![200.0; 2]];
        stops.resize(constants(rival).len(), vec![100.0; 2]);
        let rated = Rated::of(rival, &zones, &stops);
        // Each gets what the other one wants.
        let near = |a: f64, b: f64| (a / b).ln().abs() < 0.02;
        assert!(near(rated.predictions[0].predicted_spp, 200.0 * 2f64.sqrt()), "{:?}", rated.predictions);
        assert!(near(rated.predictions[1].predicted_spp, 200.0), "{:?}", rated.predictions);
        // Over both: 2^(1/4)·200, three quarters of the way from the first to the second constant.
        let constants = constants(rival);
        let place = (rated.constant / constants[0]).ln() / (constants[1] / constants[0]).ln();
        assert!((place - 0.75).abs() < 0.03, "{place}");
        assert!(near(rated.scores.error_factor, 2f64.sqrt()));
    }

    /// The variance of a batch is that of its samples, whatever pictures it was made from.
    #[test]
    fn batches_have_the_noise_of_their_samples() {
        let mut state = 5u64;
        let mut noise = move || {
            let mut sum = -6.0;
            for _ in 0..12 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum += (state >> 40) as f32 / (1u64 << 24) as f32;
            }
            sum
        };
        // Nested running means in linear light after 10, 20, 40 and 1000 samples with σ = 0.4.
        let (mut sum, mut count) = (vec![0.0f32; 4096], 0u64);
        let mut levels = Vec::new();
        for last in [10u64, 20, 40, 1000] {
            let new = (last - count) as f32;
            sum.iter_mut().for_each(|s| *s += 0.5 * new + 0.4 * new.sqrt() * noise());
            count = last;
            let pixels = sum.iter().map(|s| [s / count as f32; 3]).collect();
            let inner = noisefloor_learn::Inner { x: 0, y: 0, width: 64, height: 64 };
            levels.push(JudgedImage {
                scene: "s".into(),
                zone: 0,
                first: 0,
                last,
                encoding: Encoding::Linear,
                rounding: 0.0,
                patch: noisefloor_learn::Patch { width: 64, height: 64, pixels, inner },
            });
        }
        let noise = Noise::of(&levels).unwrap();
        assert_eq!(noise.realisations.len(), 3, "10, 10 and 20 samples; 960 are not noise but truth");
        for turn in 0..4 {
            let batch = noise.batch(turn, 25);
            let variance =
                batch.iter().zip(&noise.converged).map(|(b, c)| (b[0] - c[0]).powi(2)).sum::<f32>() / 4096.0;
            // σ²/25 = 0.0064; a variance over 4096 pixels errs by √(2/4096) = 2.2 %: 9 % is 4 σ.
            assert!((variance / 0.0064 - 1.0).abs() < 0.09, "turn {turn}: {variance}");
        }
        let (third, fourth) = (noise.batch(0, 25), noise.batch(3, 25));
        let opposite = third
            .iter()
            .zip(&fourth)
            .zip(&noise.converged)
            .all(|((a, b), c)| (a[0] + b[0] - 2.0 * c[0]).abs() < 1e-5);
        assert!(opposite, "the first realisation again, with the other sign");
    }
}
