"""A controller on the virtual throttle along a reference: one run with its signals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mgdd import _core
from mgdd._arguments import require_plain
from mgdd.errors import ParameterError
from mgdd.loop.reference import Reference
from mgdd.loop.virtual_throttle import VirtualThrottle
from mgdd.presets.meant import ThrottleLike, throttle_of
from mgdd.results.labels import labelled_dataset
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import columns_of, is_timed
from mgdd.throttle import SensorPair, Throttle

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from mgdd.results.dataset import Dataset

FIGURES = (
    "settling_ms",
    "mse_deg2",
    "static_error_deg",
    "overshoot_deg",
    "total_variation",
    "limit_cycle_deg",
    "largest_error_deg",
)
_CORE = (_core.control.GuidedPredictive, _core.control.Pid, _core.control.SlidingMode, _core.loop.Mgdd1)


class AngleController(Protocol):
    """A controller of the plate: any object with this method."""

    def step(self, reference_deg: float, measurement_deg: float, /) -> float:
        """Give the duty of this sample."""
        ...


def sensors_of(noise_deg: float) -> SensorPair:
    """Give position sensors with that noise and no filter."""
    ParameterError.unless(0.0 <= noise_deg <= 10.0, "noise_deg", noise_deg, "in [0, 10] deg")
    ideal = SensorPair()
    return SensorPair(noise_v=noise_deg * ideal.span_v / ideal.travel_deg, lag_s=0.0)


def core_of(controller: Any) -> Any:
    """Give the controller of the core behind a controller of mgdd, or None for one of the user."""
    inner = getattr(controller, "_core", controller)
    return inner if isinstance(inner, _CORE) else None


def track(
    controller: AngleController,
    reference: Any,
    *,
    throttle: ThrottleLike | None = None,
    delay_samples: int = 1,
    airflow_torque_nm: ArrayLike | None = None,
    supply_v: ArrayLike | None = None,
    start_deg: float | None = None,
    noise_deg: float = 0.03,
    sensors: SensorPair | None = None,
    seed: int = 0,
) -> Dataset:
    """Run a controller on the virtual throttle along a reference, and say how well it followed.

    Parameters
    ----------
    controller : object
        A controller of `mgdd.control`, or any object with ``step(reference_deg, measurement_deg) -> duty``. It goes on
        from its present state and is left in the state after the run.
    reference : Reference, str, array_like, shape (n,), or a signal with its time
        What to follow: a `Reference`, what `Reference.parse` reads, angles [deg] 1 ms apart, or a Dataset, DataFrame,
        mapping, DataArray or Series with ``reference_deg`` over ``time_s``.
    throttle : Throttle, Preset, str or path-like, optional
        The plant; the preset ``P1`` if left out.
    delay_samples : int
        Whole samples between the computed duty and its effect, 0 to 20.
    airflow_torque_nm, supply_v : array_like, shape (n,), optional
        Torque on the plate [N m], positive when it opens, and supply of the bridge [V]; one number acts all the time.
    start_deg : float, optional
        Angle at rest at the start [deg]; the first angle of the reference, inside the travel, if left out.
    noise_deg : float
        Standard deviation of the measured angle [deg]; not used where `sensors` are given.
    sensors : SensorPair, optional
        The position sensors.
    seed : int
        Of the noise.

    Returns
    -------
    xarray.Dataset
        Over ``time_s``: ``reference_deg``, ``angle_deg`` (true, at the end of the sample), ``sensed_angle_deg``,
        ``speed_deg_per_s``, ``current_a`` and ``duty`` [-]. Scalars, judged from ``reference.from_s`` on:
        ``settling_ms`` (until the error stays in the band; NaN: never), ``mse_deg2``, ``static_error_deg`` (mean size
        over the last 0.1 s), ``overshoot_deg``, ``total_variation`` of the duty [-], ``limit_cycle_deg`` (peak to peak
        over the last 0.3 s of a reference that stands still) and ``largest_error_deg``.

    Raises
    ------
    mgdd.errors.ParameterError
        A bad setting, or a controller without ``step``.
    mgdd.errors.ShapeError
        Columns of different length.

    Examples
    --------
    >>> from mgdd.control import GuidedPredictive
    >>> from mgdd.loop import track
    >>> run = track(GuidedPredictive(), "step:40:42", seed=1)
    >>> float(run["settling_ms"]) < 30.0, run["settling_ms"].units
    (True, 'ms')
    """
    target = reference_of(reference)
    plant = plant_of(throttle, target, start_deg, sensors or sensors_of(noise_deg), seed)
    n = len(target.angle_deg)
    airflow, supply = column_of("airflow_torque_nm", airflow_torque_nm, n), column_of("supply_v", supply_v, n)
    inner = core_of(controller)
    if inner is not None:
        run = _core.loop.track_throttle(
            inner,
            plant,
            delay_samples=delay_samples,
            reference_deg=target.angle_deg,
            airflow_torque_nm=airflow,
            supply_v=supply,
            from_sample=target.from_sample,
            band_deg=target.band_deg,
        )
        figures = {name: float(column[0]) for name, column in run.pop("figures").items()}
    elif callable(getattr(controller, "step", None)):
        run = _run_in_python(controller, plant, target.angle_deg, delay_samples, airflow, supply)
        figures = _core.loop.tracking_figures(
            reference_deg=target.angle_deg,
            angle_deg=run["angle_deg"],
            duty=run["duty"],
            sample_s=target.sample_s,
            from_sample=target.from_sample,
            band_deg=target.band_deg,
        )
    else:
        raise ParameterError.of(
            "controller", controller, "an object with step(reference_deg, measurement_deg); "
            "tuned_controller('guided', model) makes one for a throttle, a preset or a fit"
        )  # fmt: skip
    variables: dict[str, tuple[Any, ...]] = {"time_s": ("time_s", np.arange(n) * target.sample_s)}
    variables["reference_deg"] = ("time_s", target.angle_deg)
    for name, column in run.items():
        variables[name] = ("time_s", column)
    for name in FIGURES:
        variables[name] = ((), float(figures[name]))
    for name, column in (("airflow_torque_nm", airflow), ("supply_v", supply)):
        if len(column):
            variables[name] = ("time_s", column)
    attributes = {"reference": target.name, "band_deg": target.band_deg, "delay_samples": delay_samples, "seed": seed}
    return labelled_dataset(variables, attrs=attributes)


def step_times_us(controller: AngleController, run: xr.Dataset) -> tuple[float, float]:
    """Replay a run through a controller of mgdd, and give median and 99.9th percentile of its step [us]."""
    inner = core_of(controller)
    ParameterError.unless(inner is not None, "controller", controller, "a controller of mgdd")
    times = _core.loop.step_times_us(inner, run["reference_deg"].to_numpy(), run["sensed_angle_deg"].to_numpy())
    return float(np.median(times)), float(np.quantile(times, 0.999))


def reference_of(given: Any) -> Reference:
    """Read what `track` takes as a reference."""
    if isinstance(given, Reference):
        return given
    if isinstance(given, str):
        return Reference.parse(given)
    if is_timed(given):
        time_s, angle_deg = columns_of(given, ("time_s", "reference_deg"), what="reference")
        return Reference(angle_deg=angle_deg, sample_s=even_step(time_s))
    if np.ndim(given) == 0:
        bound = "a Reference, 'step:20:60', 'sine:40:10:1', a CSV file, or one angle per sample"
        raise ParameterError.of("reference", given, bound)
    return Reference(angle_deg=np.asarray(given, float))


def plant_of(
    throttle: ThrottleLike | None, reference: Reference, start_deg: float | None, sensors: SensorPair, seed: int
) -> VirtualThrottle:
    """Give the plant at rest at the first angle of the reference, inside its travel, by default."""
    body = Throttle() if throttle is None else throttle_of(throttle)
    start = float(np.clip(reference.angle_deg[0], body.closed_deg, body.open_deg)) if start_deg is None else start_deg
    return VirtualThrottle(body, sensors=sensors, start_deg=start, sample_s=reference.sample_s, seed=seed)


def column_of(name: str, given: ArrayLike | None, n: int) -> NDArray[np.float64]:
    """Give a column of n samples from one number or from a column; empty for None."""
    if given is None:
        return np.empty(0)
    require_plain(name, given)
    column = np.asarray(given, float)
    if column.ndim > 1:
        raise ParameterError.of(name, f"an array of shape {column.shape}", "one number or one per sample")
    return np.full(n, float(column)) if column.ndim == 0 else column


def _run_in_python(
    controller: AngleController,
    plant: VirtualThrottle,
    reference_deg: NDArray[np.float64],
    delay_samples: int,
    airflow: NDArray[np.float64],
    supply: NDArray[np.float64],
) -> dict[str, NDArray[np.float64]]:
    ParameterError.unless(0 <= delay_samples <= 20, "delay_samples", delay_samples, "in [0, 20]")
    names = ("angle_deg", "sensed_angle_deg", "speed_deg_per_s", "current_a", "duty")
    out = {name: np.empty(len(reference_deg)) for name in names}
    still = plant._still
    measured = plant.start_deg
    for k, target_deg in enumerate(reference_deg):
        out["duty"][k] = controller.step(float(target_deg), measured)
        values = plant.step(
            duty=out["duty"][k - delay_samples] if k >= delay_samples else 0.0,
            supply_v=supply[k] if len(supply) else still["supply_v"],
            airflow_torque_nm=airflow[k] if len(airflow) else 0.0,
            bridge_open=False,
        )
        measured = values["sensed_angle_deg"]
        for name in names[:-1]:
            out[name][k] = values[name]
    return out
