//! Model files and formulas: what is accepted is written so that it reads back the same, and gives the same bits in a batch and in a stream.

use super::{STEP_S, check_error, flight, same_bits};
use phyture::formula::{Formula, Value};
use phyture::physics::Model;
use std::path::Path;

/// Samples that a formula is evaluated on, numbers at the edges among them.
const SAMPLES: [f64; 8] = [0.5, -1.0, 0.0, 3.0e8, -0.0, f64::MAX, f64::MIN_POSITIVE, f64::NAN];

/// A formula, its names taken as columns and as parameters.
pub fn formula(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let formula = match Formula::parse(text) {
        Ok(formula) => formula,
        Err(phyture::Error::Formula { at, .. }) => {
            assert!(at <= text.chars().count(), "a place behind the formula");
            return false;
        }
        Err(other) => panic!("an error without a place: {other}"),
    };
    let printed = formula.to_string();
    let again = Formula::parse(&printed).expect("what is printed can be read");
    assert!(again == formula && again.to_string() == printed, "{printed} comes back as {again}");
    let _ = formula.evaluate(SAMPLES.len(), STEP_S, &|_| Some(Value::from(0.25)));
    let batch = formula.evaluate(SAMPLES.len(), STEP_S, &|_| Some(Value::from(&SAMPLES[..])));
    let stream = formula.stream(STEP_S);
    assert_eq!(batch.is_ok(), stream.is_ok(), "accepted in one form only");
    let (Ok(batch), Ok(mut stream)) = (batch, stream) else { return true };
    let count = stream.inputs().len();
    let pushed: Vec<f64> =
        SAMPLES.iter().map(|value| stream.push(&vec![*value; count]).expect("a number for each input")).collect();
    assert!(same_numbers(&batch, &pushed), "{printed}: {batch:?} in a batch and {pushed:?} in a stream");
    true
}

/// Bits, but for those of what is no number.
fn same_numbers(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| same_bits(&[*a], &[*b]) || (a.is_nan() && b.is_nan()))
}

/// A model file: read, written, streamed, and exported as C.
pub fn model(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let path = Path::new("model.toml");
    let model = match Model::from_toml(text, path) {
        Ok(model) => model,
        Err(error) => return check_error(&error, &["model.toml"]),
    };
    let written = model.to_toml().expect("what was read can be written");
    let again = Model::from_toml(&written, path).expect("what was written can be read");
    assert!(again == model, "another model comes back:\n{written}");
    let _ = model.export_c(None, Some(STEP_S));
    let Ok(mut stream) = model.stream(STEP_S) else { return true };
    let own = vec![0.5; stream.extra_inputs().len()];
    let flight = flight();
    let streamed: Vec<_> = (0..3).map(|sample| stream.push_with(&flight.state(sample), &own)).collect();
    // A stream knows no flight, so it has none of the numbers that belong to one.
    let Ok(predicted) = model.of_unknown_flights().predict(flight) else { return true };
    for (sample, streamed) in streamed.into_iter().enumerate().filter(|_| own.is_empty()) {
        let Ok(streamed) = streamed else { continue };
        let batch = predicted.values().iter().map(|column| column[sample]).collect::<Vec<_>>();
        assert!(same_numbers(&batch, streamed.values()), "{batch:?} in a batch and {streamed:?} in a stream");
    }
    true
}
