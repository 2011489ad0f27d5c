//! `completions` and `man`: what a shell and `man` know of the command line, made from the command line itself.

use crate::context::Context;
use phyture::{Error, Result};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

const NAME: &str = "phyture";

/// Completions for a shell, to standard output
#[derive(clap::Args)]
#[command(after_help = "Example:\n  phyture completions bash > ~/.local/share/bash-completion/completions/phyture")]
pub struct CompletionsArgs {
    /// Shell
    pub shell: clap_complete::Shell,
}

/// Manual pages, one a command
#[derive(clap::Args)]
#[command(after_help = "Example:\n  phyture man ~/.local/share/man/man1")]
pub struct Args {
    /// Folder to write them to
    pub dir: PathBuf,
}

/// Prints the completions of a shell for `command`.
pub fn completions(args: &CompletionsArgs, mut command: clap::Command) -> ExitCode {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, NAME, &mut script);
    // A closed pipe (`phyture completions bash | head`) is no error.
    let _ = std::io::stdout().write_all(&script);
    ExitCode::SUCCESS
}

/// A command and all that are below it, as `effect show` below `effect`.
fn with_subcommands(command: clap::Command) -> Vec<clap::Command> {
    let below: Vec<clap::Command> =
        command.get_subcommands().filter(|command| command.get_name() != "help").cloned().flat_map(with_subcommands).collect();
    std::iter::once(command).chain(below).collect()
}

/// Writes the page of `command` and one for each that is below it.
pub fn run(context: &Context, Args { dir: folder }: &Args, mut command: clap::Command) -> Result<ExitCode> {
    std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
    command.build();
    let mut written = 0;
    for page in with_subcommands(command) {
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
