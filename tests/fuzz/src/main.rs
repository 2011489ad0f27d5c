//! The fuzz targets as a program for libFuzzer: `PHYTURE_FUZZ=csv phyture-fuzz CORPUS`.
#![no_main]

#[path = "../../counting/mod.rs"]
mod counting;
mod targets;

use libfuzzer_sys::fuzz_target;
use phyture::flight::guard;
use std::backtrace::Backtrace;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::OnceLock;
use targets::{MOST_BYTES, TARGETS, Target, hostile, seeds};

static TARGET: OnceLock<Target> = OnceLock::new();

fuzz_target!(init: set_up(), |bytes: &[u8]| {
    let Some(target) = TARGET.get() else { return };
    let taken = counting::most_held(|| {
        target(bytes);
    });
    assert!(taken <= MOST_BYTES, "{taken} bytes of memory for {} bytes of input", bytes.len());
});

/// Chooses the target, writes the seeds where they are asked for, and lets a panic end the program: in whatever thread it is, but not one that a
/// reader catches.
fn set_up() {
    std::panic::set_hook(Box::new(|panic| {
        if !guard::inside() {
            eprintln!("{panic}\n{}", Backtrace::force_capture());
            std::process::abort();
        }
    }));
    let wanted = std::env::var("PHYTURE_FUZZ").unwrap_or_default();
    if wanted == "list" {
        println!("{}", TARGETS.map(|target| target.0).join(" "));
        std::process::exit(0);
    }
    let target = TARGETS.iter().find(|target| target.0 == wanted);
    let (name, run) = target.unwrap_or_else(|| panic!("PHYTURE_FUZZ is `{wanted}`, and `PHYTURE_FUZZ=list` tells what it may be"));
    if let Some(folder) = std::env::var_os("PHYTURE_FUZZ_SEEDS") {
        put_seeds(name, Path::new(&folder)).expect("seeds can be written");
    }
    // What is made once for all inputs is no input's.
    seeds(name).first().map(|seed| run(seed));
    TARGET.get_or_init(|| *run);
}

/// Writes the seeds of a target, and what was found before, into a folder, and the words in them beside it, as libFuzzer reads them.
fn put_seeds(name: &str, folder: &Path) -> std::io::Result<()> {
    let mut words = BTreeSet::from(["\"nan\"\n", "\"inf\"\n", "\"1e308\"\n"].map(str::to_owned));
    let found = hostile(name).iter().map(std::fs::read).collect::<std::io::Result<Vec<_>>>()?;
    for (number, seed) in seeds(name).iter().chain(&found).enumerate() {
        std::fs::write(folder.join(number.to_string()), seed)?;
        let text = String::from_utf8_lossy(seed);
        let parts = text.split(|letter: char| !(letter.is_ascii_alphanumeric() || "_-/.".contains(letter)));
        words.extend(parts.filter(|word| (3..30).contains(&word.len())).map(|word| format!("\"{word}\"\n")));
    }
    // Names, not numbers: most of them begin with a letter.
    let is_name = |word: &&String| word.as_bytes().get(1).is_some_and(u8::is_ascii_alphabetic);
    std::fs::write(folder.with_extension("words"), words.iter().filter(is_name).cloned().collect::<String>())
}
