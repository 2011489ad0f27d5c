//! A model as one file of C99 that needs `math.h` alone: physics for a flight computer, with the numbers of [`Model::stream`]. The layout of the
//! file, its declarations and where its columns come from; the statements are `formula/c_text`'s.

use super::compose::Composer;
use super::effect::Effect;
use super::model::Model;
use crate::error::{Error, Result};
use crate::flight::derived::Derived;
use crate::flight::{Channel, Column, GRAVITY_M_S2};
use crate::formula::c_text::{Statements, statements};
use std::fmt::Write;

/// A model in C.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CFile {
    /// The file.
    pub text: String,
    /// What its names begin with.
    pub prefix: String,
    /// Further columns of the log that it reads, in the order of the argument `own`.
    pub own_columns: Vec<String>,
    /// Whether it holds for one step alone: it remembers earlier samples, or reads the time.
    pub of_one_step: bool,
    /// Numbers that each flight has for itself, as `<effect>.<coefficient>`: the file has their values for a flight that the model does not know.
    pub by_flight: Vec<String>,
}

/// Longest prefix of names.
const LONGEST_PREFIX: usize = 40;

/// A prefix made of any name: small letters, digits and underscores, a letter first.
fn prefix_of(name: &str) -> String {
    let letter = |letter: char| if letter.is_ascii_alphanumeric() { letter.to_ascii_lowercase() } else { '_' };
    let made: String = name.chars().take(LONGEST_PREFIX).map(letter).collect();
    if made.starts_with(|first: char| first.is_ascii_lowercase()) { made } else { format!("model_{made}") }
}

/// Text of the model as it may stand in a comment: printable ASCII, and nothing that ends the comment or stands for the prefix.
fn comment(text: &str) -> String {
    let ascii = |letter: char| match letter {
        '²' => "^2".to_owned(),
        '³' => "^3".to_owned(),
        '·' => "*".to_owned(),
        '@' => "(at)".to_owned(),
        '\\' => "/".to_owned(),
        '\n' | ' '..='~' => letter.to_string(),
        _ => "?".to_owned(),
    };
    let text = text.chars().map(ascii).collect::<String>().replace("*/", "* /").replace("/*", "/ *");
    // Two question marks may begin a trigraph; once leaves two of three side by side.
    text.replace("??", "? ?").replace("??", "? ?")
}

/// The name of a variable for a column, and its value in C.
fn source(name: &str, own: &[String]) -> (String, String) {
    if let Some(column) = Column::STATE.iter().find(|column| column.name() == name) {
        return (name.to_owned(), state(*column));
    }
    if let Some(derived) = Derived::from_name(name) {
        return (name.to_owned(), derived_text(derived));
    }
    let place = own.iter().position(|own| own == name).expect("what is no standard quantity is a column of the log's own");
    (format!("own_{place}"), format!("own[{place}]"))
}

fn state(column: Column) -> String {
    format!("state[{}]", column as usize)
}

/// What [`Derived::at`] computes.
fn derived_text(derived: Derived) -> String {
    let [roll, pitch, vx, vy, vz] = [Column::Roll, Column::Pitch, Column::Vx, Column::Vy, Column::Vz].map(state);
    match derived {
        Derived::Time => "memory->start_s + R(STEP_S) * (@_real)memory->samples".into(),
        Derived::Height => format!("-{}", state(Column::Z)),
        Derived::Airspeed => format!("F(hypot)(F(hypot)({vx}, {vy}), {vz})"),
        Derived::Alpha => format!("F(atan2)({vz}, {vx})"),
        Derived::Beta => format!("F(atan2)({vy}, F(hypot)({vx}, {vz}))"),
        Derived::GravityX => format!("R({:?}) * F(sin)({pitch})", -GRAVITY_M_S2),
        Derived::GravityY => format!("R({GRAVITY_M_S2:?}) * F(cos)({pitch}) * F(sin)({roll})"),
        Derived::GravityZ => format!("R({GRAVITY_M_S2:?}) * F(cos)({pitch}) * F(cos)({roll})"),
    }
}

