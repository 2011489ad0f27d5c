//! Bad data: simulated flights with one thing wrong in each case, and what `check` and `diagnose` say of them. A program, not a timed test.
//!
//!     cargo bench --features cli --bench bad_data                                      a few cases, some minutes
//!     cargo bench --features cli --bench bad_data -- run OUT.jsonl [SEEDS] [WHAT…]     everything, resumable
//!     cargo bench --features cli --bench bad_data -- development OUT.jsonl [SEEDS] [WHAT…]   the same on development seeds
//!     cargo bench --features cli --bench bad_data -- table OUT.jsonl                   the tables
//!     cargo bench --features cli --bench bad_data -- write FOLDER CORRUPTION PART SEED [HIDDEN]   the flights of one case, as a folder
//!     cargo bench --features cli --bench bad_data -- sound                             only that each corruption changes what it is to change
//!
//! SEEDS is how many, 10 and 2 if it is not given, or some of them: `501..504`; WHAT are corruptions, or `clean` for data with nothing wrong. Each case is a line of
//! JSON, appended; one that is there already is not repeated.

#[path = "../hidden_effect/cases.rs"]
#[allow(dead_code, reason = "another benchmark's list, of which this one takes the sizes of single effects")]
mod cases;
mod change;
mod corruptions;
mod eighth;
mod fifth;
mod fourth;
mod further;
mod mend;
mod ninth;
mod run;
mod second;
mod seventh;
mod sixth;
mod sound;
mod tables;
mod tenth;
mod third;
mod words;

use run::Plan;
use std::ops::Range;
use std::path::Path;

fn main() -> phyture::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["run", out, words @ ..] => asked(out, words, run::REPORTED),
        ["development", out, words @ ..] => asked(out, words, run::DEVELOPMENT),
        ["table", out] => tables::print(Path::new(out)),
        ["write", folder, id, part, seed, hidden @ ..] => {
            let seed = seed.parse().map_err(|_| phyture::Error::Undetermined(format!("`{seed}` is no seed")))?;
            run::write_case(Path::new(folder), id, part, seed, hidden.first().copied())
        }
        ["list"] => {
            sound::list();
            Ok(())
        }
        ["sound"] => sound::all(),
        _ => {
            let out = std::env::temp_dir().join(format!("bad_data_{}.jsonl", std::process::id()));
            sound::all()?;
            run::all(&out, &run::FEW, &[])?;
            tables::print(&out)?;
            std::fs::remove_file(&out).map_err(phyture::Error::io(&out))
        }
    }
}

/// Runs a plan with what the command line adds to it.
fn asked(out: &str, words: &[&str], plan: Plan) -> phyture::Result<()> {
    sound::all()?;
    let some = |word: &str| -> Option<Range<u64>> {
        let (first, end) = word.split_once("..")?;
        Some(first.parse().ok()?..end.parse().ok()?)
    };
    let count = |word: &str| Some(plan.seeds.start..plan.seeds.start + word.parse::<u64>().ok()?);
    let (seeds, what) = match words {
        [first, rest @ ..] => some(first).or_else(|| count(first)).map_or((plan.seeds.clone(), words), |seeds| (seeds, rest)),
        [] => (plan.seeds.clone(), words),
    };
    run::all(Path::new(out), &Plan { seeds, ..plan }, what)
}
