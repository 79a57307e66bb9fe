//! placeholder
use crate::evidence::TilePlanes;
use crate::mask::NoiseMask;

pub(super) const NAMES: [&str; 2] = ["noise", "brightness"];

pub(super) fn describe(planes: &TilePlanes, mask: NoiseMask, out: &mut Vec<f32>) {
    let m = mask.apply(&planes.residual);
    out.push((m.mapv(|v| v * v).mean().unwrap_or(0.0).sqrt() + 1e-4).ln());
    out.push(planes.image.mean().unwrap_or(0.0));
}

pub(super) fn project(descriptor: &mut [f32], factor: f32) {
    descriptor[0] -= 0.5 * factor.ln();
}