/// Numbers of enabled effects that differ from flight to flight.
fn by_flight(model: &Model) -> Vec<String> {
    let of = |effect: &Effect| {
        let own =
            |coefficient: &&super::effect::Coefficient| coefficient.by_flight.as_ref().is_some_and(|values| !values.is_empty());
        effect
            .coefficients
            .iter()
            .filter(own)
            .map(|coefficient| format!("{}.{}", effect.name, coefficient.name))
            .collect::<Vec<_>>()
    };
    model.effects.iter().filter(|effect| effect.enabled).flat_map(of).collect()
}

/// What the parts of the file are made of.
struct Export<'a> {
    model: &'a Model,
    made: Statements,
    step_s: Option<f64>,
    reads_time: bool,
    own: Vec<String>,
    by_flight: Vec<String>,
}

impl Model {
    /// The model as one file of C99 that needs `math.h` alone, in `double`, or in `float` where `PHYTURE_SINGLE` is defined. It says what
    /// [`Model::stream`] says, but for rounding.
    ///
    /// All its names begin with `prefix`, which is made of the model's name where it is not given. `step_s` is the time between samples; it may
    /// be left out for a model that neither remembers nor reads the time.
    ///
    /// # Errors
    /// [`Error::Config`] if the step is missing, a prefix is no name of C, or the model has a number that C has no constant for; otherwise as
    /// [`Model::stream`].
    pub fn export_c(&self, prefix: Option<&str>, step_s: Option<f64>) -> Result<CFile> {
        let fault = |field: &str, found: String, expected: &str| Error::Config {
            place: format!("model `{}` as C", self.name),
            field: field.into(),
            found,
            expected: expected.into(),
        };
        let prefix = prefix.map_or_else(|| prefix_of(&self.name), str::to_owned);
        if prefix_of(&prefix) != prefix {
            let expected = format!("small letters, digits and underscores, a letter first, at most {LONGEST_PREFIX}");
            return Err(fault("prefix", format!("`{prefix}`"), &expected));
        }
        // Whatever a stream refuses is refused here, too. What needs no step has the same statements at any.
        let any_s = step_s.unwrap_or(1.0);
        let own = self.stream(any_s)?.extra_inputs().to_vec();
        let mut composer = Composer::new();
        let channels = composer.add(self, None, false)?.channels;
        let made = statements(&composer.graph, channels.values(), any_s, &|name| source(name, &own))
            .map_err(|message| fault("number", message, "finite numbers"))?;
        let reads_time = channels.iter().any(|channel| composer.graph.reads(*channel).contains(&Derived::Time.name()));
        let of_one_step = reads_time || !made.members.is_empty();
        if of_one_step && step_s.is_none() {
            let expected = "the time between samples (`--hz`): the model remembers earlier samples or reads the time, and holds for one step alone";
            return Err(fault("step", "not given".into(), expected));
        }
        let export =
            Export { model: self, made, step_s: step_s.filter(|_| of_one_step), reads_time, own, by_flight: by_flight(self) };
        let text = export.file().replace("@^", &prefix.to_ascii_uppercase()).replace('@', &prefix);
        Ok(CFile { text, prefix, own_columns: export.own, of_one_step, by_flight: export.by_flight })
    }
}

