//! What holds for every formula: any text is parsed or refused, printing and parsing are inverse, columns and single samples
//! give the same bits; and the errors a person meets.

use super::*;
use phyture_kernels::Tolerance;
use proptest::prelude::*;

const STEP_S: f64 = 0.01;

/// Random formulas over the columns `a`, `b` and the parameter `p`, fully bracketed.
fn formulas() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("a".to_owned()),
        Just("b".to_owned()),
        Just("p".to_owned()),
        (-300i32..300).prop_map(|n| format!("{:?}", f64::from(n.abs()) / 8.0)),
        (0.0..1e-3f64).prop_map(|x| format!("{x:?}")),
    ];
    leaf.prop_recursive(5, 40, 3, |inner| {
        let binary = prop::sample::select(vec!["+", "-", "*", "/", "^", "<", "<=", ">", ">="]);
        let unary = prop::sample::select(vec!["abs", "sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "sign", "rate", "-"]);
        let double = prop::sample::select(vec!["min", "max", "hypot", "atan2"]);
        prop_oneof![
            (inner.clone(), binary, inner.clone()).prop_map(|(x, op, y)| format!("({x}){op}({y})")),
            (unary, inner.clone()).prop_map(|(f, x)| format!("{f}({x})")),
            (double, inner.clone(), inner.clone()).prop_map(|(f, x, y)| format!("{f}({x}, {y})")),
            (inner.clone(), inner.clone(), inner.clone()).prop_map(|(x, y, z)| format!("clamp({x}, {y}, {z})")),
            (inner.clone(), 0.0..0.1f64).prop_map(|(x, t)| format!("lag({x}, {t:?})")),
            (inner.clone(), 0.1..90.0f64).prop_map(|(x, limit)| format!("slew({x}, {limit:?})")),
            (inner, 0.0..0.1f64).prop_map(|(x, t)| format!("delay({x}, {t:?} * p / p)")),
        ]
    })
}

/// Formulas about as long as they may be, many of which grow when printed.
pub(super) fn long_formulas() -> impl Strategy<Value = String> {
    let words = prop::sample::select(vec![
        "a",
        "b",
        "1e15",
        "9e15",
        "-2e15",
        "1e-5",
        "0.1e9",
        ".5",
        "max(a,b)",
        "(a<b)",
        "-a^-b^2",
        "rate(-(a-b))",
    ]);
    let operators = prop::sample::select(vec!["+", "-", "*", "/", "^", "-(", "*("]);
    (proptest::collection::vec((words, operators), 150..900), 100..4097_usize).prop_map(|(parts, length)| {
        let (mut text, mut open) = (String::new(), 0);
        for (word, operator) in parts {
            if text.len() + word.len() + operator.len() + open + 2 > length {
                break;
            }
            // No deeper than the parser allows.
            let operator = if open < 60 { operator } else { "+" };
            open += usize::from(operator.ends_with('('));
            text = text + word + operator;
        }
        format!("{text}a{}", ")".repeat(open))
    })
}

fn columns(samples: usize, phase: f64) -> (Vec<f64>, Vec<f64>) {
    let a = (0..samples).map(|k| (0.37 * k as f64 + phase).sin() * 3.0).collect();
    let b = (0..samples).map(|k| (0.11 * k as f64 - phase).cos()).collect();
    (a, b)
}

proptest! {
    #[test]
    fn any_text_is_a_formula_or_an_error_with_a_place(text in "[a-z0-9_+*/^(),.<>=& \\-]{0,60}|.{0,40}") {
        match Formula::parse(&text) {
            Ok(formula) => prop_assert_eq!(&Formula::parse(&formula.to_string())?, &formula),
            Err(Error::Formula { at, .. }) => prop_assert!(at <= text.chars().count()),
            Err(other) => prop_assert!(false, "{}", other),
        }
    }

    #[test]
    fn what_is_accepted_is_accepted_as_it_prints(text in long_formulas()) {
        match Formula::parse(&text) {
            Ok(formula) => {
                let printed = formula.to_string();
                let again = Formula::parse(&printed);
                prop_assert!(matches!(&again, Ok(again) if *again == formula), "{} characters, printed {}", text.len(), printed.len());
            }
            Err(Error::Formula { message, .. }) => {
                prop_assert!(message.contains("as it is written to files") || message.contains("deep"), "{message}: {text}");
            }
            Err(other) => prop_assert!(false, "{}", other),
        }
    }

    #[test]
    fn printing_and_parsing_are_inverse(text in formulas()) {
        let formula = Formula::parse(&text)?;
        let printed = formula.to_string();
        prop_assert!(printed.len() <= text.len() + 4 * text.matches(['+', '-', '*', '/', '<', '>', ',']).count());
        let again = Formula::parse(&printed)?;
        prop_assert_eq!(&again, &formula);
        prop_assert_eq!(again.to_string(), printed);
    }

    #[test]
    fn columns_and_single_samples_give_the_same_bits(text in formulas(), phase in 0.0..6.0f64, samples in 1usize..1200) {
        let formula = Formula::parse(&text)?;
        let (a, b) = columns(samples, phase);
        let whole = formula.evaluate(samples, STEP_S, &|name| match name {
            "a" => Some((&a).into()),
            "b" => Some((&b).into()),
            "p" => Some(1.25.into()),
            _ => None,
        })?;
        let mut stream = formula.stream_with(STEP_S, &|name| (name == "p").then_some(1.25))?;
        let inputs = stream.inputs().to_vec();
        for k in 0..samples {
            let sample: Vec<f64> = inputs.iter().map(|name| if name == "a" { a[k] } else { b[k] }).collect();
            let value = stream.push(&sample)?;
            prop_assert!(value.to_bits() == whole[k].to_bits() || (value.is_nan() && whole[k].is_nan()), "{} {} {}", k, value, whole[k]);
        }
        stream.reset();
        let first: Vec<f64> = inputs.iter().map(|name| if name == "a" { a[0] } else { b[0] }).collect();
        let again = stream.push(&first)?;
        prop_assert!(again.to_bits() == whole[0].to_bits() || (again.is_nan() && whole[0].is_nan()));
    }

    #[test]
    fn substitution_is_evaluation_of_the_replacement(text in formulas(), phase in 0.0..6.0f64) {
        let formula = Formula::parse(&text)?;
        let swap = Formula::parse("lag(a + b, 0.03)")?;
        let swapped = formula.substitute(&|name| (name == "b").then(|| swap.clone()))?;
        let (a, b) = columns(100, phase);
        let b_new = swap.evaluate(100, STEP_S, &|name| Some(if name == "a" { (&a).into() } else { (&b).into() }))?;
        let get = |b: &Vec<f64>| formula.evaluate(100, STEP_S, &|name| match name {
            "a" => Some(a.clone().into()),
            "b" => Some(b.clone().into()),
            _ => Some(1.25.into()),
        });
        let expected = get(&b_new)?;
        let found = swapped.evaluate(100, STEP_S, &|name| match name {
            "a" => Some((&a).into()),
            "b" => Some((&b).into()),
            _ => Some(1.25.into()),
        })?;
        for (x, y) in found.iter().zip(&expected) {
            prop_assert!(x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan()));
        }
    }
}

