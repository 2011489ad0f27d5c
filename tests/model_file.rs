//! The model file: what it means, that it reads back as written, and how it refuses.
#![cfg(feature = "files")]

use phyture::flight::Channel;
use phyture::physics::{Assumed, Correlation, Effect, Entry, Model, Parameter};
use phyture::{Error, Result};
use proptest::prelude::*;
use std::path::Path;

fn parse(text: &str) -> Result<Model> {
    Model::from_toml(text, Path::new("n9.toml"))
}

/// The message of an error that must be there.
fn message<T>(result: Result<T>) -> Result<String> {
    match result {
        Ok(_) => Err(Error::Undetermined("an error was expected".into())),
        Err(error) => Ok(error.to_string()),
    }
}

/// The example of the documentation.
const EXAMPLE: &str = r#"
[model]
name    = "n9"
mass_kg = 4.58
inertia = [0.18, 0.34, 0.28]      # diagonal; ratios matter
rotor_radius_m = 0.80
baseline = "paper"

[data]
control_delay_s = 0.005
locked = ["turn_demos1", "chaos"]

[[effect]]
kind = "linear_drag"
coefficients = { a_x = -0.05, a_y = -0.06, a_z = -1.42 }
ci95 = { a_z = [-1.5, -1.4] }
added_by = "diagnose"

[[effect]]
kind = "moment_bias"
enabled = false

[[effect]]
kind    = "formula"
name    = "my_blowback"
channel = "wx_dot"
formula = "vy * hypot(vx, vy)"
coefficient = 0.0

[[effect]]
kind = "formula"
name = "ground"
channel = "vz_dot"
formula = "u4 * (radius_m / (4 * max(height, 0.1)))^2"
parameters = { radius_m = 0.8 }
unit = "m/s²"

[provenance]
data_sha256 = "abc"
seed = 7
rmse = { before = { mean = 1.5 }, after = { mean = 0.25 } }
when = 2024-05-01
"#;

#[test]
fn a_file_means_what_it_says() -> Result<()> {
    let model = parse(EXAMPLE)?;
    assert_eq!((model.name.as_str(), model.effects.len()), ("n9", 11));
    assert_eq!(model.data.control_delay_s.to_bits(), 0.005_f64.to_bits());
    assert_eq!(model.data.locked, ["turn_demos1", "chaos"]);
    let drag = model.effect("linear_drag").ok_or_else(|| Error::Undetermined("no drag".into()))?;
    assert_eq!(drag.coefficient("a_z").map(|c| (c.value, c.ci95)), Some((-1.42, Some([-1.5, -1.4]))));
    assert_eq!(drag.added_by.as_deref(), Some("diagnose"));
    assert_eq!(
        model.effects.iter().filter(|effect| !effect.enabled).map(|effect| effect.name.as_str()).collect::<Vec<_>>(),
        ["moment_bias"]
    );
    assert_eq!(
        model.effect("my_blowback").map(ToString::to_string).as_deref(),
        Some("wx_dot += 0 rad/s² per unit * (vy * hypot(vx, vy))")
    );
    assert_eq!(model.provenance.get("seed"), Some(&Entry::Integer(7)));
    assert_eq!(parse(&model.to_toml()?)?, model);
    Ok(())
}

#[test]
fn a_model_table_alone_is_complete() -> Result<()> {
    let model = parse("[model]\nbaseline = \"paper\"\n")?;
    let paper = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8);
    assert_eq!(model, Model { assumed: Assumed::ALL, ..paper }, "the vehicle is assumed, and marked so");
    let text = model.to_toml()?;
    assert!(text.contains("# mass_kg = 4.58    # assumed"), "{text}");
    assert_eq!(parse(&text)?, model, "what was assumed is not written as if it were known");
    assert!(parse("[model]\n")?.effects.is_empty());
    Ok(())
}

