"""What a figure of a fitted response shows: points as measured, fitted and left out, and cuts through the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.results.labels import labelled_dataset
from mgdd.surrogate.response_findings import outlier_bound

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.surrogate.response_model import ResponseModel

__all__ = ["diagnostics_of"]

_STEPS = 41


def diagnostics_of(model: ResponseModel, left_out: NDArray[np.float64], studentised: NDArray[np.float64]) -> xr.Dataset:
    """Tabulate points and cuts of a model."""
    from scipy.stats import norm, rankdata

    fitted, weight = model.surface.fitted()
    n, names, (unit, said) = model.values.size, tuple(model.factors), model.label
    bound = outlier_bound(n, model.surface.freedom)
    scores = norm.ppf((rankdata(studentised, method="ordinal") - 0.375) / (n + 0.25))
    columns = {
        name: ("point", column, *label)
        for (name, label), column in zip(model.factors.items(), model.points.T, strict=True)
    }
    low, high, middle = model.points.min(axis=0), model.points.max(axis=0), np.median(model.points, axis=0)
    steps = np.linspace(low, high, _STEPS, axis=1)
    at = np.tile(middle, (len(names), _STEPS, 1))
    for place in range(len(names)):
        at[place, :, place] = steps[place]
    cuts = model.predict(dict(zip(names, at.reshape(-1, len(names)).T, strict=True)))
    cut = {name: cuts[name].to_numpy().reshape(len(names), _STEPS) for name in ("mean", "lower", "upper")}
    along, own = ("factor", "step"), "unit of the factor"
    return labelled_dataset(
        {
            "point": ("point", np.arange(n), "-", "point in run order"),
            **columns,
            "measured": ("point", model.values, unit, f"{said}, measured"),
            "fitted": ("point", fitted, unit, f"{said}, fitted"),
            "left_out": ("point", left_out, unit, f"{said}, predicted from the other points"),
            "residual": ("point", model.values - fitted, unit, f"{said}, measured minus fitted"),
            "studentised": ("point", studentised, "-", "studentised residual"),
            "leverage": ("point", weight, "-", "leverage"),
            "normal_score": ("point", scores, "-", "normal score"),
            "outlier": ("point", np.abs(studentised) > bound, "-", "beyond the bound for outliers"),
            "outlier_bound": ((), bound, "-", "bound for outliers"),
            "factor": ("factor", list(names), "-", "factor"),
            "step": ("step", np.arange(_STEPS), "-", "step of a cut"),
            "cut": (along, steps, own, "factor, the others at their medians"),
            "cut_mean": (along, cut["mean"], unit, f"{said}, prediction"),
            "cut_lower": (along, cut["lower"], unit, f"{said}, lower end of the interval"),
            "cut_upper": (along, cut["upper"], unit, f"{said}, upper end of the interval"),
        },
        attrs={"response": model.name, "kind": model.kind, "level": 0.95},
    )
