//! What the fuzzer found once, and seeds that it begins with, through the very functions that it calls (`tests/fuzz`): nothing panics, takes memory
//! for a size that a file claims, or comes back as something else. Needs no fuzzer.
//!
//! A file of its own, because the allocator counts for the whole program; and hardly more than one test, because it counts for all threads.
#![cfg(all(feature = "cli", unix))]

mod counting;
#[path = "fuzz/src/targets/mod.rs"]
mod targets;

use phyture::flight::guard;
use std::time::{Duration, Instant};
use targets::{MOST_BYTES, TARGETS, hostile, seeds};

/// Time that one file may take; none takes a second where nothing else runs.
const LONGEST: Duration = Duration::from_secs(20);

#[test]
fn what_was_found_stays_mended_and_what_is_sound_is_taken() {
    // A panic that a reader catches is not worth a trace.
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !guard::inside() {
            report(panic);
        }
    }));
    for (name, target) in TARGETS {
        let seeds = seeds(name);
        assert!(!seeds.is_empty(), "{name} has no seed");
        for (number, seed) in seeds.iter().enumerate() {
            assert!(target(seed), "seed {number} of {name} is refused: {}", String::from_utf8_lossy(seed));
        }
        for path in hostile(name) {
            eprintln!("{}", path.display());
            let bytes = std::fs::read(&path).expect("a file that is there");
            let begun = Instant::now();
            let taken = counting::most_held(|| {
                target(&bytes);
            });
            assert!(begun.elapsed() < LONGEST, "{}: {:?}", path.display(), begun.elapsed());
            assert!(taken <= MOST_BYTES, "{}: {taken} bytes of memory for {} bytes", path.display(), bytes.len());
        }
    }
}

#[test]
fn every_folder_is_that_of_a_target() {
    for folder in hostile("") {
        let name = folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        assert!(TARGETS.iter().any(|target| target.0 == name), "no target `{name}`");
    }
}
