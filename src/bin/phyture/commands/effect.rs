//! `effect list`, `effect signals`, `effect show` and `effect add`: the catalogue for a person, and the way of an effect into a model file.

use crate::context::Context;
use phyture::flight::Column;
use phyture::formula::{Formula, Shared, shared};
use phyture::physics::catalogue::{definition, definitions};
use phyture::physics::{Definition, Effect, Model, Origin, SIGNALS, Signal, Term, signal_named, standard_names};
use phyture::suggest::did_you_mean;
use phyture::{Error, Result};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What puts an effect into a model file here.
const ADDED_BY: &str = "effect add";

/// The catalogue of physical effects; add one to a model
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture effect list\n  phyture effect show ground_effect\n  phyture effect add ground_effect -m n9.toml -o n9-ground.toml"
)]
pub struct Args {
    /// What to do with it.
    #[command(subcommand)]
    pub command: Action,
}

/// What to do with the catalogue.
#[derive(clap::Subcommand)]
pub enum Action {
    /// Every effect in a line
    List,
    /// The signals that effects read and change, which formulas of your own may read and change too
    Signals,
    /// All that is known about one effect
    Show {
        /// Effect
        effect: String,
    },
    /// Put an effect with coefficients 0 into a model file, to be calibrated
    Add {
        /// Effect
        effect: String,
        /// Model file
        #[arg(short, long)]
        model: PathBuf,
        /// Model file to write
        #[arg(short, long)]
        output: PathBuf,
    },
}

/// Does what was asked for.
pub fn run(context: &Context, Args { command }: &Args) -> Result<ExitCode> {
    match command {
        Action::List => list(context),
        Action::Signals => signals(context),
        Action::Show { effect } => show(context, effect),
        Action::Add { effect, model, output } => add(context, effect, model, output),
    }
}

/// An effect of the catalogue, or an error with the nearest name.
pub fn find(id: &str) -> Result<&'static Definition> {
    definition(id).filter(|definition| definition.notes.is_some()).ok_or_else(|| {
        let known = definitions().map(|definition| definition.kind);
        Error::Config {
            place: "command line".into(),
            field: "effect".into(),
            found: format!("`{id}`{}", did_you_mean(id, known)),
            expected: "an effect of the catalogue; `phyture effect list` shows them".into(),
        }
    })
}

/// Names of the accelerations that an effect changes in the paper's baseline.
fn channels(definition: &Definition) -> Vec<&'static str> {
    let mut model = Model::paper("", 1.0, [1.0; 3], 1.0);
    model.effects.push(definition.effect(1.0, 1.0));
    let touched = model.acts(model.effects.len() - 1).expect("a built-in effect goes with the baseline");
    Column::TARGETS.into_iter().zip(touched).filter(|(_, touched)| *touched).map(|(column, _)| column.name()).collect()
}

