"""Limp-home as a record shows it: read off its first rest, and doubted where friction may hold the plate elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import ParameterError
from mgdd.identify.throttle.free_run import source_of
from mgdd.results.finding import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from mgdd.results.model import Model

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
    """Say where limp-home was read off, and doubt it after the fit.

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
