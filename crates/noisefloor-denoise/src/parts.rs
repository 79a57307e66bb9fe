//! Parts of a picture: what a verdict has to look at while few tiles are open.

use noisefloor::Tile;

/// What the error of a tile is estimated from lies this near, in pixels: the average of its bias, the square around it, and most
/// of what the coarsest scale is made of.
const AROUND: usize = 64;

/// Disjoint rectangles that hold each of the tiles with [`AROUND`] pixels more to each side, as far as there are any; the whole
/// picture, alone, if that is hardly more.
pub(crate) fn parts_around(tiles: &[Tile], size: (usize, usize)) -> Vec<Tile> {
    let mut parts: Vec<Tile> = Vec::new();
    for &tile in tiles {
        let mut part = grown(tile, AROUND, size);
        while let Some(other) = parts.iter().position(|&other| overlap(part, other)) {
            part = around_both(part, parts.swap_remove(other));
        }
        parts.push(part);
    }
    if nearly_all(&parts, size) { vec![whole(size)] } else { parts }
}

/// Whether rectangles have three quarters of all pixels, or more: then the whole picture takes no longer.
pub(crate) fn nearly_all(parts: &[Tile], (width, height): (usize, usize)) -> bool {
    4 * parts.iter().map(|part| part.pixels()).sum::<usize>() >= 3 * width * height
}

/// All of a picture.
pub(crate) fn whole((width, height): (usize, usize)) -> Tile {
    Tile { index: 0, x: 0, y: 0, width, height }
}

/// A rectangle with so many pixels more to each side, within the picture.
pub(crate) fn grown(tile: Tile, by: usize, (width, height): (usize, usize)) -> Tile {
    let (x, y) = (tile.x.saturating_sub(by), tile.y.saturating_sub(by));
    let (right, bottom) = ((tile.x + tile.width + by).min(width), (tile.y + tile.height + by).min(height));
    Tile { index: tile.index, x, y, width: right - x, height: bottom - y }
}

/// A rectangle of a picture, as one of `part`, which holds it.
pub(crate) fn within(tile: Tile, part: Tile) -> Tile {
    Tile { x: tile.x - part.x, y: tile.y - part.y, ..tile }
}

/// Whether `part` holds all of `tile`.
pub(crate) fn holds(part: Tile, tile: Tile) -> bool {
    around_both(part, tile).pixels() == part.pixels()
}

fn overlap(a: Tile, b: Tile) -> bool {
    a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height
}

fn around_both(a: Tile, b: Tile) -> Tile {
    let (x, y) = (a.x.min(b.x), a.y.min(b.y));
    let (right, bottom) = ((a.x + a.width).max(b.x + b.width), (a.y + a.height).max(b.y + b.height));
    Tile { index: 0, x, y, width: right - x, height: bottom - y }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tile(x: usize, y: usize) -> Tile {
        Tile { index: 0, x, y, width: 32, height: 32 }
    }

    #[test]
    fn a_tile_alone_takes_what_is_near() {
        let [part] = parts_around(&[tile(320, 0)], (960, 540))[..] else { panic!("not one part") };
        assert_eq!((part.x, part.y, part.width, part.height), (256, 0, 160, 96));
        // Two that are far apart are looked at apart, two neighbours together
        assert_eq!(parts_around(&[tile(0, 0), tile(800, 400)], (960, 540)).len(), 2);
        assert_eq!(parts_around(&[tile(0, 0), tile(64, 32)], (960, 540)).len(), 1);
        // In a picture that is hardly larger, all of it is
        assert_eq!(parts_around(&[tile(64, 64)], (160, 160)), [whole((160, 160))]);
    }

    proptest! {
        #[test]
        fn parts_are_disjoint_and_hold_each_tile_with_what_is_near(
            places in prop::collection::vec((0_usize..60, 0_usize..34), 0..40),
        ) {
            let size = (60 * 32, 34 * 32);
            let tiles: Vec<Tile> = places.iter().map(|&(x, y)| tile(32 * x, 32 * y)).collect();
            let parts = parts_around(&tiles, size);
            for &open in &tiles {
                let near = grown(open, AROUND, size);
                prop_assert_eq!(parts.iter().filter(|&&part| holds(part, near)).count(), 1);
            }
            for (i, &a) in parts.iter().enumerate() {
                prop_assert!(holds(whole(size), a));
                prop_assert!(parts[i + 1..].iter().all(|&b| !overlap(a, b)));
            }
        }
    }
}
