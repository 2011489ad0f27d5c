//! `formula`: the language of formulas, and what one formula is read as.

use crate::context::Context;
use phyture::Result;
use phyture::formula::{Formula, functions};
use phyture::physics::{signal_named, standard_names};
use serde_json::json;
use std::fmt::Write;
use std::process::ExitCode;

/// The operators, loosest first. The functions are listed by the grammar itself.
const OPERATORS: [(&str, &str); 5] = [
    ("a < b, <=, >, >=", "1 where it holds, else 0; they do not chain: join with * (and) or max (or)"),
    ("a + b, a - b", "sum and difference"),
    ("a * b, a / b", "product and quotient"),
    ("-a", "minus; -a^2 is -(a^2)"),
    ("a^b", "power; a^b^c is a^(b^c)"),
];

/// A usual step of a log, s, to try a formula at.
const STEP_S: f64 = 0.01;

/// The language as a text of at most 100 columns.
fn grammar() -> String {
    let mut text = String::from("Operators, loosest first:\n");
    let row = |text: &mut String, (form, meaning): (&str, &str)| {
        // Writing to a String does not fail.
        let _ = writeln!(text, "  {form:<20} {meaning}");
    };
    OPERATORS.into_iter().for_each(|operator| row(&mut text, operator));
    text.push_str("\nFunctions (the last four remember; the second argument of delay and slew is a number or a parameter):\n");
    functions().for_each(|function| row(&mut text, function));
    text.push('\n');
    let mut line = String::from("Names:");
    for name in standard_names() {
        if line.len() + name.len() > 98 {
            let _ = writeln!(text, "{line}");
            line = " ".repeat(6);
        }
        let _ = write!(line, " {name}");
    }
    let _ = write!(text, "{line}\n       and the log's own columns, the effect's coefficients and parameters");
    text.push_str("\n\nExamples:\n  phyture formula \"vy * hypot(vx, vy)\"\n  phyture formula \"lag(u1, 0.05) - u1\"");
    text
}

/// The language of formulas: its operators, functions and names; or what a formula of yours is read as
#[derive(clap::Args)]
#[command(
    after_help = grammar()
)]
pub struct Args {
    /// Formula to read
    pub formula: Option<String>,
}

/// Whether a log or the model gives a value of this name.
fn is_known(name: &str) -> bool {
    standard_names().contains(&name) || signal_named(name).is_some()
}

/// Prints the language, or what `formula` is read as.
pub fn run(context: &Context, Args { formula }: &Args) -> Result<ExitCode> {
    let Some(text) = formula else {
        context.say(grammar());
        context.json(&json!({ "functions": functions().map(|(form, meaning)| json!({ "form": form, "meaning": meaning })).collect::<Vec<_>>(), "names": standard_names() }))?;
        return Ok(ExitCode::SUCCESS);
    };
    let formula = Formula::parse(text)?;
    // Names that no log has of itself may be parameters; whether the times of lags and delays are numbers is seen when it is bound.
    formula.stream_with(STEP_S, &|name| (!is_known(name)).then_some(1.0))?;
    context.say(&formula);
    let (known, own): (Vec<&str>, Vec<&str>) = formula.names().into_iter().partition(|name| is_known(name));
    if !known.is_empty() {
        context.say(format!("reads {}", known.join(", ")));
    }
    if !own.is_empty() {
        context.say(format!("and {}: a column of the log or a parameter of the effect must have this name", own.join(", ")));
    }
    if formula.remembers() {
        context.say("remembers earlier samples");
    }
    context.json(&json!({ "formula": formula.to_string(), "names": formula.names(), "remembers": formula.remembers() }))?;
    Ok(ExitCode::SUCCESS)
}
