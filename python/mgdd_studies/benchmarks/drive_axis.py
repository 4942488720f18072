"""A motor-driven slide with friction: a model of a few lines, fitted to its open-loop response."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import ParameterError
from mgdd.identify import DiscreteModel, fit_model
from mgdd.optimize import FitOptions
from mgdd.results import Fit
from mgdd.signals.even_grid import even_step

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["drive_free_run", "drive_inverse_dynamics", "fit_drive", "slide_model"]

_WINDOW = 20  # samples from which position and speed at the start are taken
_STRETCH = 3500  # samples of a stretch of multiple shooting, a little more than half a motion cycle
_NAMES = (
    "mass_kg", "viscous_ns_per_m", "viscous_asymmetry_ns_per_m", "coulomb_n", "offset_n", "offset_drift_n_per_s",
    "stribeck_n", "stribeck_speed_m_per_s",
)  # fmt: skip
_REST = 1e-3  # least speed of the Stribeck rise [m/s]: the slide leaves it within a few samples
_FORMS: dict[str, tuple[str, ...]] = {
    "coulomb": ("coulomb_n", "offset_n"),
    "directional": ("coulomb_n", "offset_n", "viscous_asymmetry_ns_per_m"),
    "stiction": ("coulomb_n", "offset_n", "viscous_asymmetry_ns_per_m", "stribeck_n"),
    "stribeck": ("coulomb_n", "offset_n", "viscous_asymmetry_ns_per_m", "stribeck_n", "stribeck_speed_m_per_s"),
}
_FILTER_ORDER, _DECIMATION = 4, 10


def slide(x: NDArray[Any], u: NDArray[Any], p: NDArray[Any]) -> tuple[Any, Any]:
    """Step position and speed by a sample under the time and the voltage.

    The force that is left after friction moves the mass; friction at rest is set-valued and solved exactly by a
    proximal step, so the slide neither chatters nor creeps.
    """
    mass, viscous, asymmetry, coulomb, offset, drift, stribeck, stribeck_speed, force_per_v, h = p
    position, speed = x
    inertia = mass / h
    push = inertia * speed + (force_per_v * u[1] - offset - drift * u[0])
    limit = coulomb + stribeck * np.exp(-np.abs(speed) / stribeck_speed)
    left = push - np.minimum(np.maximum(push, -limit), limit)
    speed = left / (inertia + viscous + asymmetry * np.sign(push))
    return position + h * speed, speed


def slide_model(
    parameters: Mapping[str, float],
    *,
    force_n_per_v: float,
    sample_s: float = 1e-3,
    initial_state: tuple[float, float] = (0.0, 0.0),
) -> DiscreteModel:
    """Make a model of a slide with mass, friction and offset, driven by a voltage.

    Parameters
    ----------
    parameters : mapping of str to float
        Names carry the unit: ``mass_kg``, ``viscous_ns_per_m``, ``viscous_asymmetry_ns_per_m`` (added forward, taken
        off backward), ``coulomb_n``, ``offset_n``, ``offset_drift_n_per_s``, ``stribeck_n`` and
        ``stribeck_speed_m_per_s``; one that is left out is zero.
    force_n_per_v : float
        Force of the drive per volt [N/V].
    sample_s : float
        Step of the model [s].
    initial_state : tuple of float
        Position [m] and speed [m/s] at the first sample.

    Returns
    -------
    DiscreteModel
        From ``time_s`` [s], whose zero is where the drift of the offset starts, and ``drive_v`` [V] to ``position_m``.

    Raises
    ------
    ParameterError
        An unknown parameter.

    Examples
    --------
    >>> from mgdd_studies.benchmarks.drive_axis import slide_model
    >>> slide = slide_model({"mass_kg": 95.0, "coulomb_n": 20.0}, force_n_per_v=35.0)
    >>> run = slide.simulate({"time_s": [0.0, 0.001, 0.002], "drive_v": [0.5, 0.5, 0.5]})
    >>> run["position_m"].values.tolist()  # 17.5 N do not overcome 20 N
    [0.0, 0.0, 0.0]
    """
    fixed = {"force_n_per_v": force_n_per_v, "step_s": sample_s}
    unknown = [name for name in parameters if name not in (*_NAMES, *fixed)]
    if unknown:
        raise ParameterError(f"parameter {unknown[0]!r}: must be one of {', '.join(_NAMES)}")
    at_rest = {"mass_kg": 1.0, "stribeck_speed_m_per_s": 0.03}
    values = {name: float(parameters.get(name, at_rest.get(name, 0.0))) for name in _NAMES}
    return DiscreteModel(
        step=slide,
        parameters=values | fixed,
        initial_state=initial_state,
        input_names=("time_s", "drive_v"),
        output_names=("position_m",),
        sample_s=sample_s,
    )


def drive_inverse_dynamics(
    record: xr.Dataset, *, cutoff_hz: float = 50.0, directional: bool = True
) -> dict[str, float]:
    """Estimate mass and friction from the force balance: linear least squares on filtered signals.

    Fourth-order Butterworth filter run forward and backward, central differences, every tenth sample.

    Parameters
    ----------
    record : xarray.Dataset
        As `fit_drive` takes it.
    cutoff_hz : float
        Of the filter [Hz].
    directional : bool
        Let the viscous friction differ between the directions.

    Returns
    -------
    dict of str to float
        ``mass_kg``, ``viscous_ns_per_m``, ``viscous_asymmetry_ns_per_m``, ``coulomb_n`` and ``offset_n``.

    Raises
    ------
    mgdd.errors.DataError
        Uneven times, or fewer than 100 samples.

    References
    ----------
    Janot, Gautier and Brunot (2019), Data Set and Reference Models of EMPS.

    Examples
    --------
    >>> from mgdd_studies.benchmarks import records
    >>> from mgdd_studies.benchmarks.drive_axis import drive_inverse_dynamics
    >>> if "emps" in records.names():
    ...     found = drive_inverse_dynamics(records.read("emps")[0], directional=False)
    ...     assert round(found["mass_kg"], 1) == 95.1
    """
    from scipy.signal import butter, filtfilt

    dt_s = even_step(record["time_s"])
    b, a = butter(_FILTER_ORDER, 2.0 * cutoff_hz * dt_s)
    position = filtfilt(b, a, record["position_m"].to_numpy())
    speed = np.gradient(position, dt_s)
    columns = [np.gradient(speed, dt_s), speed, np.abs(speed), np.sign(speed), np.ones_like(speed)]
    names = ["mass_kg", "viscous_ns_per_m", "viscous_asymmetry_ns_per_m", "coulomb_n", "offset_n"]
    force = float(record["force_n_per_v"]) * record["drive_v"].to_numpy()
    if not directional:
        del columns[2], names[2]
    kept = slice(200, -200, _DECIMATION)
    regressors = np.column_stack([filtfilt(b, a, column)[kept] for column in columns])
    estimate = np.linalg.lstsq(regressors, filtfilt(b, a, force)[kept], rcond=None)[0]
    return {"viscous_asymmetry_ns_per_m": 0.0, **dict(zip(names, map(float, estimate), strict=True))}


def drive_start(record: xr.Dataset) -> tuple[float, float]:
    """Position [m] and speed [m/s] at sample 19: a cubic through the first 20 samples."""
    time = record["time_s"].to_numpy()[:_WINDOW]
    cubic = np.polyfit(time - time[-1], record["position_m"].to_numpy()[:_WINDOW], 3)
    return float(cubic[-1]), float(cubic[-2])


def drive_free_run(model: DiscreteModel, record: xr.Dataset) -> NDArray[np.float64]:
    """Simulate a record from the state that its first 20 samples show.

    Parameters
    ----------
    model : DiscreteModel
        The slide.
    record : xarray.Dataset
        As `fit_drive` takes it; only the first 20 positions are used.

    Returns
    -------
    ndarray, shape (n - 20,)
        Positions of samples 20 to the end [m].

    Raises
    ------
    mgdd.errors.DataError
        Times that are not evenly spaced.

    Examples
    --------
    >>> from mgdd_studies.benchmarks import records
    >>> from mgdd_studies.benchmarks.drive_axis import drive_free_run, drive_inverse_dynamics, slide_model
    >>> if "emps" in records.names():
    ...     train, test = records.read("emps")
    ...     slide = slide_model(drive_inverse_dynamics(train), force_n_per_v=float(train["force_n_per_v"]))
    ...     assert drive_free_run(slide, test).size == 24821
    """
    run = model.simulate(record.isel(time_s=slice(_WINDOW - 1, None)), initial_state=drive_start(record))
    return run["position_m"].to_numpy()[1:]


def fit_drive(
    record: xr.Dataset,
    *,
    friction: str = "stribeck",
    drift: bool = True,
    start_values: Mapping[str, float] | None = None,
    options: FitOptions | None = None,
) -> Fit:
    """Fit mass and friction of a driven slide to its free run under the measured voltage.

    The start is linear least squares on the force balance. A free run integrates every error of the force, so its cost
    has a long valley between mass and friction, with many shallow hollows: multiple shooting crosses them.

    Parameters
    ----------
    record : xarray.Dataset
        ``drive_v`` [V], ``position_m`` [m] over an evenly spaced ``time_s`` [s], and ``force_n_per_v``, as
        `mgdd_studies.benchmarks.records.read` returns ``emps``.
    friction : str
        ``coulomb``: viscous and Coulomb friction and an offset; ``directional``: another viscous friction in each
        direction; ``stiction``: that, and more friction at rest than in motion; ``stribeck``: the same with a gradual
        rise towards rest.
    drift : bool
        Let the offset force drift linearly over the record, as an amplifier does that warms up.
    start_values : mapping of str to float, optional
        Start, by parameter name; without it the inverse dynamics give it (`drive_inverse_dynamics`).
    options : FitOptions, optional
        10 trial steps and a tolerance of 1e-5 by default, otherwise as of `mgdd.identify.fit_model`.

    Returns
    -------
    mgdd.results.Fit
        Report [m], with position and speed at sample 19, and model.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown form of friction or parameter.
    mgdd.errors.DataError
        Uneven times, or fewer than 100 samples.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the best fit so far.

    References
    ----------
    Janot, Gautier and Brunot (2019), Data Set and Reference Models of EMPS.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd_studies.benchmarks.drive_axis import fit_drive, slide_model
    >>> time = np.arange(4000) * 1e-3
    >>> drive = 2.0 * np.sign(np.sin(4.0 * time)) + 0.5 * np.sin(11.0 * time)
    >>> truth = {"mass_kg": 90.0, "coulomb_n": 21.0, "viscous_ns_per_m": 200.0, "offset_n": 1.0}
    >>> slide = slide_model(truth, force_n_per_v=35.0)
    >>> record = slide.simulate({"time_s": time, "drive_v": drive}).assign(force_n_per_v=35.0)
    >>> fit = fit_drive(record, friction="directional", drift=False, start_values=dict(truth, mass_kg=95.0))
    >>> round(fit.model.parameters["mass_kg"])
    90
    """
    if friction not in _FORMS:
        raise ParameterError.of("friction", friction, f"one of {', '.join(_FORMS)}")
    given = options or FitOptions()
    chosen = FitOptions(
        n_starts=given.n_starts,
        seed=given.seed,
        max_iterations=given.max_iterations or 10,
        tolerance=given.tolerance or 1e-5,
    )
    start = dict(drive_inverse_dynamics(record) if start_values is None else start_values)
    if friction == "coulomb":
        start["viscous_asymmetry_ns_per_m"] = 0.0
    elif friction in ("stribeck", "stiction"):
        start.setdefault("stribeck_n", 2.0)
        start["stribeck_speed_m_per_s"] = 0.03 if friction == "stribeck" else _REST
    later = record.isel(time_s=slice(_WINDOW - 1, None))
    model = slide_model(
        start,
        force_n_per_v=float(record["force_n_per_v"]),
        sample_s=even_step(record["time_s"]),
        initial_state=drive_start(record),
    )
    return fit_model(
        model,
        later,
        free=("mass_kg", "viscous_ns_per_m", *_FORMS[friction], *(("offset_drift_n_per_s",) if drift else ())),
        free_state=(0, 1),
        bounds={**_around(model.parameters), "stribeck_n": (0.0, 10.0), "stribeck_speed_m_per_s": (_REST, 0.2)},
        skip=1,
        shooting_samples=_STRETCH if later.sizes["time_s"] > 2 * _STRETCH else None,
        options=chosen,
    )


def _around(start: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Give bounds about a start: a third of what is positive, and as much force for what has a sign."""
    names = ("mass_kg", "viscous_ns_per_m", "coulomb_n")
    bounds = {name: (start[name] / 1.5, 1.5 * start[name]) for name in names}
    signed = (("viscous_asymmetry_ns_per_m", "viscous_ns_per_m"), ("offset_n", "coulomb_n"))
    return (
        bounds
        | {name: (start[name] - 0.5 * start[of], start[name] + 0.5 * start[of]) for name, of in signed}
        | {"offset_drift_n_per_s": (-1.0, 1.0), "state_0": (-10.0, 10.0), "state_1": (-10.0, 10.0)}
    )
