"""A drive over the throttle: pedal, demand chain, position controller, plate, air and torque, sample by sample."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.control import Pid
from mgdd.errors import ParameterError, ShapeError
from mgdd.loop.track import AngleController
from mgdd.loop.virtual_throttle import VirtualThrottle
from mgdd.presets.meant import ThrottleLike, throttle_of
from mgdd.results.labels import labelled_dataset
from mgdd.throttle import DemandChain, SensorPair, Throttle

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

_LABELS = {
    "wanted_torque_nm": ("N m", "torque wanted"),
    "torque_nm": ("N m", "torque"),
    "wanted_air_g_per_s": ("g/s", "air into the cylinders wanted"),
    "throttle_air_g_per_s": ("g/s", "air through the throttle"),
    "cylinder_air_g_per_s": ("g/s", "air into the cylinders"),
    "wanted_pressure_kpa": ("kPa", "manifold pressure wanted"),
    "pressure_kpa": ("kPa", "manifold pressure"),
    "reference_deg": ("deg", "reference of the plate angle"),
    "angle_deg": ("deg", "plate angle"),
    "sensed_angle_deg": ("deg", "plate angle as sensed"),
    "duty": ("-", "duty"),
    "airflow_torque_nm": ("N m", "torque of the air flow on the plate"),
}


def simulate_drive(
    chain: DemandChain,
    pedal_percent: ArrayLike,
    speed_rpm: ArrayLike,
    *,
    controller: AngleController | None = None,
    throttle: ThrottleLike | None = None,
    engine: DemandChain | None = None,
    measured_pressure: bool = True,
    air_torque: bool = True,
    sensors: SensorPair | None = None,
    sample_s: float = 1e-3,
    seed: int = 0,
) -> xr.Dataset:
    """Simulate what the pedal makes of the torque: demand chain, controller, throttle, manifold and engine in a loop.

    Parameters
    ----------
    chain : DemandChain
        The chain of the controller, from pedal and speed to the reference of the plate.
    pedal_percent : array_like, shape (n,)
        Pedal at every sample [%], 0 to 100.
    speed_rpm : float or array_like, shape (n,)
        Engine speed [rpm], > 0.
    controller : AngleController, optional
        ``step(reference_deg, measured_deg)`` gives the duty of a sample; a fresh `mgdd.control.Pid` if left out. It
        must have the sample time of the run.
    throttle : Throttle, Preset, str or path-like, optional
        The throttle; the preset ``P1`` if left out.
    engine : DemandChain, optional
        The engine as it is: throttle flow, manifold and torque; as in the controller if left out.
    measured_pressure : bool
        Whether the chain gets the manifold pressure; without it the opening follows from the wanted one.
    air_torque : bool
        Whether the pressure drop over the plate loads it, ``-D³ (p_0 - p) C_T(angle)``, in place of the constant
        ``pressure_drop_kpa`` of the throttle.
    sensors : SensorPair, optional
        As in `VirtualThrottle`.
    sample_s : float
        Time between samples [s].
    seed : int
        Of the sensors' noise.

    Returns
    -------
    xarray.Dataset
        Over ``time_s``: ``pedal_percent``, ``speed_rpm``, torque, air and manifold pressure as wanted and as they are,
        ``reference_deg``, ``angle_deg``, ``sensed_angle_deg``, ``duty`` and ``airflow_torque_nm``. A sample holds the
        state at its time and the duty that acts from then on. The run starts steady at the first demand.

    Raises
    ------
    mgdd.errors.ParameterError
        A pedal or speed outside its domain, or a duty that is not finite.
    mgdd.errors.ShapeError
        A pedal that is not a column, or a speed of another length.

    Notes
    -----
    The engine speed is an input; no vehicle is modelled. Torque follows the air without delay. C_T of the air torque
    is a placeholder of plausible shape.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.loop import simulate_drive
    >>> from mgdd.throttle import DemandChain
    >>> pedal = np.where(np.arange(1200) < 200, 10.0, 60.0)
    >>> run = simulate_drive(DemandChain(), pedal, 2000.0, seed=1)
    >>> abs(float((run["torque_nm"] - run["wanted_torque_nm"])[-1])) < 1.0
    True
    """
    pedal, speed = _traces(pedal_percent, speed_rpm)
    truth = chain if engine is None else engine
    body = Throttle() if throttle is None else throttle_of(throttle)
    steers = Pid(sample_s=sample_s) if controller is None else controller
    start_kpa, start_deg = _steady(chain, truth, pedal[0], speed[0], body)
    plate = VirtualThrottle(
        body.replace(pressure_drop_kpa=0.0) if air_torque else body,
        inputs=("duty", "airflow_torque_nm"), sensors=sensors, start_deg=start_deg, sample_s=sample_s, seed=seed,
    )  # fmt: skip
    load = body.replace(pressure_drop_kpa=1.0, bore_mm=truth.bore_mm)
    tracker = chain.tracker(sample_s=sample_s)
    angle = sensed = start_deg
    kpa = start_kpa
    rows = np.empty((pedal.size, 9))
    for k in range(pedal.size):
        demand = tracker.step(pedal[k], speed[k], kpa if measured_pressure else math.nan)
        duty = float(steers.step(demand["reference_deg"], sensed))
        drop = truth.ambient_kpa - kpa
        air_nm = drop * float(_core.throttle.airflow_torque(load, [angle])[0]) if air_torque else 0.0
        rows[k] = (
            demand["torque_nm"], demand["air_g_per_s"], demand["pressure_kpa"], demand["reference_deg"],
            angle, sensed, duty, air_nm, kpa,
        )  # fmt: skip
        plate.apply({"duty": duty, "airflow_torque_nm": air_nm})
        values = plate.measure().values
        on_the_way = 0.5 * (angle + values["angle_deg"])
        kpa, _, _ = _core.throttle.fill_manifold(truth, kpa, on_the_way, speed[k], sample_s=sample_s)
        angle, sensed = values["angle_deg"], values["sensed_angle_deg"]
    names = (
        "wanted_torque_nm", "wanted_air_g_per_s", "wanted_pressure_kpa", "reference_deg",
        "angle_deg", "sensed_angle_deg", "duty", "airflow_torque_nm", "pressure_kpa",
    )  # fmt: skip
    columns = dict(zip(names, rows.T, strict=True))
    travel = np.clip(columns["angle_deg"], 0.0, 90.0)  # an end stop gives way a little
    columns["throttle_air_g_per_s"] = np.asarray(truth.throttle_g_per_s(travel, columns["pressure_kpa"]))
    columns["cylinder_air_g_per_s"] = np.asarray(truth.cylinder_g_per_s(columns["pressure_kpa"], speed))
    columns["torque_nm"] = np.asarray(truth.torque_nm(columns["cylinder_air_g_per_s"], speed))
    return labelled_dataset(
        {
            "time_s": ("time_s", np.arange(pedal.size) * sample_s),
            "pedal_percent": ("time_s", pedal, "%", "pedal"),
            "speed_rpm": ("time_s", speed, "rpm", "engine speed"),
            **{name: ("time_s", columns[name], *label) for name, label in _LABELS.items()},
        },
        attrs={"sample_s": sample_s, "seed": seed},
    )


def _traces(pedal_percent: ArrayLike, speed_rpm: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    pedal, speed = np.asarray(pedal_percent, np.float64), np.asarray(speed_rpm, np.float64)
    if pedal.ndim != 1 or not pedal.size:
        raise ShapeError(f"pedal_percent has shape {pedal.shape}: must be a column with a sample or more")
    if speed.ndim and speed.shape != pedal.shape:
        raise ShapeError(f"speed_rpm has shape {speed.shape}, pedal_percent has {pedal.shape}")
    speed = np.broadcast_to(speed, pedal.shape).astype(np.float64)
    for name, values, good, bound in (
        ("pedal_percent", pedal, (pedal >= 0.0) & (pedal <= 100.0), "in [0, 100]"),
        ("speed_rpm", speed, (speed > 0.0) & np.isfinite(speed), "> 0 and finite"),
    ):
        if not good.all():
            raise ParameterError.of(name, float(values[~good][0]), bound)
    return pedal, speed


def _steady(chain: DemandChain, truth: DemandChain, pedal: float, speed: float, body: Throttle) -> tuple[float, float]:
    """Give manifold pressure and opening at the first demand, as the chain reaches it on this engine."""
    opening = float(chain.steady(pedal, speed)["opening_deg"].item())
    angle = min(max(opening, body.closed_deg), body.open_deg)
    return float(np.asarray(truth.steady_kpa(min(max(angle, 0.0), 90.0), speed))), angle
