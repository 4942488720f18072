"""What several response models say at the same places, as one table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.io.point_table import POINT
from mgdd.results.labels import label_of, labelled_dataset

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.surrogate.response_model import ResponseModel

# What stands behind the name of a response, and the part of a prediction that it is.
_PARTS = {"": "mean", "_sd": "sd", "_lower": "lower", "_upper": "upper"}


def prediction_table(
    models: Sequence[ResponseModel],
    axes: Mapping[str, NDArray[Any]],
    columns: Mapping[str, NDArray[np.float64]],
    *,
    extrapolate: bool,
    level: float,
) -> tuple[xr.Dataset, dict[str, int]]:
    """Predict every response over a grid, or over a list of points."""
    labels = {name: label for model in models for name, label in model.factors.items()}
    dims, shape = tuple(axes), tuple(len(values) for values in axes.values())
    variables: dict[str, tuple[Any, ...]] = {
        name: (name, values, *labels.get(name, ("-", "number of the point"))) for name, values in axes.items()
    }
    beside = [name for name in labels if name not in axes]
    variables |= {name: (POINT, columns[name], *labels[name]) for name in beside}
    outside: dict[str, int] = {}
    for model in models:
        found = model.predict({name: columns[name].ravel() for name in model.factors}, level=level)
        beyond = found["extrapolated"].to_numpy()
        outside[model.name] = int(beyond.sum())
        keep = np.ones(beyond.shape, dtype=bool) if extrapolate else ~beyond
        for ending, part in _PARTS.items():
            values = np.where(keep, found[part].to_numpy(), np.nan).reshape(shape)
            variables[f"{model.name}{ending}"] = (dims, values, *label_of(found[part]))
        if extrapolate:
            where = beyond.reshape(shape).astype(np.int8)
            variables[f"{model.name}_extrapolated"] = (dims, where, *label_of(found["extrapolated"]))
    table = labelled_dataset(variables, attrs={"level": level}).set_coords(beside)
    for model in models:
        table[model.name].attrs["source"] = "predicted"
    return table, outside
