use super::*;
use proptest::prelude::*;

fn tile(width: usize, height: usize) -> Tile {
    Tile { index: 3, x: 64, y: 32, width, height }
}

#[test]
fn shares_are_gradual_and_nobody_starves() {
    let tile = tile(128, 128);
    // One block needs everything
    let needs: Vec<f64> = (0..64).map(|block| if block == 27 { 1e6 } else { 0.0 }).collect();
    let shares = shares(&needs, tile, 16);
    let most = shares.iter().copied().fold(0.0, f32::max);
    assert_eq!(shares[27], most);
    assert!(shares.iter().all(|&share| share >= 0.25 * most * (1.0 - 1e-6)));
    // Neighbours in a row: ½ to ¼ of it
    let row: Vec<f32> = shares[24..32].iter().map(|share| share / most).collect();
    assert_eq!(row, [0.25, 0.25, 0.5, 1.0, 0.5, 0.25, 0.25, 0.25]);
    assert!((shares.iter().sum::<f32>() / 64.0 - 1.0).abs() < 1e-5);
}

#[test]
fn needs_that_say_nothing_give_equal_shares() {
    for nothing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(shares(&[nothing; 4], tile(32, 32), 16), [1.0; 4]);
    }
    assert_eq!(shares(&[2.5; 4], tile(32, 32), 16), [1.0; 4]);
    assert_eq!(shares(&[1e-9], tile(9, 5), 16), [1.0]);
}

#[test]
fn a_pixel_gets_what_its_block_is_asked_for() {
    let blocks: Vec<_> = (0..6).map(|n| BlockSamples { first: 10 * n, spp: n + 1 }).collect();
    let request = BlockRequest { tile: tile(40, 20), spp: 3, edge: 16, blocks };
    assert_eq!(
        [(0, 0), (15, 15), (16, 0), (39, 15), (39, 16)].map(|(x, y)| request.at(x, y).spp),
        [1, 1, 2, 3, 6]
    );
    assert_eq!(request.samples(), 256 + 2 * 256 + 3 * 128 + 4 * 64 + 5 * 64 + 6 * 32);
}

proptest! {
    #[test]
    fn as_many_samples_as_of_every_pixel(
        width in 1usize..129, height in 1usize..129, edge in prop::sample::select(vec![16usize, 32]),
        spp in 4u64..500, seed in 0u64..1000,
    ) {
        let tile = tile(width, height);
        let count = blocks_of(tile, edge).count();
        let needs: Vec<f64> =
            (0..count as u64).map(|block| noisefloor_testkit::Noise::keyed(&[seed, block]).uniform().powi(4)).collect();
        let shares = shares(&needs, tile, edge);
        let counts = spread(&shares, tile, edge, spp);
        let request = |counts: Vec<u64>| {
            let blocks = counts.into_iter().map(|spp| BlockSamples { first: 0, spp }).collect();
            BlockRequest { tile, spp, edge, blocks }
        };
        prop_assert!(counts.iter().all(|&n| n > 0));
        let (asked, even) = (request(counts).samples(), spp * tile.pixels() as u64);
        // Half a sample of each pixel of the last block, and where shares begin at ¼ nobody needs the floor
        // of one sample
        let half_a_block = (edge * edge) as u64 / 2 + 1;
        prop_assert!(asked.abs_diff(even) <= half_a_block, "{asked} instead of {even}");
        prop_assert_eq!(blocks_of(tile, edge).map(|block| block.pixels()).sum::<usize>(), tile.pixels());
    }
}
