"""The one measure of how well a throttle model meets a log: its free run, without the first 50 ms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mgdd.errors import DataError
from mgdd.results import Fit
from mgdd.results.finding import Finding
from mgdd.results.fit import FitQuality, Model
from mgdd.results.labels import labelled_dataset
from mgdd.signals.even_grid import even_step
from mgdd.signals.metrics import nrmse_fit_percent, rmse
from mgdd.signals.model import as_signal, columns_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

# What the start of a free run still carries of the unknown speed and current.
DISCARD_S = 0.05
LOG_COLUMNS = ("time_s", "duty", "angle_deg")


def as_log(log: Any, what: str = "log") -> xr.Dataset:
    """Return a log as a Dataset, of any form of a signal."""
    return as_signal(log, LOG_COLUMNS, what=what, optional=("current_a", "supply_v"))


def discarded(step_s: float, size: int) -> int:
    """Return how many samples at the start a figure of merit leaves out: 50 ms, at most half of the record."""
    return min(round(DISCARD_S / step_s), size // 2)


def free_run(model: Model, log: xr.Dataset) -> xr.Dataset:
    """Run a model free over a log from its first angle."""
    time, duty, angle = columns_of(log, LOG_COLUMNS)
    run = model.simulate(log, initial_state={"angle_deg": float(angle[0])})["angle_deg"].to_numpy()
    if run.shape != angle.shape or not np.isfinite(run).all():
        raise DataError(f"the {model.kind} model runs away on {source_of(log)}: its fit has failed")
    return labelled_dataset(
        {
            "time_s": ("time_s", time),
            "duty": ("time_s", duty),
            "angle_deg": ("time_s", angle),
            "model_deg": ("time_s", run),
            "residual_deg": ("time_s", run - angle, "deg", "model minus measured angle"),
        },
        attrs={"file": source_of(log), "kind": model.kind},
    )


def quality_of(runs: Sequence[xr.Dataset]) -> FitQuality:
    """Compare free runs with their logs, all together, each without its first 50 ms."""
    measured, modelled = [], []
    for run in runs:
        skip = discarded(even_step(run["time_s"]), run.sizes["time_s"])
        measured.append(run["angle_deg"].to_numpy()[skip:])
        modelled.append(run["model_deg"].to_numpy()[skip:])
    y, yh = np.concatenate(measured), np.concatenate(modelled)
    return FitQuality(nrmse_fit_percent=nrmse_fit_percent(y, yh), rmse=rmse(y, yh), unit="deg", n=y.size)


def source_of(log: xr.Dataset) -> str:
    """Return the name of a log."""
    return str(log.attrs.get("file", "log"))


def draw_free_run(fit: Fit, ax: Any) -> Any:
    """Draw the free run of a throttle fit over its log."""
    from mgdd.plot.throttle import free_run as draw

    return draw(cast("xr.Dataset", fit.run), ax=ax)


_MISSED_PERCENT = 3.0  # points of the fit below what noise alone would leave
_LEAST_FOUR_FIFTHS = 0.4377  # mean square of the least four fifths of a normal variable, over its variance


def noise_of(angle: NDArray[np.float64]) -> float:
    """Return the standard deviation of white noise on an angle, from its second differences, which motion hardly has.

    The mean square of the smaller four fifths, over what it is of a normal distribution: a median would be a whole
    number of steps of the converter.
    """
    second = np.sort(np.abs(np.diff(angle, 2)))
    least = second[: max(4 * second.size // 5, 1)]
    return float(np.sqrt(np.mean(least**2) / (_LEAST_FOUR_FIFTHS * 6.0)))


def below_ceiling(
    logs: Sequence[xr.Dataset], quality: FitQuality | None, name: str = "its own log"
) -> tuple[Finding, ...]:
    """Report a fit that misses far more of logs than the noise of their angle."""
    fit = None if quality is None else quality.nrmse_fit_percent
    if fit is None:
        return ()
    angles = [log["angle_deg"].to_numpy() for log in logs]
    noise = float(np.sqrt(np.average([noise_of(angle) ** 2 for angle in angles], weights=[a.size for a in angles])))
    ceiling = 100.0 * (1.0 - noise / float(np.std(np.concatenate(angles))))
    if ceiling - fit <= _MISSED_PERCENT:
        return ()
    text = (
        f"the fit meets {name} at {fit:.1f} %, and the noise of the angle alone would leave {ceiling:.1f} %: the "
        "plate does what the model does not have, and the intervals hold for the model only"
    )
    remedy = "compare with the other kinds of model, look at the residuals, and check the stops and the log"
    return (Finding("below_ceiling", (), text, remedy),)
