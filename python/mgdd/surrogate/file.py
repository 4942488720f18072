"""A surrogate as a parameter file: surfaces, support, sensor lags and residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.io.parameters import Entry, ParameterFile, Wanted, wanted
from mgdd.results.labels import Label
from mgdd.surrogate.response_surface import PolynomialBasis, Support
from mgdd.surrogate.sensor_lag import SensorLag
from mgdd.surrogate.signal_model import SignalModel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.surrogate.surrogate import EngineSurrogate

__all__ = ["array_of", "labels_of", "numbers_entry", "read_surrogate", "surrogate_file", "whole_of"]

_LABELS = ("name", "units", "long_name")
_SIGNAL = "signal_"
_OWN = ("r2", "r2_held_out", "residual_sd", "cyclic_sd")
_SENSOR = ("tau_cycles", "tau_stderr_cycles", "total_cycles", "total_stderr_cycles")
_PER_INPUT = "unit of the input"
_LARGEST_COUNT = 1_000_000


def surrogate_file(surrogate: EngineSurrogate) -> ParameterFile:
    """Give everything that a surrogate holds."""
    support, names = surrogate.support, list(surrogate.inputs)
    own = {name: numbers_entry(getattr(support, name), _PER_INPUT) for name in ("lower", "upper")}
    own |= {name: numbers_entry(getattr(support.basis, name), _PER_INPUT) for name in ("centre", "scale")}
    own |= {"root": numbers_entry(support.root), "leverage_limit": Entry(value=float(support.leverage_limit))}
    tables = {
        "inputs": {
            **_labels(names, [surrogate.input_labels[name] for name in names]),
            "median": numbers_entry([surrogate.medians[name] for name in names], _PER_INPUT),
        },
        "support": own,
        "signals": _labels(list(surrogate.signals), [signal.label for signal in surrogate.signals.values()]),
        **{_SIGNAL + name: _signal(signal) for name, signal in surrogate.signals.items()},
        "records": {
            "nonnegative": Entry(value=list(surrogate.nonnegative)),
            "residuals": numbers_entry(surrogate.residuals, "unit of the signal"),
        },
        "source": {name: Entry(value=_said(value)) for name, value in surrogate.source.items()},
    }
    return ParameterFile(kind="surrogate", tables=tables)


def read_surrogate(file: ParameterFile) -> dict[str, Any]:
    """Give what such a file holds, by the fields of the surrogate."""
    per_signal = [table for table in file.tables if table.startswith(_SIGNAL)]
    file.expect(kinds=("surrogate",), tables=("inputs", "support", "signals", "records", "source", *per_signal))
    inputs = file.values("inputs", {**wanted(_LABELS, form="texts"), "median": Wanted(_PER_INPUT, "numbers")})
    signals = file.values("signals", wanted(_LABELS, form="texts"))
    vectors = {name: Wanted(_PER_INPUT, "numbers") for name in ("lower", "upper", "centre", "scale")}
    own = file.values("support", {**vectors, "root": Wanted(form="numbers"), "leverage_limit": Wanted()})
    records = file.values(
        "records", {"nonnegative": Wanted(form="texts"), "residuals": Wanted("unit of the signal", "numbers")}
    )
    labels = labels_of(file, "signals", signals)
    if [_SIGNAL + name for name in labels] != per_signal:
        raise DataError(f"{file.origin}: [signals] names {', '.join(labels)}: each needs its table [signal_...]")
    n, terms = len(inputs["name"]), (len(inputs["name"]) + 1) * (len(inputs["name"]) + 2) // 2
    lower, upper, centre, scale = (array_of(file, f"[support] {name}", own[name], (n,)) for name in vectors)
    support = Support(
        inputs=tuple(inputs["name"]),
        lower=lower,
        upper=upper,
        leverage_limit=own["leverage_limit"],
        basis=PolynomialBasis.of("quadratic", centre=centre, scale=scale),
        root=array_of(file, "[support] root", own["root"], (terms, terms)),
    )
    return dict(  # noqa: C408 one line per field
        signals={name: _signal_of(file, name, label, terms) for name, label in labels.items()},
        support=support,
        medians={
            name: float(value)
            for name, value in zip(
                inputs["name"], array_of(file, "[inputs] median", inputs["median"], (n,)), strict=True
            )
        },
        input_labels=labels_of(file, "inputs", inputs),
        nonnegative=tuple(records["nonnegative"]),
        residuals=array_of(file, "[records] residuals", records["residuals"], (len(records["residuals"]), len(labels))),
        source={
            name: tuple(entry.value) if isinstance(entry.value, list) else entry.value
            for name, entry in file.tables["source"].items()
        },
    )


def _signal(signal: SignalModel) -> dict[str, Entry]:
    unit = signal.label.units
    own = {
        "coefficients": numbers_entry(signal.coefficients, unit),
        "lag_cycles": Entry(value=int(signal.lag_cycles), unit="cycles"),
        "lags": numbers_entry(list(signal.lag_scores), "cycles"),
        "lag_scores": numbers_entry(list(signal.lag_scores.values())),
        "lag_at_bound": Entry(value=bool(signal.lag_at_bound)),
        **{name: Entry(value=float(getattr(signal, name)), unit=_unit(name, unit)) for name in _OWN},
    }
    sensor = signal.sensor
    if sensor is not None:
        own |= {name: Entry(value=float(getattr(sensor, name)), unit="cycles") for name in _SENSOR}
        own |= {
            "delay_cycles": Entry(value=int(sensor.delay_cycles), unit="cycles"),
            "delays": numbers_entry(list(sensor.delay_share), "cycles"),
            "delay_share": numbers_entry(list(sensor.delay_share.values())),
            "at_bound": Entry(value=bool(sensor.at_bound)),
        }
    return own


def _signal_of(file: ParameterFile, name: str, label: Label, terms: int) -> SignalModel:
    table = _SIGNAL + name
    expected = {
        "coefficients": Wanted(label.units, "numbers"),
        "lag_cycles": Wanted("cycles", "integer"),
        "lags": Wanted("cycles", "numbers"),
        "lag_scores": Wanted(form="numbers"),
        "lag_at_bound": Wanted(form="flag"),
        **{own: Wanted(_unit(own, label.units)) for own in _OWN},
    }
    slow = {
        **{own: Wanted("cycles") for own in _SENSOR},
        "delay_cycles": Wanted("cycles", "integer"),
        "delays": Wanted("cycles", "numbers"),
        "delay_share": Wanted(form="numbers"),
        "at_bound": Wanted(form="flag"),
    }
    has_sensor = not slow.keys().isdisjoint(file.tables[table])
    values = file.values(table, expected | (slow if has_sensor else {}))
    sensor = None
    if has_sensor:
        sensor = SensorLag(
            delay_share=_scores(file, table, values, "delays", "delay_share"),
            **{own: values.pop(own) for own in (*_SENSOR, "delay_cycles", "at_bound")},
        )
    scores = _scores(file, table, values, "lags", "lag_scores")
    coefficients = array_of(file, f"[{table}] coefficients", values.pop("coefficients"), (terms,))
    return SignalModel(name=name, label=label, coefficients=coefficients, lag_scores=scores, sensor=sensor, **values)


def _labels(names: Sequence[str], labels: Sequence[Label]) -> dict[str, Entry]:
    return {
        "name": Entry(value=list(names)),
        "units": Entry(value=[label.units for label in labels]),
        "long_name": Entry(value=[label.long_name for label in labels]),
    }


def _unit(name: str, own: str) -> str:
    return "-" if name.startswith("r2") else own


def numbers_entry(values: Any, unit: str = "-") -> Entry:
    """Return numbers as an entry of a file."""
    return Entry(value=np.asarray(values, dtype=np.float64).tolist(), unit=unit)


def array_of(file: ParameterFile, what: str, values: Any, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    """Return what a file holds as an array, and refuse another shape."""
    try:
        array = np.array(values, dtype=np.float64)
    except ValueError as error:
        raise DataError(f"{file.origin}: {what}: rows of different length") from error
    if shape is not None and array.shape != shape:
        raise DataError(f"{file.origin}: {what}: has shape {array.shape}: must be {shape}")
    return array


def whole_of(file: ParameterFile, what: str, values: Any) -> NDArray[np.intp]:
    """Return numbers that a file counts with, and refuse fractions."""
    array = array_of(file, what, values)
    if not (np.abs(array) < _LARGEST_COUNT).all() or (array != np.rint(array)).any():
        raise DataError(f"{file.origin}: {what}: must be whole numbers below {_LARGEST_COUNT}")
    return array.astype(np.intp)


def labels_of(file: ParameterFile, table: str, columns: Mapping[str, Any]) -> dict[str, Label]:
    """Return the labels of a table of names, units and long names."""
    if len({len(columns[part]) for part in _LABELS}) > 1:
        raise DataError(f"{file.origin}: [{table}]: {', '.join(_LABELS)} must be equally long")
    return {name: Label(*label) for name, *label in zip(*(columns[part] for part in _LABELS), strict=True)}


def _scores(file: ParameterFile, table: str, values: dict[str, Any], keys: str, own: str) -> dict[int, float]:
    """Take counts of cycles and what belongs to each."""
    counts = whole_of(file, f"[{table}] {keys}", values.pop(keys))
    numbers = array_of(file, f"[{table}] {own}", values.pop(own), counts.shape)
    return dict(zip(counts.tolist(), numbers.tolist(), strict=True))


def _said(value: object) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, tuple | list):
        return [_said(item) for item in value]
    return value if isinstance(value, str | int | float) else str(value)
