"""How far a throttle model can be trusted: free run, n steps ahead, what is left, and what the log cannot tell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._describe import described
from mgdd.errors import DataError
from mgdd.identify.metrics import ResidualTests, fit_percent, mse, residual_tests, rmse, vaf_percent
from mgdd.identify.n_step import DISCARD_S, columns_of, n_step_rms, samples_of, step_of, whole_horizons
from mgdd.identify.prior import prior_of
from mgdd.identify.record_content import open_questions, record_content
from mgdd.identify.throttle_fit import ThrottleFit, ThrottleModel
from mgdd.io import check_throttle_log
from mgdd.results import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.optimize import FitReport

__all__ = ["ThrottleValidation", "correlation_dataset", "validate_throttle"]

_CORRELATED = 0.98
_GOOD_PERCENT = 85.0


@described
@dataclass(frozen=True, kw_only=True)
class ThrottleValidation:
    """A model against a log.

    Parameters
    ----------
    kind : str
        Kind of the model.
    fit_percent, vaf_percent : float
        Of the free run [%], without its first 50 ms.
    rmse_deg : float
        Error of the free run [deg].
    mse_deg2 : float
        Its square [deg²].
    n_step : xarray.Dataset
        ``n_step_rms_deg`` [deg] of the model and of "stays where it is" over ``horizon_s`` [s].
    tests : ResidualTests
        On the one-step residuals.
    free_run : xarray.Dataset
        ``duty``, ``angle_deg``, ``model_deg`` and ``residual_deg`` over ``time_s``.
    findings : tuple of str
        What to distrust, what the log cannot tell, and which excitation would.
    source : str
        Name of the log.

    Examples
    --------
    >>> from mgdd.identify import ThrottleValidation
    >>> "fit_percent" in ThrottleValidation.__dataclass_fields__
    True
    """

    kind: str
    fit_percent: float
    vaf_percent: float
    rmse_deg: float
    mse_deg2: float
    n_step: xr.Dataset = field(repr=False)
    tests: ResidualTests = field(repr=False)
    free_run: xr.Dataset = field(repr=False)
    findings: tuple[str, ...] = ()
    source: str = "log"

    def summary(self) -> str:
        """Say it in a few lines.

        Returns
        -------
        str
            Free run, n steps ahead, residual tests, findings.
        """
        rows = [
            f"{self.kind} on {self.source}: free-run fit {self.fit_percent:.2f} %, VAF {self.vaf_percent:.2f} %",
            f"free-run error {self.rmse_deg:.4g} deg RMS, {self.mse_deg2:.4g} deg² mean square",
        ]
        for horizon, pair in zip(self.n_step["horizon_s"].to_numpy(), self._growth(), strict=True):
            rows.append(f"{1e3 * horizon:4.0f} ms ahead {pair[0]:.4g} deg RMS (staying there: {pair[1]:.4g})")
        words = {True: "yes", False: "no"}
        rows.append(
            f"one-step residual white: {words[self.tests.white]} ({100 * self.tests.share_white:.0f} % of lags), "
            f"independent of the duty: {words[self.tests.independent]} ({100 * self.tests.share_independent:.0f} %)"
        )
        return "\n".join([*rows, *(f"  {finding}" for finding in self.findings)])

    def to_dict(self) -> dict[str, Any]:
        """Give figures and sentences as a dict, without the runs.

        Returns
        -------
        dict
            With ``n_step_rms`` by horizon in milliseconds.
        """
        names = ("kind", "source", "fit_percent", "vaf_percent", "rmse_deg", "mse_deg2")
        horizons = [f"{1e3 * h:g}" for h in self.n_step["horizon_s"].to_numpy()]
        growth = self._growth()
        return {name: getattr(self, name) for name in names} | {
            "n_step_rms": {h: pair[0] for h, pair in zip(horizons, growth, strict=True)},
            "n_step_rms_persistence": {h: pair[1] for h, pair in zip(horizons, growth, strict=True)},
            "residual_white": self.tests.white,
            "residual_independent": self.tests.independent,
            "share_white": self.tests.share_white,
            "share_independent": self.tests.share_independent,
            "findings": list(self.findings),
        }

    def _growth(self) -> list[list[float]]:
        values: list[list[float]] = (
            self.n_step["n_step_rms_deg"].transpose("horizon_s", "predictor").to_numpy().tolist()
        )
        return values


def validate_throttle(
    model: ThrottleModel | ThrottleFit,
    log: xr.Dataset,
    *,
    horizons_s: Sequence[float] | None = None,
    limp_home_deg: float | None = None,
) -> ThrottleValidation:
    """Validate a model, or a fit, on a log, best on one that it was not fitted to.

    Parameters
    ----------
    model : ThrottleModel or ThrottleFit
        The model; a fit also says which of its parameters are entangled.
    log : xarray.Dataset
        The log.
    horizons_s : sequence of float
        How far ahead predictions are tested [s]. None: 5, 20 and 50 ms, each as the nearest whole sample.
    limp_home_deg : float, optional
        Limp-home angle [deg]; None takes the model's.

    Returns
    -------
    ThrottleValidation
        Free run, n steps ahead, residual tests, findings.

    Raises
    ------
    DataError
        All of `mgdd.io.check_throttle_log`; a model that runs away.
    ParameterError
        A horizon that is no whole number of samples.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import validate_throttle
    >>> from mgdd.io import throttle_log
    >>> class Still:
    ...     kind, parameters = "pw_r", {}
    ...     def simulate(self, time_s, duty, *, start_deg):
    ...         return np.full(len(time_s), start_deg)
    ...     def predict(self, time_s, duty, angle_deg, horizon):
    ...         return np.asarray(angle_deg)[:-horizon]
    ...     def to_toml(self):
    ...         return ""
    >>> time = np.arange(2000) * 1e-3
    >>> log = throttle_log(time, 0.2 * np.sin(6.0 * time), 20.0 + 15.0 * np.sin(6.0 * time))
    >>> validate_throttle(Still(), log).fit_percent < 1.0
    True
    """
    check_throttle_log(log)
    fit = model if isinstance(model, ThrottleFit) else None
    own = model.model if isinstance(model, ThrottleFit) else model
    time, duty, angle = columns_of(log)
    step = step_of(time)
    horizons_s = whole_horizons(step, time.size) if horizons_s is None else horizons_s
    for horizon in horizons_s:
        samples_of(horizon, step, time.size)
    run = free_run(own, log)
    skip = discarded(log)
    measured, modelled = angle[skip:], run["model_deg"].to_numpy()[skip:]
    one = angle[1:] - np.asarray(own.predict(time, duty, angle, 1), dtype=np.float64)
    tests = residual_tests(one[skip:], duty[:-1][skip:])
    known = prior_of(own)
    limp_home = known.limp_home_deg if limp_home_deg is None else limp_home_deg
    content = record_content(time, angle, limp_home_deg=limp_home, stops_deg=known.stops_deg)
    fitted = fit_percent(measured, modelled)
    notes = _notes(fitted, tests)
    pairs = entangled(fit.report) if fit is not None else ()
    return ThrottleValidation(
        kind=own.kind,
        fit_percent=fitted,
        vaf_percent=vaf_percent(measured, modelled),
        rmse_deg=rmse(measured, modelled),
        mse_deg2=mse(measured, modelled),
        n_step=n_step_rms(own, log, horizons_s=horizons_s),
        tests=tests,
        free_run=run,
        findings=(*notes, *open_questions(content, swing=known.swing, pairs=pairs)),
        source=str(log.attrs.get("file", "log")),
    )


def free_run(model: ThrottleModel, log: xr.Dataset) -> xr.Dataset:
    """Run a model free over a log from its first angle."""
    time, duty, angle = columns_of(log)
    run = np.asarray(model.simulate(time, duty, start_deg=float(angle[0])), dtype=np.float64)
    if run.shape != angle.shape or not np.isfinite(run).all():
        raise DataError(f"the {model.kind} model runs away on {log.attrs.get('file', 'log')}: its fit has failed")
    return labelled_dataset(
        {
            "time_s": ("time_s", time),
            "duty": ("time_s", duty),
            "angle_deg": ("time_s", angle),
            "model_deg": ("time_s", run),
            "residual_deg": ("time_s", run - angle, "deg", "model minus measured angle"),
        },
        attrs={"file": str(log.attrs.get("file", "log")), "kind": model.kind},
    )


def discarded(log: xr.Dataset) -> int:
    """Return how many samples at the start a figure of merit leaves out."""
    return round(DISCARD_S / step_of(log["time_s"].to_numpy()))


def entangled(report: FitReport) -> tuple[tuple[str, str, float], ...]:
    """Return the pairs whose correlation exceeds 0.98."""
    c = np.asarray(report.correlation)
    return tuple(
        (report.names[i], report.names[j], float(c[i, j]))
        for i in range(len(report.names))
        for j in range(i + 1, len(report.names))
        if math.isfinite(c[i, j]) and abs(c[i, j]) > _CORRELATED
    )


def correlation_dataset(report: FitReport) -> xr.Dataset:
    """Give the correlation of the estimates of a fit as a labelled matrix.

    Parameters
    ----------
    report : mgdd.optimize.FitReport
        The report of a fit.

    Returns
    -------
    xarray.Dataset
        ``correlation`` [-] over ``parameter`` and ``other``; NaN for parameters at a bound.

    Examples
    --------
    >>> from mgdd.identify import correlation_dataset
    >>> from mgdd.optimize import least_squares
    >>> report = least_squares(lambda x: ([x[0] - 1.0, x[1], x[0] + x[1]], [[1, 0], [0, 1], [1, 1]]), [0.0, 0.0])
    >>> round(float(correlation_dataset(report)["correlation"][0, 1]), 3)
    -0.5
    """
    names = list(report.names)
    return labelled_dataset(
        {
            "parameter": ("parameter", names, "-", "parameter"),
            "other": ("other", names, "-", "parameter"),
            "correlation": (("parameter", "other"), np.asarray(report.correlation), "-", "correlation"),
        }
    )


def _notes(fitted: float, tests: ResidualTests) -> list[str]:
    out = []
    if fitted < _GOOD_PERCENT:
        out.append(
            f"the free run reaches {fitted:.1f} %, below the {_GOOD_PERCENT:g} % that a throttle model should: look at "
            "the overlay for a wrong sign, delay or side, or take a model with friction (pw_r, first_principle)"
        )
    if not tests.white:
        out.append(
            "the one-step residual has memory: usual near stiction, where it is no reason to reject; standard errors, "
            "which take it as white, are too small"
        )
    return out
