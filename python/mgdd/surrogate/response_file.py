"""A response model as a parameter file: factors, points, and the polynomial or the Gaussian process."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.io.parameters import Entry, ParameterFile, Wanted, wanted
from mgdd.results.labels import Label
from mgdd.surrogate.file import array_of, labels_of, numbers_entry, whole_of
from mgdd.surrogate.polynomial import PolynomialSurface
from mgdd.surrogate.process import ProcessSurface
from mgdd.surrogate.response_surface import PolynomialBasis, Support

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.surrogate.response_model import ResponseModel

__all__ = ["read_response", "response_file"]

_LABELS = ("name", "units", "long_name")
_OWN = "unit of the factor"
_KINDS = ("polynomial", "gaussian_process")


def response_file(model: ResponseModel) -> ParameterFile:
    """Give everything that a response model holds."""
    unit, surface = model.label.units, model.surface
    labels = [(name, *label) for name, label in model.factors.items()]
    response = dict(zip(_LABELS, (model.name, *model.label), strict=True))
    if isinstance(surface, PolynomialSurface):
        support = surface.support
        own = {
            "centre": numbers_entry(support.basis.centre, _OWN),
            "scale": numbers_entry(support.basis.scale, _OWN),
            "monomials": numbers_entry(support.basis.monomials),
            "root": numbers_entry(support.root),
            "leverage_limit": Entry(value=float(support.leverage_limit)),
            "coefficients": numbers_entry(surface.coefficients, unit),
        }
    else:
        own = {
            "length_scales": numbers_entry(surface.length_scales, _OWN),
            "offset": Entry(value=float(surface.offset), unit=unit),
            "signal_sd": Entry(value=float(surface.signal_sd), unit=unit),
        }
    columns = dict(zip(model.factors, model.points.T, strict=True))
    tables = {
        "factors": {part: Entry(value=[row[k] for row in labels]) for k, part in enumerate(_LABELS)},
        "response": {part: Entry(value=value) for part, value in response.items()},
        model.kind: own | {"noise_sd": Entry(value=float(surface.noise_sd), unit=unit)},
        "points": {name: numbers_entry(column, model.factors[name].units) for name, column in columns.items()},
        "values": {model.name: numbers_entry(model.values, unit)},
    }
    return ParameterFile(kind="response", tables=tables)


def read_response(file: ParameterFile) -> dict[str, Any]:
    """Give what such a file holds, by the fields of the model."""
    kinds = [kind for kind in _KINDS if kind in file.tables]
    if file.kind == "response" and len(kinds) != 1:
        raise DataError(
            f"{file.origin}: holds {' and '.join(kinds) or 'neither'}: must hold one of [{'], ['.join(_KINDS)}]"
        )
    file.expect(kinds=("response",), tables=("factors", "response", "points", "values", *kinds))
    factors = file.values("factors", wanted(_LABELS, form="texts"))
    response = file.values("response", wanted(_LABELS, form="text"))
    labels = labels_of(file, "factors", factors)
    label = Label(response["units"], response["long_name"])
    columns = file.values("points", {name: Wanted(each.units, "numbers") for name, each in labels.items()})
    measured = file.values("values", {response["name"]: Wanted(label.units, "numbers")})
    values = np.array(measured[response["name"]], dtype=np.float64)
    points = np.column_stack([array_of(file, name, columns[name], values.shape) for name in labels])
    own = {"points": points, "values": values}
    read = _polynomial if kinds == ["polynomial"] else _process
    return {
        "name": response["name"],
        "label": label,
        "factors": labels,
        "surface": read(file, label, tuple(labels), own),
    }


def _polynomial(
    file: ParameterFile, label: Label, names: tuple[str, ...], own: dict[str, NDArray[np.float64]]
) -> PolynomialSurface:
    given = file.values(
        "polynomial",
        {
            **{name: Wanted(_OWN, "numbers") for name in ("centre", "scale")},
            **{name: Wanted(form="numbers") for name in ("monomials", "root")},
            "leverage_limit": Wanted(),
            "coefficients": Wanted(label.units, "numbers"),
            "noise_sd": Wanted(label.units),
        },
    )
    m, p = len(names), len(given["coefficients"])
    monomials = whole_of(file, "[polynomial] monomials", given["monomials"])
    if monomials.ndim != 2 or len(monomials) != p or monomials.min() < 0 or monomials.max() > m:
        raise DataError(
            f"{file.origin}: [polynomial] monomials: must be {p} rows of factors, numbered 1 to {m}, 0 for none"
        )
    basis = PolynomialBasis(
        centre=array_of(file, "centre", given["centre"], (m,)),
        scale=array_of(file, "scale", given["scale"], (m,)),
        monomials=monomials,
    )
    support = Support(
        inputs=names,
        lower=own["points"].min(axis=0),
        upper=own["points"].max(axis=0),
        leverage_limit=given["leverage_limit"],
        basis=basis,
        root=array_of(file, "root", given["root"], (p, p)),
    )
    coefficients = array_of(file, "coefficients", given["coefficients"], (p,))
    return PolynomialSurface(support=support, coefficients=coefficients, noise_sd=given["noise_sd"], **own)


def _process(
    file: ParameterFile, label: Label, names: tuple[str, ...], own: dict[str, NDArray[np.float64]]
) -> ProcessSurface:
    single = ("offset", "signal_sd", "noise_sd")
    given = file.values(
        "gaussian_process",
        {"length_scales": Wanted(_OWN, "numbers"), **{name: Wanted(label.units) for name in single}},
    )
    scales = array_of(file, "length_scales", given["length_scales"], (len(names),))
    if not (scales > 0.0).all() or not given["signal_sd"] > 0.0 or not given["noise_sd"] >= 0.0:
        raise DataError(f"{file.origin}: [gaussian_process]: length scales and signal_sd must be > 0, noise_sd >= 0")
    return ProcessSurface(
        length_scales=scales,
        offset=given["offset"],
        signal_sd=given["signal_sd"],
        noise_sd=given["noise_sd"],
        **own,
    )
