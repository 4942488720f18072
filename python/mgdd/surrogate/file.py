"""Response models as parameter files: one list of keys writes each table and reads it back."""

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

_LARGEST_COUNT = 1_000_000
LABELS = wanted(("name", "units", "long_name"), form="texts")
NUMBERS = Wanted(form="numbers")
_PER_FACTOR = Wanted("unit of the factor", "numbers")


def _surface_keys(kind: str, label: Label) -> dict[str, Wanted]:
    if kind == "polynomial":
        keys = {**dict.fromkeys(("centre", "scale"), _PER_FACTOR), **dict.fromkeys(("monomials", "root"), NUMBERS)}
        keys |= {"leverage_limit": Wanted(), "coefficients": Wanted(label.units, "numbers")}
    else:
        keys = {"length_scales": _PER_FACTOR, **dict.fromkeys(("offset", "signal_sd"), Wanted(label.units))}
    return {**keys, "noise_sd": Wanted(label.units)}


def response_file(model: Mapping[str, Any]) -> ParameterFile:
    """Give everything that the fields of a response model hold."""
    label, factors, surface = model["label"], model["factors"], model["surface"]
    kind = "polynomial" if isinstance(surface, PolynomialSurface) else "gaussian_process"
    fields = vars(surface)
    if isinstance(surface, PolynomialSurface):
        fields = vars(surface.support.basis) | vars(surface.support) | fields
    units = {name: Wanted(factor.units, "numbers") for name, factor in factors.items()}
    response = dict(zip(LABELS, (model["name"], *label), strict=True))
    tables = {
        "factors": written(label_columns(factors), LABELS),
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
    factors = labels_of(file, "factors", file.values("factors", LABELS))
    name, *label_texts = file.values("response", wanted(LABELS, form="text")).values()
    label = Label(*label_texts)
    columns = file.values("points", {factor: Wanted(each.units, "numbers") for factor, each in factors.items()})
    values = array_of(file, "values", file.values("values", {name: Wanted(label.units, "numbers")})[name])
    points = np.column_stack([array_of(file, factor, columns[factor], values.shape) for factor in factors])
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
    given = shaped(file, "polynomial", given, {"centre": (m,), "scale": (m,), "root": (p, p), "coefficients": (p,)})
    monomials = whole_of(file, "[polynomial] monomials", given["monomials"])
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
    given = shaped(file, "gaussian_process", given, {"length_scales": (len(names),)})
    if not (given["length_scales"] > 0.0).all() or not given["signal_sd"] > 0.0 or not given["noise_sd"] >= 0.0:
        raise DataError(f"{file.origin}: [gaussian_process]: length scales and signal_sd must be > 0, noise_sd >= 0")
    return ProcessSurface(**given, **fields)


def label_columns(labels: Mapping[str, Label]) -> dict[str, list[str]]:
    """Give names, units and long names as columns of texts."""
    rows = [(name, *label) for name, label in labels.items()]
    return {part: [row[k] for row in rows] for k, part in enumerate(LABELS)}


def labels_of(file: ParameterFile, table: str, columns: Mapping[str, Any]) -> dict[str, Label]:
    """Read labels back from such columns."""
    if len({len(columns[part]) for part in LABELS}) > 1:
        raise DataError(f"{file.origin}: [{table}]: {', '.join(LABELS)} must be equally long")
    return {name: Label(*label) for name, *label in zip(*(columns[part] for part in LABELS), strict=True)}


def shaped(
    file: ParameterFile, table: str, values: dict[str, Any], shapes: Mapping[str, tuple[int, ...]]
) -> dict[str, Any]:
    """Turn the values of known shape into arrays."""
    return values | {key: array_of(file, f"[{table}] {key}", values[key], shape) for key, shape in shapes.items()}


def array_of(file: ParameterFile, what: str, values: Any, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    """Read numbers as an array of a shape."""
    try:
        array = np.array(values, dtype=np.float64)
    except ValueError as error:
        raise DataError(f"{file.origin}: {what}: rows of different length") from error
    if shape is not None and array.shape != shape:
        raise DataError(f"{file.origin}: {what}: has shape {array.shape}: must be {shape}")
    return array


def whole_of(file: ParameterFile, what: str, values: Any) -> NDArray[np.intp]:
    """Read whole numbers as an array."""
    array = array_of(file, what, values)
    if not (np.abs(array) < _LARGEST_COUNT).all() or (array != np.rint(array)).any():
        raise DataError(f"{file.origin}: {what}: must be whole numbers below {_LARGEST_COUNT}")
    return array.astype(np.intp)
