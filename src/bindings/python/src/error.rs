//! Errors on their way to Python: one exception, with the library's message and the kind of error in one word.

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
    of_kind(error.kind(), error.to_string())
}

/// A panic of the library, which stops here.
pub fn fault(said: &str) -> PyErr {
    of_kind("fault", format!("a fault of the library: {said}"))
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
