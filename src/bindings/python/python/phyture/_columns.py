"""Columns between Python's tables and the extension: numbers cross as the bytes of machine floats."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping
from typing import Any

#: Text columns, then number columns (as bytes), by name.
Table = tuple[list[tuple[str, list[str]]], list[tuple[str, bytes]]]


def _bytes(values: Any) -> bytes:
    """The bytes of numbers: of a NumPy array, a column of pandas or polars, or any sequence of numbers."""
    if hasattr(values, "to_numpy"):
        values = values.to_numpy()
    if hasattr(values, "astype"):
        return bytes(values.astype("=f8").tobytes())
    return array("d", values).tobytes()


def _named(columns: Any) -> Iterable[tuple[str, Any]]:
    """Columns by name: of a mapping, or of a frame of pandas or polars."""
    if isinstance(columns, Mapping):
        return columns.items()
    if hasattr(columns, "columns"):
        return [(name, columns[name]) for name in columns.columns]
    raise TypeError(f"columns of a flight are a mapping or a frame, not {type(columns).__name__}")


def logs(flights: Mapping[str, Any]) -> list[tuple[str, list[tuple[str, bytes]]]]:
    """What the extension takes of columns by flight."""
    return [
        (str(flight), [(str(name), _bytes(values)) for name, values in _named(columns)])
        for flight, columns in flights.items()
    ]


def array_of(data: bytes) -> Any:
    """A NumPy array of these numbers; it can be written to."""
    import numpy

    return numpy.frombuffer(data, dtype="=f8").copy()


def frame(table: Table) -> Any:
    """A pandas frame of this table; texts that repeat are categories."""
    import pandas

    texts, numbers = table
    columns: dict[str, Any] = {name: pandas.Categorical(values) for name, values in texts}
    columns.update({name: array_of(data) for name, data in numbers})
    return pandas.DataFrame(columns)
