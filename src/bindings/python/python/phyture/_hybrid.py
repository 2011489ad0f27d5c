"""Physics and network as one estimator, in the manner of scikit-learn, which is not needed for it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from typing import Any

from ._phyture import Flights, Model, Network
from ._progress import Progress
from ._results import CHANNELS
from ._work import SEED, calibrate, compare, predict, train


class Hybrid:
    """A calibrated model with a residual network: ``fit`` on flights, ``predict`` their accelerations, ``score`` them.

    ``model`` is a first-principles model, which ``fit`` calibrates first unless ``calibrated``. ``config`` is a training configuration as
    ``phyture.train`` takes it. With ``folder`` the run is kept there; without it nothing but the network is.

    After ``fit``: ``model_``, ``network_``, ``training_``.
    """

    def __init__(
        self,
        model: Model,
        *,
        calibrated: bool = False,
        config: Mapping[str, Any] | None = None,
        epochs: int | None = None,
        seed: int = SEED,
        folder: str | os.PathLike[str] | None = None,
        progress: Progress = None,
    ) -> None:
        self.model = model
        self.calibrated = calibrated
        self.config = config
        self.epochs = epochs
        self.seed = seed
        self.folder = folder
        self.progress = progress

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The arguments of the constructor."""
        return {name: getattr(self, name) for name in ("model", "calibrated", "config", "epochs", "seed", "folder", "progress")}

    def set_params(self, **params: Any) -> Hybrid:
        """Other arguments of the constructor."""
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise ValueError(f"no parameter {name!r}; there are {', '.join(known)}")
            setattr(self, name, value)
        return self

    def fit(self, flights: Flights, y: None = None) -> Hybrid:
        """Calibrates the model on the part of the flights that trains, and trains the network on what it leaves over."""
        model = self.model if self.calibrated else calibrate(flights, self.model, seed=self.seed).model
        if self.folder is not None:
            training = self._train(flights, model, self.folder)
        else:
            with tempfile.TemporaryDirectory() as folder:
                training = self._train(flights, model, folder)
        self.model_ = model
        self.training_ = training
        self.network_: Network = training.network
        return self

    def _train(self, flights: Flights, model: Model, folder: Any) -> Any:
        return train(
            flights, model, folder, config=self.config, epochs=self.epochs, seed=self.seed, force=True, progress=self.progress
        )

    def _fitted(self) -> Network:
        if not hasattr(self, "network_"):
            raise ValueError("this Hybrid has not been fitted; call fit first")
        return self.network_

    def predict(self, flights: Flights) -> Any:
        """Accelerations ``[rows, 6]``, m/s² and rad/s², of every sample that has a full history (needs NumPy)."""
        return predict(flights, network=self._fitted()).to_numpy()

    def score(self, flights: Flights, y: None = None) -> float:
        """Mean over the six accelerations of the coefficient of determination R², on all of these flights."""
        found = compare(flights, networks={"hybrid": self._fitted()}, all=True, seed=self.seed)
        r2 = next(model["r2"] for model in found["models"] if model["name"] == "hybrid")
        return float(sum(r2[channel] for channel in CHANNELS) / len(CHANNELS))
