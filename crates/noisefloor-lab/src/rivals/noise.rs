//! The noise of a zone, told from its pictures.

use noisefloor::{Rgb, srgb_decode};
use noisefloor_learn::{Encoding, JudgedImage};

/// The mean of some of the samples may amplify the rounding of 8-bit pictures by no more than this.
const AMPLIFICATION: f64 = 8.0;

/// What the pictures of a zone say of its noise, in linear light.
pub(super) struct Noise {
    pub(super) converged: Vec<Rgb>,
    /// Differences from the converged picture, scaled to the variance of a single sample.
    realisations: Vec<Vec<Rgb>>,
}

impl Noise {
    /// From images by increasing samples.
    pub(super) fn of(levels: &[JudgedImage]) -> Option<Self> {
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
    pub(super) fn batch(&self, turn: usize, samples: u64) -> Vec<Rgb> {
        let count = self.realisations.len();
        let sign = if (turn / count).is_multiple_of(2) { 1.0 } else { -1.0 };
        mix(&self.converged, 1.0, &self.realisations[turn % count], sign / (samples as f64).sqrt())
    }
}

fn mix(a: &[Rgb], fa: f64, b: &[Rgb], fb: f64) -> Vec<Rgb> {
    let pixel =
        |(a, b): (&Rgb, &Rgb)| std::array::from_fn(|c| (f64::from(a[c]) * fa + f64::from(b[c]) * fb) as f32);
    a.iter().zip(b).map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
