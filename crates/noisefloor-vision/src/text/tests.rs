//! What reads back, and what is refused.

use super::*;
use crate::viewing::Primaries;
use proptest::prelude::*;

#[test]
fn every_preset_reads_back() {
    for preset in PRESETS {
        let viewing: Viewing = preset.name.parse().unwrap();
        assert_eq!(viewing, preset.viewing());
        assert_eq!(viewing.to_string().parse(), Ok(viewing));
    }
}

#[test]
fn numbers_change_a_preset() {
    let numbers: Viewing = "ppd=60,peak=300,black=0.3,ambient=100".parse().unwrap();
    assert_eq!(
        (numbers.pixels_per_degree(), numbers.params().peak, numbers.params().ambient),
        (60.0, 300.0, 100.0)
    );
    let far: Viewing = "desk, distance=1.2".parse().unwrap();
    let desk = Viewing::default();
    assert!((far.pixels_per_degree() / desk.pixels_per_degree() - 2.0).abs() < 1e-4);
    let bright: Viewing = "desk,peak=400".parse().unwrap();
    assert!((bright.params().black - 0.4).abs() < 1e-12);
    let by_contrast: Viewing = "tv,contrast=100".parse().unwrap();
    assert!((by_contrast.params().black - 3.5).abs() < 1e-12);
}

#[test]
fn primaries_and_whites_are_read() {
    let primaries = |text: &str| text.parse::<Viewing>().unwrap().params().primaries;
    let measured = |white| Primaries::Measured(Chromaticities { white, ..Chromaticities::REC709 });
    assert_eq!(primaries("desk,primaries=p3"), Primaries::Measured(Chromaticities::DISPLAY_P3));
    for d50 in ["desk,white=d50", "white=d50,primaries=rec709", "desk,white=0.3457:0.3585"] {
        assert_eq!(primaries(d50), measured(Chromaticities::D50), "{d50}");
    }
    assert_eq!(primaries("white=8000K"), measured(Chromaticities::daylight(8000.0).unwrap()));
    assert_eq!(primaries("white=0.333:0.333"), measured([0.333, 0.333]));
    // Presets keep their primaries, and their white
    let hdr = Chromaticities { white: Chromaticities::D93, ..Chromaticities::REC2020 };
    assert_eq!(primaries("standard_hdr_pq,white=d93"), Primaries::Measured(hdr));
    // Whatever says Rec.709 with D65 is the same as saying nothing
    for same in ["desk,white=d65", "desk,primaries=0.64:0.33:0.3:0.6:0.15:0.06", "white=0.3127:0.3290"] {
        assert_eq!(same.parse::<Viewing>().unwrap(), Viewing::default(), "{same}");
    }
    let by_hand = ViewingParams {
        primaries: Primaries::Measured(Chromaticities::REC709),
        ..Viewing::default().params()
    };
    assert_eq!(by_hand.check(), Ok(Viewing::default()));
}

#[test]
fn colours_are_written_by_name() {
    for (typed, written) in [
        ("primaries=p3,white=d65", ",primaries=p3"),
        ("primaries=rec2020,white=0.3457:0.3585", ",primaries=rec2020,white=d50"),
        ("white=0.33:0.33", ",white=0.33:0.33"),
        ("primaries=0.65:0.33:0.3:0.6:0.15:0.06", ",primaries=0.65:0.33:0.3:0.6:0.15:0.06"),
    ] {
        let shown = typed.parse::<Viewing>().unwrap().to_string();
        assert_eq!(shown.split_once(",reflectivity=0.005").unwrap().1, written);
    }
}

