//! Columns of numbers and texts on their way between Python and the library. Numbers cross as bytes of the machine's own `f64`, so that they keep
//! their bits and no package of arrays is needed here; what Python makes of them is in `python/phyture/_columns.py`.

use phyture::flight::Given;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;

/// Columns of text, then of numbers, by name.
pub type Table<'py> = (Vec<(String, Vec<String>)>, Vec<(String, Bound<'py, PyBytes>)>);

/// Numbers as bytes.
pub fn bytes<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyBytes>> {
    PyBytes::new_with(py, size_of_val(values), |room| {
        for (place, value) in room.chunks_exact_mut(size_of::<f64>()).zip(values) {
            place.copy_from_slice(&value.to_ne_bytes());
        }
        Ok(())
    })
}

/// Numbers as a NumPy array.
pub fn array<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    py.import("phyture._columns")?.call_method1("array_of", (bytes(py, values)?,))
}

/// A table as a pandas frame.
pub fn frame<'py>(py: Python<'py>, table: Table<'py>) -> PyResult<Bound<'py, PyAny>> {
    py.import("phyture._columns")?.call_method1("frame", (table,))
}

/// A log as Python gives it: its name, and its columns by name.
type Log = (String, Vec<(String, PyBackedBytes)>);

/// Logs of whatever Python has: frames, or mappings of names to arrays, by the name of the flight.
pub fn given(flights: &Bound<'_, PyAny>) -> PyResult<Vec<Given>> {
    let shaped = flights.py().import("phyture._columns")?.call_method1("logs", (flights,))?;
    let logs: Vec<Log> = shaped.extract()?;
    let one = |(name, columns): Log| {
        let (names, columns) = columns.into_iter().map(|(name, bytes)| (name, numbers(&bytes))).unzip();
        Given { name, names, columns }
    };
    Ok(logs.into_iter().map(one).collect())
}

fn numbers(bytes: &[u8]) -> Vec<f64> {
    let (whole, _) = bytes.as_chunks::<{ size_of::<f64>() }>();
    whole.iter().map(|bytes| f64::from_ne_bytes(*bytes)).collect()
}
