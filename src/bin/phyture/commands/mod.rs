//! The commands, one file each; here their list and the dispatch.

mod benchmark;
mod calibrate;
mod check;
mod compare;
mod demo;
mod diagnose;
mod effect;
mod explainable;
mod export_c;
mod formula;
mod implant;
mod init;
mod manual;
mod parity;
mod predict;
mod rollout;
mod simulate;
mod studio;
mod train;

use crate::arguments::Common;
use crate::context::Context;
use crate::output;
use clap::{CommandFactory, Parser, Subcommand};
use phyture::Result;
use std::process::ExitCode;

/// Where to begin, and what a script has to know.
const HELP: &str = "\
Start with: phyture demo

Exit codes: 0 done; 2 bad usage or bad input; 3 a check failed (its report is written); 130 interrupted (state saved).
With --json a failure is JSON too: { \"schema\": 1, \"error\": { \"kind\", \"message\" }, \"exit_code\" }.";

/// Calibrate a first-principles model of an unmanned helicopter on recorded flights, see where it fails, and learn the rest.
#[derive(Parser)]
#[command(version, about, max_term_width = 110, after_help = HELP)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Options of every command.
    #[command(flatten)]
    pub common: Common,
}

/// The commands. What is said of each stands where its options are.
#[derive(Subcommand)]
pub enum Command {
    Demo(demo::Args),
    Simulate(simulate::Args),
    Init(init::Args),
    Check(check::Args),
    Calibrate(calibrate::Args),
    Compare(compare::Args),
    Diagnose(diagnose::Args),
    Loop(diagnose::LoopArgs),
    Studio(studio::Args),
    #[command(mut_arg("data", |data| data.required(false).required_unless_present("print_config")))]
    Train(train::Args),
    Predict(predict::Args),
    Rollout(rollout::Args),
    Effect(effect::Args),
    Implant(implant::Args),
    Benchmark(benchmark::Args),
    ExportC(export_c::Args),
    Formula(formula::Args),
    Completions(manual::CompletionsArgs),
    Man(manual::Args),
    Parity(parity::Args),
}

/// Exit code of a check that failed.
const CHECK_FAILED: u8 = 3;

/// Runs the command that was asked for.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let context = Context::new(&arguments.common)?;
    context.limit_threads();
    if context.common.quiet {
        output::be_quiet();
    }
    match &arguments.command {
        Command::Demo(args) => demo::run(&context, args),
        Command::Simulate(args) => simulate::run(&context, args),
        Command::Init(args) => init::run(&context, args),
        Command::Check(args) => check::run(&context, args),
        Command::Calibrate(args) => calibrate::run(&context, args),
        Command::Compare(args) => compare::run(&context, args),
        Command::Diagnose(args) => diagnose::run(&context, args),
        Command::Loop(args) => diagnose::run_loop(&context, args),
        Command::Studio(args) => studio::run(&context, args),
        Command::Train(args) => train::run(&context, args),
        Command::Predict(args) => predict::run(&context, args),
        Command::Rollout(args) => rollout::run(&context, args),
        Command::Effect(args) => effect::run(&context, args),
        Command::Implant(args) => implant::run(&context, args),
        Command::Benchmark(args) => benchmark::run(&context, args),
        Command::ExportC(args) => export_c::run(&context, args),
        Command::Formula(args) => formula::run(&context, args),
        Command::Completions(args) => Ok(manual::completions(args, Arguments::command())),
        Command::Man(args) => manual::run(&context, args, Arguments::command()),
        Command::Parity(args) => parity::run(&context, args),
    }
}
