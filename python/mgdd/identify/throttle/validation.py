"""How far a throttle model can be trusted: free run, n steps ahead, residuals, and what the log does not identify."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.identify.throttle.free_run import LOG_COLUMNS, as_log, discarded, free_run, quality_of, source_of
from mgdd.identify.throttle.prior import prior_of
from mgdd.identify.throttle.record_content import open_questions, record_content
from mgdd.io.throttle_checks import check_throttle_log
from mgdd.results import Fit
from mgdd.results.finding import Finding
from mgdd.results.fit import FitQuality, Model
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import Result, merged
from mgdd.signals.even_grid import even_step
from mgdd.signals.metrics import ResidualTests, residual_tests, rmse, vaf_percent
from mgdd.signals.model import columns_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

HORIZONS_S = (0.005, 0.020, 0.050)
_WHOLE = 1e-6


def n_step_rms(
    model: Model, log: xr.Dataset, *, horizons_s: Sequence[float] | None = None, true_deg: ArrayLike | None = None
) -> xr.Dataset:
    """Give the error of predictions that start anew from the measurement at every sample."""
    time, _, angle = columns_of(log, LOG_COLUMNS)
    truth = angle if true_deg is None else np.asarray(true_deg, dtype=np.float64)
    step = even_step(time)
    horizons_s = whole_horizons(step, time.size) if horizons_s is None else horizons_s
    skip = discarded(step, time.size)
    table = np.empty((2, len(horizons_s)))
    for at, horizon in enumerate(horizons_s):
        n = samples_of(horizon, step, time.size)
        ahead = model.predict(log, n)["angle_deg"].to_numpy()
        if ahead.shape != (time.size - n,):
            raise DataError(f"predict gave {ahead.shape} values {n} samples ahead: must be ({time.size - n},)")
        target = truth[n:][skip:]
        table[:, at] = rmse(target, ahead[skip:]), rmse(target, angle[: time.size - n][skip:])
    return labelled_dataset(
        {
            "predictor": ("predictor", [str(model.kind), "persistence"], "-", "predictor"),
            "horizon_s": ("horizon_s", np.asarray(horizons_s, dtype=np.float64), "s", "horizon"),
            "n_step_rms_deg": (("predictor", "horizon_s"), table, "deg", "RMS error ahead"),
        }
    )


def whole_horizons(step_s: float, size: int) -> tuple[float, ...]:
    """5, 20 and 50 ms in whole samples, at least one; what a log samples too coarsely or is too short for falls out."""
    samples = sorted({max(1, round(horizon / step_s)) for horizon in HORIZONS_S})
    return tuple(n * step_s for n in samples if n <= max(1, size // 2))


def samples_of(horizon_s: float, step_s: float, size: int) -> int:
    """Give how many whole samples a horizon is; ParameterError where it is none, or more than half of the log."""
    n = round(horizon_s / step_s)
    if n < 1 or abs(n * step_s - horizon_s) > _WHOLE * step_s * max(n, 1) + 1e-9:
        raise ParameterError(f"horizons_s: {horizon_s:g} s is not a whole number of samples of {step_s:g} s")
    if n > size // 2:
        raise ParameterError(f"horizons_s: {horizon_s:g} s is more than half of the log, {size * step_s:g} s")
    return n


_CORRELATED = 0.98
_GOOD_PERCENT = 85.0


@dataclass(frozen=True, kw_only=True, repr=False)
class ThrottleValidation(Result):
    """A model against a log.

    Parameters
    ----------
    kind : str
        Kind of the model.
    quality : FitQuality
        Of the free run, without its first 50 ms.
    vaf_percent : float
        Variance accounted for by the same run [%].
    n_step : xarray.Dataset
        ``n_step_rms_deg`` [deg] of the model and of "stays where it is" over ``horizon_s`` [s].
    tests : ResidualTests
        On the one-step residuals.
    free_run : xarray.Dataset
        ``duty``, ``angle_deg``, ``model_deg`` and ``residual_deg`` over ``time_s``.
    findings : tuple of Finding
        Limitations found, what the log does not identify, and which excitation would.
    source : str
        Name of the log.
    """

    kind: str
    quality: FitQuality
    vaf_percent: float
    n_step: xr.Dataset = field(repr=False)
    tests: ResidualTests = field(repr=False)
    free_run: xr.Dataset = field(repr=False)
    findings: tuple[Finding, ...] = ()
    source: str = "log"

    @property
    def dataset(self) -> xr.Dataset:
        """Free run, error ahead and correlations of the residual."""
        return merged(self.free_run, self.n_step, self.tests.dataset)

    def summary(self) -> str:
        """Return a short summary."""
        figures = f"free-run fit {self.quality.nrmse_fit_percent:.2f} %, VAF {self.vaf_percent:.2f} %"
        rows = [
            f"{self.kind} on {self.source}: {figures}",
            f"free-run error {self.quality.rmse:.4g} deg RMS, {self.quality.rmse**2:.4g} deg² mean square",
        ]
        for horizon, pair in zip(self.n_step["horizon_s"].to_numpy(), self._growth(), strict=True):
            rows.append(f"{1e3 * horizon:4.0f} ms ahead {pair[0]:.4g} deg RMS (staying there: {pair[1]:.4g})")
        words = {True: "yes", False: "no"}
        rows.append(
            f"one-step residual white: {words[self.tests.white]} ({100 * self.tests.share_white:.0f} % of lags), "
            f"independent of the duty: {words[self.tests.independent]} ({100 * self.tests.share_independent:.0f} %)"
        )
        return "\n".join([*rows, *(f"  {finding}" for finding in self.findings)])

    def plot(self, what: str = "free_run", *, ax: Any = None) -> Any:
        """Draw one part of the validation.

        Parameters
        ----------
        what : {"free_run", "n_step", "residuals"}
            Measured and modelled angle and their difference; how the error grows with the horizon; or what the
            one-step residual remembers of itself and of the duty.
        ax : matplotlib.axes.Axes, optional
            Where to draw; None makes a figure.

        Returns
        -------
        matplotlib.axes.Axes
            The upper axes; a panel below them is ``ax.figure.axes[-1]``.

        Raises
        ------
        ParameterError
            Another part.
        """
        from mgdd.plot.identification import error_growth, residual_correlation
        from mgdd.plot.throttle import free_run

        parts = {"free_run": free_run, "n_step": error_growth, "residuals": residual_correlation}
        ParameterError.unless(what in parts, "what", what, f"one of {', '.join(parts)}")
        return parts[what](self, ax=ax)

    def to_dict(self) -> dict[str, Any]:
        """Give figures and sentences as a dict, without the runs."""
        figures = {
            "kind": self.kind,
            "source": self.source,
            "fit_percent": self.quality.nrmse_fit_percent,
            "vaf_percent": self.vaf_percent,
            "rmse_deg": self.quality.rmse,
            "mse_deg2": self.quality.rmse**2,
        }
        horizons = [f"{1e3 * h:g}" for h in self.n_step["horizon_s"].to_numpy()]
        growth = self._growth()
        return figures | {
            "n_step_rms": {h: pair[0] for h, pair in zip(horizons, growth, strict=True)},
            "n_step_rms_persistence": {h: pair[1] for h, pair in zip(horizons, growth, strict=True)},
            "residual_white": self.tests.white,
            "residual_independent": self.tests.independent,
            "share_white": self.tests.share_white,
            "share_independent": self.tests.share_independent,
            "findings": [str(finding) for finding in self.findings],
        }

    def _growth(self) -> list[list[float]]:
        values: list[list[float]] = (
            self.n_step["n_step_rms_deg"].transpose("horizon_s", "predictor").to_numpy().tolist()
        )
        return values


def validate_throttle(
    model: Model | Fit, log: Any, *, horizons_s: Sequence[float] | None = None, limp_home_deg: float | None = None
) -> ThrottleValidation:
    """Validate a model, or a fit, on a log, best on one that it was not fitted to.

    Parameters
    ----------
    model : Model or Fit
        The model; a fit also reports which of its parameters are entangled.
    log : Dataset, DataFrame or mapping of columns
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
        As in `mgdd.io.throttle_log`; a model that runs away.
    ParameterError
        A horizon that is not a whole number of samples.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import validate_throttle
    >>> from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
    >>> model, time = FirstPrincipleModel(), np.arange(2000) * 1e-3
    >>> log = model.simulate({"time_s": time, "duty": 0.2 * np.sin(6.0 * time)})
    >>> validate_throttle(model, log).quality.nrmse_fit_percent
    100.0
    """
    log = as_log(log)
    check_throttle_log(log)
    fit = model if isinstance(model, Fit) else None
    plain_model = model.model if isinstance(model, Fit) else model
    time, duty, angle = columns_of(log, LOG_COLUMNS)
    step = even_step(time)
    horizons_s = whole_horizons(step, time.size) if horizons_s is None else horizons_s
    for horizon in horizons_s:
        samples_of(horizon, step, time.size)
    run = free_run(plain_model, log)
    skip = discarded(step, time.size)
    measured, modelled = angle[skip:], run["model_deg"].to_numpy()[skip:]
    one_step = angle[1:] - plain_model.predict(log, 1)["angle_deg"].to_numpy()
    tests = residual_tests(one_step[skip:], duty[:-1][skip:])
    throttle = prior_of(plain_model)
    limp_home = throttle.limp_home_deg if limp_home_deg is None else limp_home_deg
    content = record_content(time, angle, limp_home_deg=limp_home, stops_deg=throttle.stops_deg)
    quality = quality_of([run])
    notes = _notes(quality, tests)
    pairs = entangled(fit.report) if fit is not None else ()
    return ThrottleValidation(
        kind=plain_model.kind,
        quality=quality,
        vaf_percent=vaf_percent(measured, modelled),
        n_step=n_step_rms(plain_model, log, horizons_s=horizons_s),
        tests=tests,
        free_run=run,
        findings=(*notes, *open_questions(content, swing=throttle.swing, pairs=pairs)),
        source=source_of(log),
    )


def entangled(report: FitReport) -> tuple[tuple[str, str, float], ...]:
    """Return the pairs whose correlation exceeds 0.98."""
    c = np.asarray(report.correlation)
    return tuple(
        (report.names[i], report.names[j], float(c[i, j]))
        for i in range(len(report.names))
        for j in range(i + 1, len(report.names))
        if math.isfinite(c[i, j]) and abs(c[i, j]) > _CORRELATED
    )


def _notes(quality: FitQuality, tests: ResidualTests) -> list[Finding]:
    out = []
    fitted = math.nan if quality.nrmse_fit_percent is None else quality.nrmse_fit_percent
    if fitted < _GOOD_PERCENT:
        out.append(
            Finding(
                "poor_free_run",
                (),
                f"the free run reaches {fitted:.1f} %, below the {_GOOD_PERCENT:g} % that a throttle model should",
                "look at the overlay for a wrong sign, delay or side, or take a model with friction (pw_r, "
                "first_principle)",
            )
        )
    if not tests.white:
        out.append(
            Finding(
                "residual_not_white",
                (),
                "the one-step residual has memory: usual near stiction, where it is not a reason to reject; standard "
                "errors, which take it as white, are too small",
            )
        )
    return out
