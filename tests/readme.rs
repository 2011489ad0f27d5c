//! The commands of the README as they stand there, typed into a fresh folder, twice: the first time they work, the second time nothing
//! that the first left is lost.
#![cfg(all(feature = "cli", unix))]

mod program;

use phyture::{Error, Result};
use program::{contents, folder, phyture};
use std::fs;
use std::path::Path;
use std::process::Output;

/// The commands of the first indented block after `heading`, without their comments. Training is cut to an epoch.
fn commands(heading: &str) -> Result<Vec<String>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let text = fs::read_to_string(&path).map_err(Error::io(path))?;
    let block = text.lines().skip_while(|line| !line.starts_with(heading)).skip_while(|line| !line.starts_with("    phyture"));
    let lines = block.take_while(|line| line.starts_with("    "));
    let command = |line: &str| {
        let command = line.split(" #").next().unwrap_or(line).trim().to_owned();
        // Its minutes are no test of what it does.
        if command.contains(" train ") { command + " --epochs 1" } else { command }
    };
    Ok(lines.map(command).collect())
}

fn run(folder: &Path, command: &str) -> Result<Output> {
    let words: Vec<&str> = command.split_whitespace().collect();
    assert_eq!(words.first(), Some(&"phyture"), "{command}");
    phyture(folder, &words[1..])
}

#[test]
fn the_sequence_for_one_s_own_flights_works_and_loses_nothing_the_second_time() -> Result<()> {
    let commands = commands("On your own flights")?;
    assert!(commands.len() >= 7 && commands.iter().any(|command| command.contains(" train ")), "{commands:#?}");
    let place = folder()?;
    // Ten minutes hold a flight of each class, the locked one among them.
    let flights = run(place.path(), "phyture simulate flights --minutes 10 --baseline --hide weathercock=2 --seed 7600")?;
    assert!(flights.status.success(), "{}", String::from_utf8_lossy(&flights.stderr));
    for command in &commands {
        let output = run(place.path(), command)?;
        assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let before = contents(place.path())?;
    for command in &commands {
        let output = run(place.path(), command)?;
        let text = String::from_utf8_lossy(&output.stderr);
        let writes = command.contains(" -o ") || command.contains(" --report ");
        let expected = if writes { Some(2) } else { Some(0) };
        assert_eq!(output.status.code(), expected, "{command}: {text}");
        assert!(!writes || text.contains("is there already"), "{command}: {text}");
    }
    assert_eq!(contents(place.path())?, before);
    Ok(())
}
