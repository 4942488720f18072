"""Controllers on many throttles along many references: on cores, processes or machines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd import _core
from mgdd.errors import Interrupted, ParameterError, WorkerLostError
from mgdd.loop.reference import Reference
from mgdd.loop.track import FIGURES, AngleController, column_of, core_of, plant_of, reference_of, sensors_of
from mgdd.parallel.chunks import pieces, run_chunks
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.parallel.pool import MakesExecutor, threads_of
from mgdd.presets.meant import ThrottleLike, throttle_of
from mgdd.results.labels import labelled_dataset
from mgdd.throttle import Throttle

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray


def track_many(
    controllers: Mapping[str, AngleController],
    references: Sequence[Reference | str],
    throttles: Sequence[ThrottleLike],
    *,
    delay_samples: int = 1,
    airflow_torque_nm: Mapping[str, ArrayLike] | None = None,
    noise_deg: float = 0.03,
    first_seed: int = 0,
    executor: MakesExecutor | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Run every controller along every reference on every throttle, on all cores or on an executor.

    Each run has the numbers of `track`; they do not depend on executor, workers or chunks.

    Parameters
    ----------
    controllers : mapping of str to controller
        Controllers of `mgdd.control` by name; each run starts from a copy.
    references : sequence of Reference or str
        As for `track`, all with the same sample time.
    throttles : sequence of Throttle, Preset, str or path-like
        The plants; the noise of number i has the seed ``first_seed + i`` in every run.
    delay_samples, noise_deg : int, float
        As for `track`.
    airflow_torque_nm : mapping of str to array_like, optional
        Torque on the plate [N m] by the name of the reference, one number or one per sample.
    first_seed : int
        Of the noise of the first throttle.
    executor, workers, progress
        As in `mgdd.parallel.map_items`, an item being a run: threads on all cores if left out. Every worker computes
        on one thread.

    Returns
    -------
    xarray.Dataset
        The scalars of `track` over ``throttle``, ``controller`` and ``reference``.

    Raises
    ------
    mgdd.errors.ParameterError
        Nothing to run, a controller that is not one of mgdd, references of different sample time.
    mgdd.errors.WorkerLostError
        As in `mgdd.parallel.map_items`; ``partial`` is a Dataset as after Ctrl-C.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the whole Dataset, in which ``finished`` marks the runs that came to their end; the
        others are NaN.

    Examples
    --------
    >>> from mgdd.control import GuidedPredictive, Pid
    >>> from mgdd.loop import track_many
    >>> from mgdd.throttle import Throttle
    >>> plants = [Throttle().replace(coulomb_nm=0.25 + 0.01 * i) for i in range(5)]
    >>> runs = track_many({"guided": GuidedPredictive(), "PID": Pid()}, ["step:40:42"], plants)
    >>> mse = runs["mse_deg2"].mean("throttle").squeeze()
    >>> bool(mse.sel(controller="guided") < mse.sel(controller="PID"))
    True
    """
    wanted = [reference_of(reference) for reference in references]
    if not wanted or not controllers or not throttles:
        raise ParameterError("controllers, references and throttles: give at least one each")
    if len({reference.sample_s for reference in wanted}) > 1:
        raise ParameterError("references: must all have the same sample_s")
    for name, controller in controllers.items():
        if core_of(controller) is None:
            raise ParameterError.of(f"controllers[{name!r}]", controller, "a controller of mgdd; run others with track")
    sensors_of(noise_deg)
    flows = dict(airflow_torque_nm or {})
    unknown = set(flows) - {reference.name for reference in wanted}
    if unknown:
        raise ParameterError.of("airflow_torque_nm", sorted(unknown), "names of references")
    scenarios = [_Scenario(r, column_of("airflow_torque_nm", flows.get(r.name), len(r.angle_deg))) for r in wanted]
    runs = _Runs(
        [throttle_of(each) for each in throttles],
        list(controllers.values()),
        scenarios,
        delay_samples,
        noise_deg,
        first_seed,
    )
    stop: Interrupted | WorkerLostError | None
    if executor is None and progress is None:
        threads = threads_of(workers)
        (figures, finished), stop = or_partial(lambda: _tracks(runs, threads=threads))
    else:
        figures, finished, stop = _in_chunks(runs, executor=executor, workers=workers, progress=progress)
    dims = ("throttle", "controller", "reference")
    variables: dict[str, tuple[Any, ...]] = {
        "throttle": ("throttle", np.arange(len(throttles)), "-", "number of the throttle"),
        "controller": ("controller", list(controllers), "-", "controller"),
        "reference": ("reference", [r.name for r in wanted], "-", "reference"),
    }
    for name in FIGURES:
        variables[name] = (dims, figures[name] if stop is None else np.where(finished, figures[name], np.nan))
    if stop is not None:
        variables["finished"] = (dims, finished, "-", "whether the run came to its end")
    attrs = {"delay_samples": delay_samples, "noise_deg": noise_deg, "seed": first_seed}
    return hand_over(labelled_dataset(variables, attrs=attrs), stop)


