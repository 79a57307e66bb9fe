use noisefloor_image::{
    Plane, RenderLayers, WriteFault, read_exr, read_png, write_atomic, write_exr, write_png,
};
use std::io::{self, Write};

fn entries(folder: &std::path::Path) -> usize {
    std::fs::read_dir(folder).unwrap().count()
}

#[test]
fn exr_there_and_back_with_layers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let rgb: Vec<[f32; 3]> = (0..35 * 20).map(|i| [i as f32 * 0.1, -1.0, 1e9]).collect();
    let spp: Vec<u32> = (0..35 * 20).map(|i| 4_000_000_000 - i).collect();
    let probability = vec![0.9; 35 * 20];
    let noise: Vec<f32> = (0..35 * 20).map(|i| i as f32).collect();
    let layers = RenderLayers {
        spp: Some(spp[..].into()),
        probability: Some(probability[..].into()),
        stopped: Some(Plane::Computed(&|_| true)),
        visible_noise: Some(Plane::Computed(&|pixel| noise[pixel])),
        ..RenderLayers::rgb(35, 20, &rgb)
    };
    write_exr(&path, &layers).unwrap();
    assert_eq!(read_exr(&path).unwrap().pixels, rgb);
    assert_eq!(entries(folder.path()), 1);

    // The layers, as another program sees them
    let image = exr::prelude::read_all_flat_layers_from_file(&path).unwrap();
    let channels = &image.layer_data[0].channel_data.list;
    let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["B", "G", "R", "oracle.P", "oracle.spp", "oracle.stop", "oracle.visible_noise"]);
    assert_eq!(channels[3].sample_data, exr::prelude::FlatSamples::F32(probability));
    assert_eq!(channels[4].sample_data, exr::prelude::FlatSamples::U32(spp));
    assert_eq!(channels[5].sample_data, exr::prelude::FlatSamples::F32(vec![1.0; 35 * 20]));
    assert_eq!(channels[6].sample_data, exr::prelude::FlatSamples::F32(noise));
}

#[test]
fn png_there_and_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let rgb: Vec<u8> = (0..=255).flat_map(|v| [v, 255 - v, v / 2]).collect();
    write_png(&path, 16, 16, &rgb).unwrap();
    let back = read_png(&path).unwrap();
    let bytes: Vec<u8> = back.pixels.iter().flatten().map(|v| (v * 255.0).round() as u8).collect();
    assert_eq!(bytes, rgb);
}

/// A map of the widest image that can be judged has a margin around it.
#[test]
fn a_png_may_be_wider_than_an_image() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stops.png");
    let width = noisefloor::tile::MAX_EDGE + 104;
    write_png(&path, width, 2, &vec![7; width * 2 * 3]).unwrap();
    let decoder = image::ImageReader::open(&path).unwrap();
    assert_eq!(decoder.into_dimensions().unwrap(), (width as u32, 2));
}

#[test]
fn wrong_lengths_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let rgb = [[0.0; 3]; 4];
    assert!(matches!(
        write_exr(&path, &RenderLayers::rgb(2, 3, &rgb)).unwrap_err().fault,
        WriteFault::Size { got: 4, want: 6, .. }
    ));
    assert!(matches!(
        write_exr(&path, &RenderLayers::rgb(0, 3, &rgb)).unwrap_err().fault,
        WriteFault::Image(_)
    ));
    let layers = RenderLayers { spp: Some([1][..].into()), ..RenderLayers::rgb(2, 2, &rgb) };
    assert!(matches!(write_exr(&path, &layers).unwrap_err().fault, WriteFault::Size { what: "spp", .. }));
    assert!(matches!(write_png(&path, 2, 2, &[0; 4]).unwrap_err().fault, WriteFault::Size { want: 12, .. }));
    assert!(matches!(write_png(&path, 0, 2, &[]).unwrap_err().fault, WriteFault::Png { .. }));
    assert!(matches!(write_png(&path, 1 << 31, 1, &[]).unwrap_err().fault, WriteFault::Png { .. }));
    assert_eq!(entries(folder.path()), 0);
}

#[test]
fn a_failure_leaves_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.json");
    std::fs::write(&path, "old").unwrap();
    let error = write_atomic(&path, |writer| {
        writer.write_all(&[b'x'; 100_000])?;
        Err(io::Error::other("half of it"))
    });
    let said = error.unwrap_err().to_string();
    assert!(said.contains("report.json") && said.contains("half of it"), "{said}");
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    assert_eq!(entries(folder.path()), 1);

    write_atomic(&path, |writer| writer.write_all(b"new")).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
}

#[test]
fn folders_that_cannot_be_written_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("absent").join("a.csv");
    let error = write_atomic(&path, |writer| writer.write_all(b"x")).unwrap_err();
    assert!(
        matches!(&error.fault, WriteFault::Folder { folder, .. } if folder.ends_with("absent")),
        "{error}"
    );

    // A folder in the place of the file
    let error = write_atomic(folder.path(), |writer| writer.write_all(b"x")).unwrap_err();
    assert!(matches!(error.fault, WriteFault::NotAFile), "{error}");
}

#[cfg(unix)]
#[test]
fn links_and_devices_survive() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let (file, link) = (folder.path().join("file"), folder.path().join("link"));
    write_atomic(&file, |writer| writer.write_all(b"old")).unwrap();
    std::os::unix::fs::symlink(&file, &link).unwrap();
    write_atomic(&link, |writer| writer.write_all(b"new")).unwrap();
    assert_eq!(std::fs::read(&file).unwrap(), b"new");
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());

    // Readable as any new file, not by its owner alone
    let plain = folder.path().join("plain");
    std::fs::write(&plain, b"").unwrap();
    let mode = |path| std::fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&file), mode(&plain));

    let device = std::path::Path::new("/dev/null");
    assert!(matches!(write_atomic(device, |w| w.write_all(b"x")).unwrap_err().fault, WriteFault::NotAFile));
}
