"""A controller on the virtual throttle along a reference: one run with its signals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mgdd import _core
from mgdd._arguments import require_plain
from mgdd.errors import ParameterError
from mgdd.loop.plates import OwnPlate, PlateLike, plate_of, require_loop_delay
from mgdd.loop.reference import Reference
from mgdd.loop.virtual_throttle import VirtualThrottle
from mgdd.results.finding import Finding
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
SWINGS_DEG = 0.5  # peak to peak at rest, where only that is known of a run
# Crossings that follow one another as quickly as those of a loop that is too slow; settling makes two or three.
_BESIDE_DEG, _QUICK_S, _CROSSINGS = 0.25, 0.15, 4
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
    throttle: PlateLike | None = None,
    delay_samples: int | None = None,
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
    throttle : Throttle, Preset, Fit, its model, str or path-like, or an object with `step` and `output`, optional
        The plant; the preset ``P1`` if left out. A fit, its model or its TOML file moves as the log did. A plant of
        your own has ``step(duty)``, which lets a duty act for one sample, and ``output``, the angle now [deg]; it goes
        on from its present state and is left in the state after the run.
    delay_samples : int, optional
        Whole samples between the computed duty and its effect, 0 to 20; the delay of a fit, to the nearest sample, or
        1 if left out.
    airflow_torque_nm, supply_v : array_like, shape (n,), optional
        Torque on the plate of a throttle [N m], positive when it opens, and supply of its bridge [V]; one number acts
        all the time.
    start_deg : float, optional
        Angle at rest at the start [deg]; the first angle of the reference, inside the travel, if left out.
    noise_deg : float
        Standard deviation of the measured angle [deg]; not used where `sensors` are given.
    sensors : SensorPair, optional
        The position sensors of a throttle.
    seed : int
        Of the noise.

    Returns
    -------
    xarray.Dataset
        Over ``time_s``: ``reference_deg``, ``angle_deg`` (true, at the end of the sample), ``sensed_angle_deg``,
        ``duty`` [-], of a throttle or a first-principle fit ``speed_deg_per_s``, and of a throttle ``current_a``.
        Scalars, judged from ``reference.from_s`` on:
        ``settling_ms`` (until the error stays in the band; NaN: never), ``mse_deg2``, ``static_error_deg`` (mean size
        over the last 0.1 s), ``overshoot_deg``, ``total_variation`` of the duty [-], ``limit_cycle_deg`` (peak to peak
        over the last 0.3 s of a reference that stands still) and ``largest_error_deg``. ``attrs["findings"]`` where
        the plate swings.

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
    target, plate = reference_of(reference), plate_of(throttle)
    plate.require_torques(airflow_torque_nm=airflow_torque_nm, supply_v=supply_v)
    delay_samples = plate.delay_samples(delay_samples, target.sample_s)
    n, inner = len(target.angle_deg), core_of(controller)
    airflow, supply = column_of("airflow_torque_nm", airflow_torque_nm, n), column_of("supply_v", supply_v, n)
    if inner is None and not callable(getattr(controller, "step", None)):
        raise ParameterError.of(
            "controller", controller, "an object with step(reference_deg, measurement_deg); "
            "tuned_controller('guided', model) makes one for a throttle, a preset or a fit"
        )  # fmt: skip
    require_loop_delay(delay_samples)
    if not isinstance(plate.plant, Throttle):
        if sensors is not None:
            raise ParameterError.of("sensors", sensors, "left out where the plant is not a throttle: give noise_deg")
        sensors_of(noise_deg)  # refuses it alike
        own = OwnPlate(plate, target.sample_s, float(target.angle_deg[0]), start_deg, noise_deg, seed)
        run = _run_in_python(controller, own, target.angle_deg, delay_samples, airflow, supply)
    else:
        plant = plant_of(plate.plant, target, start_deg, sensors or sensors_of(noise_deg), seed)
        if inner is None:
            run = _run_in_python(controller, plant, target.angle_deg, delay_samples, airflow, supply)
        else:
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
    figures = run.pop("figures", None) or _core.loop.tracking_figures(
        reference_deg=target.angle_deg,
        angle_deg=run["angle_deg"],
        duty=run["duty"],
        sample_s=target.sample_s,
        from_sample=target.from_sample,
        band_deg=target.band_deg,
    )
    if plate.model is not None:
        run.pop("current_a", None)
    variables: dict[str, tuple[Any, ...]] = {"time_s": ("time_s", np.arange(n) * target.sample_s)}
    variables["reference_deg"] = ("time_s", target.angle_deg)
    for name, column in run.items():
        variables[name] = ("time_s", column)
    for name in FIGURES:
        variables[name] = ((), float(np.ravel(figures[name])[0]))
    for name, column in (("airflow_torque_nm", airflow), ("supply_v", supply)):
        if len(column):
            variables[name] = ("time_s", column)
    attributes = {"reference": target.name, "band_deg": target.band_deg, "delay_samples": delay_samples, "seed": seed}
    swing = swinging(target.angle_deg, run["angle_deg"], target.sample_s)
    if swing is not None:
        attributes["findings"] = str(swing)
    return labelled_dataset(variables, attrs=attributes)


def swinging(reference_deg: NDArray[np.float64], angle_deg: NDArray[np.float64], sample_s: float) -> Finding | None:
    """Return what is to be said of a plate that swings about a reference which stands still, None where it does not."""
    error = angle_deg - reference_deg
    stands = np.cumsum(np.diff(reference_deg, prepend=reference_deg[0]) != 0.0)
    beside = np.flatnonzero(np.abs(error) > _BESIDE_DEG)
    crossed = (error[beside[1:]] > 0.0) != (error[beside[:-1]] > 0.0)
    crossings = beside[1:][crossed & (stands[beside[1:]] == stands[beside[:-1]])]
    quick = (np.diff(crossings) * sample_s <= _QUICK_S) & (np.diff(stands[crossings]) == 0)
    begins = np.flatnonzero(np.concatenate([[True], ~quick])) if crossings.size else np.empty(0, int)
    lengths = np.diff(np.append(begins, crossings.size))
    if not (lengths >= _CROSSINGS).any():
        return None
    longest = int(np.argmax(lengths))
    own = crossings[begins[longest] : begins[longest] + lengths[longest]]
    spread = float(np.ptp(error[own[0] : own[-1] + 1]))
    return Finding(
        "oscillation", ("angle_deg",),
        f"the plate swings by {spread:.2g} deg about a reference that stands still: it crosses it {own.size} times "
        f"from {own[0] * sample_s:.3g} s on",
        "make the controller for the delay of the loop (tuned_controller('guided', ..., delay_samples=...), or numbers "
        "of tune_controller(..., delay_samples=...) for one that takes none; in the shell mgdd throttle tune "
        "--delay-samples N), or lower its gains",
    )  # fmt: skip


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
    body: Throttle, reference: Reference, start_deg: float | None, sensors: SensorPair, seed: int
) -> VirtualThrottle:
    """Give the plant at rest at the first angle of the reference, inside its travel, by default."""
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
    plant: VirtualThrottle | OwnPlate,
    reference_deg: NDArray[np.float64],
    delay_samples: int,
    airflow: NDArray[np.float64],
    supply: NDArray[np.float64],
) -> dict[str, Any]:
    names = ("angle_deg", "sensed_angle_deg", "speed_deg_per_s", "current_a")
    rows: list[dict[str, float]] = []
    duty = np.empty(len(reference_deg))
    still = plant._still
    measured = plant.start_deg
    for k, target_deg in enumerate(reference_deg):
        duty[k] = controller.step(float(target_deg), measured)
        values = plant.step(
            duty=duty[k - delay_samples] if k >= delay_samples else 0.0,
            supply_v=supply[k] if len(supply) else still["supply_v"],
            airflow_torque_nm=airflow[k] if len(airflow) else 0.0,
            bridge_open=False,
        )
        measured = values["sensed_angle_deg"]
        rows.append(values)
    known = [name for name in names if name in rows[0]]
    return {name: np.array([row[name] for row in rows]) for name in known} | {"duty": duty}
