//! What a verdict allocates. A program of its own, since counting takes an allocator of its own.

use allocation_counter::{AllocationInfo, measure};
use noisefloor::{Film, Oracle, StoppingCriterion, TileGrid, criterion::View, display::Display};

/// What the second verdict on all tiles of a picture allocates, on one thread.
fn of_a_second_verdict(edge: usize, tiles: usize) -> AllocationInfo {
    let mut film = Film::new(TileGrid::new(edge * tiles, edge, edge).expect("a valid grid"));
    let tiles: Vec<_> = film.grid().tiles().collect();
    for value in [0.2, 0.3] {
        for tile in &tiles {
            film.add(tile.index, 50, &vec![[value; 3]; tile.pixels()]).expect("it fits");
        }
    }
    let view = View::new(&film, &Display::SRGB);
    let mut oracle = Oracle::bundled();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut judge = || drop(oracle.judge(&view, &tiles).expect("verdicts"));
    one.install(|| {
        judge();
        measure(judge)
    })
}

#[test]
fn verdicts_allocate_numbers_and_no_pixels() {
    // A tile of 256×256 pixels has 256 KiB of luminance alone.
    let (small, large) = (of_a_second_verdict(64, 4), of_a_second_verdict(256, 4));
    println!("{small:?} {large:?}");
    // But for a buffer that grows once more in a larger tile
    assert!(large.count_total - small.count_total <= 1);
    // Sums over blocks of 4×4 pixels, of squares and of their squares, for windows across tiles: two numbers a block of
    // what is kept and of its copy, and eight for the means over windows of the tile by itself and of the picture. With
    // planes, a pixel would have eight bytes and more
    let a_pixel = (large.bytes_total - small.bytes_total) as f64 / (4 * (256 * 256 - 64 * 64)) as f64;
    println!("{a_pixel} bytes a pixel");
    assert!(a_pixel < 5.0, "{a_pixel} bytes a pixel");
    let more = of_a_second_verdict(64, 8);
    let a_tile = (more.bytes_total - small.bytes_total) / 4;
    println!("{a_tile} bytes a tile");
    // Of which two numbers for each block of the tile: 2 kB in tiles of 64 pixels, and eleven times that on the way; and some
    // eight numbers of the tile as a whole
    assert!(a_tile < 24_576 + 64, "{a_tile} bytes a tile");
}