fn value(text: &str) -> Result<f64> {
    Ok(Formula::parse(text)?.evaluate(1, STEP_S, &|name| (name == "vx").then_some(Value::Constant(3.0)))?[0])
}

#[test]
fn precedence_is_that_of_mathematics() -> Result<()> {
    for (text, expected) in [
        ("1 + 2 * 3", 7.0),
        ("2 * 3 ^ 2", 18.0),
        ("-2^2", -4.0),
        ("2^-2 * 4", 1.0),
        ("2^3^2", 512.0),
        ("10 - 4 - 3", 3.0),
        ("24 / 4 / 2", 3.0),
        ("-vx * -2", 6.0),
        ("vx > 2 + 2", 0.0),
        ("(vx > 2) * (vx < 4)", 1.0),
        ("hypot(vx, 4)", 5.0),
        ("1e-10 * (1^2 + 2^2)", 5e-10),
        ("max(1, vx, 2)", 3.0),
    ] {
        let found = value(text)?;
        assert!((found - expected).abs() <= Tolerance::Close.relative_f64() * expected.abs().max(1e-10), "{text}: {found}");
    }
    Ok(())
}

#[test]
fn errors_point_at_the_character_and_say_what_to_do() {
    for (text, place, part) in [
        ("vx +", 4, "found the end"),
        ("", 0, "found the end"),
        ("vx vy", 3, "expected an operator"),
        ("hypot(vx)", 0, "takes 2 or more arguments, found 1"),
        ("1 + clamp(vx, 1)", 4, "takes 3 arguments, found 2"),
        ("2 * sinn(vx)", 4, "did you mean `sin`?"),
        ("(vx + 1", 7, "expected `)`"),
        ("1 < vx < 3", 7, "do not chain"),
        ("rate()", 0, "takes 1 argument, found 0"),
        ("vx $ 2", 3, "unexpected character `$`"),
        ("lag(vx, -1)", 0, "expected at least 0"),
        ("delay(vx, 1e9)", 0, "at most 60"),
        ("1 + delay(vx, vx)", 4, "must be a number or a parameter"),
        ("slew(vx, 0)", 0, "is 0 per second, expected a number or a parameter above 0"),
        ("slew(vx, vx)", 0, "varies in flight"),
    ] {
        let found = Formula::parse(text).and_then(|formula| formula.stream(STEP_S).map(|_| ()));
        match found {
            Err(Error::Formula { message, at, .. }) => {
                assert!(message.contains(part) && at == place, "`{text}`: {message} at {at}")
            }
            other => panic!("`{text}`: {other:?}"),
        }
    }
}

