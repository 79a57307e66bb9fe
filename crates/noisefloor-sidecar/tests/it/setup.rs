use crate::kit::FAKE;
use noisefloor_sidecar::{Renderer, SetupError, find, install, private_folder, probe};
use noisefloor_testkit::require_python;
use std::path::Path;

#[test]
fn a_probe_tells_the_version_or_why_not() {
    let Some(python) = require_python() else { return };
    assert_eq!(probe(&FAKE, &python).unwrap(), "1.0");
    let broken = Renderer { probe: "import no_such_renderer", ..FAKE };
    let said = probe(&broken, &python).unwrap_err().to_string();
    assert!(said.contains("ModuleNotFoundError"), "{said}");
    let silent = Renderer { probe: "pass", ..FAKE };
    assert!(matches!(probe(&silent, &python), Err(SetupError::Broken { .. })));
    assert!(probe(&FAKE, Path::new("/no/such/python")).is_err());
}

/// Other packages, another folder; other renderers, another folder.
#[test]
fn environments_are_named_by_what_is_in_them() {
    let folder = |renderer: &Renderer| private_folder(renderer).unwrap();
    assert_eq!(folder(&FAKE), folder(&FAKE));
    assert_ne!(folder(&FAKE), folder(&Renderer { requirements: "numpy==2.0", ..FAKE }));
    assert_ne!(folder(&FAKE), folder(&Renderer { name: "other", ..FAKE }));
}

#[test]
fn what_is_missing_is_said_with_its_cure() {
    let nowhere = Renderer { name: "nowhere", title: "Nowhere 2", ..FAKE };
    let said = find(&nowhere).unwrap_err().to_string();
    assert!(
        said.contains("noisefloor doctor --install nowhere") && said.contains("NOISEFLOOR_NOWHERE_PYTHON")
    );
    let old = Renderer { name: "old", pythons: &[2], ..FAKE };
    if require_python().is_some() {
        let error = install(&old, |_| ()).unwrap_err();
        assert!(matches!(&error, SetupError::NoPython { wanted, .. } if wanted == "3.2"), "{error}");
    }
}