#[test]
fn faults_are_refused_with_line_found_and_expected() -> Result<()> {
    let effect = |lines: &str| format!("[model]\nbaseline = \"paper\"\n\n[[effect]]\n{lines}\n");
    for (text, parts) in [
        ("[model]\nmas_kg = 4.58\n".to_owned(), vec!["n9.toml, line 2", "`model.mas_kg`", "did you mean `mass_kg`?"]),
        ("[modell]\n".into(), vec!["line 1", "did you mean `model`?"]),
        ("[model]\nbaseline = \"papers\"\n".into(), vec!["line 2", "did you mean `paper`?"]),
        ("[model]\nmass_kg = \"heavy\"\n".into(), vec!["`model.mass_kg` is the text \"heavy\", expected a finite number"]),
        ("[model]\nmass_kg = -1\n".into(), vec!["n9.toml", "mass_kg", "positive"]),
        (
            "[model]\nname = \"heli\"\nmass_kg = 4580\n".into(),
            vec!["n9.toml, line 3", "0.001 to 1000 kg", "looks like grams: 4.58 kg?"],
        ),
        ("[model]\nrotor_radius_m = 800\n".into(), vec!["line 2", "looks like millimetres: 0.8 m?"]),
        ("[model]\ninertia = [0.18, 0.34, 0.6]\n".into(), vec!["line 2", "about z no more than about x and y together"]),
        ("[model]\ninertia = [1, 2]\n".into(), vec!["`model.inertia`", "a list of 3 numbers"]),
        ("[model]\nmass_kg = = 2\n".into(), vec!["n9.toml", "line 2", "TOML"]),
        ("[data]\ncontrol_delay_s = 0.0\n".into(), vec!["a table `[model]`"]),
        ("[model]\n[data]\ncontrol_delay_s = -0.01\n".into(), vec!["data.control_delay_s", "cannot act before its control"]),
        ("[model]\n[data]\nlocked = \"chaos\"\n".into(), vec!["line 3", "a list of texts"]),
        (effect("kind = \"linear_darg\""), vec!["line 5", "did you mean `linear_drag`?"]),
        (effect("name = \"x\""), vec!["line 5", "`effect.kind`"]),
        (effect("kind = \"linear_drag\"\ncoefficients = { a_w = 1.0 }"), vec!["`effect.coefficients.a_w`", "did you mean `a_x`?"]),
        (effect("kind = \"linear_drag\"\ncoefficient = 1.0"), vec!["`effect.coefficient`", "did you mean `coefficients`?"]),
        (effect("kind = \"linear_drag\"\nci95 = { a_x = [2.0, 1.0] }"), vec!["`effect.ci95.a_x`", "the lower end first"]),
        (
            effect("kind = \"formula\"\nname = \"gravity\"\nchannel = \"vx_dot\"\nformula = \"vx\""),
            vec!["line 6", "the name of an effect of the baseline"],
        ),
        (
            effect("kind = \"formula\"\nname = \"f\"\nchannel = \"vx_dot\"\nformula = \"vx\"\nparameters = { vy = 1.0 }"),
            vec!["`f.vy`", "a parameter with the name of a column"],
        ),
        (effect("kind = \"gravity\"\n[[effect]]\nkind = \"gravity\""), vec!["a second effect `gravity`"]),
        (
            effect("kind = \"formula\"\nname = \"f\"\nchannel = \"wx_dott\"\nformula = \"vx\""),
            vec!["line 7", "did you mean `wx_dot`?"],
        ),
        (effect("kind = \"formula\"\nname = \"f\"\nchannel = \"wx_dot\""), vec!["`effect.formula`"]),
        (
            effect("kind = \"formula\"\nname = \"f\"\nchannel = \"wx_dot\"\nformula = \"vy * hypot(vx vy)\""),
            vec!["n9.toml, line 8, effect `f`: expected `)`", "vy * hypot(vx vy)\n                ^"],
        ),
        (
            effect("kind = \"formula\"\nname = \"f\"\nchannel = \"wx_dot\"\nformula = \"wx_dot\""),
            vec!["line 8", "cannot be an input"],
        ),
    ] {
        let found = message(parse(&text))?;
        assert!(parts.iter().all(|part| found.contains(part)), "{text}\n=> {found}\nlacks one of {parts:?}");
    }
    Ok(())
}

#[test]
fn what_a_file_cannot_hold_is_not_written() -> Result<()> {
    let mut model = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8);
    let mut two = Effect::formula("two", Channel::VxDot, "vx", 1.0)?;
    two.terms.push(two.terms[0].clone());
    model.effects.push(two);
    let text = message(model.to_toml())?;
    assert!(text.contains("effect `two`") && text.contains("one formula with one coefficient"), "{text}");
    Ok(())
}

#[test]
fn files_are_written_in_one_step_and_missing_ones_are_named() -> Result<()> {
    let folder = tempfile::tempdir().map_err(Error::io("a temporary folder"))?;
    let path = folder.path().join("n9.toml");
    let model = parse(EXAMPLE)?;
    model.write(&path)?;
    assert_eq!(Model::read(&path)?, model);
    let left = std::fs::read_dir(folder.path()).map_err(Error::io(folder.path()))?.count();
    assert_eq!(left, 1);
    assert!(message(Model::read(folder.path().join("none.toml")))?.contains("none.toml"));
    Ok(())
}

