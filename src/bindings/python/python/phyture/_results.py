"""Results: the document that the command line writes, and what it looks like in Python."""

from __future__ import annotations

import json
from html import escape
from typing import TYPE_CHECKING, Any

from ._columns import Table, frame
from ._phyture import Found, Model, Network

if TYPE_CHECKING:
    import pandas

CHANNELS = ("vx_dot", "vy_dot", "vz_dot", "wx_dot", "wy_dot", "wz_dot")


class Svg(str):
    """A figure as SVG text, which a notebook shows as a picture."""

    def _repr_svg_(self) -> str:
        return str(self)


class Result:
    """What a piece of work found.

    ``str(result)`` is a text for a person, as the command line shows one; ``result.to_dict()`` is the document that it writes with ``--json``,
    to the bit; ``result["rmse"]`` is a part of that.
    """

    def __init__(self, found: Found) -> None:
        self._found = found
        self._dict: dict[str, Any] | None = None

    def to_dict(self) -> dict[str, Any]:
        """The document of the command line's ``--json``, anew with every call."""
        document: dict[str, Any] = json.loads(self._found.json())
        return document

    def to_json(self) -> str:
        """The same as text, byte for byte."""
        return self._found.json()

    def __getitem__(self, key: str) -> Any:
        if self._dict is None:
            self._dict = self.to_dict()
        return self._dict[key]

    def __str__(self) -> str:
        return self._found.text()

    def __repr__(self) -> str:
        return f"<phyture.{type(self).__name__}>"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"


class _Tabled(Result):
    """A result with a table."""

    def _rows(self) -> list[dict[str, Any]]:
        """The table, row by row."""
        raise NotImplementedError

    def to_pandas(self) -> pandas.DataFrame:
        """The table of this result as a frame (needs pandas)."""
        import pandas

        table: pandas.DataFrame = pandas.DataFrame(self._rows())
        return table

    def _lead(self) -> str:
        """One or two sentences that stand above the table."""
        return ""

    def _repr_html_(self) -> str:
        rows = self._rows()
        if not rows:
            return super()._repr_html_()
        names = list(dict.fromkeys(name for row in rows for name in row))
        head = "".join(f"<th>{escape(name)}</th>" for name in names)
        body = "".join("<tr>" + "".join(f"<td>{escape(_cell(row.get(name)))}</td>" for name in names) + "</tr>" for row in rows)
        lead = self._lead()
        return (f"<p>{escape(lead)}</p>" if lead else "") + f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


