//! Errors on their way to Python: one exception, with the library's message and the kind of error in one word. Where a message names an option of the
//! command line, Python has an argument of that name.

use pyo3::exceptions::PyException;
use pyo3::prelude::*;

pyo3::create_exception!(
    phyture,
    Error,
    PyException,
    "What the library refuses, with where, what was found and what was expected.\n\nIts attribute `kind` is one word: `io`, `cell`, `log`, \
     `config`, `formula`, `shape`, `undetermined`, `file`, `exists`, `busy`, `interrupted`, or `fault` for a fault of the library itself."
);

/// An error of the library.
pub fn raised(error: &phyture::Error) -> PyErr {
    of_kind(error.kind(), arguments(&error.to_string()))
}

/// A panic of the library, which stops here.
pub fn fault(said: &str) -> PyErr {
    of_kind("fault", format!("a fault of the library: {said}"))
}

/// A message with the names of arguments in the place of options: `lock` for `--lock`, `split_at_gaps` for `--split-at-gaps`.
fn arguments(message: &str) -> String {
    let mut parts = message.split("--");
    let mut said = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|letter: char| !(letter.is_ascii_lowercase() || letter == '-')).unwrap_or(part.len());
        let (name, rest) = part.split_at(end);
        if name.is_empty() || said.ends_with(|last: char| !(last.is_whitespace() || "`(".contains(last))) {
            said.extend(["--", part]);
            continue;
        }
        let quote = if said.ends_with('`') { "" } else { "`" };
        said.extend([quote, &name.replace('-', "_"), quote, rest]);
    }
    said
}

fn of_kind(kind: &str, message: String) -> PyErr {
    Python::attach(|py| {
        let error = Error::new_err(message);
        match error.value(py).setattr("kind", kind) {
            Ok(()) => error,
            Err(other) => other,
        }
    })
}
