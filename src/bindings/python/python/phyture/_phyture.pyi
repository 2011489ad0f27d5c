"""The extension module: what crosses the border to the library."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, final

import numpy
import pandas

_Path = str | os.PathLike[str]
_Tell = Callable[[str, int, int], Any] | None
_Table = tuple[list[tuple[str, list[str]]], list[tuple[str, bytes]]]

__version__: str

class Error(Exception):
    """What the library refuses, with where, what was found and what was expected."""

    kind: str
    """``io``, ``cell``, ``log``, ``config``, ``formula``, ``shape``, ``undetermined``, ``file``, ``exists``, ``busy``, ``interrupted``, or
    ``fault`` for a fault of the library itself."""

@final
class Flights:
    """Flights of one data set, sorted by manoeuvre and name."""

    @staticmethod
    def read(
        path: _Path,
        *,
        dataset: _Path | None = None,
        described: str | None = None,
        split_at_gaps: bool = False,
        leave_out: Sequence[str] = ...,
        minimum_rows: int = 1,
    ) -> Flights:
        """Reads flights as the command line does."""
    @staticmethod
    def from_columns(
        flights: Mapping[str, Any],
        *,
        dataset: _Path | None = None,
        described: str | None = None,
        split_at_gaps: bool = False,
        leave_out: Sequence[str] = ...,
        minimum_rows: int = 1,
    ) -> Flights:
        """Flights of columns in memory, by the name of the flight; SI units and radians."""
    def __len__(self) -> int: ...
    @property
    def names(self) -> list[str]:
        """Names of the flights, in their order."""
    @property
    def manoeuvres(self) -> list[str]:
        """Manoeuvre class of each flight."""
    @property
    def steps_s(self) -> list[float]:
        """Step of each flight, s."""
    @property
    def duration_s(self) -> float:
        """Length of all flights together, s."""
    @property
    def notes(self) -> list[str]:
        """What the reader did that a person should know."""
    @property
    def sha256(self) -> str:
        """SHA-256 over names and contents of what was read; empty for simulated flights."""
    @property
    def explainable(self) -> Flights | None:
        """What a model could explain of simulated flights; ``None`` for others."""
    def leave_out(self, names: Sequence[str]) -> Flights:
        """The same flights without those of these names, or without ``"suspects"``."""
    def write(self, folder: _Path) -> None:
        """Writes the flights as ``folder/<manoeuvre>/<flight>.csv``."""
    def column(self, flight: str, column: str) -> numpy.ndarray[Any, numpy.dtype[numpy.float64]]:
        """One column of one flight, in its unit."""
    def to_pandas(self) -> pandas.DataFrame:
        """All flights as one frame."""

@final
class Model:
    """A first-principles model of a helicopter. It never changes; another is made of it."""

    @staticmethod
    def read(path: _Path) -> Model:
        """Reads a model file (TOML)."""
    @staticmethod
    def from_toml(text: str) -> Model:
        """Reads the text of a model file."""
    @staticmethod
    def paper(name: str, mass_kg: float, inertia: Sequence[float], rotor_radius_m: float) -> Model:
        """The paper's baseline with all coefficients zero: kg, kg m², m."""
    def save(self, path: _Path) -> None:
        """Writes a model file, over what is there."""
    def to_toml(self) -> str:
        """The text of its file."""
    def with_formula(self, name: str, channel: str, formula: str, value: float = 0.0) -> Model:
        """The same model with ``coefficient * formula`` on one acceleration."""
    def without(self, name: str) -> Model:
        """The same model without one effect."""
    @property
    def name(self) -> str:
        """Its name."""
    @property
    def mass_kg(self) -> float:
        """Mass, kg."""
    @property
    def inertia(self) -> list[float]:
        """Diagonal of the inertia tensor, kg m²."""
    @property
    def rotor_radius_m(self) -> float:
        """Rotor radius, m."""
    @property
    def effects(self) -> list[dict[str, Any]]:
        """The effects in the order in which they are summed."""

@final
class Network:
    """A calibrated model with a trained residual network."""

    @staticmethod
    def read(path: _Path) -> Network:
        """Reads a run folder, or its ``network.safetensors``."""
    def save(self, path: _Path) -> None:
        """Writes its one file, with model and scales."""
    @property
    def model(self) -> Model:
        """The model that it was trained on."""
    @property
    def history(self) -> int:
        """Samples that a prediction needs."""
    @property
    def step_s(self) -> float:
        """Step of the data that it was trained on, s."""

@final
class Found:
    """What a piece of work found, before it has a shape in Python."""

    def json(self) -> str: ...
    def text(self) -> str: ...
    def figures(self) -> list[tuple[str, str, str]]: ...
    def page(self) -> str: ...

def simulate(session: dict[str, Any]) -> Flights: ...
def check(
    flights: Flights, model: Model | None, progress: _Tell
) -> tuple[Found, tuple[str, list[str], list[tuple[str, str]]] | None]: ...
def calibrate(
    flights: Flights, model: Model, division: dict[str, Any], weights: str, horizon: int | None, progress: _Tell
) -> tuple[Found, Model]: ...
def compare(
    flights: Flights,
    who: tuple[list[tuple[str, Model]], list[tuple[str, Network]]],
    division: dict[str, Any],
    comparing: dict[str, Any],
    explainable: Flights | None,
    progress: _Tell,
) -> Found: ...
def rollout(
    flights: Flights,
    who: tuple[list[tuple[str, Model]], list[tuple[str, Network]]],
    division: dict[str, Any],
    rolling: dict[str, Any],
    progress: _Tell,
) -> Found: ...
def diagnose(
    flights: Flights,
    who: tuple[Model | None, Network | None],
    division: dict[str, Any],
    searching: dict[str, Any],
    explainable: Flights | None,
    progress: _Tell,
) -> tuple[Found, Model]: ...
def amend(
    flights: Flights,
    model: Model,
    division: dict[str, Any],
    searching: dict[str, Any],
    explainable: Flights | None,
    progress: _Tell,
) -> tuple[Found, Model]: ...
def train(
    flights: Flights, model: Model, division: dict[str, Any], learning: dict[str, Any], progress: _Tell
) -> tuple[Found, Network]: ...
def predict(
    flights: Flights, who: tuple[Model | None, Network | None], stride: int, progress: _Tell
) -> tuple[Found, _Table]: ...
def training_config(text: str, place: _Path, paper: bool) -> str: ...