class _Drawn(_Tabled):
    """A result with figures, which are drawn when they are asked for."""

    def figures(self) -> dict[str, Svg]:
        """All figures as SVG, by name, in the order of the page."""
        return {name: Svg(svg) for name, svg, _ in self._found.figures()}

    def svg(self, name: str | None = None) -> Svg:
        """One figure as SVG, by its name or a part of it; the first without."""
        figures = self.figures()
        found = [figure for known, figure in figures.items() if name is None or name in known]
        if not found:
            raise KeyError(f"no figure `{name}`; there are {', '.join(figures)}")
        return found[0]

    def data(self, name: str) -> str:
        """What is drawn in a figure, as CSV."""
        found = [csv for known, _, csv in self._found.figures() if name in known]
        if not found:
            raise KeyError(f"no figure `{name}`")
        return found[0]

    def page(self) -> str:
        """The page of the command line's ``--report``: HTML that loads nothing."""
        return self._found.page()

    def save_page(self, path: Any) -> None:
        """Writes the page."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.page())


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(_cell(part) for part in value)
    return str(value)


def _values(values: dict[str, Any]) -> dict[str, Any]:
    """Values by channel and their mean, in the order of the channels."""
    return {name: values.get(name) for name in (*CHANNELS, "mean")}


class CheckReport(_Tabled):
    """What ``check`` says of a log. ``fault`` is whether a convention is wrong; nothing that follows would mean anything then."""

    def __init__(self, found: Found, suggested: tuple[str, list[str], list[tuple[str, str]]] | None) -> None:
        super().__init__(found)
        #: Text of a ``dataset.toml`` that mends what is at fault; ``None`` where nothing is, or nothing can be mended so.
        self.suggestion: str | None = suggested[0] if suggested and suggested[1] else None
        #: What that text mends, by name of the finding.
        self.mends: list[str] = suggested[1] if suggested else []
        #: What is left to a person: name of the finding, reason.
        self.open: list[tuple[str, str]] = suggested[2] if suggested else []

    @property
    def fault(self) -> bool:
        return bool(self["fault"])

    def _lead(self) -> str:
        return str(self["summary"])

    def _rows(self) -> list[dict[str, Any]]:
        kept = ("subject", "name", "verdict", "measured", "expected", "unit", "message", "set")
        return [{key: finding.get(key) for key in kept} for finding in self["findings"]]


class Calibration(_Tabled):
    """A calibrated model (``model``), its numbers with 95 % intervals, and its errors by part (``rmse``, m/s² and rad/s²)."""

    def __init__(self, found: Found, model: Model) -> None:
        super().__init__(found)
        #: The model with its numbers.
        self.model = model

    @property
    def rmse(self) -> dict[str, dict[str, float]]:
        rmse: dict[str, dict[str, float]] = self["rmse"]
        return rmse

    def _rows(self) -> list[dict[str, Any]]:
        fitted = self.to_dict().get("output_error") or self
        rows = []
        for number in fitted["coefficients"]:
            low, high = number["ci95"] or (None, None)
            kept = {key: number[key] for key in ("effect", "name", "value")}
            rows.append({**kept, "low": low, "high": high, "unit": number["unit"]})
        return rows


class Comparison(_Drawn):
    """Models beside each other on flights that were kept back: RMSE in m/s² and rad/s², and more in ``to_dict()``."""

    def _rows(self) -> list[dict[str, Any]]:
        return [{"model": model["name"], **_values(model["rmse"])} for model in self["models"]]

    def to_pandas(self, measure: str = "rmse") -> pandas.DataFrame:
        """One measure (``rmse``, ``mae``, ``max_abs``, ``r2``) by model and channel (needs pandas)."""
        import pandas

        rows = {model["name"]: _values(model[measure]) for model in self["models"]}
        table: pandas.DataFrame = pandas.DataFrame.from_dict(rows, orient="index")
        return table


class Rollouts(_Drawn):
    """Models integrated forward from measured states: mean error by step, m, m/s, rad and rad/s."""

    def _rows(self) -> list[dict[str, Any]]:
        return [{"model": row["name"], **row["sum"], "diverged": row["diverged"]} for row in self["rows"]]

    def to_pandas(self) -> pandas.DataFrame:
        """Mean error by model, quantity and step (needs pandas)."""
        import pandas

        parts = [
            {"model": row["name"], "quantity": quantity, "step": step, "seconds": step * self["step_s"], "error": error}
            for row in self["rows"]
            for quantity, errors in row["error"].items()
            for step, error in enumerate(errors, start=1)
        ]
        table: pandas.DataFrame = pandas.DataFrame(parts)
        return table


def _steps(diagnosis: dict[str, Any]) -> list[dict[str, Any]]:
    worth = {one["effect"]: one for one in diagnosis.get("worth", [])}
    rows = []
    for step in diagnosis["steps"]:
        numbers = "; ".join(f"{number['name']} = {number['value']:.4g} {number['unit']}" for number in step["coefficients"])
        kept = {key: step[key] for key in ("effect", "meaning", "channels", "p_value", "selection_frequency", "stability")}
        share = worth.get(step["effect"], {}).get("share", {})
        # What of the error would come back without it, in the channel where that is most.
        largest = max((found["share"] for found in share.values()), default=None)
        rows.append({**kept, "numbers": numbers, "worth": largest})
    return rows


class Diagnosis(_Drawn):
    """Which effects are missing (``accepted``), and the model with them (``model``), which still is to be calibrated on all that trains."""

    def __init__(self, found: Found, model: Model) -> None:
        super().__init__(found)
        #: The model with what was found; the one that was given where nothing was.
        self.model = model

    @property
    def verdict(self) -> str:
        """``effects_missing``, ``explained``, ``not_in_catalogue``, ``too_little_data`` or ``convention_fault``."""
        return str(self["verdict"])

    @property
    def accepted(self) -> list[str]:
        return list(self["accepted"])

    def _rows(self) -> list[dict[str, Any]]:
        return _steps(self.to_dict())


class Loop(_Drawn):
    """What a loop of diagnoses added, and the calibrated model with it (``model``)."""

    def __init__(self, found: Found, model: Model) -> None:
        super().__init__(found)
        #: The calibrated model with all that was added.
        self.model = model

    @property
    def together(self) -> dict[str, Any]:
        """All rounds as one diagnosis. After a convention fault, that diagnosis: nothing was searched."""
        document = self.to_dict()
        together: dict[str, Any] = document.get("together", document)
        return together

    @property
    def accepted(self) -> list[str]:
        return list(self.together["accepted"])

    def _rows(self) -> list[dict[str, Any]]:
        return _steps(self.together)


class Training(Result):
    """A trained network (``network``) and its losses, (m/s²)² + (rad/s²)²."""

    def __init__(self, found: Found, network: Network) -> None:
        super().__init__(found)
        #: The network with its model.
        self.network = network


class Predictions(Result):
    """Measured and predicted accelerations, m/s² and rad/s², one row a sample that has a full history."""

    def __init__(self, found: Found, table: Table) -> None:
        super().__init__(found)
        self._table = table

    def __len__(self) -> int:
        return int(self["rows"])

    def to_pandas(self) -> pandas.DataFrame:
        """``manoeuvre``, ``flight``, ``t`` in s, then each acceleration as ``vx_dot`` and ``vx_dot_predicted`` (needs pandas)."""
        table: pandas.DataFrame = frame(self._table)
        return table

    def to_numpy(self) -> Any:
        """The predictions alone, ``[rows, 6]`` in the order of the channels (needs NumPy)."""
        import numpy

        from ._columns import array_of

        numbers = dict(self._table[1])
        return numpy.stack([array_of(numbers[f"{channel}_predicted"]) for channel in CHANNELS], axis=1)
