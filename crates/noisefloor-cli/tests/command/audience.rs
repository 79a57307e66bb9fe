use crate::kit::{fail, said_json, succeed, text};
use tempfile::tempdir;

#[test]
fn a_line_is_fitted_and_can_be_pasted() {
    let folder = tempdir().unwrap();
    let file = folder.path().join("pairs.csv");
    // Students of computer art, in a table with a column more, and one answer that went wrong
    let mut table = "zone,audience,observers\n".to_owned();
    for (zone, t) in [300.0, 500.0, 700.0, 1100.0, 1900.0, 2300.0, 3100.0].into_iter().enumerate() {
        table += &format!("{zone},{:.2},{t}\n", 1.94 * t - 346.0);
    }
    std::fs::write(&file, table + "7,9000,350\n").unwrap();

    let said = succeed(&["audience", "fit", text(&file)]);
    assert!(said.contains("T' = 1.940 T - 346.0") && said.contains("8 pairs"), "{said}");
    assert!(said.contains("gather more") && said.contains("--audience 1.9400,-346.00"), "{said}");

    let report = said_json(&["audience", "fit", text(&file), "--json"]);
    assert!((report["line"]["slope"].as_f64().unwrap() - 1.94).abs() < 1e-6, "{report}");
    let argument = report["argument"].as_str().unwrap();
    let out = folder.path().join("out");
    let size = ["--size", "16x16", "--tile", "16", "--criterion", "spp:4", "--quiet"];
    succeed(&[&["render", "--audience", argument, "--out", text(&out)][..], &size].concat());
}

#[test]
fn bad_pairs_are_told_with_their_line() {
    let folder = tempdir().unwrap();
    let file = folder.path().join("pairs.csv");
    let refused = |table: &str, words: &[&str]| {
        std::fs::write(&file, table).unwrap();
        fail(&["audience", "fit", text(&file)], &[&["pairs.csv"], words].concat());
    };
    refused("observers,students\n1,2\n", &["line 1", "audience"]);
    refused("", &["line 1", "observers"]);
    refused("observers,audience\n1,2\n2,many\n", &["line 3", "audience", "many"]);
    refused("observers,audience\n1,2\n-2,3\n", &["line 3", "observers", "-2"]);
    refused("observers,audience\n1,NaN\n", &["line 2", "NaN"]);
    refused("observers,audience\n1,2\n2\n", &["line: 3"]);
    refused("observers,audience\n1,2\n2,3\n", &["3 to 2000 pairs", "there are 2"]);
    refused("observers,audience\n5,2\n5,3\n5,4\n", &["all thresholds", "5"]);
    refused("observers,audience\n1,3\n2,2\n3,1\n", &["falls"]);
    refused(&("observers,audience\n".to_owned() + &"1,2\n".repeat(2001)), &["line 2002", "more than 2000"]);
    fail(&["audience", "fit", text(&folder.path().join("none.csv"))], &["none.csv", "cannot be read"]);
    fail(&["audience", "fit"], &["FILE"]);
    fail(&["audience", "fit", text(folder.path())], &["cannot be read"]);
}
