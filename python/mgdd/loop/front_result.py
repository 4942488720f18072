"""The front of two objectives: a model of each over all readings, and its points that no other point beats in both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.optimize.inputs import unit_of_input
from mgdd.results.describe import Row
from mgdd.results.finding import Finding, findings_html
from mgdd.results.labels import labelled_dataset, named_label
from mgdd.results.result import Result
from mgdd.results.units import unit_of
from mgdd.surrogate import fit_response

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from mgdd.optimize import Input, Limit
    from mgdd.surrogate import ResponseModel
    from mgdd.surrogate.response_fit import ResponseFit

    Numbers = NDArray[np.float64]

_DEGREES, _MOST_TERMS = (2, 3, 4), 40
_SLACK = 1.05  # of the left-out error: a higher degree has to be better by more
_CANDIDATES, _SPREAD = 4096, (0.1, 0.03, 0.01)  # of the range of the readings, round by round
_ROUNDING = 1e-9  # of what was measured: a polynomial of noise-free readings states less than it can hold
_SURE = 2.0


@dataclass(frozen=True, kw_only=True, repr=False)
class FrontResult(Result):
    """A front of two objectives, from the best of one to the best of the other.

    Parameters
    ----------
    dataset : xarray.Dataset
        Over ``point``: ``inputs``, ``objectives`` and ``objectives_sd``, their predictions and standard deviations, and
        ``limits`` where there are limits. Over ``cycle``: ``applied``, ``measured``, ``measured_limits``, ``weight`` of
        the first objective in the sum that was sought in that cycle, and ``void``.
    models : dict of str to ResponseModel
        Of every objective and limit, over the inputs.
    findings : tuple of Finding
        Reasons to doubt it: codes ``few_cycles``, ``one_best``, ``above_limit``, ``uncertain``, ``interrupted``, and
        those of the fits, with the name of the objective or limit in front.
    """

    dataset: xr.Dataset
    models: dict[str, ResponseModel]
    findings: tuple[Finding, ...]

    def _rows(self) -> list[Row]:
        data = self.dataset
        rows = [Row("points", str(data.sizes["point"])), Row("cycles", str(data.sizes["cycle"]))]
        for over, values in (("input", data["inputs"]), ("objective", data["objectives"])):
            for name in map(str, data[over].to_numpy()):
                own = values.sel({over: name}).to_numpy()
                rows.append(Row(name, f"{own[0]:.5g} to {own[-1]:.5g}", unit_of(name)))
        return rows + [Row("doubt", str(finding)) for finding in self.findings]

    def _repr_html_(self) -> str:
        return super()._repr_html_() + findings_html("Reasons to doubt it", self.findings)

    def _draw(self, ax: Axes | None) -> Axes:
        from mgdd.plot.style import BLUE, GREY, legend, new_axes

        ax = new_axes(ax)
        first, second = (self.dataset["objectives"].isel(objective=k).to_numpy() for k in (0, 1))
        sd = self.dataset["objectives_sd"].to_numpy()
        read = self.dataset["measured"].to_numpy()
        cloud = ax.plot(read[:, 0], read[:, 1], ".", color=GREY, markersize=3, label="readings")
        front = ax.plot(first, second, "o-", color=BLUE, markersize=4, label="front")
        ax.errorbar(first, second, xerr=sd[:, 0], yerr=sd[:, 1], fmt="none", ecolor=BLUE, elinewidth=0.8)
        names = [str(name) for name in self.dataset["objective"].to_numpy()]
        ax.set(
            **{f"{axis}label": f"{name} [{named_label(name).units}]" for axis, name in zip("xy", names, strict=True)}
        )
        legend(ax, [*cloud, *front])
        return ax


def undominated(values: Numbers) -> NDArray[np.bool_]:
    """Return which rows, shape (n, 2), to be maximised, no other row beats in both columns."""
    order = np.lexsort((-values[:, 1], -values[:, 0]))
    best = np.r_[-math.inf, np.maximum.accumulate(values[order, 1])[:-1]]
    out = np.zeros(len(values), np.bool_)
    out[order] = values[order, 1] > best
    return out


def front_of(
    inputs: Sequence[Input],
    signs: Mapping[str, float],
    limits: Sequence[Limit],
    *,
    applied: Numbers,
    measured: Numbers,
    measured_limits: Numbers,
    weight: Numbers,
    void: NDArray[np.bool_],
    late: int,
    points: int,
    seed: int,
    interrupted: bool,
) -> FrontResult:
    """Fit every quantity to all readings, `late` cycles after their inputs, and find the front of the fits."""
    names, wanted = [one.name for one in inputs], list(signs)
    valid = ~void[late:]
    caused = applied[: len(applied) - late][valid]
    columns = dict(zip(names, caused.T, strict=True))
    fits = {name: fit_of(columns, measured[late:][valid][:, k]) for k, name in enumerate(wanted)}
    fits |= {limit.name: fit_of(columns, measured_limits[late:][valid][:, k]) for k, limit in enumerate(limits)}
    models = {name: fit.model for name, fit in fits.items()}
    at, kept = _front_inputs(models, signs, limits, caused, seed)
    at = at[_spaced(_signed(models, signs, at), points)]
    predicted = {name: model.predict(dict(zip(names, at.T, strict=True))) for name, model in models.items()}
    mean, sd = (np.column_stack([predicted[name][what].to_numpy() for name in wanted]) for what in ("mean", "mean_sd"))
    of, unit = "unit of the objective", "unit of the input"
    data: dict[str, tuple[Any, ...]] = {
        "point": ("point", np.arange(len(at)), "-", "point of the front"),
        "input": ("input", names, "-", "input of the plant"),
        "input_units": ("input", [unit_of_input(one) for one in inputs], "-", unit),
        "objective": ("objective", wanted, "-", "objective"),
        "cycle": ("cycle", np.arange(len(applied))),
        "inputs": (("point", "input"), at, unit, "inputs on the front"),
        "objectives": (("point", "objective"), mean, of, "objective predicted"),
        "objectives_sd": (("point", "objective"), sd, of, "standard deviation of the prediction"),
        "applied": (("cycle", "input"), applied, unit, "input that the plant applied"),
        "measured": (("cycle", "objective"), measured, of, "objective measured"),
        "weight": ("cycle", weight, "-", "weight of the first objective in the sum that was sought"),
        "void": ("cycle", void, "-", "cycle that was not used"),
    }
    if limits:
        held = [limit.name for limit in limits]
        table = np.column_stack([predicted[name]["mean"].to_numpy() for name in held])
        own = "unit of the limit"
        data["limit"] = ("limit", held, "-", "limited quantity")
        data["limits"] = (("point", "limit"), table, own, "limited quantity predicted")
        data["measured_limits"] = (("cycle", "limit"), measured_limits, own, "limited quantity measured")
    dataset = labelled_dataset(data).set_coords("input_units")
    dataset.attrs |= {f"objective_{name}": "max" if sign > 0.0 else "min" for name, sign in signs.items()}
    least = _ROUNDING * (np.nanmax(measured, axis=0) - np.nanmin(measured, axis=0))
    findings = [*_doubts(mean, np.maximum(sd, least), wanted, len(applied), len(inputs)), *_of_fits(fits)]
    if not kept:
        text = "no input that was tried holds the limits by their models: the front is without them"
        findings.append(Finding("above_limit", tuple(limit.name for limit in limits), text, "widen the bounds"))
    if interrupted:
        findings.append(Finding("interrupted", (), f"interrupted after {len(applied)} cycles"))
    if findings:
        dataset.attrs["findings"] = "\n".join(map(str, findings))
    return FrontResult(dataset=dataset, models=models, findings=tuple(findings))


def fit_of(columns: Mapping[str, Numbers], values: Numbers) -> ResponseFit:
    """Fit the polynomial of the lowest degree that predicts left-out readings about as well as any."""
    inputs = len(columns)
    fits: list[tuple[float, ResponseFit]] = []
    for degree in _DEGREES:
        terms = math.comb(inputs + degree, degree)
        if fits and (terms > _MOST_TERMS or 2 * terms > values.size):
            break
        fit = fit_response(columns, values, degree=degree)
        fits.append((math.inf if fit.test is None else fit.test.rmse, fit))
    least = min(error for error, _ in fits)
    return next(fit for error, fit in fits if error <= _SLACK * least)


def _signed(models: Mapping[str, ResponseModel], signs: Mapping[str, float], at: Numbers) -> Numbers:
    """Predict the objectives, to be maximised."""
    return np.column_stack([sign * models[name].surface.predict(at)[0] for name, sign in signs.items()])


def _front_inputs(
    models: Mapping[str, ResponseModel], signs: Mapping[str, float], limits: Sequence[Limit], tried: Numbers, seed: int
) -> tuple[Numbers, bool]:
    """Find inputs that no other input beats in both models, among what was tried, and whether they hold the limits."""
    rng = np.random.default_rng(seed)
    low, high = tried.min(axis=0), tried.max(axis=0)
    of_objectives = [models[name] for name in signs]

    def allowed(at: Numbers) -> NDArray[np.bool_]:
        out: NDArray[np.bool_] = ~np.any([model.extrapolated(at) for model in of_objectives], axis=0)
        return out

    def held(at: Numbers) -> NDArray[np.bool_]:
        over = [models[limit.name].surface.predict(at)[0] > limit.upper - limit.margin for limit in limits]
        return ~np.any(over, axis=0) if over else np.ones(len(at), np.bool_)

    at = np.vstack([tried, rng.uniform(low, high, (_CANDIDATES, tried.shape[1]))])
    at = at[allowed(at)]
    if not len(at):
        raise DataError("front: every input tried is outside of its own models; take more cycles")
    keeps = bool(held(at).any())
    for spread in (*_SPREAD, 0.0):
        at = at[held(at)] if keeps else at
        at = at[undominated(_signed(models, signs, at))]
        if spread:
            near = np.repeat(at, math.ceil(_CANDIDATES / len(at)), axis=0)
            near = np.clip(near + spread * (high - low) * rng.standard_normal(near.shape), low, high)
            at = np.vstack([at, near[allowed(near)]])
    return at[np.argsort(-_signed(models, signs, at)[:, 0], kind="stable")], keeps


def _spaced(values: Numbers, points: int) -> NDArray[np.intp]:
    """Choose rows of a front at even distances, in shares of its ranges, both ends included."""
    span = np.ptp(values, axis=0)
    steps = np.linalg.norm(np.diff(values, axis=0) / np.where(span > 0.0, span, 1.0), axis=1)
    way = np.r_[0.0, np.cumsum(steps)]
    chosen = [int(np.argmin(np.abs(way - there))) for there in np.linspace(0.0, way[-1], points)]
    return np.unique(chosen)


def _doubts(mean: Numbers, sd: Numbers, names: Sequence[str], cycles: int, inputs: int) -> list[Finding]:
    out = list[Finding]()
    if cycles < 20 * (inputs + 1):
        out.append(Finding("few_cycles", (), f"{cycles} cycles are few", f"take {20 * (inputs + 1)} at least"))
    for k, name in enumerate(names):
        span = float(np.ptp(mean[:, k]))
        if span <= _SURE * float(sd[:, k].max()):
            text = f"{name} changes by {span:.3g} along the front, which its uncertainty may be"
            out.append(Finding("one_best", (name,), text, "the objectives may not conflict: seek their sum"))
        elif float(np.median(sd[:, k])) > 0.1 * span:
            text = f"{name} is known to {np.median(sd[:, k]):.2g} only, of {span:.3g} along the front"
            out.append(Finding("uncertain", (name,), text, "take more cycles"))
    return out


def _of_fits(fits: Mapping[str, ResponseFit]) -> list[Finding]:
    """Repeat the reasons to doubt the fits; readings that follow a seeker are neither even nor in random order."""
    own = {"poor_prediction", "few_points", "lack_of_fit"}
    return [
        Finding(one.code, (name, *one.names), f"{name}: {one.text}", one.remedy)
        for name, fit in fits.items()
        for one in fit.findings
        if one.code in own
    ]
