use std::process::Command;

/// Packages that a crate pulls in, by the cargo that runs this test, offline.
fn dependencies(package: &str, features: &[&str]) -> String {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| env!("CARGO").into());
    let output = Command::new(cargo)
        .args([
            "tree",
            "--offline",
            "--locked",
            "--package",
            package,
            "--edges",
            "normal",
            "--prefix",
            "none",
        ])
        .args(features)
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .output()
        .unwrap();
    let tree = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "cargo tree: {}", String::from_utf8_lossy(&output.stderr));
    assert!(tree.starts_with(&format!("{package} v")), "{tree}");
    tree
}

#[test]
fn judging_alone_needs_no_machinery_of_training() {
    for features in [&["--no-default-features"][..], &[]] {
        let tree = dependencies("noisefloor", features);
        assert!(!tree.contains("linfa") && !tree.contains("ndarray"), "{features:?}:\n{tree}");
    }
    // Training does; so the test can fail
    assert!(dependencies("noisefloor-learn", &[]).contains("linfa-svm"));
}
