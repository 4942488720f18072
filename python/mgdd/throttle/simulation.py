"""Runs of throttles: one with all its signals, or many at once, and the summary of a step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mgdd import _core
from mgdd._core.throttle import Throttle
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.presets.meant import ThrottleLike, throttle_model_of, throttle_of, unknown_to_a_fit
from mgdd.results.labels import labelled_dataset
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import SampledModel, columns_of, is_timed

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from mgdd.results import Fit
    from mgdd.results.dataset import Dataset

_DEFAULT_DURATION_S = 1.0
_MOST_SAMPLES = 5_000_000
_MOVED_DEG = 0.01


def simulate_throttle(
    throttle: ThrottleLike | Sequence[ThrottleLike] | Fit | SampledModel,
    duty: Any,
    *,
    time_s: ArrayLike | None = None,
    sample_s: float = 1e-3,
    duration_s: float | None = None,
    start_deg: ArrayLike | None = None,
    bridge: str = "brake",
    supply_v: ArrayLike | None = None,
    airflow_torque_nm: ArrayLike = 0.0,
    step_s: float = 1e-4,
) -> Dataset:
    """Simulate a throttle from rest, without current, under a duty signal; or many cases at once in vector lanes.

    Parameters
    ----------
    throttle : Throttle, Preset, str or path-like, or a sequence of them; Fit or its model
        The throttle; or a preset, its name or its file; a sequence is one case each, with friction and backlash of the
        same form. A fit runs as its model does, with its delay; it gives the angle and starts at rest.
    duty : float or array_like, shape (n,), or a signal with its time
        Duty [-], -1 to 1, positive opens. Sample k acts from ``time_s[k]`` to ``time_s[k + 1]``. A Dataset, DataFrame
        or mapping with ``time_s`` and ``duty``, and a DataArray or Series over ``time_s``, bring their time.
    time_s : array_like, shape (n,), optional
        Even, increasing times [s]; without it samples are `sample_s` apart and start at 0.
    sample_s : float
        Time between samples [s]; not used where `time_s` is given.
    duration_s : float, optional
        Length of the run [s], for a constant duty only, rounded to whole samples; 1 s if left out.
    start_deg : float or array_like, shape (cases,), optional
        Angle at the start [deg], within the travel; limp-home if left out. Several starts are one case each.
    bridge : {"brake", "open"}
        What the bridge does at zero duty: short the motor, which brakes, or let go of it.
    supply_v : float or array_like, shape (n,), optional
        Supply of the bridge [V]; that of the throttle if left out.
    airflow_torque_nm : float or array_like, shape (n,)
        Torque on the plate [N m], positive when it opens; in addition to ``pressure_drop_kpa`` of the throttle.
    step_s : float
        Integration step [s], 1e-6 to 5e-3; goes a whole number of times into the sample time.

    Returns
    -------
    xarray.Dataset
        ``duty`` [-], ``angle_deg`` [deg], ``speed_deg_per_s`` and ``current_a`` over ``time_s``, and ``supply_v`` and
        ``airflow_torque_nm`` where they were given. Its attributes are the run's settings and every parameter. Of many
        cases ``angle_deg(case, time_s)``, with the bits of single runs, ``duty(time_s)`` and ``start_deg(case)``.

    Raises
    ------
    mgdd.errors.ParameterError
        A start outside the travel, a step or a bridge that does not exist, no throttle at all.
    mgdd.errors.DataError
        A duty beyond 1, a value that is not finite, an uneven time.
    mgdd.errors.ShapeError
        Columns of different length.

    Notes
    -----
    Tan (2018), section 7.1.1, names the parts of the model; its equations were not at hand. Dry friction is solved
    exactly at every step (Moreau 1988), so that the plate sticks without creeping.

    Examples
    --------
    >>> from mgdd import presets
    >>> from mgdd.throttle import simulate_throttle
    >>> run = simulate_throttle(presets.load("P1").throttle, 0.6, duration_s=0.06)
    >>> round(float(run["angle_deg"][-1]), 2)
    33.6
    >>> throttle = presets.load("P1").throttle
    >>> runs = simulate_throttle(throttle, 0.0, duration_s=0.5, start_deg=[0.0, 30.0, 90.0], bridge="open")
    >>> runs["angle_deg"][:, -1].values.round(1).tolist()
    [7.9, 8.0, 7.9]
    """
    if time_s is None and is_timed(duty):
        time_s, duty = columns_of(duty, ("time_s", "duty"), what="duty")
    times, column, sample = _grid(duty, time_s=time_s, sample_s=sample_s, duration_s=duration_s)
    supply = _signal("supply_v", supply_v, column.size)
    air = _signal("airflow_torque_nm", airflow_torque_nm, column.size)
    model = throttle_model_of(throttle)
    if isinstance(model, SampledModel):
        stated = {"supply_v": supply_v, "airflow_torque_nm": airflow_torque_nm if air.any() else None}
        return _run_of_fit(model, times, column, start_deg, stated | {"bridge": None if bridge == "brake" else bridge})
    body: Throttle | list[Throttle]
    if isinstance(throttle, Sequence) and not isinstance(throttle, str):
        body = [throttle_of(each) for each in throttle]
    else:
        body = throttle_of(throttle)
    given = None if start_deg is None else np.asarray(start_deg, dtype=np.float64)
    settings = {"bridge": bridge, "sample_s": sample, "step_s": step_s}
    options: dict[str, Any] = {**settings, "supply_v": supply, "airflow_torque_nm": air}
    if not isinstance(body, Throttle) or (given is not None and given.ndim):
        starts = np.empty(0) if given is None else np.atleast_1d(given)
        cases = [body] * starts.size if isinstance(body, Throttle) else body
        if not cases:
            raise ParameterError("throttle, start_deg are empty: give at least one")
        if given is None:
            starts = np.array([case.limp_home_deg for case in cases])
        elif starts.size == 1:
            starts = np.repeat(starts, len(cases))
        angle = _core.throttle.simulate_many(cases, column, start_deg=starts, **options)
        return labelled_dataset(
            {
                "time_s": ("time_s", times),
                "case": ("case", np.arange(len(cases)), "-", "case"),
                "duty": ("time_s", column),
                "start_deg": ("case", starts, "deg", "plate angle at the start"),
                "angle_deg": (("case", "time_s"), angle),
            },
            attrs=settings,
        )
    start = body.limp_home_deg if given is None else float(given)
    raw = _core.throttle.simulate(body, column, start_deg=start, **options)
    variables: dict[str, tuple[Any, ...]] = {"time_s": ("time_s", times), "duty": ("time_s", column)}
    variables |= {name: ("time_s", values) for name, values in raw.items()}
    if supply.size:
        variables["supply_v"] = ("time_s", supply)
    if air.any():
        variables["airflow_torque_nm"] = ("time_s", air)
    return labelled_dataset(variables, attrs={"start_deg": start, **settings, **body.to_dict()})


def _run_of_fit(
    model: SampledModel,
    time_s: NDArray[np.float64],
    duty: NDArray[np.float64],
    start_deg: Any,
    stated: Mapping[str, Any],
) -> Dataset:
    """Run what a log in duty and angle has shown."""
    for name, value in stated.items():
        if value is not None:
            raise unknown_to_a_fit(name, value)
    if np.ndim(start_deg):
        raise ParameterError.of("start_deg", start_deg, "one angle with a fit")
    start = {} if start_deg is None else {"angle_deg": float(start_deg)}
    return cast("Dataset", model.simulate({"time_s": time_s, "duty": duty}, initial_state=start))


def step_summary(run: xr.Dataset) -> dict[str, float]:
    """Summarize a run as the answer to a step at its first sample: start, final and extreme angles [deg].

    The times t10 and t90 [s] are when 10 and 90 percent of the way are first passed; NaN where the plate ends
    within 0.01 deg of its start.
    """
    for name in ("time_s", "angle_deg"):
        if name not in run.variables:
            raise DataError(f"run has no variable {name!r}: mgdd.throttle.simulate_throttle makes it")
    time, angle = run["time_s"].to_numpy(), run["angle_deg"].to_numpy()
    if angle.ndim != 1 or not angle.size:
        raise DataError(f"angle_deg has shape {angle.shape}: a summary is of one run with at least one sample")
    start, final = float(angle[0]), float(angle[-1])
    return {
        "start_angle_deg": start,
        "final_angle_deg": final,
        "max_angle_deg": float(angle.max()),
        "min_angle_deg": float(angle.min()),
        "t10_s": _passes(time, angle, 0.1),
        "t90_s": _passes(time, angle, 0.9),
    }


def _passes(time: NDArray[np.float64], angle: NDArray[np.float64], share: float) -> float:
    """Give the time after the first sample at which a share of the way from first to last angle is passed."""
    way = float(angle[-1] - angle[0])
    if abs(way) < _MOVED_DEG:
        return math.nan
    done = (angle - angle[0]) / way
    k = int(np.argmax(done >= share))
    part = (share - done[k - 1]) / (done[k] - done[k - 1])
    return float(time[k - 1] + part * (time[k] - time[k - 1]) - time[0])


def _grid(
    duty: ArrayLike, *, time_s: ArrayLike | None, sample_s: float, duration_s: float | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Give times, duty column and sample time."""
    column = np.asarray(duty, dtype=np.float64)
    if column.ndim > 1:
        raise ShapeError(f"duty has shape {column.shape}: must be one number or one column")
    if time_s is not None:
        if duration_s is not None:
            raise ParameterError(f"duration_s = {duration_s:g} s contradicts time_s: leave one out")
        times = np.asarray(time_s, dtype=np.float64)
        sample = even_step(times, remedy="resample the duty first")
        if column.ndim == 0:
            column = np.full(times.size, float(column))
        if column.size != times.size:
            raise ShapeError(f"duty has {column.size} samples, time_s has {times.size}")
        return times, column, sample
    if not (math.isfinite(sample_s) and sample_s > 0.0):
        raise ParameterError(f"sample_s = {sample_s:g} s: must be > 0 and finite")
    if column.ndim == 0:
        length = _DEFAULT_DURATION_S if duration_s is None else duration_s
        if not (math.isfinite(length) and length >= sample_s):
            raise ParameterError(f"duration_s = {length:g} s: must be finite and >= sample_s = {sample_s:g} s")
        if length / sample_s > _MOST_SAMPLES:
            raise ParameterError(f"duration_s = {length:g} s: {_MOST_SAMPLES} samples of {sample_s:g} s are the most")
        column = np.full(round(length / sample_s) + 1, float(column))
    elif duration_s is not None:
        raise ParameterError(
            f"duration_s = {duration_s:g} s: goes with a constant duty only; this one has {column.size} samples"
        )
    return np.arange(column.size, dtype=np.float64) * float(sample_s), column, float(sample_s)


def _signal(name: str, values: ArrayLike | None, size: int) -> NDArray[np.float64]:
    """Give a column; empty if there is none."""
    if values is None:
        return np.empty(0)
    column = np.asarray(values, dtype=np.float64)
    if column.ndim > 1:
        raise ShapeError(f"{name} has shape {column.shape}: must be one number or one column")
    return np.full(size, float(column)) if column.ndim == 0 else column
