use crate::util::{encoding, f32s, flat_exr};
use exr::meta::attribute::AttributeValue;
use exr::prelude::*;
use noisefloor::stills::SampleOrigin;
use noisefloor_image::{
    PictureFault, RenderLayers, SampleFacts, read_facts, read_still, write_exr, write_png,
};
use std::path::Path;

fn write(path: &Path, facts: &SampleFacts) {
    let layers = RenderLayers { facts: Some(facts), ..RenderLayers::rgb(2, 2, &[[0.5; 3]; 4]) };
    write_exr(path, &layers).unwrap();
}

#[test]
fn what_is_written_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let origin = |source: &str, seed, repeats| {
        SampleOrigin::new(source, if repeats { "0123" } else { "" }, seed, repeats)
    };
    for facts in [
        SampleFacts { samples: Some((400, 400)), origin: Some(origin("hall by ptwne", u64::MAX, true)) },
        SampleFacts { samples: Some((100, 900)), origin: Some(origin("grün", 0, false)) },
        // More than an attribute of 32 bits holds
        SampleFacts { samples: Some((1 << 40, 1 << 40)), origin: None },
        SampleFacts::default(),
    ] {
        write(&path, &facts);
        assert_eq!(read_facts(&path).unwrap(), facts);
        let bytes = std::fs::read(&path).unwrap();
        for _ in 0..8 {
            write(&path, &facts);
            assert!(std::fs::read(&path).unwrap() == bytes, "the same facts, another file");
        }
    }
    // What Latin-1 lacks is escaped, the same way every time
    write(&path, &SampleFacts { samples: None, origin: Some(origin("灰色", 0, false)) });
    let escaped = read_facts(&path).unwrap().origin;
    assert_eq!(escaped, Some(origin("\\u{7070}\\u{8272}", 0, false)));
    flat_exr(&path, (2, 2), 0.5);
    assert_eq!(read_facts(&path).unwrap(), SampleFacts::default());
    let png = folder.path().join("a.png");
    write_png(&png, 2, 2, &[0; 12]).unwrap();
    assert_eq!(read_facts(&png).unwrap(), SampleFacts::default());
}

/// pbrt's attribute, in a file of another program.
#[test]
fn samples_of_other_programs_are_read_and_nonsense_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pbrt.exr");
    let text = |value: &str| AttributeValue::Text(Text::from(value));
    let read = |name: &str, value: AttributeValue| {
        let other = [(Text::from(name), value)].into_iter().collect();
        let attributes = LayerAttributes { other, ..LayerAttributes::default() };
        let channels = ["B", "G", "R"].map(|name| AnyChannel::new(name, f32s(&[0.5; 4])));
        let channels = AnyChannels::sort(channels.into_iter().collect());
        let layer = Layer::new((2, 2), attributes, encoding(Compression::Uncompressed), channels);
        Image::from_layer(layer).write().to_file(&path).unwrap();
        read_facts(&path).unwrap()
    };
    assert_eq!(read("samplesPerPixel", AttributeValue::I32(64)).spp(), Some(64));
    for nonsense in [AttributeValue::I32(0), AttributeValue::I32(-4), AttributeValue::F32(3.5), text("many")]
    {
        assert_eq!(read("samplesPerPixel", nonsense), SampleFacts::default());
    }
    for nonsense in ["seed=7", "fewest=7", "fewest=9\nmost=7", "seed=x\nsource=a", "source=a", "=", ""] {
        assert_eq!(read("noisefloor.samples", text(nonsense)), SampleFacts::default(), "{nonsense}");
    }
    let long = format!("seed=7\nsource={}", "a".repeat(5000));
    assert_eq!(read("noisefloor.samples", text(&long)), SampleFacts::default());
}

#[test]
fn a_comparison_takes_what_the_file_says_or_what_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let origin = Some(SampleOrigin::new("hall", "", 1, true));
    write(&path, &SampleFacts { samples: Some((64, 64)), origin: origin.clone() });
    let still = read_still(&path, None).unwrap();
    assert_eq!((still.spp, still.origin), (64.0, origin));
    assert_eq!(read_still(&path, Some(65.0)).unwrap().spp, 65.0);
    write(&path, &SampleFacts { samples: Some((64, 128)), origin: None });
    let uneven = read_still(&path, None);
    let uneven = uneven.unwrap_err().fault;
    assert!(matches!(uneven, PictureFault::UnevenSamples { fewest: 64, most: 128 }), "{uneven:?}");
    flat_exr(&path, (2, 2), 0.5);
    let silent = read_still(&path, None).unwrap_err();
    assert!(matches!(silent.fault, PictureFault::NoSamples) && silent.to_string().contains("a.exr"));
}

/// A header cut anywhere is an error, never a panic.
#[test]
fn broken_headers_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    write(&path, &SampleFacts { samples: Some((64, 64)), origin: None });
    let whole = std::fs::read(&path).unwrap();
    let header = whole.len().min(300);
    for cut in 0..header {
        std::fs::write(&path, &whole[..cut]).unwrap();
        let _ = read_facts(&path);
        let mut flipped = whole.clone();
        flipped[cut] ^= 0x41;
        std::fs::write(&path, &flipped).unwrap();
        let _ = read_facts(&path);
    }
    std::fs::write(&path, &whole[..20]).unwrap();
    assert!(matches!(read_facts(&path).unwrap_err().fault, PictureFault::Broken { .. }));
}
