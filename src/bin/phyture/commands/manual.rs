//! `completions` and `man`: what a shell and `man` know of the command line, made from the command line itself.

use super::Context;
use crate::arguments::Arguments;
use clap::CommandFactory;
use phyture::{Error, Result};
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

const NAME: &str = "phyture";

/// Prints the completions of a shell.
pub fn completions(shell: clap_complete::Shell) -> ExitCode {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), NAME, &mut script);
    // A closed pipe (`phyture completions bash | head`) is no error.
    let _ = std::io::stdout().write_all(&script);
    ExitCode::SUCCESS
}

/// Writes `phyture.1` and a page for each command into `folder`.
pub fn pages(context: &Context, folder: &Path) -> Result<ExitCode> {
    std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
    let mut command = Arguments::command();
    command.build();
    let subcommands = command.get_subcommands().filter(|command| command.get_name() != "help").cloned().collect::<Vec<_>>();
    let mut written = 0;
    for page in std::iter::once(command).chain(subcommands) {
        let name = page.get_display_name().unwrap_or_else(|| page.get_name()).to_owned();
        let target = context.new_file(&folder.join(format!("{name}.1")), &[])?;
        let manual = clap_mangen::Man::new(page).title(name.to_uppercase());
        phyture::disk::write_atomically(context.ready(&target)?, |mut file| manual.render(&mut file))?;
        written += 1;
    }
    context.say(format!("{written} manual pages written to {}", folder.display()));
    context.json(&serde_json::json!({ "folder": folder, "pages": written }))?;
    Ok(ExitCode::SUCCESS)
}
