"""A motor-driven slide with friction, fitted to its open-loop response."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core import systems
from mgdd.errors import ParameterError
from mgdd.io.parameters import ModelParameters, wanted
from mgdd.optimize.least_squares import FitOptions, LeastSquaresOptions, fit_of, fit_options, fit_run
from mgdd.parallel.finished import hand_over, keep_finished
from mgdd.results import Fit
from mgdd.results.describe import described
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import Label
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import RunInputs, SampledModel

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["DriveModel", "drive_free_run", "drive_inverse_dynamics", "fit_drive"]

_WINDOW = 20  # samples from which position and speed at the start are taken
_FORMS: dict[str, tuple[str, ...]] = {
    "coulomb": ("coulomb_n", "offset_n"),
    "directional": ("coulomb_n", "offset_n", "viscous_asymmetry_ns_per_m"),
    "stiction": ("coulomb_n", "offset_n", "viscous_asymmetry_ns_per_m", "stribeck_n"),
    "stribeck": ("coulomb_n", "offset_n", "viscous_asymmetry_ns_per_m", "stribeck_n", "stribeck_speed_m_per_s"),
}
# Of a parameter between starts: relative to it (standard deviation of its logarithm), or in its own unit.
_RELATIVE = {
    "mass_kg": 0.08,
    "viscous_ns_per_m": 0.08,
    "coulomb_n": 0.08,
    "stribeck_n": 0.4,
    "stribeck_speed_m_per_s": 0.4,
}
_ABSOLUTE = {"viscous_asymmetry_ns_per_m": 8.0, "offset_n": 0.5, "offset_drift_n_per_s": 0.02}
_NEAR = 0.25  # of that scatter, for the starts about the best
_REST = 1e-3  # least speed of the Stribeck rise [m/s]: the slide leaves it within a few samples
_FILTER_ORDER, _DECIMATION = 4, 10


@described
@dataclass(frozen=True, kw_only=True)
class DriveModel(SampledModel, ModelParameters):
    """A slide with mass, friction and offset, driven by a voltage.

    Parameters
    ----------
    parameters : mapping of str to float
        Names carry the unit: ``mass_kg``, ``viscous_ns_per_m``, ``viscous_asymmetry_ns_per_m`` (added forward, taken
        off backward), ``coulomb_n``, ``stribeck_n``, ``stribeck_speed_m_per_s``, ``offset_n``,
        ``offset_drift_n_per_s`` and ``stiffness_n_per_m``; one that is left out is zero.
    force_n_per_v : float
        Force of the drive per volt [N/V].

    Notes
    -----
    Inputs are ``time_s`` [s], whose zero is where the drift of the offset starts, and ``drive_v`` [V]; states are
    ``position_m`` and ``speed_m_per_s``, at rest at 0 without; the output is ``position_m`` [m].

    Examples
    --------
    >>> from mgdd_studies.benchmarks.drive_axis import DriveModel
    >>> slide = DriveModel(parameters={"mass_kg": 95.0, "coulomb_n": 20.0}, force_n_per_v=35.0)
    >>> run = slide.simulate({"time_s": [0.0, 0.001, 0.002], "drive_v": [0.5, 0.5, 0.5]})
    >>> run["position_m"].values.tolist()  # 17.5 N do not overcome 20 N
    [0.0, 0.0, 0.0]
    """

    kind = "drive"
    parameter_names = tuple(systems.DriveAxis.parameter_names)
    settings = MappingProxyType(wanted(("force_n_per_v",)))
    input_names = ("drive_v",)
    output_name = observed_state = "position_m"
    state_names = ("position_m", "speed_m_per_s")
    labels = MappingProxyType({"drive_v": Label("V", "voltage"), "position_m": Label("m", "position")})

    parameters: Mapping[str, float]
    force_n_per_v: float

    def _rest(self) -> list[float]:
        return [0.0, 0.0]

    def _run(self, run: RunInputs) -> NDArray[np.float64]:
        return np.asarray(
            systems.DriveAxis(force_n_per_v=self.force_n_per_v).free_run(
                parameters=_row(self.parameters),
                start=[*run.state, float(run.time_s[0])],
                input=run.columns[0],
                dt_s=run.step_s,
            )
        )

    def _written(self) -> Mapping[str, float]:
        return dict(zip(self.parameter_names, _row(self.parameters), strict=True))


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


def drive_free_run(model: DriveModel, record: xr.Dataset) -> NDArray[np.float64]:
    """Simulate a record from the state that its first 20 samples show.

    Parameters
    ----------
    model : DriveModel
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
    >>> from mgdd_studies.benchmarks.drive_axis import DriveModel, drive_free_run, drive_inverse_dynamics
    >>> if "emps" in records.names():
    ...     train, test = records.read("emps")
    ...     slide = DriveModel(parameters=drive_inverse_dynamics(train), force_n_per_v=float(train["force_n_per_v"]))
    ...     assert drive_free_run(slide, test).size == 24821
    """
    position, speed = drive_start(record)
    later = record.isel(time_s=slice(_WINDOW - 1, None))
    return model.simulate(later, initial_state=(position, speed))["position_m"].to_numpy()[1:]


def fit_drive(
    record: xr.Dataset,
    *,
    friction: str = "stribeck",
    drift: bool = True,
    start_values: Mapping[str, float] | None = None,
    options: FitOptions | None = None,
) -> Fit:
    """Fit mass and friction of a driven slide to its free run under the measured voltage.

    Output-error fit with exact sensitivities; position and speed at the start come from the first 20 samples, which
    are left out of the residual. A free run integrates every error of the force, so its cost has a long valley between
    mass and friction, with many shallow hollows: the search is repeated from starts scattered about the first, then
    about the best, and the best by the error on this record is taken.

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
        First start, by parameter name; without it the inverse dynamics give it (`drive_inverse_dynamics`).
    options : FitOptions, optional
        48 starts, scattered with seed 1, 60 trial steps per start and a tolerance of 1e-6 by default.

    Returns
    -------
    mgdd.results.Fit
        Report [m], model, and the error of every start: how sharply the record points at one answer.

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
    >>> from mgdd_studies.benchmarks.drive_axis import DriveModel, fit_drive
    >>> from mgdd.optimize import FitOptions
    >>> time = np.arange(4000) * 1e-3
    >>> drive = 2.0 * np.sign(np.sin(4.0 * time)) + 0.5 * np.sin(11.0 * time)
    >>> truth = {"mass_kg": 90.0, "coulomb_n": 21.0, "viscous_ns_per_m": 200.0, "offset_n": 1.0}
    >>> slide = DriveModel(parameters=truth, force_n_per_v=35.0)
    >>> record = slide.simulate({"time_s": time, "drive_v": drive}).assign(force_n_per_v=35.0)
    >>> options = FitOptions(n_starts=2)
    >>> fit = fit_drive(
    ...     record, friction="directional", drift=False, start_values=dict(truth, mass_kg=95.0), options=options)
    >>> round(fit.model.parameters["mass_kg"])
    90
    """
    if friction not in _FORMS:
        raise ParameterError.of("friction", friction, f"one of {', '.join(_FORMS)}")
    chosen = fit_options(options, n_starts=48, seed=1, max_iterations=60, tolerance=1e-6)
    starts = chosen.n_starts
    names = tuple(systems.DriveAxis.parameter_names)
    free = ["mass_kg", "viscous_ns_per_m", *_FORMS[friction]]
    free += ["offset_drift_n_per_s"] if drift else []
    first = _core_record(record)
    dt_s = even_step(record["time_s"])
    axis = systems.DriveAxis(force_n_per_v=float(record["force_n_per_v"]))
    search = LeastSquaresOptions(max_iterations=chosen.max_iterations, cost_tolerance=chosen.tolerance)
    base = dict(drive_inverse_dynamics(record) if start_values is None else start_values)
    if friction == "coulomb":
        base["viscous_asymmetry_ns_per_m"] = 0.0
    elif friction == "stribeck":
        base.setdefault("stribeck_n", 2.0)
    elif friction == "stiction":
        base.setdefault("stribeck_n", 10.0)
        base["stribeck_speed_m_per_s"] = _REST
    base = dict(zip(names, _row(base), strict=True))
    rng = np.random.default_rng(chosen.seed)
    measured = record["position_m"].to_numpy()[_WINDOW:]
    found: list[systems.FreeRunFit] = []

    def points() -> Iterator[dict[str, float]]:
        yield base
        for index in range(1, starts):
            if index < (starts + 5) // 6:
                yield _scattered(base, free, 1.0, rng)
            else:
                near = min(found, key=_cost).parameters
                yield _scattered(dict(zip(names, near, strict=True)), free, _NEAR, rng)

    stop = keep_finished(
        lambda point: axis.fit(base=list(point.values()), free=free, records=[first], dt_s=dt_s, options=search),
        points(),
        found,
    )
    best = min(found, key=_cost)
    errors = [float(np.sqrt(2.0 * _cost(one) / measured.size)) for one in found]
    model = DriveModel(
        parameters=dict(zip(names, best.parameters, strict=True)), force_n_per_v=float(record["force_n_per_v"])
    )
    report = FitReport.from_core(best.report, measured)
    run = fit_run(
        record["time_s"].to_numpy()[_WINDOW:], measured, drive_free_run(model, record), model.labels["position_m"]
    )
    return hand_over(fit_of(report, model, run, errors), stop)


def _cost(found: systems.FreeRunFit) -> float:
    return float(found.report.cost)


def _row(parameters: Mapping[str, float]) -> list[float]:
    names = tuple(systems.DriveAxis.parameter_names)
    unknown = [name for name in parameters if name not in names]
    if unknown:
        raise ParameterError(f"parameter {unknown[0]!r}: must be one of {', '.join(names)}")
    at_rest = {"mass_kg": 1.0, "stribeck_speed_m_per_s": 0.03}
    return [float(parameters.get(name, at_rest.get(name, 0.0))) for name in names]


def _scattered(
    centre: Mapping[str, float], free: list[str], scale: float, rng: np.random.Generator
) -> dict[str, float]:
    point = dict(centre)
    for name in free:
        if name in _RELATIVE:
            point[name] *= float(np.exp(scale * _RELATIVE[name] * rng.standard_normal()))
        else:
            point[name] += float(scale * _ABSOLUTE[name] * rng.standard_normal())
    # Inside the bounds of the core.
    point["stribeck_speed_m_per_s"] = max(point["stribeck_speed_m_per_s"], _REST)
    return point


def _core_record(record: xr.Dataset) -> Any:
    position, speed = drive_start(record)
    first = _WINDOW - 1
    return systems.FreeRunRecord(
        input=record["drive_v"].to_numpy()[first:],
        output=record["position_m"].to_numpy()[first:],
        start=[position, speed, float(record["time_s"][first])],
        skip=1,
    )
