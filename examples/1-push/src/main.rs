//! Push: a renderer keeps its own loop, hands its samples to a session tile by tile, and leaves tiles alone
//! that are done.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{Oracle, Params, Request, Rgb, Session, SessionError};

const WIDTH: usize = 384;
const HEIGHT: usize = 256;

fn main() -> Result<(), SessionError> {
    let params = Params::default().with_tile(64);
    let mut session = Session::new(WIDTH, HEIGHT, Oracle::bundled(), params)?;

    // The loop stays the renderer's. `requests` names the open tiles, and how many samples each deserves
    // next.
    while !session.is_done() {
        for request in session.requests() {
            session.push(request.tile.index, request.spp, &render(&request))?;
        }
        for stop in session.judge()? {
            println!("tile {:2}: {} at {} samples per pixel", stop.tile.index, stop.reason, stop.spp);
        }
        // What is certainly wrong with samples is an error above; what is likely wrong is said here.
        session.new_warnings().iter().for_each(|warning| println!("warning: {warning}"));
    }
    let most = session.stops().map(|stop| stop.spp).max().unwrap_or(0);
    let mean = session.film().total_samples() as f64 / (WIDTH * HEIGHT) as f64;
    println!("{mean:.0} samples per pixel on average, where the worst tile needed {most}");
    Ok(()) // The picture is `session.film().image()`: linear RGB, row-major.
}

/// The renderer: the mean of the new samples of each pixel, row-major over the tile.
fn render(Request { tile, first, spp: samples, .. }: &Request) -> Vec<Rgb> {
    let pixel = |i: usize| {
        let (x, y) = (tile.x + i % tile.width, tile.y + i / tile.width);
        let sample = |n: u64| radiance(x as f32, y as f32, ((y * WIDTH + x) as u64) << 32 | (first + n));
        let sum: f32 = (0..*samples).map(sample).sum();
        [sum / *samples as f32; 3]
    };
    (0..tile.pixels()).map(pixel).collect()
}

/// Sample `n` of a pixel: a floor in the light of a square lamp, and the shadow of a ball that hangs between
/// them.
fn radiance(x: f32, y: f32, n: u64) -> f32 {
    let [dx, dy, u, v] = [0, 1, 2, 3].map(|dimension| random(4 * n + dimension));
    let depth = 300.0 / (y + dy + 20.0); // the floor runs away towards the top of the picture
    let floor = [(x + dx - 192.0) / 200.0 * depth, depth];
    let to_lamp = [0.8 * u - 0.4 - floor[0], 4.0, 0.8 * v + 2.6 - floor[1]];
    let to_ball = [-floor[0], 2.0, 2.5 - floor[1]];
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (square, along) = (dot(to_lamp, to_lamp), dot(to_lamp, to_ball));
    let in_shadow = dot(to_ball, to_ball) - along * along / square < 0.25;
    if in_shadow { 0.05 } else { 0.05 + 64.0 / (square * square) }
}

/// A number in [0, 1) that depends on `n` alone (SplitMix64).
fn random(n: u64) -> f32 {
    let z = n.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_wrong_with_its_samples() {
        let params = Params::default().with_tile(64).with_max_spp(200);
        let mut session = Session::new(WIDTH, HEIGHT, Oracle::bundled(), params).unwrap();
        while !session.is_done() {
            for request in session.requests() {
                session.push(request.tile.index, request.spp, &render(&request)).unwrap();
            }
            session.judge().unwrap();
        }
        assert_eq!(session.warnings(), []);
    }
}