#[test]
fn unknown_names_are_pointed_at_with_a_suggestion() -> Result<()> {
    let formula = Formula::parse("vx + hieght * 2")?;
    let Some(Error::Formula { at, .. }) = formula.unknown_name(&|name| name == "vx") else { panic!("known") };
    assert_eq!(at, 5);
    let message = formula.check_names(&["vx", "height"]).map_err(|error| error.to_string());
    assert!(matches!(message, Err(text) if text.contains("unknown name `hieght`; did you mean `height`?")));
    Ok(())
}

#[test]
fn hostile_texts_are_refused_without_harm() {
    for text in [
        "(".repeat(4000),
        "-".repeat(4000),
        "2^".repeat(2000),
        "abs(".repeat(1000),
        "a+".repeat(5000),
        format!("{}1", "a+".repeat(2040)),
    ] {
        let parsed = Formula::parse(&text);
        assert!(parsed.is_err() || text.len() < 4096, "{}…", &text[..20]);
    }
    let long = format!("{}1", "a+".repeat(1020));
    let sum = Formula::parse(&long).and_then(|formula| formula.evaluate(1, STEP_S, &|_| Some(1.0.into())));
    assert!(matches!(sum.as_deref(), Ok([total]) if *total == 1021.0), "{sum:?}");
}

#[test]
fn the_limit_is_on_what_is_printed() {
    // 2047 characters that print as 4093 are read again; 3000 that print as 5999 were not.
    let chain = |terms: usize| format!("a{}", "+a".repeat(terms - 1));
    let printed = Formula::parse(&chain(1024)).map(|formula| formula.to_string());
    assert!(matches!(printed, Ok(printed) if printed.len() == 4093 && Formula::parse(&printed).is_ok()));
    let message = Formula::parse(&chain(1500)).map_err(|error| error.to_string());
    assert!(matches!(message, Err(text) if text.contains("5997 characters as it is written to files (2999 here)")));
    // The longest growth there is stays below what is left unlooked at.
    let grown = Formula::parse("9e15*9e15").map(|formula| formula.to_string().len());
    assert!(matches!(grown, Ok(length) if length < 8 * 9), "{grown:?}");
}

#[test]
fn a_delay_of_too_many_samples_is_refused() -> Result<()> {
    let refused = Formula::parse("delay(vx, 1)")?.stream(1e-302).map(|_| ()).map_err(|error| error.to_string());
    assert!(matches!(refused, Err(text) if text.contains("samples of 1e-302 s")));
    assert!(Formula::parse("delay(vx, 60)")?.stream(1e-5).is_ok());
    Ok(())
}

#[test]
fn names_inside_a_rate_are_told_apart() -> Result<()> {
    let formula = Formula::parse("rate(gx + k * a) + a * lag(b, 0.1) - rate(a)")?;
    assert_eq!(formula.names_outside_rates(), ["a", "b"]);
    Ok(())
}

#[test]
fn formulas_are_stored_as_text() -> std::result::Result<(), serde_json::Error> {
    let formula: Formula = serde_json::from_str("\"((vy)) * hypot( vx,vy )\"")?;
    assert_eq!(serde_json::to_string(&formula)?, "\"vy * hypot(vx, vy)\"");
    assert!(serde_json::from_str::<Formula>("\"vy *\"").is_err());
    Ok(())
}

#[test]
fn a_quoted_name_may_hold_anything_but_a_quote_and_prints_as_it_parses() -> Result<()> {
    let formula = Formula::parse("-'a.b[0]' * 'vx' + 'out 1' * abs('abs')")?;
    assert_eq!(formula.names(), ["a.b[0]", "vx", "out 1", "abs"]);
    assert_eq!(formula.to_string(), "-'a.b[0]' * vx + 'out 1' * abs(abs)");
    assert_eq!(Formula::parse(&formula.to_string())?.to_string(), formula.to_string());
    // A quoted name is no function.
    assert!(Formula::parse("'abs'(2)").is_err());
    Ok(())
}

#[test]
fn delays_of_a_model_share_what_may_be_kept() {
    let sum = |count: usize| (0..count).map(|index| format!("delay(a, {})", 50.0 + index as f64)).collect::<Vec<_>>().join(" + ");
    let formula = |count: usize| Formula::parse(&sum(count)).and_then(|formula| formula.stream(1e-5)).map(|_| ());
    assert!(formula(1).is_ok());
    let refused = formula(2).map_err(|error| error.to_string());
    assert!(matches!(&refused, Err(text) if text.contains("101 s in all") && text.contains("at most 1e7 samples")), "{refused:?}");
    let each: Vec<Formula> = [50, 51].iter().filter_map(|time| Formula::parse(&format!("delay(a, {time})")).ok()).collect();
    assert!(StreamingFormula::of_each(&each[..1], 1e-5).is_ok() && StreamingFormula::of_each(&each, 1e-5).is_err());
}
