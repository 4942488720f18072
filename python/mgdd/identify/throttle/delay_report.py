"""A delay that was chosen among several, as an estimate of the report beside those of the search."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.finding import Finding
from mgdd.results.fit_report import FitReport

if TYPE_CHECKING:
    from numpy.typing import NDArray

_NAME = "delay_samples"
_STAND_IN = ("electrical_s", "tau_s")


def with_delay(
    report: FitReport, delay: float, rmse: Mapping[float, float], n: float, tried: Sequence[float] | None = None
) -> FitReport:
    """Add the chosen delay, with the error of the flattest parabola through the costs of the others.

    A delay that fits as well as the chosen one leaves a whole sample open. At the end of what may be the error is NaN:
    the search did not go further; those of lag and time constant, too.
    """
    curvature = min(
        2.0 * n * math.log(other / rmse[delay]) / (at - delay) ** 2 for at, other in rmse.items() if at != delay
    )
    low, high = min(tried or rmse), max(tried or rmse)
    side = 1 if delay == high else -1 if delay == low > 0.0 else 0  # less than no delay there is not
    error = math.nan if side else 1.0 / math.sqrt(max(curvature, 1.0))
    stderr, covariance = report.stderr, report.covariance
    if side:  # they stand for the rest of the delay, however well they are known at this one
        gone = [report.names.index(name) for name in _STAND_IN if name in report.names]
        stderr, covariance = stderr.copy(), covariance.copy()
        stderr[gone] = covariance[gone, :] = covariance[:, gone] = math.nan
    null = np.vstack([report.null_directions, np.zeros((1, report.null_directions.shape[1]))])
    null.flags.writeable = False
    return dataclasses.replace(
        report,
        names=(*report.names, _NAME),
        values=_longer(report.values, delay),
        stderr=_longer(stderr, error),
        lower=_longer(report.lower, low),
        upper=_longer(report.upper, high),
        bounds_active=_longer(report.bounds_active, side),
        covariance=_wider(covariance, error**2),
        correlation=_wider(report.correlation, 1.0),
        null_directions=null,
    )


def delay_at_end(kept: float, tried: Sequence[float], longest_known: float) -> list[Finding]:
    """Say that the delay which was taken is an end of what was tried."""
    longest = kept == max(tried)
    if len(tried) < 2 or not (longest or kept == min(tried) > 0.0):
        return []
    most, more = ("longest", "longer") if longest else ("shortest", "shorter")
    text = f"a delay of {kept:g} samples is the {most} that was tried: the true one may be {more}, and then"
    text += " lag and time constant stand for the rest"
    remedy = "log at a longer sample time, of which a delay is fewer"
    if kept < longest_known:
        remedy = f"give {more} delay_samples" + (f", or {remedy}" if longest else "")
    return [Finding("delay_at_end", (_NAME, *_STAND_IN), text, remedy)]


def _longer(array: NDArray[Any], value: float) -> NDArray[Any]:
    out = np.append(array, array.dtype.type(value))
    out.flags.writeable = False
    return out


def _wider(matrix: NDArray[np.float64], corner: float) -> NDArray[np.float64]:
    out = np.full((matrix.shape[0] + 1, matrix.shape[1] + 1), np.nan)
    out[:-1, :-1], out[-1, -1] = matrix, corner
    out.flags.writeable = False
    return out
