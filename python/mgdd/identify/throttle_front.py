"""One call for every throttle model: check the log, fit, test on another log, and say what stays open."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import ParameterError
from mgdd.identify.metrics import fit_percent, rmse
from mgdd.identify.prior import prior_of
from mgdd.identify.record_content import open_questions, record_content
from mgdd.identify.throttle_fit import KINDS, ThrottleFit
from mgdd.identify.throttle_fits import fit_kind
from mgdd.identify.throttle_validation import discarded, entangled, free_run
from mgdd.io import check_throttle_log

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["identify_throttle"]

_LOST_PERCENT = 10.0
# Rest, as the noise of a sensor and the soft corner of the preload leave it.
_REST_S, _REST_DEG, _READ_S = 0.01, 0.5, 0.004


def identify_throttle(
    log: xr.Dataset,
    model: str = "pw_r",
    *,
    test: xr.Dataset | None = None,
    limp_home_deg: float | None = None,
    two_sided: bool = False,
    starts: int | None = None,
    seed: int = 0,
) -> ThrottleFit:
    """Fit a throttle model to a log and test it on another.

    Parameters
    ----------
    log : xarray.Dataset
        As `mgdd.io.read_throttle_log` gives it.
    model : {"pw_r", "pw_w", "pw_p", "first_principle"}
        Kind of the model: pseudo-Wiener with friction inside (the default), strict Wiener, Wiener with play, or the
        groups of the first-principle plant.
    test : xarray.Dataset, optional
        Another log, for ``fit_percent_test`` and ``rmse_test_deg``.
    limp_home_deg : float, optional
        Limp-home angle [deg], if it is known. None: the first-principle fit estimates it, for the others the record
        starts at rest there.
    two_sided : bool
        Fit a set of parameters above and one below limp-home; the log must have been on both sides.
    starts : int, optional
        Starts of the search; None takes the model's own number.
    seed : int
        Of the starts.

    Returns
    -------
    ThrottleFit
        Model, report, fits in percent, and findings in words.

    Raises
    ------
    DataError
        All of `mgdd.io.check_throttle_log`.
    ParameterError
        An unknown model; a record that does not start at rest, without `limp_home_deg`.

    Examples
    --------
    >>> from mgdd.identify import chirp, identify_throttle
    >>> from mgdd.io import throttle_log
    >>> from mgdd.throttle import Throttle, simulate
    >>> signal = chirp(3.0, offset=0.15, amplitude=0.2)
    >>> run = simulate(Throttle(), signal["duty"], time_s=signal["time_s"])
    >>> fit = identify_throttle(throttle_log(run["time_s"], run["duty"], run["angle_deg"]), starts=2)
    >>> fit.kind, fit.fit_percent_train > 98.0
    ('pw_r', True)
    """
    if model not in KINDS:
        raise ParameterError(f"model = {model!r}: must be one of {', '.join(map(repr, KINDS))}")
    check_throttle_log(log)
    if test is not None:
        check_throttle_log(test)
    limp_home = limp_home_deg
    if limp_home is None and (two_sided or model != "first_principle"):
        limp_home = _limp_home(log)
    if two_sided:
        check_throttle_log(log, two_sided=True, limp_home_deg=limp_home)
    known_home = limp_home_deg if model == "first_principle" else limp_home
    fit = fit_kind(log, model, limp_home_deg=known_home, two_sided=two_sided, starts=starts, seed=seed)
    train, _ = _quality(fit, log)
    tested = (None, None) if test is None else _quality(fit, test)
    known = prior_of(fit.model)
    home = known.limp_home_deg if limp_home is None else limp_home
    content = record_content(
        log["time_s"].to_numpy(), log["angle_deg"].to_numpy(), limp_home_deg=home, stops_deg=known.stops_deg
    )
    asked = open_questions(content, swing=known.swing, pairs=entangled(fit.report))
    # The report names correlated pairs, too; here each comes with its remedy.
    own = (text for text in fit.findings if not (text in fit.report.findings and ": correlation " in text))
    findings = tuple(dict.fromkeys((*own, *_carried_over(train, tested[0]), *asked)))
    return dataclasses.replace(
        fit,
        fit_percent_train=train,
        fit_percent_test=tested[0],
        rmse_test_deg=tested[1],
        findings=findings,
        source=str(log.attrs.get("file", "log")),
    )


def _quality(fit: ThrottleFit, log: xr.Dataset) -> tuple[float, float]:
    """Return free-run fit [%] and error [deg], without the start."""
    run = free_run(fit.model, log)
    skip = discarded(log)
    measured, modelled = run["angle_deg"].to_numpy()[skip:], run["model_deg"].to_numpy()[skip:]
    return fit_percent(measured, modelled), rmse(measured, modelled)


def _carried_over(train: float, test: float | None) -> tuple[str, ...]:
    """Say that a fit holds for its own log only."""
    if test is None or train - test < _LOST_PERCENT:
        return ()
    text = (
        f"the fit meets its own log at {train:.1f} % and the test log at {test:.1f} %: what it has learned does "
        "not carry over; fit fewer parameters, from more starts, or to a log that excites them all"
    )
    return (text,)


def _limp_home(log: xr.Dataset) -> float:
    time, angle = log["time_s"].to_numpy(), log["angle_deg"].to_numpy()
    first = angle[: max(2, int(np.searchsorted(time, time[0] + _REST_S)))]
    if float(np.ptp(first)) > _REST_DEG:
        raise ParameterError(
            f"limp_home_deg = None: {log.attrs.get('file', 'log')} does not start at rest (it moves by "
            f"{float(np.ptp(first)):.2g} deg in {1e3 * _REST_S:g} ms), so limp-home cannot be read off it; give it"
        )
    return float(angle[: max(1, int(np.searchsorted(time, time[0] + _READ_S)))].mean())
