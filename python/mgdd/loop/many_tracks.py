"""Controllers on many throttles along many references, on all cores."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import Interrupted, ParameterError
from mgdd.loop.plates import PlateLike, plate_of
from mgdd.loop.reference import Reference
from mgdd.loop.track import (
    FIGURES,
    SWINGS_DEG,
    AngleController,
    column_of,
    core_of,
    plant_of,
    reference_of,
    sensors_of,
    track,
)
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.parallel.pool import threads_of
from mgdd.results.labels import labelled_dataset
from mgdd.throttle import Throttle

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike


def track_many(
    controllers: Mapping[str, AngleController],
    references: Sequence[Reference | str],
    throttles: Sequence[PlateLike],
    *,
    delay_samples: int | None = None,
    airflow_torque_nm: Mapping[str, ArrayLike] | None = None,
    noise_deg: float = 0.03,
    first_seed: int = 0,
    workers: int | None = None,
) -> xr.Dataset:
    """Run every controller along every reference on every throttle, on all cores.

    Each run has the numbers of `track`; they do not depend on `workers`.

    Parameters
    ----------
    controllers : mapping of str to controller
        Controllers of `mgdd.control` by name; each run starts from a copy.
    references : sequence of Reference or str
        As for `track`, all with the same sample time.
    throttles : sequence of Throttle, Preset, Fit, its model, str or path-like, or objects with `step` and `output`
        The plants; the noise of number i has the seed ``first_seed + i`` in every run. A plant of your own is copied
        for every run, which then is one of `track`, in turn.
    delay_samples, noise_deg : int, float
        As for `track`; left out, the delay of the first plant.
    airflow_torque_nm : mapping of str to array_like, optional
        Torque on the plate [N m] by the name of the reference, one number or one per sample.
    first_seed : int
        Of the noise of the first throttle.
    workers : int, optional
        Threads; one per core if left out.

    Returns
    -------
    xarray.Dataset
        The scalars of `track` over ``throttle``, ``controller`` and ``reference``. ``attrs["findings"]`` where plates
        swing.

    Raises
    ------
    mgdd.errors.ParameterError
        Nothing to run, a controller that is not one of mgdd, references of different sample time.
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
    all_references = [reference_of(reference) for reference in references]
    if not all_references or not controllers or not throttles:
        raise ParameterError("controllers, references and throttles: give at least one each")
    if len({reference.sample_s for reference in all_references}) > 1:
        raise ParameterError("references: must all have the same sample_s")
    for name, controller in controllers.items():
        if core_of(controller) is None:
            raise ParameterError.of(f"controllers[{name!r}]", controller, "a controller of mgdd; run others with track")
    flows = dict(airflow_torque_nm or {})
    unknown = set(flows) - {reference.name for reference in all_references}
    if unknown:
        raise ParameterError.of("airflow_torque_nm", sorted(unknown), "names of references")
    airflow = [column_of("airflow_torque_nm", flows.get(r.name), len(r.angle_deg)) for r in all_references]
    plates = [plate_of(each) for each in throttles]
    delay_samples = plates[0].delay_samples(delay_samples, all_references[0].sample_s)
    for plate in plates:
        plate.require_torques(airflow_torque_nm=airflow_torque_nm)

    def run() -> Any:
        sensors = sensors_of(noise_deg)
        plants = [
            plant_of(plate.plant, all_references[0], None, sensors, first_seed + number)
            for number, plate in enumerate(plates)
            if isinstance(plate.plant, Throttle)
        ]
        return _core.loop.track_throttles(
            plants,
            [core_of(controller) for controller in controllers.values()],
            [(r.angle_deg, flow, np.empty(0), r.from_sample) for r, flow in zip(all_references, airflow, strict=True)],
            delay_samples=delay_samples,
            band_deg=[r.band_deg for r in all_references],
            threads=threads_of(workers),
        )

    def in_turn() -> Any:
        rows = {name: np.full(len(plates) * len(controllers) * len(all_references), np.nan) for name in FIGURES}
        finished = np.zeros(len(rows[FIGURES[0]]), bool)
        runs = itertools.product(range(len(plates)), controllers.values(), range(len(all_references)))
        try:
            for at, (plant, controller, reference) in enumerate(runs):
                one = track(
                    copy.deepcopy(controller),
                    all_references[reference],
                    throttle=copy.deepcopy(throttles[plant]),
                    delay_samples=delay_samples,
                    airflow_torque_nm=flows.get(all_references[reference].name),
                    noise_deg=noise_deg,
                    seed=first_seed + plant,
                )
                finished[at] = True
                for name in FIGURES:
                    rows[name][at] = float(one[name])
        except KeyboardInterrupt:
            return (rows, finished), Interrupted("interrupted: the runs until then are in .partial")
        return (rows, finished), None

    in_core = all(isinstance(plate.plant, Throttle) for plate in plates)
    (figures, finished), stop = or_partial(run) if in_core else in_turn()
    shape = len(throttles), len(controllers), len(all_references)
    finished = np.asarray(finished).reshape(shape)
    dims = ("throttle", "controller", "reference")
    variables: dict[str, tuple[Any, ...]] = {
        "throttle": ("throttle", np.arange(len(throttles)), "-", "number of the throttle"),
        "controller": ("controller", list(controllers), "-", "controller"),
        "reference": ("reference", [r.name for r in all_references], "-", "reference"),
    }
    for name in FIGURES:
        values = np.asarray(figures[name]).reshape(shape)
        variables[name] = (dims, values if stop is None else np.where(finished, values, np.nan))
    if stop is not None:
        variables["finished"] = (dims, finished, "-", "whether the run came to its end")
    attrs: dict[str, Any] = {"delay_samples": delay_samples, "noise_deg": noise_deg, "seed": first_seed}
    swinging = int((np.asarray(figures["limit_cycle_deg"]) > SWINGS_DEG).sum())
    if swinging:
        attrs["findings"] = f"{swinging} of {finished.size} runs swing by more than {SWINGS_DEG:g} deg: limit_cycle_deg"
    return hand_over(labelled_dataset(variables, attrs=attrs), stop)
