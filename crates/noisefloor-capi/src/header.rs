//! The header is what cbindgen makes of these sources.
//!
//! After a change of the interface, write it anew and look at the difference:
//! `NOISEFLOOR_WRITE_HEADER=1 cargo test --workspace --all-features --lib header`.

use std::path::Path;

/// A number that a comment calls a default is that of [`NfParams::default`](crate::params::NfParams).
#[test]
fn defaults_are_as_the_header_says() {
    let header =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("include/noisefloor.h")).unwrap();
    let fields = header.split("} NfParams;").next().unwrap().rsplit('{').next().unwrap();
    let said: Vec<(&str, f64)> = fields
        .split(';')
        .filter_map(|field| {
            let number = field.split("Default: ").nth(1)?.split_whitespace().next()?.trim_end_matches('.');
            Some((field.split_whitespace().last()?, number.parse().ok()?))
        })
        .collect();
    let p = crate::params::NfParams::default();
    let are = [
        ("tile", f64::from(p.tile)),
        ("step", p.step as f64),
        ("min_spp", p.min_spp as f64),
        ("max_spp", p.max_spp as f64),
        ("consecutive", f64::from(p.consecutive)),
        ("key", f64::from(p.key)),
        ("exposure", f64::from(p.exposure)),
        ("audience_slope", p.audience_slope),
        ("audience_offset", p.audience_offset),
    ];
    assert_eq!(said.len(), are.len(), "{said:?}");
    for (said, are) in said.into_iter().zip(are) {
        assert!(said.0 == are.0 && (said.1 - are.1).abs() < 1e-6, "{said:?} {are:?}");
    }
}

#[test]
fn the_header_is_that_of_the_sources() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(package.join("cbindgen.toml")).unwrap();
    // In the order in which one reads a header
    let sources = [
        "status",
        "oracle",
        "params",
        "eyes",
        "session",
        "denoise",
        "tone",
        "push",
        "background",
        "results",
        "files",
        "check",
        "tune",
    ];
    let builder = cbindgen::Builder::new().with_config(config);
    let builder = sources.iter().fold(builder, |b, name| b.with_src(package.join(format!("src/{name}.rs"))));
    let mut made = Vec::new();
    builder.generate().unwrap().write(&mut made);
    let made = String::from_utf8(made).unwrap();

    let path = package.join("include/noisefloor.h");
    if std::env::var_os("NOISEFLOOR_WRITE_HEADER").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap();
    assert!(kept == made, "include/noisefloor.h is not that of the sources; see header.rs");
}

/// The defaults that the header names are those of Rust, which change.
#[test]
fn the_header_names_the_defaults() {
    use crate::params::NfParams;
    let header =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("include/noisefloor.h")).unwrap();
    let NfParams { tile, step, min_spp, max_spp, consecutive, key, exposure, .. } = NfParams::default();
    for (field, value) in [
        ("uint32_t tile;", tile.to_string()),
        ("uint64_t step;", step.to_string()),
        ("uint64_t min_spp;", min_spp.to_string()),
        ("uint64_t max_spp;", max_spp.to_string()),
        ("uint32_t consecutive;", consecutive.to_string()),
        ("float key;", key.to_string()),
        ("float exposure;", exposure.to_string()),
    ] {
        let (before, _) = header.split_once(field).unwrap();
        let said = before.lines().rev().find(|line| line.contains("//")).unwrap();
        assert!(said.ends_with(&format!("Default: {value}.")), "{field} {value}, but: {said}");
    }
}
