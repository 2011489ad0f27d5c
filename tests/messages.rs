//! Mistakes and what the program says to them: `docs/messages.md` is run as it stands.
//!
//! Lines that begin with `    $ ` are given to a shell, one after the other, in a fresh folder. A command with nothing under it has to
//! succeed. One with text under it is a mistake: it has to fail, with exactly this text but
//! for empty lines. `PHYTURE_WRITE_DOCS=1` writes the
//! texts of today into the page, to be read by a person before they are kept.
#![cfg(all(feature = "cli", unix))]

use phyture::{Error, Result};
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

const PAGE: &str = "docs/messages.md";
const PROMPT: &str = "    $ ";
const INDENT: &str = "    ";

/// Exit code and what was said on standard error; where that is nothing, on standard output.
fn run(folder: &Path, line: &str) -> Result<(Option<i32>, String)> {
    let program = Path::new(env!("CARGO_BIN_EXE_phyture"));
    let programs = program.parent().map_or(String::new(), |folder| folder.display().to_string());
    let path = format!("{programs}:{}", std::env::var("PATH").unwrap_or_default());
    let mut shell = Command::new("sh");
    let output = shell.args(["-c", line]).current_dir(folder).env("PATH", path).output().map_err(Error::io("sh"))?;
    let said = if output.stderr.is_empty() { output.stdout } else { output.stderr };
    Ok((output.status.code(), String::from_utf8_lossy(&said).into_owned()))
}

#[test]
fn every_mistake_of_the_page_is_answered_as_the_page_says() -> Result<()> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join(PAGE);
    let text = std::fs::read_to_string(&page).map_err(Error::io(&page))?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let (mut today, mut mistakes) = (String::new(), 0);
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        let _ = writeln!(today, "{line}");
        let Some(command) = line.strip_prefix(PROMPT) else { continue };
        let mut expected = false;
        while lines.next_if(|line| line.starts_with(INDENT) && !line.starts_with(PROMPT)).is_some() {
            expected = true;
        }
        let (code, said) = run(place.path(), command)?;
        if expected {
            mistakes += 1;
            assert!(code.is_some_and(|code| code != 0), "{command}: no mistake\n{said}");
            // An empty line would end the block.
            let lines = said.lines().filter(|line| !line.trim().is_empty());
            lines.for_each(|line| writeln!(today, "{INDENT}{}", line.trim_end()).unwrap_or_default());
        } else {
            assert_eq!(code, Some(0), "{command}: {said}");
        }
    }
    assert!(mistakes >= 30, "{mistakes} mistakes");
    if std::env::var_os("PHYTURE_WRITE_DOCS").is_some() {
        return std::fs::write(&page, today).map_err(Error::io(page));
    }
    for (number, (page, program)) in text.lines().zip(today.lines()).enumerate() {
        assert_eq!(page, program, "line {} of {PAGE}", number + 1);
    }
    assert_eq!(text.lines().count(), today.lines().count());
    Ok(())
}
