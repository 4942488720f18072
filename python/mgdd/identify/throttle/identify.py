"""One call for every throttle model: check the log, fit, test on another log, and say what stays open."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import ParameterError
from mgdd.identify.throttle.fits import KINDS, check_kind, fit_kind
from mgdd.identify.throttle.free_run import free_run, quality_of, source_of
from mgdd.identify.throttle.prior import prior_of
from mgdd.identify.throttle.record_content import open_questions, record_content
from mgdd.identify.throttle.validation import entangled
from mgdd.io.throttle_checks import check_throttle_log
from mgdd.results import Finding, Fit
from mgdd.results.finding import unique
from mgdd.results.fit import FitQuality

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.optimize import FitOptions

__all__ = ["identify_throttle"]

_LOST_PERCENT = 10.0
_IDLE_DUTY, _SIDE_DEG = 0.03, 2.0
_PLATEAU_DEG, _PLATEAU_VISITS = 0.4, 3
# Rest, as the noise of a sensor and the soft corner of the preload leave it.
_REST_S, _REST_DEG, _READ_S = 0.01, 0.5, 0.004


def identify_throttle(
    log: xr.Dataset,
    model: str = "pw_r",
    *,
    test: xr.Dataset | None = None,
    limp_home_deg: float | None = None,
    two_sided: bool = False,
    closed_deg: float = 0.0,
    open_deg: float = 90.0,
    delay_samples: float | Sequence[float] = 0,
    options: FitOptions | None = None,
) -> Fit:
    """Fit a throttle model to a log and test it on another.

    Parameters
    ----------
    log : xarray.Dataset
        As `mgdd.io.read_throttle_log` gives it.
    model : {"pw_r", "pw_w", "pw_p", "first_principle"}
        Kind of the model: pseudo-Wiener with friction inside (the default), strict Wiener, Wiener with play, or the
        groups of the first-principle plant.
    test : xarray.Dataset, optional
        Another log, for the quality ``test``.
    limp_home_deg : float, optional
        Limp-home angle [deg], if it is known. None: the first-principle fit estimates it from a log that has been on
        both sides; otherwise the record starts at rest there, and the findings say which angle was read off it.
    two_sided : bool
        Fit a set of parameters above and one below limp-home; the log must have been on both sides.
    closed_deg, open_deg : float
        Mechanical stops [deg].
    delay_samples : float or sequence of float
        Samples, 0 to 5, until the duty acts; of several the best is kept. Pseudo-Wiener models only.
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
    >>> from mgdd.throttle import Throttle, simulate
    >>> signal = chirp(3.0, offset=0.15, amplitude=0.2)
    >>> run = simulate(Throttle(), signal["duty"], time_s=signal["time_s"])
    >>> from mgdd.optimize import FitOptions
    >>> log = throttle_log(run["time_s"], run["duty"], run["angle_deg"])
    >>> fit = identify_throttle(log, options=FitOptions(n_starts=2))
    >>> fit.kind, fit.train.nrmse_fit_percent > 98.0
    ('pw_r', True)
    """
    if model not in KINDS:
        raise ParameterError.of("model", model, f"one of {', '.join(map(repr, KINDS))}")
    check_kind(model, two_sided=two_sided, delay_samples=delay_samples)
    if not closed_deg < open_deg:
        raise ParameterError.of("open_deg", open_deg, f"above closed_deg = {closed_deg:.12g}")
    check_throttle_log(log)
    if test is not None:
        check_throttle_log(test)
    limp_home = limp_home_deg
    if limp_home is None and (two_sided or model != "first_principle"):
        limp_home = _limp_home(log)
    if two_sided:
        check_throttle_log(log, two_sided=True, limp_home_deg=limp_home)
    known_home = limp_home_deg if model == "first_principle" else limp_home
    fit = fit_kind(
        log, model, limp_home_deg=known_home, two_sided=two_sided, delay_samples=delay_samples,
        stops_deg=(closed_deg, open_deg), options=options,
    )  # fmt: skip
    tested = None if test is None else quality_of([free_run(fit.model, test)])
    known = prior_of(fit.model)
    home = known.limp_home_deg if limp_home is None else limp_home
    content = record_content(
        log["time_s"].to_numpy(), log["angle_deg"].to_numpy(), limp_home_deg=home, stops_deg=known.stops_deg
    )
    asked = open_questions(content, swing=known.swing, pairs=entangled(fit.report))
    # The report names correlated pairs, too; here each comes with its remedy.
    own = (found for found in fit.findings if found.code != "correlated")
    read = _read_off(log, home) if limp_home_deg is None and model != "first_principle" else ()
    stops = _plateaus(log, home, (closed_deg, open_deg))
    findings = unique((*own, *_carried_over(fit.train, tested), *read, *stops, *asked))
    return dataclasses.replace(fit, test=tested, findings=findings)


def _carried_over(train: FitQuality | None, test: FitQuality | None) -> tuple[Finding, ...]:
    """Report a fit that holds for its own log only."""
    own, other = (None if quality is None else quality.nrmse_fit_percent for quality in (train, test))
    if own is None or other is None or own - other < _LOST_PERCENT:
        return ()
    text = (
        f"the fit meets its own log at {own:.1f} % and the test log at {other:.1f} %: what it has learned does "
        "not carry over"
    )
    remedy = "fit fewer parameters, from more starts, or to a log that excites them all"
    return (Finding("overfitted", (), text, remedy),)


def _read_off(log: xr.Dataset, home: float | None) -> tuple[Finding, ...]:
    """Say where limp-home was read off, and doubt it where friction may hold the plate elsewhere."""
    duty, angle = log["duty"].to_numpy(), log["angle_deg"].to_numpy()
    if home is None:
        return ()
    text, remedy = f"limp-home was read off the first samples: {home:.3g} deg", ""
    if abs(float(duty[0])) > _IDLE_DUTY and angle.min() < home - _SIDE_DEG and angle.max() > home + _SIDE_DEG:
        text += (
            f"; the duty is {float(duty[0]):.3g} there and the plate goes to both sides, so friction may have held it "
            "elsewhere"
        )
        remedy = "give limp_home_deg"
    return (Finding("limp_home_read_off", ("limp_home_deg",), text, remedy),)


def _plateaus(log: xr.Dataset, home: float | None, stops_deg: tuple[float, float]) -> tuple[Finding, ...]:
    """Name an extreme angle that the plate meets again and again inside the travel: a stop that was not given."""
    angle = log["angle_deg"].to_numpy()
    low, high = float(angle.min()), float(angle.max())
    found = []
    for name, extreme, stop, share in (
        ("closed_deg", low, stops_deg[0], angle - low),
        ("open_deg", high, stops_deg[1], high - angle),
    ):
        inside = abs(extreme - stop) > _SIDE_DEG and (home is None or abs(extreme - home) > _SIDE_DEG)
        if inside and _visits(share < _PLATEAU_DEG) >= _PLATEAU_VISITS:
            text = f"the plate stops at {extreme:.3g} deg again and again, {name} is {stop:g} deg"
            found.append(Finding("unknown_stop", (name,), text, "if there is a stop, give it"))
    return tuple(found)


def _visits(there: NDArray[np.bool_]) -> int:
    """Count the separate stays of more than nine samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], there.astype(np.int8), [0]])))
    return int(np.count_nonzero(edges[1::2] - edges[::2] > 9))


def _limp_home(log: xr.Dataset) -> float:
    time, angle = log["time_s"].to_numpy(), log["angle_deg"].to_numpy()
    first = angle[: max(2, int(np.searchsorted(time, time[0] + _REST_S)))]
    if float(np.ptp(first)) > _REST_DEG:
        raise ParameterError(
            f"limp_home_deg = None: {source_of(log)} does not start at rest (it moves by "
            f"{float(np.ptp(first)):.2g} deg in {1e3 * _REST_S:g} ms), so limp-home cannot be read off it; give it"
        )
    return float(angle[: max(1, int(np.searchsorted(time, time[0] + _READ_S)))].mean())
