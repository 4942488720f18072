"""A motor-driven slide with friction, fitted to its open-loop response."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._describe import described
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.io.parameters import ParameterFile, Parameters, entries, wanted
from mgdd.optimize import FitReport

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

__all__ = ["DriveFit", "DriveModel", "drive_free_run", "drive_inverse_dynamics", "fit_drive"]

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
class DriveModel(Parameters):
    """A slide with mass, friction and offset, driven by a voltage.

    Parameters
    ----------
    parameters : mapping of str to float
        Names carry the unit: ``mass_kg``, ``viscous_ns_per_m``, ``viscous_asymmetry_ns_per_m`` (added forward, taken
        off backward), ``coulomb_n``, ``stribeck_n``, ``stribeck_speed_m_per_s``, ``offset_n``,
        ``offset_drift_n_per_s`` and ``stiffness_n_per_m``; one that is left out is zero.
    force_n_per_v : float
        Force of the drive per volt [N/V].

    Examples
    --------
    >>> from mgdd.identify import DriveModel
    >>> slide = DriveModel(parameters={"mass_kg": 95.0, "coulomb_n": 20.0}, force_n_per_v=35.0)
    >>> slide.simulate([0.0, 0.001, 0.002], [0.5, 0.5, 0.5]).tolist()  # 17.5 N do not overcome 20 N
    [0.0, 0.0, 0.0]
    """

    parameters: Mapping[str, float]
    force_n_per_v: float

    def simulate(
        self,
        time_s: ArrayLike,
        drive_v: ArrayLike,
        *,
        start_position_m: float = 0.0,
        start_speed_m_per_s: float = 0.0,
    ) -> NDArray[np.float64]:
        """Run freely from a start; the voltage of a sample acts until the next.

        Parameters
        ----------
        time_s : array_like, shape (n,)
            Evenly spaced times [s]; zero is where the drift of the offset starts.
        drive_v : array_like, shape (n,)
            Voltage [V].
        start_position_m, start_speed_m_per_s : float
            State at the first sample [m, m/s].

        Returns
        -------
        ndarray, shape (n,)
            Position [m].

        Raises
        ------
        mgdd.errors.DataError
            Times that are not evenly spaced.
        mgdd.errors.ShapeError
            Arrays of different length.
        mgdd.errors.ParameterError
            A parameter with an unknown name.
        """
        time, drive = np.asarray(time_s, dtype=np.float64), np.asarray(drive_v, dtype=np.float64)
        return np.asarray(
            _core.DriveAxis(force_n_per_v=self.force_n_per_v).free_run(
                parameters=_row(self.parameters),
                start=[start_position_m, start_speed_m_per_s, float(time[0])],
                input=drive,
                dt_s=_spacing(time, drive),
            )
        )

    def to_parameters(self) -> ParameterFile:
        """Give all parameters, as `to_toml` writes them."""
        values = dict(zip(_core.DriveAxis.parameter_names, _row(self.parameters), strict=True))
        tables = {"parameters": entries(values), "settings": entries({"force_n_per_v": float(self.force_n_per_v)})}
        return ParameterFile(kind="drive", tables=tables)

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> DriveModel:
        """Make the slide of a file that `to_toml` wrote."""
        file.expect(kinds=("drive",), tables=("parameters", "settings"))
        return cls(
            parameters=file.values("parameters", wanted(_core.DriveAxis.parameter_names)),
            force_n_per_v=file.values("settings", wanted(("force_n_per_v",)))["force_n_per_v"],
        )


@described
@dataclass(frozen=True, kw_only=True)
class DriveFit:
    """A fitted slide.

    Parameters
    ----------
    report : FitReport
        Of the best start; the residual is in m.
    model : DriveModel
        The slide.
    fit_percent : float
        Of the free run over the record [%].
    starts_fit_percent : tuple of float
        The same for every start, best first: how sharply the record points at one answer.

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd.identify import fit_drive
    >>> if "emps" in datasets.available():
    ...     fit = fit_drive(datasets.load_emps()[0], friction="coulomb", drift=False, starts=1)
    ...     assert fit.fit_percent == fit.starts_fit_percent[0]
    """

    report: FitReport
    model: DriveModel
    fit_percent: float
    starts_fit_percent: tuple[float, ...]


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
    >>> from mgdd import datasets
    >>> from mgdd.identify import drive_inverse_dynamics
    >>> if "emps" in datasets.available():
    ...     found = drive_inverse_dynamics(datasets.load_emps()[0], directional=False)
    ...     assert round(found["mass_kg"], 1) == 95.1
    """
    from scipy.signal import butter, filtfilt

    dt_s = _spacing(record["time_s"].to_numpy(), record["drive_v"].to_numpy())
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
    >>> from mgdd import datasets
    >>> from mgdd.identify import DriveModel, drive_free_run, drive_inverse_dynamics
    >>> if "emps" in datasets.available():
    ...     train, test = datasets.load_emps()
    ...     slide = DriveModel(parameters=drive_inverse_dynamics(train), force_n_per_v=float(train["force_n_per_v"]))
    ...     assert drive_free_run(slide, test).size == 24821
    """
    position, speed = drive_start(record)
    later = record.isel(time_s=slice(_WINDOW - 1, None))
    run = model.simulate(later["time_s"], later["drive_v"], start_position_m=position, start_speed_m_per_s=speed)
    return run[1:]


def fit_drive(
    record: xr.Dataset,
    *,
    friction: str = "stribeck",
    drift: bool = True,
    start: Mapping[str, float] | None = None,
    starts: int = 48,
    seed: int = 1,
    max_iterations: int = 60,
) -> DriveFit:
    """Fit mass and friction of a driven slide to its free run under the measured voltage.

    Output-error fit with exact sensitivities; position and speed at the start come from the first 20 samples, which
    are left out of the residual. A free run integrates every error of the force, so its cost has a long valley between
    mass and friction, with many shallow hollows: the search is repeated from starts scattered about the first, then
    about the best, and the best by the error on this record is taken.

    Parameters
    ----------
    record : xarray.Dataset
        ``drive_v`` [V], ``position_m`` [m] over an evenly spaced ``time_s`` [s], and ``force_n_per_v``, as
        `mgdd.datasets.load_emps` returns it.
    friction : str
        ``coulomb``: viscous and Coulomb friction and an offset; ``directional``: another viscous friction in each
        direction; ``stiction``: that, and more friction at rest than in motion; ``stribeck``: the same with a gradual
        rise towards rest.
    drift : bool
        Let the offset force drift linearly over the record, as an amplifier does that warms up.
    start : mapping of str to float, optional
        First start, by parameter name; without it the inverse dynamics give it (`drive_inverse_dynamics`).
    starts : int
        Number of starts, >= 1.
    seed : int
        Of the scattered starts.
    max_iterations : int
        Trial steps per start.

    Returns
    -------
    DriveFit
        Report, model and fit.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown form of friction or parameter, or fewer than one start.
    mgdd.errors.DataError
        Uneven times, or fewer than 100 samples.

    References
    ----------
    Janot, Gautier and Brunot (2019), Data Set and Reference Models of EMPS.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import DriveModel, fit_drive
    >>> from mgdd.results import labelled_dataset
    >>> time = np.arange(4000) * 1e-3
    >>> drive = 2.0 * np.sign(np.sin(4.0 * time)) + 0.5 * np.sin(11.0 * time)
    >>> truth = {"mass_kg": 90.0, "coulomb_n": 21.0, "viscous_ns_per_m": 200.0, "offset_n": 1.0}
    >>> position = DriveModel(parameters=truth, force_n_per_v=35.0).simulate(time, drive)
    >>> record = labelled_dataset({
    ...     "time_s": ("time_s", time, "s", "time"),
    ...     "drive_v": ("time_s", drive, "V", "voltage"),
    ...     "position_m": ("time_s", position, "m", "position"),
    ...     "force_n_per_v": ((), 35.0, "N/V", "force per volt"),
    ... })
    >>> fit = fit_drive(record, friction="directional", drift=False, starts=2, start=dict(truth, mass_kg=95.0))
    >>> round(fit.model.parameters["mass_kg"])
    90
    """
    if friction not in _FORMS:
        raise ParameterError(f"friction = {friction!r}: must be one of {', '.join(_FORMS)}")
    if starts < 1:
        raise ParameterError(f"starts = {starts}: must be >= 1")
    names = tuple(_core.DriveAxis.parameter_names)
    free = ["mass_kg", "viscous_ns_per_m", *_FORMS[friction]]
    free += ["offset_drift_n_per_s"] if drift else []
    first = _core_record(record)
    dt_s = _spacing(record["time_s"].to_numpy(), record["drive_v"].to_numpy())
    axis = _core.DriveAxis(force_n_per_v=float(record["force_n_per_v"]))
    options = _core.LeastSquaresOptions(max_iterations=max_iterations, cost_tolerance=1e-6)
    base = dict(drive_inverse_dynamics(record) if start is None else start)
    if friction == "coulomb":
        base["viscous_asymmetry_ns_per_m"] = 0.0
    elif friction == "stribeck":
        base.setdefault("stribeck_n", 2.0)
    elif friction == "stiction":
        base.setdefault("stribeck_n", 10.0)
        base["stribeck_speed_m_per_s"] = _REST
    base = dict(zip(names, _row(base), strict=True))
    rng = np.random.default_rng(seed)
    measured = record["position_m"].to_numpy()[_WINDOW:]
    found: list[tuple[float, Any]] = []
    for index in range(starts):
        if index == 0:
            point = base
        elif index < (starts + 5) // 6:
            point = _scattered(base, free, 1.0, rng)
        else:
            near = min(found, key=lambda entry: entry[0])[1].parameters
            point = _scattered(dict(zip(names, near, strict=True)), free, _NEAR, rng)
        result = axis.fit(base=list(point.values()), free=free, records=[first], dt_s=dt_s, options=options)
        found.append((float(result.report.cost), result))
    found.sort(key=lambda entry: entry[0])
    percents = tuple(
        float(100.0 * (1.0 - np.sqrt(2.0 * cost) / np.linalg.norm(measured - measured.mean()))) for cost, _ in found
    )
    best = found[0][1]
    parameters = dict(zip(names, best.parameters, strict=True))
    return DriveFit(
        report=FitReport.from_core(best.report, measured),
        model=DriveModel(parameters=parameters, force_n_per_v=float(record["force_n_per_v"])),
        fit_percent=percents[0],
        starts_fit_percent=percents,
    )


def _row(parameters: Mapping[str, float]) -> list[float]:
    names = tuple(_core.DriveAxis.parameter_names)
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
    return _core.FreeRunRecord(
        input=record["drive_v"].to_numpy()[first:],
        output=record["position_m"].to_numpy()[first:],
        start=[position, speed, float(record["time_s"][first])],
        skip=1,
    )


def _spacing(time: NDArray[np.float64], drive: NDArray[np.float64]) -> float:
    if time.shape != drive.shape or time.ndim != 1:
        raise ShapeError(f"time_s has shape {time.shape}, drive_v {drive.shape}: must be one length")
    if time.size < 2:
        raise DataError(f"time_s has {time.size} samples: at least two are needed")
    steps = np.diff(time)
    dt_s = float((time[-1] - time[0]) / (time.size - 1))
    if not (dt_s > 0.0 and np.all(np.abs(steps - dt_s) < 1e-3 * dt_s)):
        raise DataError("time_s is not evenly spaced: resample the record first")
    return dt_s