/// Names of signals, one after the other.
fn names(signals: &[&Signal]) -> String {
    let names: Vec<&str> = signals.iter().map(|signal| signal.name).collect();
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

fn signals(context: &Context) -> Result<ExitCode> {
    let effects: Vec<Effect> = definitions().map(|definition| definition.effect(1.0, 1.0)).collect();
    let changers = |signal: &Signal| -> Vec<&str> {
        let changes = |effect: &&Effect| effect.changes().iter().any(|changed| changed.name == signal.name);
        effects.iter().filter(changes).map(|effect| effect.kind.as_str()).collect()
    };
    let width = |text: fn(&Signal) -> &str| SIGNALS.iter().map(|signal| text(signal).chars().count()).max().unwrap_or_default();
    let (names, units, meanings) = (width(|signal| signal.name), width(|signal| signal.unit), width(|signal| signal.meaning));
    context.print(format!("{:<names$}  {:<units$}  {:<meanings$}  changed by", "signal", "unit", "what it is"));
    for signal in &SIGNALS {
        let changers = changers(signal);
        let by = if changers.is_empty() { "-".into() } else { changers.join(" ") };
        context.print(format!("{:<names$}  {:<units$}  {:<meanings$}  {by}", signal.name, signal.unit, signal.meaning));
    }
    context.print(concat!(
        "\na formula of your own changes a signal like this, in a model file:\n\n",
        "  [[effect]]\n  kind = \"formula\"\n  name = \"blade_twist\"\n  changes = \"thrust\"\n  formula = \"thrust * airspeed\""
    ));
    let described = SIGNALS.iter().map(
        |signal| json!({ "name": signal.name, "unit": signal.unit, "meaning": signal.meaning, "changed_by": changers(signal) }),
    );
    context.json(&json!({ "signals": described.collect::<Vec<_>>() }))?;
    Ok(ExitCode::SUCCESS)
}

fn list(context: &Context) -> Result<ExitCode> {
    let width = definitions().map(|definition| definition.kind.len()).max().unwrap_or_default();
    context.print(format!("{:<width$}  {:<42}  what it is", "effect", "changes"));
    for definition in definitions() {
        let aside = if definition.notes.is_some_and(|notes| !notes.searched) { " (listed only)" } else { "" };
        let channels = channels(definition).join(" ");
        context.print(format!("{:<width$}  {channels:<42}  {}{aside}", definition.kind, definition.meaning));
    }
    context.print("\n`phyture effect show EFFECT` prints formulas, sizes and what it is mistaken for, `phyture effect signals` what they read and change");
    context.json(&json!({ "effects": definitions().map(described).collect::<Vec<_>>() }))?;
    Ok(ExitCode::SUCCESS)
}

fn show(context: &Context, id: &str) -> Result<ExitCode> {
    // One of the baseline is shown, too, though no search and no `add` knows it.
    let definition = definition(id).map_or_else(|| find(id), Ok)?;
    context.print(text(definition));
    context.json(&described(definition))?;
    Ok(ExitCode::SUCCESS)
}

/// Everything about an effect, for a person.
fn text(definition: &Definition) -> String {
    let mut text = format!("{}: {}\n", definition.kind, definition.meaning);
    let mut line = |indent: usize, content: String| {
        // Writing to a String does not fail.
        let _ = writeln!(text, "{:indent$}{content}", "");
    };
    line(0, String::new());
    let effect = definition.effect(1.0, 1.0);
    let product = |term: &Term| match &term.coefficient {
        Some(name) => Formula::parse(&format!("{name} * ({})", term.regressor)).expect("a product of what parses"),
        None => term.regressor.clone(),
    };
    let changes = effect.swaps.iter().map(|swap| swap.with.clone());
    let Shared { formulas, parts } = shared(&effect.terms.iter().map(product).chain(changes).collect::<Vec<_>>());
    let (products, changes) = formulas.split_at(effect.terms.len());
    for (term, product) in effect.terms.iter().zip(products) {
        line(2, format!("{:<6} += {product}   [{}]", term.channel.name(), term.channel.unit()));
    }
    for (swap, with) in effect.swaps.iter().zip(changes) {
        let within = if swap.within.is_empty() { String::new() } else { format!("   in {}", swap.within.join(", ")) };
        line(2, format!("{:<6} := {with}{within}", swap.name));
    }
    parts.iter().for_each(|(name, part)| line(4, format!("where {name} = {part}")));
    line(0, format!("\nReads signals     {}\nChanges signals   {}", names(&effect.reads()), names(&effect.changes())));
    if !definition.coefficients.is_empty() {
        line(0, "\nCoefficients".into());
    }
    for coefficient in definition.coefficients {
        let range = match coefficient.bounds {
            [f64::NEG_INFINITY, f64::INFINITY] => "any value".into(),
            [low, high] => format!("{low} to {high}"),
        };
        let usual = coefficient.expected.map(|[low, high]| format!(", usually {low} to {high} at 5 kg")).unwrap_or_default();
        let flights = coefficient.by_flight.map(|s| format!("; one for each flight, s.d. {s}")).unwrap_or_default();
        line(2, format!("{:<10} {}, {range}{usual}{flights}: {}", coefficient.name, coefficient.unit, coefficient.meaning));
    }
    if !definition.parameters.is_empty() {
        line(0, "\nParameters".into());
    }
    for parameter in definition.parameters {
        let [low, high] = parameter.bounds;
        let origin = match parameter.origin {
            Origin::Number(number) => number.to_string(),
            Origin::RotorRadius => "the model's rotor radius".into(),
            Origin::HoverInduced => "from mass and rotor radius by momentum theory".into(),
        };
        let grid: Vec<String> = parameter.grid.iter().map(f64::to_string).collect();
        let tried = match (grid.is_empty(), parameter.tied_to) {
            (true, _) => String::new(),
            (false, None) => format!("; tried: {}", grid.join(", ")),
            (false, Some(other)) => format!("; tried together with {other}"),
        };
        line(2, format!("{:<10} {}, {origin}, {low} to {high}{tried}: {}", parameter.name, parameter.unit, parameter.meaning));
    }
    if let Some(notes) = definition.notes {
        let vehicles: Vec<&str> = notes.vehicles.iter().map(|vehicle| vehicle.name()).collect();
        let alike = if notes.confusable_with.is_empty() { "nothing".into() } else { notes.confusable_with.join(", ") };
        line(0, String::new());
        line(0, format!("Shows in          {}", notes.excitation));
        line(0, format!("Mistaken for      {alike}"));
        line(0, format!("Would tell apart  {}", notes.would_tell_apart));
        if let Some(fault) = notes.fault_of_log {
            line(0, format!("Fault of a log    {fault}"));
        }
        line(0, format!("Source            {}", notes.source));
        let rotors =
            if definition.effect(1.0, 1.0).reads_rotors() { ", whose model file lists its rotors as [[rotor]]" } else { "" };
        line(0, format!("Vehicles          {}{rotors}", vehicles.join(", ")));
        if !notes.searched {
            line(0, "Listed only: a search leaves it out".into());
        }
    }
    text.trim_end().to_owned()
}

/// Everything about an effect, for a program.
fn described(definition: &Definition) -> Value {
    let terms = definition.terms.iter().map(|(channel, coefficient, formula)| {
        json!({ "channel": channel.name(), "unit": channel.unit(), "coefficient": coefficient, "formula": formula })
    });
    let swaps = definition.swaps.iter().map(|swap| json!({ "name": swap.name, "with": swap.with, "within": swap.within }));
    let coefficients = definition.coefficients.iter().map(|coefficient| {
        json!({ "name": coefficient.name, "unit": coefficient.unit, "meaning": coefficient.meaning, "bounds": coefficient.bounds,
            "expected": coefficient.expected, "by_flight": coefficient.by_flight })
    });
    let parameters = definition.parameters.iter().map(|parameter| {
        let origin = match parameter.origin {
            Origin::Number(number) => json!(number),
            Origin::RotorRadius => json!("rotor_radius"),
            Origin::HoverInduced => json!("hover_induced"),
        };
        json!({ "name": parameter.name, "unit": parameter.unit, "meaning": parameter.meaning, "origin": origin,
            "grid": parameter.grid, "bounds": parameter.bounds, "tied_to": parameter.tied_to })
    });
    let effect = definition.effect(1.0, 1.0);
    json!({
        "effect": definition.kind,
        "meaning": definition.meaning,
        "channels": channels(definition),
        "reads": effect.reads().iter().map(|signal| signal.name).collect::<Vec<_>>(),
        "changes": effect.changes().iter().map(|signal| signal.name).collect::<Vec<_>>(),
        "terms": terms.collect::<Vec<_>>(),
        "swaps": swaps.collect::<Vec<_>>(),
        "coefficients": coefficients.collect::<Vec<_>>(),
        "parameters": parameters.collect::<Vec<_>>(),
        "excitation": definition.notes.map(|notes| notes.excitation),
        "confusable_with": definition.notes.map(|notes| notes.confusable_with),
        "would_tell_apart": definition.notes.map(|notes| notes.would_tell_apart),
        "fault_of_log": definition.notes.and_then(|notes| notes.fault_of_log),
        "source": definition.notes.map(|notes| notes.source),
        "vehicles": definition.notes.map(|notes| notes.vehicles),
        "searched": definition.notes.is_some_and(|notes| notes.searched),
    })
}

fn add(context: &Context, id: &str, path: &Path, output: &PathBuf) -> Result<ExitCode> {
    let target = context.new_file(output, &[path])?;
    let definition = find(id)?;
    let mut model = Model::read(path)?;
    let fault = |found: String, expected: &str| {
        Err(Error::Config { place: path.display().to_string(), field: "effect".into(), found, expected: expected.into() })
    };
    if let Some(present) = model.effects.iter().find(|effect| effect.kind == id || effect.name == id) {
        let how = if present.enabled { "" } else { ", disabled" };
        return fault(format!("`{id}`{how}, already there"), "a model without it; edit its entry in the file instead");
    }
    if let Some(notes) = definition.notes.filter(|notes| !notes.vehicles.contains(&model.vehicle)) {
        let vehicles: Vec<&str> = notes.vehicles.iter().map(|vehicle| vehicle.name()).collect();
        return fault(
            format!("vehicle `{}`", model.vehicle.name()),
            &format!("one for which `{id}` makes sense: {}", vehicles.join(", ")),
        );
    }
    let effect = Effect { added_by: Some(ADDED_BY.into()), ..definition.effect(model.mass_kg, model.rotor_radius_m) };
    model.effects.push(effect.clone());
    if let Some(name) = unknown_name(&model, &effect) {
        return fault(
            format!("nothing that gives `{name}`, which `{id}` reads"),
            "the enabled effect and coefficient of that name, as the paper's baseline has it",
        );
    }
    if !model.acts(model.effects.len() - 1)?.values().contains(&true) {
        return fault(
            format!("nothing that reads {}, which `{id}` changes", names(&effect.changes())),
            "an enabled effect that does, as the paper's baseline has it",
        );
    }
    model.write(context.ready(&target)?)?;
    context.say(format!("{id} added to {}; its coefficients are 0 until `phyture calibrate`", output.display()));
    context.json(&json!({ "effect": id, "model": output }))?;
    Ok(ExitCode::SUCCESS)
}

/// A name in the effect's formulas that neither a column nor the model gives.
fn unknown_name(model: &Model, effect: &Effect) -> Option<String> {
    let known = |name: &str| standard_names().contains(&name) || signal_named(name).is_some() || model.gives(effect, name);
    effect.formulas().flat_map(|formula| formula.names()).find(|name| !known(name)).map(str::to_owned)
}
