//! libFuzzer on one of the targets, which NOISEFLOOR_FUZZ_TARGET names.
#![no_main]

use libfuzzer_sys::fuzz_target;
use noisefloor_fuzz::Target;
use std::sync::OnceLock;

static TARGET: OnceLock<&Target> = OnceLock::new();

fuzz_target!(
    init: {
        let name = std::env::var("NOISEFLOOR_FUZZ_TARGET").expect("NOISEFLOOR_FUZZ_TARGET names a target");
        let target = noisefloor_fuzz::target(&name).expect("a target of that name");
        let _ = TARGET.set(target);
        // Seeds into the folder of inputs, which is the first argument that is no option
        if let Some(folder) = std::env::args().skip(1).find(|argument| !argument.starts_with('-')) {
            for (i, seed) in (target.seeds)().iter().enumerate() {
                std::fs::write(format!("{folder}/seed-{i}"), seed).expect("space for seeds");
            }
        }
        // Panics of decoders are caught by what is tested; one that is not ends in libFuzzer's own hands
        std::panic::set_hook(Box::new(|_| ()));
    },
    |bytes: &[u8]| {
        let target = TARGET.get().expect("set before the first run");
        if let Err(panic) = std::panic::catch_unwind(|| (target.run)(bytes)) {
            let what = panic.downcast_ref::<String>().map(String::as_str);
            let what = what.or_else(|| panic.downcast_ref::<&str>().copied());
            eprintln!("{} panicked: {}", target.name, what.unwrap_or("without a word"));
            std::process::abort();
        }
    }
);
