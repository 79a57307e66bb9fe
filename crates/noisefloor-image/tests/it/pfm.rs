use noisefloor_image::{Picture, PictureFault, read_pfm, read_picture};
use std::path::PathBuf;
use tempfile::TempDir;

fn file(bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.pfm");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn bytes(header: &str, values: &[f32], big: bool) -> Vec<u8> {
    let values = values.iter().flat_map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() });
    header.bytes().chain(values).collect()
}

/// Bottom row first, either byte order, and the size of the scale does not count.
#[test]
fn rows_are_turned_over_and_bytes_put_in_order() {
    let values: Vec<f32> = (0..12).map(|v| v as f32 - 3.5).collect();
    for (header, big) in
        [("PF\n2 2\n-1.0\n", false), ("PF\n2  2\n1\n", true), ("PF\r\n2 2 \r\n-7e3\r\n", false)]
    {
        let (_folder, path) = file(&bytes(header, &values, big));
        let image = read_pfm(&path).unwrap();
        assert_eq!((image.width, image.height), (2, 2));
        let rows = [[2.5, 3.5, 4.5], [5.5, 6.5, 7.5], [-3.5, -2.5, -1.5], [-0.5, 0.5, 1.5]];
        assert_eq!(image.pixels, rows, "{header:?}");
        assert_eq!(read_picture(&path).unwrap(), Picture::Linear(image));
    }
}

#[test]
fn one_channel_is_grey_and_nan_is_kept() {
    let (_folder, path) = file(&bytes("Pf\n3 1\n-1\n", &[1.0, f32::NAN, f32::INFINITY], false));
    let image = read_pfm(path).unwrap();
    assert_eq!((image.pixels[0], image.pixels[2]), ([1.0; 3], [f32::INFINITY; 3]));
    assert!(image.pixels[1].iter().all(|c| c.is_nan()));
}

/// Sizes are checked against limits and the file's length before pixels are allocated.
#[test]
fn hostile_headers_are_errors() {
    for header in [
        "PF\n2 2",
        "PF\n2 2\n-1.0",
        "PF\n2\n-1.0\n",
        "PF\n2 2 2\n-1.0\n",
        "PF\n-2 2\n-1.0\n",
        "PF\n2 2\n0\n",
        "PF\n2 2\nnan\n",
        "PF\n2 2\nx\n",
        "PF\n0 2\n-1\n",
        "PF\n99999999999999999999 2\n-1\n",
        "PF\n4000000000 4000000000\n-1\n",
        "PF\n16384 16384\n-1\n",
        "PF\n2 3\n-1\n",
    ] {
        let (_folder, path) = file(&bytes(header, &[0.0; 12], false));
        let error = read_pfm(&path).unwrap_err();
        assert!(
            matches!(error.fault, PictureFault::Broken { .. } | PictureFault::Size(_)),
            "{header:?}: {error}"
        );
    }
    let endless = [b"PF\n".as_slice(), &[b'1'; 100_000]].concat();
    let (_folder, path) = file(&endless);
    assert!(read_pfm(&path).is_err());
    let (_folder, path) = file(b"P6\n1 1\n255\nabc");
    assert!(matches!(read_pfm(&path).unwrap_err().fault, PictureFault::Foreign { .. }));

    // Every cut is an error
    let whole = bytes("PF\n2 2\n-1.0\n", &[0.5; 12], false);
    for cut in 0..whole.len() {
        let (_folder, path) = file(&whole[..cut]);
        assert!(read_pfm(path).is_err(), "cut at {cut}");
    }
}
