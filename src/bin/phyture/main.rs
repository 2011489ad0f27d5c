//! The command line: parse, call, print. What a command computes is in the library; how it is asked and shown is here.
//!
//! Exit codes: 0 done, 2 bad usage or bad input, 3 a check failed (its report is still written), 130 interrupted (state saved).

mod arguments;
mod commands;
mod output;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = arguments::Arguments::parse();
    match commands::run(&arguments) {
        Ok(code) => code,
        Err(phyture::Error::Interrupted { saved }) => {
            eprintln!("interrupted; {saved}");
            ExitCode::from(130)
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
