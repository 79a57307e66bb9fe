//! What a build leaves out says what to type.

use std::process::Command;

/// What is said of words that no build, or not this one, can obey.
#[cfg(test)]
fn refused(args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_noisefloor")).args(args).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{args:?}: {output:?}");
    String::from_utf8(output.stderr).unwrap()
}

/// A command of the other binary, or one that has moved.
#[test]
fn commands_that_are_elsewhere_say_so() {
    for command in ["train", "evaluate", "audience", "compare", "reproduce", "study", "explore"] {
        let said = refused(&[command, "--corpus", "absent"]);
        let expected = format!("error: '{command}' is a command of noisefloor-lab: `cargo run --release ");
        assert!(
            said.starts_with(&expected) && said.ends_with("--features lab --bin noisefloor-lab -- …`\n"),
            "{said}"
        );
    }
    let merge = refused(&["merge", "a.nfs"]);
    assert!(merge.contains("`noisefloor farm merge SHARD… --out DIR`"), "{merge}");
    let typo = refused(&["rendr"]);
    assert!(typo.contains("unrecognized subcommand 'rendr'") && typo.contains("'render'"), "{typo}");
}

/// What a first build can do without.
#[test]
fn what_is_left_out_says_what_to_type() {
    for (args, feature, present) in [
        (&["render", "hall.gltf"][..], "formats", cfg!(feature = "formats")),
        (&["render", "--watch"], "watch", cfg!(feature = "watch")),
        (&["metrics", "a.exr", "b.exr", "--flip-map", "map.png"], "metrics", cfg!(feature = "metrics")),
    ] {
        if !present {
            let said = refused(args);
            assert!(said.contains(&format!("--features {feature} -- {}", args[0])), "{said}");
        }
    }
}
