"""The pieces of work, each a function: what goes into them and what comes out. They compute what the commands of the same name compute.

All take ``progress`` (see ``phyture.Progress``), run without the interpreter's lock, stop at Ctrl-C, and raise ``phyture.Error``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any, Union

from . import _phyture
from ._phyture import Flights, Model, Network
from ._progress import Progress, told
from ._results import Calibration, CheckReport, Comparison, Diagnosis, Loop, Predictions, Rollouts, Training

#: One model, several, or several by the names that they get in tables.
Models = Union[Model, Sequence[Model], Mapping[str, Model], None]
Networks = Union[Network, Sequence[Network], Mapping[str, Network], None]
Path = Union[str, "os.PathLike[str]"]

#: Seed of everything random where none is given: the paper's.
SEED = 2030


def _texts(name: str, texts: Sequence[str]) -> list[str]:
    """A list of names; a single one, which is a sequence of letters, is refused."""
    if isinstance(texts, str):
        raise TypeError(f"{name} is a list of names: [{texts!r}]")
    return list(texts)


def simulate(
    *,
    minutes: float = 30.0,
    seed: int = SEED,
    hide: Mapping[str, float] | None = None,
    level: str | None = None,
    classes: Sequence[str] | None = None,
) -> Flights:
    """Flights of the built-in truth helicopter, whose causes are known; no data are needed.

    ``hide`` is what the truth has beyond the paper's baseline, by name, with a scale (``{"weathercock": 1.0}``); without it everything that the
    simulator knows. ``level`` of disturbance and noise: ``"quiet"``, ``"0"``, ``"1"``, ``"2"``. ``flights.explainable`` is what a model could explain
    of them.
    """
    session = {"minutes": minutes, "seed": seed, "hide": None if hide is None else dict(hide), "level": level, "classes": classes}
    return _phyture.simulate(session)


def _division(lock: Sequence[str], split: str | None, seed: int) -> dict[str, Any]:
    return {"lock": _texts("lock", lock), "split": split, "seed": seed}


def _named(several: Any, kind: type, what: str) -> list[tuple[str, Any]]:
    """Models or networks by the names that they get in tables."""
    if several is None:
        return []
    if isinstance(several, kind):
        several = [several]
    if isinstance(several, Mapping):
        return list(several.items())
    named = [(one.name if isinstance(one, Model) else f"{one.model.name} + network", one) for one in several]
    if len({name for name, _ in named}) < len(named):
        raise ValueError(f"two {what} of one name; give them as a mapping, {{name: …}}")
    return named


def check(flights: Flights, model: Model | None = None, *, progress: Progress = None) -> CheckReport:
    """Conventions, timing and excitation of the flights, and the description that mends what is at fault."""
    with told(progress) as tell:
        return CheckReport(*_phyture.check(flights, model, tell))


def calibrate(
    flights: Flights,
    model: Model,
    *,
    lock: Sequence[str] = (),
    split: str | None = None,
    seed: int = SEED,
    weights: str = "rows",
    output_error: bool = False,
    horizon: int = 50,
    progress: Progress = None,
) -> Calibration:
    """Least squares of the model's coefficients on the part that trains; with ``output_error`` then on rollouts of ``horizon`` steps.

    ``lock`` names manoeuvre classes or flights that are the test part, beside those that the model locks; ``split`` (``"segments"`` or
    ``"first 0.75"``) divides flights where none is locked. ``weights="flights"`` counts the rows of every flight relative to how much it
    accelerates, so that a few wild flights do not outvote the calm ones.
    """
    with told(progress) as tell:
        division = _division(lock, split, seed)
        return Calibration(*_phyture.calibrate(flights, model, division, weights, horizon if output_error else None, tell))


def compare(
    flights: Flights,
    models: Models = None,
    networks: Networks = None,
    *,
    all: bool = False,
    stride: int | None = None,
    ridge: int | None = None,
    uncertainty: bool = False,
    explainable: Flights | None = None,
    lock: Sequence[str] = (),
    split: str | None = None,
    seed: int = SEED,
    progress: Progress = None,
) -> Comparison:
    """Measured against predicted accelerations of models and networks on the test part, beside honest yardsticks.

    ``all`` judges every flight. ``stride`` is the number of samples between judged windows (without it 1, or what lets networks take about a
    minute). ``ridge`` adds a ridge regression on so many lags, ``explainable`` the floor that no model can go below.
    """
    who = (_named(models, Model, "models"), _named(networks, Network, "networks"))
    comparing = {"all": all, "stride": stride, "ridge": ridge, "uncertainty": uncertainty}
    with told(progress) as tell:
        return Comparison(_phyture.compare(flights, who, _division(lock, split, seed), comparing, explainable, tell))


def rollout(
    flights: Flights,
    models: Models = None,
    networks: Networks = None,
    *,
    horizon: int = 50,
    stride: int = 10,
    all: bool = False,
    lock: Sequence[str] = (),
    split: str | None = None,
    seed: int = SEED,
    progress: Progress = None,
) -> Rollouts:
    """Open-loop prediction from measured states under the measured controls: errors by step, beside yardsticks.

    ``horizon`` is in steps of the log, ``stride`` in samples between starts.
    """
    who = (_named(models, Model, "models"), _named(networks, Network, "networks"))
    rolling = {"all": all, "horizon": horizon, "stride": stride}
    with told(progress) as tell:
        return Rollouts(_phyture.rollout(flights, who, _division(lock, split, seed), rolling, tell))


def diagnose(
    flights: Flights,
    model: Model | None = None,
    *,
    network: Network | None = None,
    max_effects: int | None = None,
    explainable: Flights | None = None,
    lock: Sequence[str] = (),
    split: str | None = None,
    seed: int = SEED,
    progress: Progress = None,
) -> Diagnosis:
    """Which physical effect the model lacks, and how sure that is; judged on flights that the search does not see.

    With ``network`` what that network learned is searched in place of what was measured.
    """
    searching = {"max_effects": max_effects, "formulas": False, "output": None}
    with told(progress) as tell:
        division = _division(lock, split, seed)
        return Diagnosis(*_phyture.diagnose(flights, (model, network), division, searching, explainable, tell))


def loop(
    flights: Flights,
    model: Model,
    *,
    formulas: bool = False,
    output: Path | None = None,
    explainable: Flights | None = None,
    lock: Sequence[str] = (),
    split: str | None = None,
    seed: int = SEED,
    progress: Progress = None,
) -> Loop:
    """Diagnoses, adds and calibrates until nothing worthwhile is left.

    ``formulas`` also adds formulas that the rest of the error suggests and unseen flights bear out: no physics with a name. ``output`` writes
    the model there, over what is there, and the ledger beside it.
    """
    searching = {"max_effects": None, "formulas": formulas, "output": output}
    with told(progress) as tell:
        return Loop(*_phyture.amend(flights, model, _division(lock, split, seed), searching, explainable, tell))


def _toml(config: Mapping[str, Any]) -> str:
    """A configuration as TOML: plain values, and tables one level deep. JSON writes values as TOML does."""
    plain = [f"{key} = {json.dumps(value)}" for key, value in config.items() if not isinstance(value, Mapping)]
    tables = [(key, value) for key, value in config.items() if isinstance(value, Mapping)]
    parts = [f"[{key}]\n" + "".join(f"{name} = {json.dumps(one)}\n" for name, one in value.items()) for key, value in tables]
    return "\n".join([*plain, *parts]) + "\n"


def _config(config: Mapping[str, Any] | Path | None) -> tuple[str, Path]:
    """Text of a configuration, and what errors about it name."""
    if config is None or isinstance(config, Mapping):
        return _toml(config or {}), "config"
    with open(config, encoding="utf-8") as file:
        return file.read(), config


def training_config(config: Mapping[str, Any] | Path | None = None, *, paper: bool = False) -> str:
    """The training configuration in force, as TOML with a comment at each field: ``config`` over the defaults."""
    return _phyture.training_config(*_config(config), paper)


def train(
    flights: Flights,
    model: Model,
    folder: Path,
    *,
    config: Mapping[str, Any] | Path | None = None,
    epochs: int | None = None,
    paper: bool = False,
    resume: bool = False,
    force: bool = False,
    lock: Sequence[str] = (),
    split: str | None = None,
    seed: int | None = None,
    progress: Progress = None,
) -> Training:
    """Trains the residual network of a calibrated model in a run folder; Ctrl-C saves its state there, and ``resume`` goes on.

    ``config`` is a TOML file or a mapping (``{"stride": 6, "network": {"history": 64}}``); what it leaves out fits into minutes, or with
    ``paper`` is the paper's. ``force`` lets an earlier run in the folder go.
    """
    text, place = _config(config)
    learning = {
        "config": text,
        "place": place,
        "paper": paper,
        "epochs": epochs,
        "seed": seed,
        "folder": folder,
        "resume": resume,
        "force": force,
    }
    with told(progress) as tell:
        division = _division(lock, split, SEED if seed is None else seed)
        return Training(*_phyture.train(flights, model, division, learning, tell))


def predict(
    flights: Flights,
    model: Model | None = None,
    *,
    network: Network | None = None,
    stride: int = 1,
    progress: Progress = None,
) -> Predictions:
    """Predicted accelerations for every ``stride``-th sample: of a network, where there is a full history, or of a model alone."""
    with told(progress) as tell:
        return Predictions(*_phyture.predict(flights, (model, network), stride, tell))