/// Any provenance that a file can hold; empty tables and mixed lists included.
fn entries() -> impl Strategy<Value = Entry> {
    let leaf = prop_oneof![
        ".{0,12}".prop_map(Entry::Text),
        any::<i64>().prop_map(Entry::Integer),
        prop::num::f64::NORMAL.prop_map(Entry::Number),
        any::<bool>().prop_map(Entry::Boolean),
    ];
    leaf.prop_recursive(3, 12, 3, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..3).prop_map(Entry::List),
            prop::collection::btree_map(".{0,8}", inner, 0..3).prop_map(Entry::Table),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn models_read_back_as_written(
        name in ".{0,12}",
        numbers in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::ZERO, 14),
        enabled in prop::collection::vec(any::<bool>(), 10),
        half_width in 0.0..1e3f64,
        provenance in prop::collection::btree_map("[a-z_]{1,6}|.{1,6}", entries(), 0..4),
        locked in prop::collection::vec(".{0,6}", 0..3),
        mass_kg in 1e-3..1e3f64,
    ) {
        let mut model = Model::paper(name.clone(), mass_kg, [0.1, 0.2, 0.8 / 3.0], 0.8);
        let mut own = Effect::formula(format!("own {name}"), Channel::WzDot, "lag(vx, tau_s)^2 - -3e-7 * vy", -0.1)?;
        own.parameters.push(Parameter { name: "tau_s".into(), value: half_width, unit: String::new(), fixed: true, ci95: None });
        own.added_by = Some(name);
        model.effects.push(own);
        let coefficients = model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients);
        for (coefficient, value) in coefficients.zip(&numbers) {
            coefficient.value = *value;
            coefficient.ci95 = (*value > 0.0).then_some([value - half_width, value + half_width]).filter(|ends| ends.iter().all(|end| end.is_finite()));
        }
        for (effect, enabled) in model.effects.iter_mut().zip(enabled) {
            effect.enabled = enabled;
        }
        (model.provenance, model.data.locked) = (provenance, locked);
        prop_assert_eq!(parse(&model.to_toml()?)?, model);
    }

    #[test]
    fn any_text_is_a_model_or_an_error(text in ".{0,60}|\\[model\\]\n[a-z_]{1,8} = [0-9\\[\\]{}\".a-z]{0,12}\n") {
        let _ = parse(&text);
    }
}

/// A file of an earlier format is read where it means the same, and refused with the reason where it does not.
#[test]
fn numbers_found_for_another_formula_are_refused() {
    let read = |format: &str, effect: &str| {
        let text = format!("[model]\n{format}\nbaseline = \"paper\"\n\n[[effect]]\n{effect}\n");
        Model::from_toml(&text, Path::new("old.toml")).map_err(|error| error.to_string())
    };
    let droop = "kind = \"rotor_droop\"\ncoefficients = { k = -0.1 }";
    let inflow = "kind = \"inflow_lag\"\nparameters = { tau_s = 0.08, overshoot = 0.3 }";
    let wind = "kind = \"weathercock\"\ncoefficients = { k_fin = 0.03 }";
    for format in ["", "format = 2", "format = 3", "format = 4"] {
        assert!(read(format, wind).is_ok(), "{format}");
    }
    assert!(read("format = 3", droop).is_ok() && read("format = 2", "kind = \"rotor_droop\"").is_ok());
    assert!(read("format = 3", inflow).is_ok() && read("format = 2", "kind = \"inflow_lag\"").is_ok());
    for (format, effect, name) in
        [("", droop, "rotor_droop"), ("format = 2", droop, "rotor_droop"), ("format = 2", inflow, "inflow_lag")]
    {
        let refused = read(format, effect).err().unwrap_or_default();
        assert!(refused.contains(&format!("numbers of `{name}`")) && refused.contains("phyture calibrate"), "{refused}");
    }
    // A falling mass alone beside the baseline means what it did: the baseline's moments do not read the thrust.
    let mass = "kind = \"mass_drift\"\ncoefficients = { k = 0.001 }";
    let both = format!("{mass}\n\n[[effect]]\n{wind}");
    assert!(read("format = 3", mass).is_ok() && read("format = 4", &both).is_ok());
    let own = format!("{mass}\n\n[[effect]]\nkind = \"formula\"\nname = \"own\"\nchannel = \"wz_dot\"\nformula = \"thrust\"");
    for format in ["format = 2", "format = 3"] {
        for beside in [&both, &own] {
            let refused = read(format, beside).err().unwrap_or_default();
            assert!(refused.contains("numbers of `mass_drift`, found beside others"), "{refused}");
        }
    }
    assert!(read("format = 5", wind).err().is_some_and(|refused| refused.contains("1 to 4")));
}

/// Correlations are kept beside the intervals, and read back as they were written.
#[test]
fn correlations_are_kept_in_the_file() -> Result<()> {
    let mut model = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8);
    let numbers = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    model.correlations = vec![
        Correlation { numbers: numbers(&["linear_drag.a_x", "my \"own\".k", "vertical_bias.d_z"]), below: vec![0.5, -0.25, 1.0] },
        Correlation { numbers: numbers(&["moment_bias.d_x", "control_moment.c_x"]), below: vec![-0.9876] },
    ];
    let text = model.to_toml()?;
    assert!(text.contains("below = [\n    0.5,\n    -0.25, 1.0,\n]"), "{text}");
    assert_eq!(parse(&text)?.correlations, model.correlations);
    for (given, part) in
        [("0.5", "one number for each pair"), ("0.5, 1.0, 2.0", "from -1 to 1"), ("\"a\"", "a list of finite numbers")]
    {
        let group = format!("[model]\n[[correlation]]\nnumbers = [\"a.x\", \"b.y\", \"c.z\"]\nbelow = [{given}]\n");
        assert!(message(parse(&group))?.contains(part), "{given}");
    }
    Ok(())
}
