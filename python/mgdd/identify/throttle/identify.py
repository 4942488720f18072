"""One call for every throttle model: check the log, fit, test on another log, and report what stays open."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import ParameterError
from mgdd.identify.throttle.first_principle_problem import shows_limp_home
from mgdd.identify.throttle.fits import CHOICES, PSEUDO_WIENER, check_kind, fit_kind
from mgdd.identify.throttle.free_run import as_log, below_ceiling, free_run, quality_of, source_of
from mgdd.identify.throttle.prior import prior_of
from mgdd.identify.throttle.record_content import moves_against, open_questions, record_content
from mgdd.identify.throttle.validation import entangled
from mgdd.io.throttle_checks import check_sides, check_throttle_log
from mgdd.results import Fit
from mgdd.results.finding import Finding, unique
from mgdd.results.fit import FitQuality

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.optimize import FitOptions
    from mgdd.results.fit import Model

_IDLE_DUTY = 0.03
# Rest, as the noise of a sensor and the soft corner of the preload leave it.
_REST_S, _REST_DEG, _READ_S = 0.01, 0.5, 0.004
_RAMP_DEG = 0.25


def read_off(log: xr.Dataset) -> float:
    """Return the angle at which a record begins at rest."""
    time, angle = log["time_s"].to_numpy(), log["angle_deg"].to_numpy()
    first = angle[: max(2, int(np.searchsorted(time, time[0] + _REST_S)))]
    if float(np.ptp(first)) > _REST_DEG:
        raise ParameterError(
            f"limp_home_deg = None: {source_of(log)} does not start at rest (it moves by "
            f"{float(np.ptp(first)):.2g} deg in {1e3 * _REST_S:g} ms), so limp-home cannot be read off it; give it"
        )
    return float(angle[: max(1, int(np.searchsorted(time, time[0] + _READ_S)))].mean())


def doubts(log: xr.Dataset, model: Model, home: float) -> tuple[Finding, ...]:
    """Report where limp-home was read off, and doubt it after the fit.

    At rest without duty, friction holds the plate within ramp friction/preload of limp-home, and anywhere if it
    exceeds the preload; under a duty it may rest anywhere.
    """
    names = ("limp_home_deg",)
    duty = float(log["duty"].to_numpy()[0])
    read = Finding("limp_home_read_off", names, f"limp-home was read off the first samples: {home:.3g} deg")
    remedy = "give limp_home_deg, or let the record begin without duty after the plate was released"
    if abs(duty) > _IDLE_DUTY:
        text = (
            f"the plate rests at {home:.3g} deg under a duty of {duty:.3g} when the record begins, so friction may "
            "hold it away from limp-home"
        )
        return read, Finding("limp_home_stuck", names, text, remedy)
    share = _friction_over_preload(model.parameters)
    if share is not None and share > 1.0:
        text = (
            f"friction is {share:.2g} times the preload, so the plate may rest anywhere without duty; limp-home was "
            f"read at {home:.3g} deg"
        )
        return read, Finding("limp_home_stuck", names, text, remedy)
    return (read,)


def stuck_elsewhere(log: xr.Dataset, model: Model) -> tuple[Finding, ...]:
    """Name a first rest outside the band about an estimated limp-home in which friction can hold the plate."""
    angle, p = log["angle_deg"].to_numpy(), model.parameters
    time = log["time_s"].to_numpy()
    first = angle[: max(2, int(np.searchsorted(time, time[0] + _REST_S)))]
    share = _friction_over_preload(p)
    if share is None or float(np.ptp(first)) > _REST_DEG:
        return ()
    rest, home = float(first.mean()), float(p["limp_home_deg"])
    band = float(p.get("ramp_deg", _RAMP_DEG)) * share + float(p.get("half_gap_deg", 0.0)) + _REST_DEG
    if share <= 1.0 and abs(rest - home) <= band:
        return ()
    text = (
        f"the record begins at rest at {rest:.3g} deg, and limp-home is {home:.3g} deg by the fit: friction holds the "
        "plate there"
    )
    return (Finding("limp_home_stuck", ("limp_home_deg",), text),)


def _friction_over_preload(p: Mapping[str, float]) -> float | None:
    """Return static friction over the smaller preload; None for a model that has neither."""
    if "delta_duty" in p:
        static = float(p["delta_duty"]) * (1.0 + float(p.get("stribeck_drop", 0.0)))
        return static / max(min(float(p["beta_above_duty"]), float(p["beta_below_duty"])), 1e-9)
    if "above_coulomb_duty" in p:
        friction = max(float(p["above_coulomb_duty"]), float(p["below_coulomb_duty"]))
        return friction / max(min(float(p["above_preload_duty"]), float(p["below_preload_duty"])), 1e-9)
    return None


_LOST_PERCENT = 10.0
_SIDE_DEG = 2.0
_PLATEAU_DEG, _PLATEAU_VISITS = 0.4, 3


def identify_throttle(
    log: Any,
    model: str = "auto",
    *,
    test: Any = None,
    limp_home_deg: float | None = None,
    two_sided: bool = False,
    closed_deg: float = 0.0,
    open_deg: float = 90.0,
    delay_samples: float | Sequence[float] | None = None,
    options: FitOptions | None = None,
) -> Fit:
    """Fit a throttle model to a log and test it on another.

    Parameters
    ----------
    log : Dataset, DataFrame or mapping of columns
        As `mgdd.io.read_throttle_log` gives it.
    model : {"auto", "first_principle", "pw_r", "pw_w", "pw_p"}
        Kind of the model. ``first_principle``: the groups of the plant, with as much of electrical lag, delay, Stribeck
        drop, presliding and gap as the log supports. ``pw_r``, ``pw_w``, ``pw_p``: pseudo-Wiener with friction inside,
        strict Wiener, Wiener with play. ``auto`` (the default): the groups, or PW-R fitted from them where that runs
        better on a quarter of the log that neither has seen; the findings give the reason.
    test : Dataset, DataFrame or mapping of columns, optional
        Another log, for the quality ``test``.
    limp_home_deg : float, optional
        Limp-home angle [deg], if it is known. None: the groups estimate it from a log that has been on both sides;
        otherwise the record starts at rest there, and the findings state which angle was read off it.
    two_sided : bool
        Fit a set of parameters above and one below limp-home (the groups have both always); the log must have been on
        both sides.
    closed_deg : float
        Lower mechanical stop [deg].
    open_deg : float
        Upper mechanical stop [deg].
    delay_samples : float or sequence of float, optional
        Samples until the duty acts, 0 to 20, of a pseudo-Wiener model 0 to 5; of several the best is kept. None: the
        groups look at 0 to 5, and on to 20 where the best are the longest; a pseudo-Wiener model has none.
    options : FitOptions, optional
        How hard to search; the number of starts is the model's own, the seed 0 without.

    Returns
    -------
    mgdd.results.Fit
        Model, report, quality of the free run without its first 50 ms, and findings.

    Raises
    ------
    DataError
        As in `mgdd.io.throttle_log`.
    ParameterError
        An unknown model; a record that does not start at rest, without `limp_home_deg`.

    Examples
    --------
    >>> from mgdd.identify import identify_throttle
    >>> from mgdd.signals import chirp
    >>> from mgdd.io import throttle_log
    >>> from mgdd.throttle import Throttle, simulate_throttle
    >>> signal = chirp(3.0, offset=0.15, amplitude=0.2)
    >>> run = simulate_throttle(Throttle(), signal["duty"], time_s=signal["time_s"])
    >>> from mgdd.optimize import FitOptions
    >>> log = throttle_log(run["time_s"], run["duty"], run["angle_deg"])
    >>> fit = identify_throttle(log, options=FitOptions(n_starts=2))
    >>> fit.kind, fit.train.nrmse_fit_percent > 98.0, fit.parameters["delay_samples"]
    ('first_principle', True, 0.0)
    """
    log = as_log(log)
    test = None if test is None else as_log(test, "test")
    ParameterError.unless(model in CHOICES, "model", model, f"one of {', '.join(map(repr, CHOICES))}")
    check_kind(model, two_sided=two_sided, delay_samples=delay_samples)
    ParameterError.unless(closed_deg < open_deg, "open_deg", open_deg, f"above closed_deg = {closed_deg:.12g}")
    check_throttle_log(log)
    if test is not None:
        check_throttle_log(test)
    limp_home = limp_home_deg
    # What both sides of a log settle is better estimated than read.
    estimated = limp_home is None and model not in PSEUDO_WIENER and shows_limp_home(log)
    if limp_home is None and (two_sided or model in PSEUDO_WIENER or (model == "auto" and not estimated)):
        limp_home = read_off(log)
    if two_sided and limp_home is not None:
        check_sides(log, limp_home)
    fit = fit_kind(
        log, model, limp_home_deg=None if estimated else limp_home, two_sided=two_sided, delay_samples=delay_samples,
        stops_deg=(closed_deg, open_deg), options=options,
    )  # fmt: skip
    tested = None if test is None else quality_of([free_run(fit.model, test)])
    beyond = _carried_over(fit.train, tested)
    if test is not None and not beyond and all(finding.code != "below_ceiling" for finding in fit.findings):
        beyond = below_ceiling([test], tested, "the test log")
    prior = prior_of(fit.model)
    home = prior.limp_home_deg if estimated or limp_home is None else limp_home
    time, duty, angle = (log[name].to_numpy() for name in ("time_s", "duty", "angle_deg"))
    content = record_content(time, angle, limp_home_deg=home, stops_deg=prior.stops_deg)
    questions = open_questions(content, swing=prior.swing, pairs=entangled(fit.report))
    # The report names correlated pairs, too; here each comes with its remedy.
    of_fit = (finding for finding in fit.findings if finding.code != "correlated")
    read: tuple[Finding, ...] = ()
    if limp_home_deg is None:
        read = stuck_elsewhere(log, fit.model) if limp_home is None or estimated else doubts(log, fit.model, limp_home)
    stops = _plateaus(log, home, (closed_deg, open_deg))
    against = moves_against(time, duty, angle, (closed_deg, open_deg))
    findings = unique((*against, *of_fit, *beyond, *read, *stops, *questions))
    return dataclasses.replace(fit, test=tested, findings=findings)


def _carried_over(train: FitQuality | None, test: FitQuality | None) -> tuple[Finding, ...]:
    """Report a fit that holds for its own log only."""
    trained, tested = (None if quality is None else quality.nrmse_fit_percent for quality in (train, test))
    if trained is None or tested is None or trained - tested < _LOST_PERCENT:
        return ()
    text = (
        f"the fit meets its own log at {trained:.1f} % and the test log at {tested:.1f} %: what it has learned does "
        "not carry over"
    )
    remedy = "fit fewer parameters, from more starts, or to a log that excites them all"
    return (Finding("overfitted", (), text, remedy),)


def _plateaus(log: xr.Dataset, home: float | None, stops_deg: tuple[float, float]) -> tuple[Finding, ...]:
    """Name an extreme angle that the plate meets again and again inside the travel: a stop that was not given."""
    angle = log["angle_deg"].to_numpy()
    low, high = float(angle.min()), float(angle.max())
    findings = []
    for name, extreme, stop, share in (
        ("closed_deg", low, stops_deg[0], angle - low),
        ("open_deg", high, stops_deg[1], high - angle),
    ):
        inside = abs(extreme - stop) > _SIDE_DEG and (home is None or abs(extreme - home) > _SIDE_DEG)
        if inside and _visits(share < _PLATEAU_DEG) >= _PLATEAU_VISITS:
            text = f"the plate stops at {extreme:.3g} deg again and again, {name} is {stop:g} deg"
            findings.append(Finding("unknown_stop", (name,), text, "if there is a stop, give it"))
    return tuple(findings)


def _visits(there: NDArray[np.bool_]) -> int:
    """Count the separate stays of more than nine samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], there.astype(np.int8), [0]])))
    return int(np.count_nonzero(edges[1::2] - edges[::2] > 9))
