"""The model of one response over the factors of a design: prediction, interval, and where it ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.io.parameters import ParameterFile, Parameters
from mgdd.io.point_table import POINT
from mgdd.results.describe import described
from mgdd.results.labels import Label, label_of, labelled_dataset
from mgdd.surrogate.file import read_response, response_file
from mgdd.surrogate.points import EDGE, PointHull, hull_of, points_of
from mgdd.surrogate.polynomial import PolynomialSurface
from mgdd.surrogate.process import ProcessSurface

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

RESERVED = ("point", "mean", "mean_sd", "sd", "lower", "upper", "extrapolated")


def _rows(model: ResponseModel) -> dict[str, Any]:
    surface = model.surface
    rows: dict[str, Any] = {"factors": tuple(model.factors), "points": model.values.size, "noise_sd": surface.noise_sd}
    if isinstance(surface, PolynomialSurface):
        rows["terms"] = model.terms
    else:
        rows["length_scale"] = dict(zip(model.factors, surface.length_scales.tolist(), strict=True))
    return rows


@dataclass(frozen=True, kw_only=True, eq=False)
class ResponseModel(Parameters):
    """A polynomial or a Gaussian process of one response, with the points that it was fitted to.

    Parameters
    ----------
    name : str
        The response.
    label : Label
        Its unit and long name.
    factors : mapping of str to Label
        Unit and long name of each factor.
    surface : object
        Coefficients or length scales, noise and points.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.design import design_points
    >>> from mgdd.surrogate import fit_response
    >>> plan = design_points({"soi_cad": (-20.0, 5.0), "fuel_mg": (5.0, 40.0)}, 32, seed=1)
    >>> noise = np.random.default_rng(1).normal(0.0, 0.05, 32)
    >>> imep = 0.3 * plan["fuel_mg"] - 0.004 * (plan["soi_cad"] + 6.0) ** 2 + noise
    >>> model = fit_response(plan, imep).model
    >>> model.terms
    ('1', 'soi_cad', 'fuel_mg', 'soi_cad^2')
    >>> found = model.predict({"soi_cad": -6.0, "fuel_mg": [20.0, 60.0]})
    >>> found["mean"].values.round(1).tolist(), found["extrapolated"].values.tolist()
    ([6.0, 18.0], [False, True])
    """

    name: str
    label: Label
    factors: Mapping[str, Label]
    surface: PolynomialSurface | ProcessSurface

    @property
    def kind(self) -> str:
        """``polynomial`` or ``gaussian_process``."""
        return "polynomial" if isinstance(self.surface, PolynomialSurface) else "gaussian_process"

    @property
    def points(self) -> NDArray[np.float64]:
        """Points that were fitted, shape (n, m)."""
        return self.surface.points

    @property
    def values(self) -> NDArray[np.float64]:
        """The response there, shape (n,)."""
        return self.surface.values

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the terms of a polynomial, nothing of a Gaussian process."""
        if isinstance(self.surface, PolynomialSurface):
            return self.surface.support.basis.names(tuple(self.factors))
        return ()

    @cached_property
    def hull(self) -> PointHull | None:
        """Convex hull of the points; None where they have none: then their ranges count."""
        try:
            return hull_of(self.points, tuple(self.factors))
        except DataError:  # reported by `fit_response` as a finding
            return None

    def predict(self, points: Any, *, level: float = 0.95) -> xr.Dataset:
        """Predict the response.

        Parameters
        ----------
        points : xarray.Dataset, DataFrame or mapping of columns
            The factors in their units; a single number counts for every point.
        level : float
            Probability of the interval [-].

        Returns
        -------
        xarray.Dataset
            Over ``point``, in the unit of the response: ``mean``; ``mean_sd``, its standard deviation; ``sd``, that of
            one new measurement; ``lower`` and ``upper``, between which a new measurement falls with the probability;
            ``extrapolated`` [-] where the point lies outside the hull of the fitted points, or has a higher leverage
            than any of them; and the factors. The interval takes the terms or length scales as given.

        Raises
        ------
        mgdd.errors.ParameterError
            A level outside 0 to 1.
        mgdd.errors.DataError
            A factor is missing or not finite.
        """
        from scipy.stats import t

        ParameterError.unless(0.0 < level < 1.0, "level", level, "between 0 and 1")
        at = points_of(points, tuple(self.factors))
        mean, mean_sd = self.surface.predict(at)
        sd = np.sqrt(mean_sd**2 + self.surface.noise_sd**2)
        wide = float(t.ppf(0.5 + 0.5 * level, self.surface.freedom)) * sd
        extrapolated = self.extrapolated(at)
        unit, name = self.label
        attrs: dict[str, Any] = {"response": self.name, "kind": self.kind, "level": level}
        if extrapolated.any():
            attrs["remark"] = f"{int(extrapolated.sum())} of {len(at)} points are extrapolated: measure there first"
        columns = {
            factor: ("point", column, *label)
            for (factor, label), column in zip(self.factors.items(), at.T, strict=True)
        }
        return labelled_dataset(
            {
                "point": ("point", np.arange(len(at)), "-", "point"),
                **columns,
                "mean": ("point", mean, unit, f"{name}, prediction"),
                "mean_sd": ("point", mean_sd, unit, f"{name}, standard deviation of the prediction"),
                "sd": ("point", sd, unit, f"{name}, standard deviation of a new measurement"),
                "lower": ("point", mean - wide, unit, f"{name}, lower end of the prediction interval"),
                "upper": ("point", mean + wide, unit, f"{name}, upper end of the prediction interval"),
                "extrapolated": ("point", extrapolated, "-", "outside of the fitted points"),
            },
            attrs=attrs,
        )

    def extrapolated(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points, shape (n, m), lie outside of those that were fitted."""
        measured = self.points
        if self.hull is None:
            inside = np.all((points >= measured.min(axis=0)) & (points <= measured.max(axis=0)), axis=1)
        else:
            inside = self.hull.depth(points)[0] >= -EDGE
        return np.asarray(~(inside & self.surface.supports(points)), dtype=np.bool_)

    def to_parameters(self) -> ParameterFile:
        """Give everything, the points included, as `to_toml` writes it."""
        return response_file(vars(self))

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> ResponseModel:
        """Make the model of a file that `to_toml` wrote; needs no scikit-learn."""
        return cls(**read_response(file))


described(ResponseModel, rows=_rows)


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
        prediction = model.predict({name: columns[name].ravel() for name in model.factors}, level=level)
        beyond = prediction["extrapolated"].to_numpy()
        outside[model.name] = int(beyond.sum())
        keep = np.ones(beyond.shape, dtype=bool) if extrapolate else ~beyond
        for ending, part in _PARTS.items():
            values = np.where(keep, prediction[part].to_numpy(), np.nan).reshape(shape)
            variables[f"{model.name}{ending}"] = (dims, values, *label_of(prediction[part]))
        if extrapolate:
            where = beyond.reshape(shape).astype(np.int8)
            variables[f"{model.name}_extrapolated"] = (dims, where, *label_of(prediction["extrapolated"]))
    table = labelled_dataset(variables, attrs={"level": level}).set_coords(beside)
    for model in models:
        table[model.name].attrs["source"] = "predicted"
    return table, outside
