//! No memory.

use super::*;

/// Not a test: what `a_picture_too_large_for_the_memory_is_an_error` runs within a limit.
#[test]
#[ignore = "a part of another test"]
fn make_a_session_of_nine_gigabytes() {
    let (mut oracle, mut session) = (null_mut(), null_mut());
    // SAFETY: pointers to variables of this function, and a handle that was just made.
    unsafe {
        ok(nf_oracle_bundled(0.95, &mut oracle));
        assert_eq!(nf_session_new(16384, 16384, oracle, null(), &mut session), NfStatus::Memory);
        assert!(session.is_null() && message().contains("16384×16384") && message().contains("9663676416"));
        // And the library goes on
        ok(nf_session_new(WIDTH, HEIGHT, oracle, null(), &mut session));
        nf_session_free(session);
        nf_oracle_free(oracle);
    }
    println!("the process goes on");
}

/// No memory is an error and not the end of the process: a renderer has hours of work in its own.
#[test]
fn a_picture_too_large_for_the_memory_is_an_error() {
    let limited = "ulimit -v 4000000; exec \"$0\" --ignored --nocapture --exact \"$1\"";
    let test = "tests::memory::make_a_session_of_nine_gigabytes";
    let this = std::env::current_exe().unwrap();
    let output = std::process::Command::new("sh").args(["-c", limited]).arg(this).arg(test).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("the process goes on"), "{said}{errors}");
}
