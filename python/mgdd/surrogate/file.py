"""Surrogates and response models as parameter files: one list of keys writes each table and reads it back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError
from mgdd.io.parameters import Entry, ParameterFile, Wanted, wanted, written
from mgdd.results.labels import Label
from mgdd.surrogate.polynomial import PolynomialBasis, PolynomialSurface, Support
from mgdd.surrogate.process import ProcessSurface
from mgdd.surrogate.signal_model import SensorLag, SignalModel

_LARGEST_COUNT = 1_000_000
_SIGNAL = "signal_"
_LABELS = wanted(("name", "units", "long_name"), form="texts")
_NUMBERS = Wanted(form="numbers")
_PER_INPUT, _PER_FACTOR = Wanted("unit of the input", "numbers"), Wanted("unit of the factor", "numbers")
_INPUTS = {**_LABELS, "median": _PER_INPUT}
_RECORDS = {"nonnegative": Wanted(form="texts"), "residuals": Wanted("unit of the signal", "numbers")}
_SUPPORT = {
    **dict.fromkeys(("lower", "upper", "centre", "scale"), _PER_INPUT), "root": _NUMBERS, "leverage_limit": Wanted()
}  # fmt: skip
_SENSOR = {
    **dict.fromkeys(("tau_cycles", "tau_stderr_cycles", "total_cycles", "total_stderr_cycles"), Wanted("cycles")),
    "delay_cycles": Wanted("cycles", "integer"),
    "delays": Wanted("cycles", "numbers"),
    "delay_share": _NUMBERS,
    "at_bound": Wanted(form="flag"),
}


def _signal_keys(label: Label) -> dict[str, Wanted]:
    return {
        "coefficients": Wanted(label.units, "numbers"),
        "lag_cycles": Wanted("cycles", "integer"),
        "lags": Wanted("cycles", "numbers"),
        "lag_scores": _NUMBERS,
        "lag_at_bound": Wanted(form="flag"),
        **wanted(("r2", "r2_held_out")),
        **dict.fromkeys(("residual_sd", "cyclic_sd"), Wanted(label.units)),
    }


def _surface_keys(kind: str, label: Label) -> dict[str, Wanted]:
    if kind == "polynomial":
        keys = {**dict.fromkeys(("centre", "scale"), _PER_FACTOR), **dict.fromkeys(("monomials", "root"), _NUMBERS)}
        keys |= {"leverage_limit": Wanted(), "coefficients": Wanted(label.units, "numbers")}
    else:
        keys = {"length_scales": _PER_FACTOR, **dict.fromkeys(("offset", "signal_sd"), Wanted(label.units))}
    return {**keys, "noise_sd": Wanted(label.units)}


def surrogate_file(surrogate: Mapping[str, Any]) -> ParameterFile:
    """Give everything that the fields of a surrogate hold."""
    support, signals = surrogate["support"], surrogate["signals"]
    inputs = {name: surrogate["input_labels"][name] for name in support.inputs}
    medians = [surrogate["medians"][name] for name in support.inputs]
    tables = {
        "inputs": written({**_columns(inputs), "median": medians}, _INPUTS),
        "support": written(vars(support.basis) | vars(support), _SUPPORT),
        "signals": written(_columns({name: signal.label for name, signal in signals.items()}), _LABELS),
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
    inputs = _labels(file, "inputs", given)
    names, n, terms = tuple(inputs), len(inputs), (len(inputs) + 1) * (len(inputs) + 2) // 2
    median = _array(file, "[inputs] median", given["median"], (n,))
    labels = _labels(file, "signals", file.values("signals", _LABELS))
    if [_SIGNAL + name for name in labels] != per_signal:
        raise DataError(f"{file.origin}: [signals] names {', '.join(labels)}: each needs its table [signal_...]")
    shapes = {**dict.fromkeys(("lower", "upper", "centre", "scale"), (n,)), "root": (terms, terms)}
    fields = _shaped(file, "support", file.values("support", _SUPPORT), shapes)
    basis = PolynomialBasis.of("quadratic", centre=fields.pop("centre"), scale=fields.pop("scale"))
    records = file.values("records", _RECORDS)
    rows = records["residuals"]
    return {
        "signals": {name: _signal_of(file, name, label, terms) for name, label in labels.items()},
        "support": Support(inputs=names, basis=basis, **fields),
        "medians": dict(zip(names, median.tolist(), strict=True)),
        "input_labels": inputs,
        "nonnegative": tuple(records["nonnegative"]),
        "residuals": _array(file, "[records] residuals", rows, (len(rows), len(labels))),
        "source": {
            name: tuple(entry.value) if isinstance(entry.value, list) else entry.value
            for name, entry in file.tables["source"].items()
        },
    }


def _signal_of(file: ParameterFile, name: str, label: Label, terms: int) -> SignalModel:
    table, keys = _SIGNAL + name, _signal_keys(label)
    slow = not _SENSOR.keys().isdisjoint(file.tables[table])
    values = file.values(table, keys | (_SENSOR if slow else {}))
    values = _shaped(file, table, values, {"coefficients": (terms,)})
    values["lag_scores"] = _by_count(file, table, values, "lags", "lag_scores")
    sensor = None
    if slow:
        values["delay_share"] = _by_count(file, table, values, "delays", "delay_share")
        sensor = SensorLag(**{key: values.pop(key) for key in _SENSOR if key != "delays"})
    return SignalModel(name=name, label=label, sensor=sensor, **values)


def response_file(model: Mapping[str, Any]) -> ParameterFile:
    """Give everything that the fields of a response model hold."""
    label, factors, surface = model["label"], model["factors"], model["surface"]
    kind = "polynomial" if isinstance(surface, PolynomialSurface) else "gaussian_process"
    fields = vars(surface)
    if isinstance(surface, PolynomialSurface):
        fields = vars(surface.support.basis) | vars(surface.support) | fields
    units = {name: Wanted(factor.units, "numbers") for name, factor in factors.items()}
    response = dict(zip(_LABELS, (model["name"], *label), strict=True))
    tables = {
        "factors": written(_columns(factors), _LABELS),
        "response": {part: Entry(value=value) for part, value in response.items()},
        kind: written(fields, _surface_keys(kind, label)),
        "points": written(dict(zip(factors, surface.points.T, strict=True)), units),
        "values": written({model["name"]: surface.values}, {model["name"]: Wanted(label.units, "numbers")}),
    }
    return ParameterFile(kind="response", tables=tables)


def read_response(file: ParameterFile) -> dict[str, Any]:
    """Give the fields of the response model of such a file."""
    forms = ("polynomial", "gaussian_process")
    kinds = [kind for kind in forms if kind in file.tables]
    if file.kind == "response" and len(kinds) != 1:
        raise DataError(
            f"{file.origin}: holds {' and '.join(kinds) or 'neither'}: must hold one of [{'], ['.join(forms)}]"
        )
    file.expect(kinds=("response",), tables=("factors", "response", "points", "values", *kinds))
    factors = _labels(file, "factors", file.values("factors", _LABELS))
    name, *label_texts = file.values("response", wanted(_LABELS, form="text")).values()
    label = Label(*label_texts)
    columns = file.values("points", {factor: Wanted(each.units, "numbers") for factor, each in factors.items()})
    values = _array(file, "values", file.values("values", {name: Wanted(label.units, "numbers")})[name])
    points = np.column_stack([_array(file, factor, columns[factor], values.shape) for factor in factors])
    fields = {"points": points, "values": values}
    (kind,) = kinds
    read = _polynomial if kind == "polynomial" else _process
    surface = read(file, _surface_keys(kind, label), tuple(factors), fields)
    return {"name": name, "label": label, "factors": factors, "surface": surface}


def _polynomial(
    file: ParameterFile, keys: dict[str, Wanted], names: tuple[str, ...], fields: dict[str, Any]
) -> PolynomialSurface:
    given = file.values("polynomial", keys)
    m, p = len(names), len(given["coefficients"])
    given = _shaped(file, "polynomial", given, {"centre": (m,), "scale": (m,), "root": (p, p), "coefficients": (p,)})
    monomials = _whole(file, "[polynomial] monomials", given["monomials"])
    if monomials.ndim != 2 or len(monomials) != p or monomials.min() < 0 or monomials.max() > m:
        raise DataError(
            f"{file.origin}: [polynomial] monomials: must be {p} rows of factors, numbered 1 to {m}, 0 for none"
        )
    support = Support(
        inputs=names,
        lower=fields["points"].min(axis=0),
        upper=fields["points"].max(axis=0),
        leverage_limit=given["leverage_limit"],
        basis=PolynomialBasis(centre=given["centre"], scale=given["scale"], monomials=monomials),
        root=given["root"],
    )
    return PolynomialSurface(support=support, coefficients=given["coefficients"], noise_sd=given["noise_sd"], **fields)


def _process(
    file: ParameterFile, keys: dict[str, Wanted], names: tuple[str, ...], fields: dict[str, Any]
) -> ProcessSurface:
    given = file.values("gaussian_process", keys)
    given = _shaped(file, "gaussian_process", given, {"length_scales": (len(names),)})
    if not (given["length_scales"] > 0.0).all() or not given["signal_sd"] > 0.0 or not given["noise_sd"] >= 0.0:
        raise DataError(f"{file.origin}: [gaussian_process]: length scales and signal_sd must be > 0, noise_sd >= 0")
    return ProcessSurface(**given, **fields)


def _columns(labels: Mapping[str, Label]) -> dict[str, list[str]]:
    rows = [(name, *label) for name, label in labels.items()]
    return {part: [row[k] for row in rows] for k, part in enumerate(_LABELS)}


def _labels(file: ParameterFile, table: str, columns: Mapping[str, Any]) -> dict[str, Label]:
    if len({len(columns[part]) for part in _LABELS}) > 1:
        raise DataError(f"{file.origin}: [{table}]: {', '.join(_LABELS)} must be equally long")
    return {name: Label(*label) for name, *label in zip(*(columns[part] for part in _LABELS), strict=True)}


def _shaped(
    file: ParameterFile, table: str, values: dict[str, Any], shapes: Mapping[str, tuple[int, ...]]
) -> dict[str, Any]:
    """Turn the values of known shape into arrays."""
    return values | {key: _array(file, f"[{table}] {key}", values[key], shape) for key, shape in shapes.items()}


def _array(file: ParameterFile, what: str, values: Any, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    try:
        array = np.array(values, dtype=np.float64)
    except ValueError as error:
        raise DataError(f"{file.origin}: {what}: rows of different length") from error
    if shape is not None and array.shape != shape:
        raise DataError(f"{file.origin}: {what}: has shape {array.shape}: must be {shape}")
    return array


def _whole(file: ParameterFile, what: str, values: Any) -> NDArray[np.intp]:
    array = _array(file, what, values)
    if not (np.abs(array) < _LARGEST_COUNT).all() or (array != np.rint(array)).any():
        raise DataError(f"{file.origin}: {what}: must be whole numbers below {_LARGEST_COUNT}")
    return array.astype(np.intp)


def _by_count(file: ParameterFile, table: str, values: dict[str, Any], keys: str, entry: str) -> dict[int, float]:
    """Take counts of cycles and what belongs to each."""
    counts = _whole(file, f"[{table}] {keys}", values.pop(keys))
    numbers = _array(file, f"[{table}] {entry}", values.pop(entry), counts.shape)
    return dict(zip(counts.tolist(), numbers.tolist(), strict=True))


def _plain(value: object) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value if isinstance(value, str | int | float) else str(value)
