"""The studies by name: what there is, and how to run one."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import Any

from mgdd.errors import ParameterError
from mgdd.studies.base import Progress, StudyResult, check_seeds

__all__ = ["available_studies", "run_study"]

# One line per study: "my-name" is run_my_name in mgdd.studies.my_name, imported when it is run.
_TITLES = {
    "measured-traces": "calibrate a cycle model to four measured traces and find their best timing",
    "ch2-throttle-characteristics": "holding-duty hysteresis, rate dependence and air flow of a throttle",
    "ch3-optimizers": "every seeker on the same engine, noise, start and budget",
    "ch4-sensors": "NOx analyser, fast sensor and soft sensor, steady and in transients",
    "ch4-esc": "what a late NOx analyser does to extremum seeking, and three cures",
    "ch4-tests": "four tests of extremum seeking: efficiency, another start, NOx by analyser and by soft sensor",
    "ch7-first-principle": "groups of a throttle from noisy logs, also where the plant does more than the model",
    "ch7-pseudo-wiener": "three pseudo-Wiener models of a throttle, in free run and corrected by measurements",
    "identification-benchmarks": "measured drive, tanks and circuit: fits beside published ones (needs the data sets)",
    "h2df-seek": "seekers on a surrogate of a measured hydrogen-diesel engine (needs the data set)",
}


def available_studies() -> dict[str, str]:
    """List the studies.

    Returns
    -------
    dict of str to str
        Name and title.

    Examples
    --------
    >>> from mgdd.studies import available_studies
    >>> "ch4-esc" in available_studies()
    True
    """
    return dict(_TITLES)


def run_study(
    name: str,
    *,
    seeds: int | None = None,
    quick: bool = False,
    figures: bool = True,
    progress: Progress | None = None,
) -> StudyResult:
    """Run a study by its name.

    Parameters
    ----------
    name : str
        One of `available_studies`.
    seeds : int, optional
        Number of seeds behind every statistic, >= 1; the study's own number if left out.
    quick : bool
        A shorter study with wider intervals.
    figures : bool
        Draw its figures.
    progress : callable, optional
        Called with a short text before each part.

    Returns
    -------
    StudyResult
        Its summary holds at least ``study``, ``seeds`` and ``rows``.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown name, fewer than one seed, or seeds for a study without chance.

    Examples
    --------
    >>> from mgdd.studies import run_study
    >>> result = run_study("ch4-esc", seeds=2, quick=True, figures=False)
    >>> [row["step_sign"] for row in result.summary["rows"]]
    [1, -1, -1, -1, 1, 1, 1]
    """
    if name not in _TITLES:
        raise ParameterError(f"study {name!r}: must be one of {', '.join(_TITLES)}")
    module = name.replace("-", "_")
    function = getattr(import_module(f"mgdd.studies.{module}"), f"run_{module}")
    options: dict[str, Any] = {"quick": quick, "figures": figures}
    if progress is not None:
        options["progress"] = progress
    if seeds is not None:
        if "seeds" not in inspect.signature(function).parameters:
            raise ParameterError(f"seeds = {seeds}: study {name!r} has no chance in it; leave them out")
        options["seeds"] = check_seeds(seeds)
    result: StudyResult = function(**options)
    return result
