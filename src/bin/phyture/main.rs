//! The command line: parse, call, print. What a command computes is in the library; how it is asked and shown is here.
//!
//! Exit codes: 0 done, 2 bad usage or bad input, 3 a check failed (its report is still written), 130 interrupted (state saved).

mod arguments;
mod commands;
mod context;
mod folder;
mod following;
mod notes;
mod output;
mod pages;
mod style;

use clap::Parser;
use phyture::flight::guard;
use std::process::ExitCode;

/// Bad usage or bad input.
const BAD_INPUT: u8 = 2;
/// Ctrl-C; the state is saved.
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    quiet_behind_the_border();
    let arguments = match commands::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return usage(&error),
    };
    let error = match commands::run(&arguments) {
        Ok(code) => return code,
        Err(error) => error,
    };
    let code = if matches!(error, phyture::Error::Interrupted { .. }) {
        output::complain(&error);
        INTERRUPTED
    } else {
        output::complain(format_args!("error: {error}"));
        BAD_INPUT
    };
    output::failure(arguments.common.json.as_deref(), arguments.common.force, error.kind(), error.to_string(), code);
    ExitCode::from(code)
}

/// What the parser has to say: help and version, or what is wrong with the command line. A program that asked for JSON gets it.
fn usage(error: &clap::Error) -> ExitCode {
    // A closed pipe (`phyture --help | head`) is no error.
    let _ = error.print();
    if error.exit_code() == 0 {
        return ExitCode::SUCCESS;
    }
    let words: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    let next = |at: usize| words.get(at + 1).cloned();
    let file = words.iter().enumerate().find_map(|(at, word)| match word.strip_prefix("--json") {
        Some("") => next(at),
        Some(rest) => rest.strip_prefix('=').map(str::to_owned),
        None => None,
    });
    let force = words.iter().any(|word| word == "--force");
    output::failure(file.as_deref().map(std::path::Path::new), force, "usage", error.render().to_string(), BAD_INPUT);
    ExitCode::from(BAD_INPUT)
}

/// A panic that becomes an error (see [`guard`]) is told once, as that error; all others are reported as ever.
fn quiet_behind_the_border() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !guard::inside() {
            report(panic);
        }
    }));
}
