//! Every target on its seeds, on all inputs that ever failed, and on mutants for a while.
#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

use noisefloor_fuzz::{TARGETS, Target, target};
use std::cell::Cell;
use std::path::Path;
use std::sync::Once;
use std::time::{Duration, Instant};

/// How long each target runs on mutants if NOISEFLOOR_FUZZ_SECONDS does not say.
const SECONDS: f64 = 0.5;
/// Longest mutant, in bytes.
const LONGEST: usize = 1 << 16;

thread_local!(static IN_TARGET: Cell<bool> = const { Cell::new(false) });

/// A target that panics fails the test, and the input is saved. What a target itself catches, of decoders, is
/// not reported.
fn try_on(target: &Target, input: &[u8]) {
    static QUIET: Once = Once::new();
    QUIET.call_once(|| {
        let report = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !IN_TARGET.get() {
                report(panic)
            }
        }));
    });
    IN_TARGET.set(true);
    let tried = std::panic::catch_unwind(|| (target.run)(input));
    IN_TARGET.set(false);
    if tried.is_err() {
        let name = format!("{}-{}", target.name, &blake3::hash(input).to_hex()[..12]);
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, input).unwrap();
        let place = format!("fuzz/found/{}", target.name);
        panic!("{} failed on {}; keep it in {place} once it is mended", target.name, path.display());
    }
}

#[test]
fn the_seeds_of_a_target_are_valid() {
    for t in TARGETS {
        assert_eq!(target(t.name).unwrap().name, t.name);
        let valid = |seed: &Vec<u8>| (t.run)(seed);
        // Those of decoders hold nonsense on purpose
        let first = if ["exr", "png", "spectrum"].contains(&t.name) { 1 } else { usize::MAX };
        assert!((t.seeds)().iter().take(first).all(valid), "{}", t.name);
        assert!(!(t.run)(b"v x"), "{}", t.name);
    }
}

#[test]
fn what_once_failed_does_not_any_more() {
    let found = Path::new(env!("CARGO_MANIFEST_DIR")).join("found");
    for folder in std::fs::read_dir(found).into_iter().flatten().flatten() {
        let name = folder.file_name().into_string().unwrap();
        let target = target(&name).unwrap_or_else(|| panic!("found/{name} is of no target"));
        for input in std::fs::read_dir(folder.path()).unwrap() {
            try_on(target, &std::fs::read(input.unwrap().path()).unwrap());
        }
    }
}

#[test]
fn mutants_of_the_seeds_do_no_harm() {
    let seconds = std::env::var("NOISEFLOOR_FUZZ_SECONDS").ok().and_then(|s| s.parse().ok());
    let time = Duration::from_secs_f64(seconds.unwrap_or(SECONDS));
    for target in TARGETS {
        let seeds = (target.seeds)();
        seeds.iter().for_each(|seed| try_on(target, seed));
        let (mut random, begun, mut runs) = (fastrand::Rng::with_seed(1), Instant::now(), 0u64);
        while begun.elapsed() < time {
            try_on(target, &mutant(&seeds, &mut random));
            runs += 1;
        }
        println!("{}: {runs} mutants", target.name);
    }
}

/// A seed with a few changes: bytes, numbers of 32 bits, cuts, repetitions, and pieces of other seeds.
fn mutant(seeds: &[Vec<u8>], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut bytes = random.choice(seeds).unwrap().clone();
    for _ in 0..random.usize(1..=8) {
        let at = random.usize(0..=bytes.len());
        let end = (at + random.usize(0..=16)).min(bytes.len());
        match random.u8(0..8) {
            0..3 if at < bytes.len() => bytes[at] = random.u8(..),
            3 if at < bytes.len() => bytes[at] ^= 1 << random.u8(0..8),
            4 if at + 4 <= bytes.len() => {
                let number = *random.choice(&[0u32, 1, 0x7f, 0x7fff_ffff, 0x8000_0000, u32::MAX]).unwrap();
                let number = if random.bool() { number.to_le_bytes() } else { number.to_be_bytes() };
                bytes[at..at + 4].copy_from_slice(&number);
            }
            5 => drop(bytes.drain(at..end)),
            6 => {
                let piece = bytes[at..end].repeat(random.usize(1..4));
                drop(bytes.splice(at..at, piece));
            }
            _ => {
                let other = random.choice(seeds).unwrap();
                let from = random.usize(0..=other.len());
                let to = (from + random.usize(0..=64)).min(other.len());
                drop(bytes.splice(at..end, other[from..to].iter().copied()));
            }
        }
    }
    bytes.truncate(LONGEST);
    bytes
}
