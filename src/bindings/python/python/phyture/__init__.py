"""phyture: calibrate a first-principles model of an unmanned helicopter on recorded flights, see where it fails, learn the rest.

    import phyture

    flights = phyture.Flights.read("flights")
    model = phyture.calibrate(flights, phyture.Model.read("model.toml")).model
    print(phyture.compare(flights, model))

Everywhere: SI units and radians; north-east-down local frame, body axes nose-starboard-down.
"""

from ._hybrid import Hybrid
from ._phyture import Error, Flights, Model, Network, __version__
from ._progress import Progress
from ._results import (
    CHANNELS,
    Calibration,
    CheckReport,
    Comparison,
    Diagnosis,
    Loop,
    Predictions,
    Result,
    Rollouts,
    Svg,
    Training,
)
from ._work import (
    calibrate,
    check,
    compare,
    diagnose,
    loop,
    predict,
    rollout,
    simulate,
    train,
    training_config,
)

__all__ = [
    "CHANNELS",
    "Calibration",
    "CheckReport",
    "Comparison",
    "Diagnosis",
    "Error",
    "Flights",
    "Hybrid",
    "Loop",
    "Model",
    "Network",
    "Predictions",
    "Progress",
    "Result",
    "Rollouts",
    "Svg",
    "Training",
    "__version__",
    "calibrate",
    "check",
    "compare",
    "diagnose",
    "loop",
    "predict",
    "rollout",
    "simulate",
    "train",
    "training_config",
]
