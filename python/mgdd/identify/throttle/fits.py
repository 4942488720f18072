"""Which function fits which kind of throttle model, and how a saved one becomes a model again."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import Interrupted, ParameterError
from mgdd.identify.throttle.automatic import fit_groups
from mgdd.identify.throttle.first_principle_model import LONGEST_DELAY, FirstPrincipleModel
from mgdd.identify.throttle.first_principle_problem import groups_problem
from mgdd.identify.throttle.pseudo_wiener_fit import fit_pseudo_wiener
from mgdd.io.parameters import ParameterFile
from mgdd.optimize import FitOptions
from mgdd.results import Fit
from mgdd.results.finding import Finding
from mgdd.signals.metrics import nrmse_fit_percent
from mgdd.throttle import PseudoWiener

if TYPE_CHECKING:
    import os

    import xarray as xr

    from mgdd.results.fit import Model

_EARLY = 0.75  # of the log, for both models; they are compared on the rest
_BETTER_PERCENT = 0.3  # PW-R must gain that much to replace the groups, which have physical meaning
_STIFFEST_SPRING = 0.02  # that PW-R has [duty/deg]; the groups have stiffer ones below limp-home
_LONGEST_DELAY = 5.0  # that PW-R has [samples]
_LEAST_SAMPLES, _LEAST_DEG = 100, 1.0


def fit_auto(
    log: xr.Dataset,
    *,
    fixed: Mapping[str, float] | None = None,
    delays: Sequence[float] = range(21),
    stops_deg: tuple[float, float] = (0.0, 90.0),
    options: FitOptions | None = None,
) -> Fit:
    """Fit the groups with the structure that the log supports, and PW-R from their result; keep the better.

    Both are fitted to three quarters of the log and run on to its end. PW-R must be better there, and also when it is
    fitted to the whole log: a plate that stuck elsewhere once before the last quarter stays there through it.
    """
    groups = fit_groups(log, fixed=fixed, delays=delays, stops_deg=stops_deg, options=options)
    first = round(_EARLY * log.sizes["time_s"])
    early, angle = log.isel(time_s=slice(0, first)), log["angle_deg"].to_numpy()
    parts = (angle[:first], angle[first:])
    if any(part.size < _LEAST_SAMPLES or np.ptp(part) < _LEAST_DEG for part in parts):
        text = "the groups were taken without a comparison: too little happens in the last quarter of the log"
        return _with(groups, Finding("model_chosen", (), text))
    iterations = FitOptions(max_iterations=None if options is None else options.max_iterations)
    try:
        ours = _groups_again(groups, early, fixed, stops_deg)
        try:
            start = pseudo_wiener_of(ours)
        except ParameterError as error:
            text = f"the groups were taken without a comparison: PW-R is not made for such a throttle ({error})"
            return _with(groups, Finding("model_chosen", (), text))
        other = _pw_r(start, early, iterations)
        percent = [_percent_after(model, log, first) for model in (ours, other.model)]
        better = percent[1] > percent[0] + _BETTER_PERCENT
        # The groups may start PW-R in a valley of their own: it is also searched from no delay.
        best = min((_pw_r(each, log, iterations) for each in _starts(other.model)), key=_rmse) if better else groups
        if better and _rmse(best) > _rmse(groups):  # one event of the last quarter, not the model
            better, best = False, groups
    except Interrupted as stop:
        raise Interrupted(str(stop), groups) from stop
    text = (
        f"{'PW-R was' if better else 'the groups were'} taken: fitted to three quarters of the log, the groups meet "
        f"the last one at {percent[0]:.2f} % and PW-R, from their result, at {percent[1]:.2f} %"
    )
    return _with(best, Finding("model_chosen", (), text))


def _groups_again(
    groups: Fit, early: xr.Dataset, fixed: Mapping[str, float] | None, stops_deg: tuple[float, float]
) -> FirstPrincipleModel:
    """Fit what the whole log has chosen to a part of it."""
    model = groups.model
    names = [name for name in groups.report.names if name in model.parameters]
    problem = groups_problem(early, start_values=model.parameters, stops_deg=stops_deg)
    gone = {*problem.unvisited, *(fixed or {})}
    search = problem.search(
        model.parameters,
        [name for name in names if name not in gone],
        substeps=model.substeps,
        tolerance=1e-6,
        max_iterations=30,
    )
    again: FirstPrincipleModel = dataclasses.replace(model, parameters=search.values)
    return again


def _pw_r(start: PseudoWiener, log: xr.Dataset, options: FitOptions) -> Fit:
    """Search PW-R once."""
    values = start.parameters
    limp_home, angle = values["limp_home_deg"], log["angle_deg"].to_numpy()
    visited = [bool(angle.max() > limp_home + 1.0), bool(angle.min() < limp_home - 1.0)]
    sides = "both" if all(visited) else "above" if visited[0] else "below"
    return fit_pseudo_wiener(
        log, "pw_r", limp_home_deg=limp_home, sides=sides, delay_samples=values["delay_samples"], start_values=start,
        options=options,
    )  # fmt: skip


def _starts(model: PseudoWiener) -> list[PseudoWiener]:
    """Give a model and the same without its delay."""
    return [model, PseudoWiener("pw_r", {**model.parameters, "delay_samples": 0.0})]


def pseudo_wiener_of(model: FirstPrincipleModel) -> PseudoWiener:
    """Give PW-R of the groups, without lag, drop, presliding and gap."""
    p = model.parameters
    values = {name: p[name] for name in ("limp_home_deg", "delay_samples", "ramp_deg")}
    if values["delay_samples"] < _LONGEST_DELAY + 0.5:  # searched, it may pass the last by a fraction
        values["delay_samples"] = min(values["delay_samples"], _LONGEST_DELAY)
    for side in ("above", "below"):
        values |= {
            f"{side}_tau_s": p["tau_s"],
            f"{side}_gain_deg_per_s2_per_duty": p["gain_deg_per_s2_per_duty"],
            f"{side}_preload_duty": p[f"beta_{side}_duty"],
            f"{side}_spring_duty_per_deg": min(p[f"kappa_{side}_duty_per_deg"], _STIFFEST_SPRING),
            f"{side}_coulomb_duty": p["delta_duty"],
        }
    settings = {"closed_deg": model.closed_deg, "open_deg": model.open_deg, "sample_s": model.sample_s}
    return PseudoWiener("pw_r", values | settings)


def _percent_after(model: Model, log: xr.Dataset, first: int) -> float:
    """Run free over the whole log and compare from sample `first` on."""
    angle = log["angle_deg"].to_numpy()
    run = model.simulate(log, initial_state={"angle_deg": float(angle[0])})["angle_deg"].to_numpy()
    percent = nrmse_fit_percent(angle[first:], run[first:])
    return -np.inf if percent is None or not np.isfinite(percent) else float(percent)


def _rmse(fit: Fit) -> float:
    return np.inf if fit.train is None else fit.train.rmse


def _with(fit: Fit, finding: Finding) -> Fit:
    return dataclasses.replace(fit, findings=(*fit.findings, finding))


PSEUDO_WIENER = ("pw_r", "pw_w", "pw_p")
KINDS = ("first_principle", *PSEUDO_WIENER)
CHOICES = ("auto", *KINDS)
_DELAYS = tuple(float(delay) for delay in range(int(LONGEST_DELAY) + 1))
_PW_DELAY = 5.0  # the longest of a pseudo-Wiener model, whose delay line is part of its state


def fit_kind(
    log: xr.Dataset,
    kind: str,
    *,
    limp_home_deg: float | None,
    two_sided: bool,
    delay_samples: float | Sequence[float] | None,
    stops_deg: tuple[float, float],
    options: FitOptions | None,
) -> Fit:
    """Fit a kind with what the caller gives; what is None keeps the fit's own default."""
    if kind not in PSEUDO_WIENER:
        fixed = None if limp_home_deg is None else {"limp_home_deg": limp_home_deg}
        fit = fit_auto if kind == "auto" else fit_groups
        delays = _DELAYS if delay_samples is None else delays_of(delay_samples)
        return fit(log, fixed=fixed, delays=delays, stops_deg=stops_deg, options=options)
    closed, opened = stops_deg
    sides = "both" if two_sided else "shared"
    return fit_pseudo_wiener(
        log, kind, limp_home_deg=limp_home_deg, sides=sides, delay_samples=delay_samples or 0,
        options=_seeded(options), settings={"closed_deg": closed, "open_deg": opened},
    )  # fmt: skip


