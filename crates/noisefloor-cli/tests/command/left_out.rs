use crate::kit::{LAB, run, stderr};
use std::process::Command;

/// A command of the other binary, or one that has moved, says what to type.
#[test]
fn commands_that_are_elsewhere_say_so() {
    let noisefloor = env!("CARGO_BIN_EXE_noisefloor");
    let said = |program: &str, args: &[&str]| {
        let output = Command::new(program).args(args).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        stderr(&output)
    };
    for command in LAB {
        let said = said(noisefloor, &[command, "--corpus", "absent"]);
        let expected = format!("error: '{command}' is a command of noisefloor-lab: `cargo run --release ");
        assert!(
            said.starts_with(&expected) && said.ends_with("--features lab --bin noisefloor-lab -- …`\n"),
            "{said}"
        );
    }
    let merge = said(noisefloor, &["merge", "a.nfs"]);
    assert!(merge.contains("`noisefloor farm merge SHARD… --out DIR`"), "{merge}");
    let typo = said(noisefloor, &["rendr"]);
    assert!(typo.contains("unrecognized subcommand 'rendr'") && typo.contains("'render'"), "{typo}");
    #[cfg(feature = "lab")]
    {
        let render = said(env!("CARGO_BIN_EXE_noisefloor-lab"), &["render", "hall.xml"]);
        assert!(
            render.contains("'render' is a command of noisefloor: `cargo run --release -- …`"),
            "{render}"
        );
    }
}

/// Options of a command that is there can be missing, too.
#[test]
fn options_that_are_left_out_say_what_to_type() {
    let watch: &[&str] = &["render", "--watch"];
    for (args, feature, present) in [
        (watch, "watch", cfg!(feature = "watch")),
        (&["metrics", "a.exr", "b.exr", "--flip-map", "map.png"], "metrics", cfg!(feature = "metrics")),
    ] {
        if !present {
            let output = run(args);
            assert_eq!(output.status.code(), Some(2), "{args:?}");
            assert!(stderr(&output).contains(&format!("--features {feature} -- {}", args[0])), "{args:?}");
        }
    }
}
