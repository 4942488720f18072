"""The studies by name: what there is, and how to run one."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

from mgdd.errors import ParameterError, hinted
from mgdd.parallel.pool import MakesExecutor
from mgdd.studies.base import Progress, StudyResult, check_seeds, parts_on

__all__ = ["available_studies", "run_study"]

# One line per study: "my-name" is run_my_name of mgdd.studies.my_name, or of the module that stands below.
_MODULES = {"identification-benchmarks": "benchmarks.identification_benchmarks"}


class _Study(NamedTuple):
    title: str
    chapter: int | None = None  # of Tan (2018), where the question comes from it
    one_part: bool = False  # its work is one chain, nothing that workers could share


_STUDIES = {
    "measured-traces": _Study(
        "calibrate a cycle model to four measured traces and find their best timing", one_part=True
    ),
    "throttle-characteristics": _Study("holding-duty hysteresis, rate dependence and air flow of a throttle", 2),
    "seeker-comparison": _Study("every seeker on the same engine, noise, start and budget", 3),
    "seekers-several-inputs": _Study(
        "which seeker for several inputs: with and without a guide, beside tuned dithers, also under limits"
    ),
    "nox-sensors": _Study("NOx analyser, fast sensor and soft sensor, steady and in transients", 4),
    "sensor-delay": _Study("what a late NOx analyser does to extremum seeking, and three cures", 4),
    "timing-tests": _Study(
        "four tests of extremum seeking: efficiency, another start, NOx by analyser and by soft sensor", 4
    ),
    "guided-start-up": _Study("cycles that a rough model saves at the start, as feed-forward and as a curve", 5),
    "guide-accuracy": _Study("how wrong a guide may be and still help after a load step and in trouble", 5),
    "guided-transients": _Study("what a guide saves while the operating point keeps changing", 5),
    "ignition-delay": _Study("start of injection for a start of combustion, and what a wrong delay costs a guide", 5),
    "model-validation": _Study("cycle models beside measured traces, before and after calibration", 5),
    "online-calibration": _Study("what the engine teaches its model while it runs, also with errors of the sensor", 6),
    "calibrated-guide": _Study("whether a guide that the measured pressure calibrates beats one that stays wrong", 6),
    "from-design-to-map": _Study(
        "a timing map by design of experiments: its cost, its losses, other engines, and what a guide makes of it", 2
    ),
    "torque-demand": _Study("how far the torque follows the pedal through the throttle, and causes of the error", 2),
    "throttle-first-principle": _Study(
        "groups of a throttle from noisy logs, also where the plant does more than the model", 7
    ),
    "throttle-pseudo-wiener": _Study(
        "three pseudo-Wiener models of a throttle, in free run and corrected by measurements", 7
    ),
    "throttle-tracking": _Study("six controllers, tuned alike, on throttles that they do not know", 7),
    "throttle-faults": _Study("faults of a throttle under a supervisor: time to the safe state, reason, recovery"),
    "identification-benchmarks": _Study(
        "measured drive, tanks and circuit: fits beside published ones (needs the data sets)"
    ),
    "guided": _Study("a start guided by a rough model beside an unguided one, on the bench or a measured engine", 5),
    "measured-engine-seek": _Study("seekers on a surrogate of a measured hydrogen-diesel engine (needs the data set)"),
}


def available_studies() -> dict[str, str]:
    """List the studies.

    Returns
    -------
    dict of str to str
        Name and title.

    Examples
    --------
    >>> from mgdd.studies.registry import available_studies
    >>> "sensor-delay" in available_studies()
    True
    """
    return {name: study.title for name, study in _STUDIES.items()}


def run_study(
    name: str,
    *,
    seeds: int | None = None,
    quick: bool = False,
    figures: bool = True,
    executor: MakesExecutor | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> StudyResult:
    """Run a study by its name.

    Parameters
    ----------
    name : str
        One of the names that ``mgdd study`` lists, ``sensor-delay`` for example.
    seeds : int, optional
        Number of seeds behind every statistic, >= 1; the study's own number if left out.
    quick : bool
        A shorter study with wider intervals.
    figures : bool
        Draw its figures.
    executor, workers
        As in `mgdd.parallel.map_items`, for the parts of the study, each on one thread; the result does not depend on
        them. Without both the parts run one after the other, each on all cores.
    progress : callable, optional
        Called with a short text before each part.
    **options
        What one study takes beside these. ``measured-traces``: measured ``traces``, their ``cylinder``, the ``point``
        of what a trace does not carry, and ``step_cad`` and ``integrator`` as in `mgdd.identify.fit_cylinder`; the four
        heavy-duty diesel traces and the preset ``hd_diesel_128x144`` if left out. ``guided``: ``real``, whether on the
        surrogate of the measured engine.

    Returns
    -------
    StudyResult
        Its summary holds at least ``study``, ``seeds`` and ``rows``.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown name, fewer than one seed, seeds for a deterministic study, an option that it does not take, workers
        for a study that is one part, or a bad executor.
    mgdd.errors.WorkerLostError
        As in `mgdd.parallel.map_items`; ``partial`` is a StudyResult as after Ctrl-C, or None.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the StudyResult of the parts that were finished, or None.

    Examples
    --------
    >>> from mgdd.studies import run_study
    >>> result = run_study("sensor-delay", seeds=2, quick=True, figures=False)
    >>> [row["step_sign"] for row in result.summary["rows"]]
    [1, -1, -1, -1, 1, 1, 1]
    """
    function = function_of(name)
    taken = inspect.signature(function).parameters
    if unknown := [option for option in options if option not in taken]:
        raise ParameterError(f"{', '.join(unknown)}: study {name!r} takes {', '.join(taken)}")
    options |= {"quick": quick, "figures": figures}
    if progress is not None:
        options["progress"] = progress
    if seeds is not None:
        if "seeds" not in taken:
            raise ParameterError(f"seeds = {seeds}: study {name!r} is deterministic; leave them out")
        options["seeds"] = check_seeds(seeds)
    if _STUDIES[name].one_part and not (executor is None and workers is None):
        raise ParameterError(f"executor, workers: study {name!r} is one part, which they cannot share; leave them out")
    with parts_on(executor, workers):
        result: StudyResult = function(**options)
    return result


def function_of(name: str) -> Callable[..., StudyResult]:
    """Give the function that runs a study; ParameterError for an unknown name."""
    if name not in _STUDIES:
        raise ParameterError(hinted(f"study {name!r}: must be one of {', '.join(_STUDIES)}", name, _STUDIES))
    own = name.replace("-", "_")
    function: Callable[..., StudyResult] = getattr(
        import_module(f"mgdd.studies.{_MODULES.get(name, own)}"), f"run_{own}"
    )
    return function