impl Export<'_> {
    fn file(&self) -> String {
        let mut text = self.introduction();
        self.declarations(&mut text);
        self.definitions(&mut text);
        text
    }

    /// What a person has to know, as a comment.
    fn introduction(&self) -> String {
        let mut text =
            format!("Predicted accelerations of the model \"{}\": physics alone, no network.\n", comment(&self.model.name));
        // Writing to a String does not fail.
        let _ = writeln!(text, "Written by phyture {}.\n", env!("CARGO_PKG_VERSION"));
        text.push_str(
            "C99, needs math.h alone. Numbers are double; where PHYTURE_SINGLE is defined for all that includes this file, float.\n\
             Compile it once as it is. Elsewhere define @^_DECLARATIONS and include it: that gives the declarations alone.\n\
             Compile without -ffast-math and the like: minima and limits look for numbers that are none.\n\n",
        );
        match self.step_s {
            Some(step_s) => {
                let _ = writeln!(text, "Samples have to come {step_s:?} s apart, none left out.");
            }
            None => text.push_str("Samples may come at any time: nothing is remembered.\n"),
        }
        text.push_str("States have to be finite numbers. SI units and radians; north-east-down, body axes nose-starboard-down.\n");
        if !self.by_flight.is_empty() {
            let names = comment(&self.by_flight.join(", "));
            let _ = writeln!(text, "Numbers that each flight has for itself are those of an unknown flight: {names}.");
        }
        text.push_str("\nEffects, with their numbers:\n");
        for effect in self.model.effects.iter().filter(|effect| effect.enabled) {
            let _ = writeln!(text, "\n  {}: {}", comment(&effect.name), comment(&effect.meaning));
            for line in effect.to_string().lines() {
                let _ = writeln!(text, "    {}", comment(line));
            }
        }
        let lines: Vec<String> = text.lines().map(|line| format!(" * {line}").trim_end().to_owned()).collect();
        format!("/*\n{}\n */\n\n", lines.join("\n"))
    }

    fn signatures(&self) -> [String; 2] {
        let start = if self.reads_time { ", @_real start_s" } else { "" };
        let own = if self.own.is_empty() { String::new() } else { format!(", const @_real own[{}]", self.own.len()) };
        [
            format!("void @_reset(@_memory *memory{start})"),
            format!(
                "void @_step(@_memory *memory, const @_real state[{}]{own}, @_real acceleration[{}])",
                Column::STATE.len(),
                Channel::COUNT
            ),
        ]
    }

    /// The part that stands for a header.
    fn declarations(&self, text: &mut String) {
        let [reset, step] = self.signatures();
        let named = |names: &mut dyn Iterator<Item = String>| comment(&names.collect::<Vec<_>>().join(", "));
        let states = named(&mut Column::STATE.iter().map(|column| format!("{} {}", column.name(), column.unit())));
        let channels = named(&mut Channel::ALL.into_iter().map(|channel| format!("{channel} {}", channel.unit())));
        let own = named(&mut self.own.iter().cloned());
        text.push_str(
            "#ifndef @^_DECLARED\n#define @^_DECLARED\n\n#ifdef PHYTURE_SINGLE\ntypedef float @_real;\n#else\ntypedef double @_real;\n#endif\n\n",
        );
        text.push_str("/* What is remembered from sample to sample. */\ntypedef struct {\n    int started;\n");
        if self.reads_time {
            text.push_str("    unsigned long samples;\n    @_real start_s;\n");
        }
        self.made.members.iter().flat_map(|member| member.lines()).for_each(|line| {
            let _ = writeln!(text, "    {line}");
        });
        text.push_str("} @_memory;\n\n#ifdef __cplusplus\nextern \"C\" {\n#endif\n\n");
        let at = if self.reads_time { ", at time start_s in s" } else { "" };
        let _ =
            writeln!(text, "/* Starts anew: the next sample is the first one{at}. To be called once before @_step. */\n{reset};\n");
        let _ = writeln!(text, "/* Takes the next sample and predicts its accelerations.\n *\n * state: {states}.");
        if !self.own.is_empty() {
            let _ = writeln!(text, " * own, as logged: {own}.");
        }
        let _ = writeln!(text, " * acceleration: {channels}. */\n{step};");
        text.push_str("\n#ifdef __cplusplus\n}\n#endif\n\n#endif\n\n");
    }

    fn definitions(&self, text: &mut String) {
        let [reset, step] = self.signatures();
        text.push_str("#ifndef @^_DECLARATIONS\n\n#include <math.h>\n\n#define R(number) ((@_real)(number))\n");
        text.push_str("#ifdef PHYTURE_SINGLE\n#define F(function) function##f\n#else\n#define F(function) function\n#endif\n");
        if let Some(step_s) = self.step_s.filter(|_| self.reads_time) {
            let _ = writeln!(text, "#define STEP_S {step_s:?}");
        }
        text.push('\n');
        self.made.helpers.iter().for_each(|helper| {
            let _ = writeln!(text, "{}", helper.definition());
        });
        if !self.made.fits_single {
            text.push_str("#ifdef PHYTURE_SINGLE\n#error a number of this model is too large or too small for float\n#endif\n\n");
        }
        let _ = writeln!(text, "{reset}\n{{\n    memory->started = 0;");
        if self.reads_time {
            text.push_str("    memory->samples = 0;\n    memory->start_s = start_s;\n");
        }
        let _ = writeln!(text, "}}\n\n{step}\n{{");
        if !self.made.members.is_empty() {
            text.push_str("    const int first = !memory->started;\n");
        }
        self.made.lines.iter().for_each(|line| {
            let _ = writeln!(text, "    {line}");
        });
        for (channel, value) in Channel::ALL.into_iter().zip(&self.made.roots) {
            let _ = writeln!(text, "    acceleration[{}] = {value};", channel.index());
        }
        text.push_str("    memory->started = 1;\n");
        if self.reads_time {
            text.push_str("    memory->samples++;\n");
        }
        text.push_str("}\n\n#undef R\n#undef F\n");
        if self.reads_time {
            text.push_str("#undef STEP_S\n");
        }
        text.push_str("\n#endif\n");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_name_makes_a_prefix_and_no_comment_ends_early() {
        for (name, prefix) in [("N9 heli", "n9_heli"), ("9x", "model_9x"), ("", "model_"), ("_a", "model__a"), ("Größe", "gr__e")]
        {
            assert_eq!(prefix_of(name), prefix);
            assert_eq!(prefix_of(prefix), prefix, "{prefix}");
        }
        assert_eq!(comment("a */ b /*/ ???/ c *\\ @ m/s²\u{7}"), "a * / b / * / ? ? ?/ c * / (at) m/s^2?");
    }

    #[test]
    fn a_step_is_asked_for_where_the_model_holds_for_one_alone() -> Result<()> {
        let mut model = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8);
        let file = model.export_c(None, None)?;
        assert!(!file.of_one_step && file.prefix == "n9" && file.text.contains("void n9_step("));
        assert!(!file.text.contains('@') && !file.text.contains("int first"), "{}", file.text);
        let refused = |model: &Model, prefix: Option<&str>, step_s: Option<f64>| {
            model.export_c(prefix, step_s).map_err(|error| error.to_string()).err().unwrap_or_default()
        };
        assert!(refused(&model, Some("No"), None).contains("`prefix` is `No`, expected small letters"));
        model.data.control_delay_s = 0.02;
        assert!(refused(&model, None, None).contains("`step` is not given, expected the time between samples (`--hz`)"));
        assert!(refused(&model, None, Some(0.0)).contains("expected a positive, finite step"));
        assert!(model.export_c(None, Some(0.01))?.of_one_step);
        model.data.control_delay_s = 0.0;
        model.effects.push(Effect::formula("clock", Channel::WzDot, "sin(t)", 1.0)?);
        assert!(refused(&model, None, None).contains("reads the time"));
        model.effects.push(Effect::formula("endless", Channel::WzDot, "vx * (1 / 0)", 1.0)?);
        assert!(refused(&model, None, Some(0.01)).contains("`number` is inf, which C has no constant for"));
        Ok(())
    }
}
