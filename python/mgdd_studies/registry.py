"""The studies by name: what there is, and how to run one."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module
from typing import Any

from mgdd.errors import ParameterError
from mgdd.parallel.pool import MakesExecutor
from mgdd_studies.base import Progress, StudyResult, check_seeds, parts_on
from mgdd_studies.titles import STUDIES

__all__ = ["available_studies", "run_study"]

# One line per study: "my-name" is run_my_name of mgdd_studies.my_name, or of the module that stands below.
_MODULES = {"identification-benchmarks": "benchmarks.identification_benchmarks"}


def available_studies() -> dict[str, str]:
    """List the studies.

    Returns
    -------
    dict of str to str
        Name and title.

    Examples
    --------
    >>> from mgdd_studies.registry import available_studies
    >>> "sensor-delay" in available_studies()
    True
    """
    return {name: study.title for name, study in STUDIES.items()}


def run_study(
    name: str,
    *,
    n_seeds: int | None = None,
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
    n_seeds : int, optional
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
        What one study takes beside these. ``guided``: ``real``, whether on the surrogate of the measured engine.

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
    >>> from mgdd_studies import run_study
    >>> result = run_study("sensor-delay", n_seeds=2, quick=True, figures=False)
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
    if n_seeds is not None:
        if "n_seeds" not in taken:
            raise ParameterError(f"n_seeds = {n_seeds}: study {name!r} is deterministic; leave them out")
        options["n_seeds"] = check_seeds(n_seeds)
    if STUDIES[name].one_part and not (executor is None and workers is None):
        raise ParameterError(f"executor, workers: study {name!r} is one part, which they cannot share; leave them out")
    with parts_on(executor, workers):
        result: StudyResult = function(**options)
    return result


def function_of(name: str) -> Callable[..., StudyResult]:
    """Give the function that runs a study; ParameterError for an unknown name."""
    if name not in STUDIES:
        raise ParameterError.of("study", name, f"one of {', '.join(STUDIES)}", known=STUDIES)
    own = name.replace("-", "_")
    function: Callable[..., StudyResult] = getattr(
        import_module(f"mgdd_studies.{_MODULES.get(name, own)}"), f"run_{own}"
    )
    return function