#[test]
fn mistakes_are_named() {
    let refusal = |text: &str| text.parse::<Viewing>().unwrap_err().to_string();
    assert!(refusal("desc").contains("\"desc\""));
    assert!(refusal("").contains("no viewing conditions"));
    assert!(refusal("desk,ppi=3").contains("\"ppi\""));
    assert!(refusal("desk,tv").contains("\"tv\""));
    assert!(refusal("ppd=60,ppd=61").contains("twice"));
    assert!(refusal("ppd=60,distance=1").contains("either ppd or"));
    assert!(refusal("black=1,contrast=100").contains("either black or"));
    assert!(refusal("peak=bright").contains("a number"));
    assert!(refusal("resolution=0x10").contains("1920x1080"));
    assert!(refusal("eotf=gammaX").contains("gamma2.2"));
    assert!(refusal("ppd=nan").contains("1…2000"));
    assert!(refusal("distance=0").contains("distance"));
    assert!(refusal("contrast=0").contains("black"));
    assert!(refusal("standard_hdr_hlg,ambient=0").contains("0.01 lux"));
    for primaries in ["p4", "0.64:0.33", "0.64:0.33:0.3:0.6:0.15:0.06:0.1", "::::::"] {
        assert!(refusal(&format!("primaries={primaries}")).contains("rec2020, p3, or"));
    }
    for white in ["d51", "3000K", "K", "nanK", "0.3", "0.3:0.3:0.4", "0.3,0.3"] {
        assert!(refusal(&format!("white={white}")).contains("d50, d55"), "{white}");
    }
    assert!(refusal("white=d50,white=d65").contains("twice"));
    assert!(refusal("white=nan:0.3").contains("0.0001…1"));
    assert!(refusal("white=0.6:0.6").contains("inside the triangle"));
    assert!(refusal("primaries=0.3:0.6:0.64:0.33:0.15:0.06").contains("swapped"));
}

/// Those of a standard or nearby, with any white near the middle.
fn primaries() -> impl Strategy<Value = Primaries> {
    let gamut = prop_oneof![
        Just(Chromaticities::REC709),
        Just(Chromaticities::REC2020),
        Just(Chromaticities::DISPLAY_P3),
        [0.6f64..0.7, 0.2f64..0.3, 0.1f64..0.2].prop_map(|[x, green, blue]| Chromaticities {
            red: [x, 1.0 - x],
            green: [green, 0.65],
            blue: [blue, 0.05],
            white: Chromaticities::D65,
        }),
    ];
    let white = prop_oneof![
        Just(Chromaticities::D65),
        Just(Chromaticities::D93),
        (4000.0f64..25_000.0).prop_map(|kelvin| Chromaticities::daylight(kelvin).expect("in range")),
        [0.3f64..0.35, 0.3f64..0.35],
    ];
    (gamut, white).prop_map(|(gamut, white)| Chromaticities { white, ..gamut }.into())
}

proptest! {
    #[test]
    fn all_conditions_read_back(
        (ppd, peak, black) in (1.0f64..2000.0, 1.0f64..20_000.0, 0.0f64..0.99),
        (ambient, share) in (0.01f64..1e5, 0.0f64..1.0),
        eotf in prop_oneof![
            Just(Eotf::Srgb), Just(Eotf::Pq), Just(Eotf::Hlg), Just(Eotf::Linear),
            (1.0f64..4.0).prop_map(Eotf::Gamma),
        ],
        primaries in primaries(),
        frames_per_second in proptest::option::of(10.0f64..1000.0),
    ) {
        let params = ViewingParams {
            pixels_per_degree: ppd, peak, black: black * peak, ambient, reflectivity: share, eotf,
            primaries, frames_per_second,
        };
        let viewing = params.check().unwrap();
        prop_assert_eq!(viewing.to_string().parse(), Ok(viewing));
    }

    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,40}") {
        let _ = text.parse::<Viewing>();
    }
}

#[test]
fn serde_refuses_what_check_refuses() {
    let hdr: Viewing =
        "ppd=60,peak=300,black=0.5,ambient=100,eotf=gamma2.25,primaries=rec2020".parse().unwrap();
    let json = serde_json::to_string(&hdr).unwrap();
    assert_eq!(serde_json::from_str::<Viewing>(&json).unwrap(), hdr);
    let film = hdr.with_frames_per_second(Some(23.976)).unwrap();
    assert!(film.to_string().ends_with(",fps=23.976"), "{film}");
    let told = serde_json::to_string(&film).unwrap();
    assert_eq!(serde_json::from_str::<Viewing>(&told).unwrap(), film);
    // A still is written as before there were films
    assert_eq!(told, format!("{},\"frames_per_second\":23.976}}", json.strip_suffix('}').unwrap()));
    let proof: Viewing = "desk,primaries=p3,white=d50".parse().unwrap();
    let mut json = serde_json::to_value(proof).unwrap();
    assert_eq!(serde_json::from_value::<Viewing>(json.clone()).unwrap(), proof);
    json["primaries"]["measured"]["white"] = serde_json::json!([0.9, 0.1]);
    assert!(serde_json::from_value::<Viewing>(json).unwrap_err().to_string().contains("triangle"));
    let mut json = serde_json::to_value(Viewing::default()).unwrap();
    json["peak"] = serde_json::json!(-1.0);
    assert!(serde_json::from_value::<Viewing>(json).unwrap_err().to_string().contains("peak"));
}
