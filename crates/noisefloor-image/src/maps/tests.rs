use super::*;

#[test]
fn values_map_to_the_ends_of_the_scale() {
    let scale = ColourScale {
        title: "",
        low: 100.0,
        high: 10_000.0,
        log: true,
        colours: colorous::VIRIDIS,
        landmark: None,
    };
    assert_eq!((scale.place(100.0), scale.place(10_000.0), scale.place(5.0)), (0.0, 1.0, 0.0));
    assert!((scale.place(1000.0) - 0.5).abs() < 1e-9 && (scale.value_at(0.5) - 1000.0).abs() < 1e-6);
    let flat = ColourScale { low: 7.0, high: 7.0, log: false, ..scale };
    assert_eq!(flat.place(7.0), 0.5);
}

#[test]
fn colours_lie_over_their_tiles() {
    let grid = noisefloor::TileGrid::new(64, 32, 32).unwrap();
    let frame = [None, Some(([255, 0, 0], "red"))];
    let mark = |i: usize| {
        let (tile, value, label) = (grid.tile(i), i as f64, String::new());
        TileMark { tile, value, label, unfamiliar: i == 1, frame: frame[i] }
    };
    let scale = ColourScale {
        title: "t",
        low: 0.0,
        high: 1.0,
        log: false,
        colours: colorous::VIRIDIS,
        landmark: None,
    };
    let canvas = draw_tiles(&Canvas::new(64, 32, [0; 3]), &[mark(0), mark(1)], &scale);
    let at = |x: usize, y: usize| &canvas.bytes()[(y * canvas.width() + x) * 3..][..3];
    // Over black: 55 % of viridis' first and last colour.
    assert_eq!(at(16, 16), [68.0, 1.0, 84.0].map(|c: f32| (0.55 * c).round() as u8));
    assert_eq!(at(48, 16), [253.0, 231.0, 37.0].map(|c: f32| (0.55 * c).round() as u8));
    // The mark of the second tile, and its like in the legend.
    assert_eq!((at(34, 2), at(64 + 13, canvas.height() - 16)), (&PAPER[..], &PAPER[..]));
    assert_ne!(at(2, 2), PAPER);
    // Its frame, inside the borders and all around, and the line above in the legend
    for (x, y) in [(50, 1), (50, 2), (50, 31), (62, 16), (63, 16), (63, 31), (64 + 13, canvas.height() - 36)]
    {
        assert_eq!(at(x, y), [255, 0, 0], "{x} {y}");
    }
    // Which is named there
    let (mut named, line) = (Canvas::new(64 + LEGEND, canvas.height(), PAPER), canvas.height() - 16 - LINE);
    named.text("red", (64 + 27, line + 4), &FONT_7X13, INK, Alignment::Left);
    for (x, y) in (line..line + 10).flat_map(|y| (64 + 27..64 + 48).map(move |x| (x, y))) {
        assert_eq!(at(x, y), &named.bytes()[(y * named.width() + x) * 3..][..3], "{x} {y}");
    }
    assert!([(40, 0), (40, 3), (61, 16), (8, 1)].iter().all(|&(x, y)| at(x, y) != [255, 0, 0]));
}

#[test]
fn fields_lie_over_a_dark_picture() {
    let scale = ColourScale {
        title: "t",
        low: 1.0,
        high: 16.0,
        log: true,
        colours: INFERNO,
        landmark: Some((4.0, "here")),
    };
    let picture = Canvas::of_picture(4, &[[0.0; 3], [1.0; 3], [0.0; 3], [1.0; 3]]);
    let canvas = draw_field(&picture, &[0.0, 16.0, 100.0, f32::NAN], &scale);
    let at = |x: usize| &canvas.bytes()[x * 3..][..3];
    let over = |colour: [f32; 3], grey: f32| colour.map(|c| (0.7 * c + 0.3 * 255.0 * grey).round() as u8);
    // The first colour of the gradient, its last one twice, and none.
    let last = [252.0, 255.0, 164.0];
    assert_eq!(at(0), over([0.0, 0.0, 4.0], 0.0));
    assert_eq!((at(1), at(2), at(3)), (&over(last, 1.0)[..], &over(last, 0.0)[..], &over([0.0; 3], 1.0)[..]));
    // The landmark lies across the middle of the bar.
    let y = LEAST_HEIGHT - 16 - (LEAST_HEIGHT - 16 - 50) / 2;
    assert_eq!(&canvas.bytes()[(y * canvas.width() + 4 + 12) * 3..][..3], PAPER);
}
