"""The surrogate of a measured engine as a parameter file: one list of keys writes each table and reads it back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mgdd.errors import DataError
from mgdd.io.parameters import Entry, ParameterFile, Wanted, wanted, written
from mgdd.results.labels import Label
from mgdd.surrogate.file import LABELS, NUMBERS, array_of, label_columns, labels_of, shaped, whole_of
from mgdd.surrogate.polynomial import PolynomialBasis, Support
from mgdd_studies.measured_engine.signal_model import SensorLag, SignalModel

_SIGNAL = "signal_"
_PER_INPUT = Wanted("unit of the input", "numbers")
_INPUTS = {**LABELS, "median": _PER_INPUT}
_RECORDS = {"nonnegative": Wanted(form="texts"), "residuals": Wanted("unit of the signal", "numbers")}
_SUPPORT = {
    **dict.fromkeys(("lower", "upper", "centre", "scale"), _PER_INPUT), "root": NUMBERS, "leverage_limit": Wanted()
}  # fmt: skip
_SENSOR = {
    **dict.fromkeys(("tau_cycles", "tau_stderr_cycles", "total_cycles", "total_stderr_cycles"), Wanted("cycles")),
    "delay_cycles": Wanted("cycles", "integer"),
    "delays": Wanted("cycles", "numbers"),
    "delay_share": NUMBERS,
    "at_bound": Wanted(form="flag"),
}


def _signal_keys(label: Label) -> dict[str, Wanted]:
    return {
        "coefficients": Wanted(label.units, "numbers"),
        "lag_cycles": Wanted("cycles", "integer"),
        "lags": Wanted("cycles", "numbers"),
        "lag_scores": NUMBERS,
        "lag_at_bound": Wanted(form="flag"),
        **wanted(("r2", "r2_held_out")),
        **dict.fromkeys(("residual_sd", "cyclic_sd"), Wanted(label.units)),
    }


def surrogate_file(surrogate: Mapping[str, Any]) -> ParameterFile:
    """Give everything that the fields of a surrogate hold."""
    support, signals = surrogate["support"], surrogate["signals"]
    inputs = {name: surrogate["input_labels"][name] for name in support.inputs}
    medians = [surrogate["medians"][name] for name in support.inputs]
    tables = {
        "inputs": written({**label_columns(inputs), "median": medians}, _INPUTS),
        "support": written(vars(support.basis) | vars(support), _SUPPORT),
        "signals": written(label_columns({name: signal.label for name, signal in signals.items()}), LABELS),
        **{_SIGNAL + name: _signal(signal) for name, signal in signals.items()},
        "records": written(surrogate, _RECORDS),
        "source": {name: Entry(value=_plain(value)) for name, value in surrogate["source"].items()},
    }
    return ParameterFile(kind="surrogate", tables=tables)


def _signal(signal: SignalModel) -> dict[str, Entry]:
    scores = {"lags": list(signal.lag_scores), "lag_scores": list(signal.lag_scores.values())}
    keys = written(vars(signal) | scores, _signal_keys(signal.label))
    if signal.sensor is None:
        return keys
    share = signal.sensor.delay_share
    return keys | written(vars(signal.sensor) | {"delays": list(share), "delay_share": list(share.values())}, _SENSOR)


def read_surrogate(file: ParameterFile) -> dict[str, Any]:
    """Give the fields of the surrogate of such a file."""
    per_signal = [table for table in file.tables if table.startswith(_SIGNAL)]
    file.expect(kinds=("surrogate",), tables=("inputs", "support", "signals", "records", "source", *per_signal))
    given = file.values("inputs", _INPUTS)
    inputs = labels_of(file, "inputs", given)
    names, n, terms = tuple(inputs), len(inputs), (len(inputs) + 1) * (len(inputs) + 2) // 2
    median = array_of(file, "[inputs] median", given["median"], (n,))
    labels = labels_of(file, "signals", file.values("signals", LABELS))
    if [_SIGNAL + name for name in labels] != per_signal:
        raise DataError(f"{file.origin}: [signals] names {', '.join(labels)}: each needs its table [signal_...]")
    shapes = {**dict.fromkeys(("lower", "upper", "centre", "scale"), (n,)), "root": (terms, terms)}
    fields = shaped(file, "support", file.values("support", _SUPPORT), shapes)
    basis = PolynomialBasis.of("quadratic", centre=fields.pop("centre"), scale=fields.pop("scale"))
    records = file.values("records", _RECORDS)
    rows = records["residuals"]
    return {
        "signals": {name: _signal_of(file, name, label, terms) for name, label in labels.items()},
        "support": Support(inputs=names, basis=basis, **fields),
        "medians": dict(zip(names, median.tolist(), strict=True)),
        "input_labels": inputs,
        "nonnegative": tuple(records["nonnegative"]),
        "residuals": array_of(file, "[records] residuals", rows, (len(rows), len(labels))),
        "source": {
            name: tuple(entry.value) if isinstance(entry.value, list) else entry.value
            for name, entry in file.tables["source"].items()
        },
    }


def _signal_of(file: ParameterFile, name: str, label: Label, terms: int) -> SignalModel:
    table, keys = _SIGNAL + name, _signal_keys(label)
    slow = not _SENSOR.keys().isdisjoint(file.tables[table])
    values = file.values(table, keys | (_SENSOR if slow else {}))
    values = shaped(file, table, values, {"coefficients": (terms,)})
    values["lag_scores"] = _by_count(file, table, values, "lags", "lag_scores")
    sensor = None
    if slow:
        values["delay_share"] = _by_count(file, table, values, "delays", "delay_share")
        sensor = SensorLag(**{key: values.pop(key) for key in _SENSOR if key != "delays"})
    return SignalModel(name=name, label=label, sensor=sensor, **values)


def _by_count(file: ParameterFile, table: str, values: dict[str, Any], keys: str, entry: str) -> dict[int, float]:
    """Take counts of cycles and what belongs to each."""
    counts = whole_of(file, f"[{table}] {keys}", values.pop(keys))
    numbers = array_of(file, f"[{table}] {entry}", values.pop(entry), counts.shape)
    return dict(zip(counts.tolist(), numbers.tolist(), strict=True))


def _plain(value: object) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value if isinstance(value, str | int | float) else str(value)