class _Scenario(NamedTuple):
    reference: Reference
    airflow_torque_nm: NDArray[np.float64]


class _Runs(NamedTuple):
    """Every controller along every scenario on every throttle; what a worker is sent."""

    throttles: list[Throttle]
    controllers: list[AngleController]
    scenarios: list[_Scenario]
    delay_samples: int
    noise_deg: float
    first_seed: int

    @property
    def shape(self) -> tuple[int, int, int]:
        return len(self.throttles), len(self.controllers), len(self.scenarios)

    def some(self, throttles: slice, controllers: slice, scenarios: slice) -> _Runs:
        return self._replace(
            throttles=self.throttles[throttles],
            controllers=self.controllers[controllers],
            scenarios=self.scenarios[scenarios],
            first_seed=self.first_seed + throttles.start,
        )


def _tracks(runs: _Runs, *, threads: int = 1) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.bool_]]:
    """Run them in one call of the core: the figures, and which runs came to their end, in the shape of the runs."""
    sensors, first = sensors_of(runs.noise_deg), runs.scenarios[0].reference
    plants = [
        plant_of(throttle, first, None, sensors, runs.first_seed + number)._core
        for number, throttle in enumerate(runs.throttles)
    ]

    def track() -> Any:
        return _core.loop.track_throttles(
            plants,
            [core_of(controller) for controller in runs.controllers],
            [(r.angle_deg, airflow, np.empty(0), r.from_sample) for r, airflow in runs.scenarios],
            delay_samples=runs.delay_samples,
            band_deg=[r.band_deg for r, _ in runs.scenarios],
            threads=threads,
        )

    (figures, finished), stop = or_partial(track)
    found = {name: np.asarray(figures[name]).reshape(runs.shape) for name in FIGURES}
    return hand_over((found, np.asarray(finished).reshape(runs.shape)), stop)


def _in_chunks(
    runs: _Runs, *, executor: MakesExecutor | None, workers: int | None, progress: Callable[[int, int], None] | None
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.bool_], Interrupted | WorkerLostError | None]:
    n_throttles, n_controllers, n_scenarios = runs.shape
    # A scenario that the core refuses is found before any work, on one throttle.
    _, stopped = or_partial(lambda: _tracks(runs.some(slice(0, 1), slice(0, 1), slice(None))))
    # Throttles innermost: those of one piece run side by side.
    figures = {name: np.full((n_controllers * n_scenarios, n_throttles), np.nan) for name in FIGURES}
    finished = np.zeros((n_controllers * n_scenarios, n_throttles), bool)

    def cut(start: int, stop: int) -> tuple[list[_Runs]]:
        places = ((divmod(row, n_scenarios), slice(a, b)) for row, a, b in pieces(start, stop, n_throttles))
        return ([runs.some(these, slice(c, c + 1), slice(s, s + 1)) for (c, s), these in places],)

    def keep(start: int, stop: int, parts: list[dict[str, NDArray[np.float64]]]) -> None:
        for (row, a, b), part in zip(pieces(start, stop, n_throttles), parts, strict=True):
            finished[row, a:b] = True
            for name, table in figures.items():
                table[row, a:b] = part[name]

    error = stopped or run_chunks(
        _some_tracks, cut, keep, finished.size, executor=executor, workers=workers, progress=progress
    )
    shape = (n_controllers, n_scenarios, n_throttles)
    arranged = {name: np.moveaxis(table.reshape(shape), -1, 0).copy() for name, table in figures.items()}
    return arranged, np.moveaxis(finished.reshape(shape), -1, 0).copy(), error


def _some_tracks(many: Sequence[_Runs]) -> list[dict[str, NDArray[np.float64]]]:
    return [{name: table.ravel() for name, table in _tracks(runs)[0].items()} for runs in many]