def check_kind(kind: str, *, two_sided: bool, delay_samples: float | Sequence[float] | None) -> None:
    """Refuse what the kind does not have, before the log is looked at."""
    if two_sided and kind in ("pw_w", "pw_p"):
        raise ParameterError(f"two_sided = True: {kind} has one set of parameters; only pw_r has one per side")
    longest = _PW_DELAY if kind in PSEUDO_WIENER else LONGEST_DELAY
    for delay in () if delay_samples is None else delays_of(delay_samples):
        ParameterError.unless(0.0 <= delay <= longest, "delay_samples", delay, f"within [0, {longest:g}]")


def delays_of(delay_samples: float | Sequence[float]) -> tuple[float, ...]:
    """Return the delays that were asked for, at least one."""
    delays = (delay_samples,) if isinstance(delay_samples, int | float) else tuple(delay_samples)
    if not delays:
        raise ParameterError("delay_samples = (): must be at least one delay")
    return tuple(float(delay) for delay in delays)


def load_throttle_model(path: str | os.PathLike[str]) -> Model:
    """Make a model of the parameters that a fit has written.

    Parameters
    ----------
    path : path-like
        TOML of `mgdd.results.Fit.to_toml`, as ``mgdd throttle identify --output`` writes it.

    Returns
    -------
    Model
        Ready to simulate.

    Raises
    ------
    FileNotFoundError
        No such file.
    DataError
        Not TOML, another kind or format version, a missing table or key.
    ParameterError
        An unknown key, another unit, a wrong type, a value outside its domain.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.identify import load_throttle_model
    >>> from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "fit.toml"
    ...     _ = file.write_text(FirstPrincipleModel().to_toml())
    ...     load_throttle_model(file).kind
    'first_principle'
    """
    file = ParameterFile.read(path)
    model = FirstPrincipleModel if file.kind == "first_principle" else PseudoWiener
    file.expect(kinds=KINDS, tables=file.tables, notes=file.notes)
    return model.of_file(file)


def _seeded(options: FitOptions | None) -> FitOptions:
    """Return the options with the seed of every identification, 0."""
    chosen = options or FitOptions()
    return chosen if chosen.seed is not None else replace(chosen, seed=0)
