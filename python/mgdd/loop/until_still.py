"""A closed loop that ends before all its cycles once the estimate has come to rest."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import Interrupted, ParameterError, argument
from mgdd.loop.closed_loop import run_seeker
from mgdd.loop.criteria import LoopCriteria
from mgdd.loop.plant_loop import LoopRun
from mgdd.loop.summary import summarize_cycles
from mgdd.optimize.inputs import named_values
from mgdd.results.result import Figures

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.loop.plant import Plant
    from mgdd.loop.seek_choice import Question

_CYCLES = 20  # per input: twice what an estimate takes to arrive, docs/benchmarks.md
_LOOK = 5  # cycles between two looks


def stillness(asked: Question, tolerance: Any) -> NDArray[np.float64] | None:
    """Read a tolerance, a number per input, by name or alone; None for none."""
    if tolerance is None:
        return None
    still = np.atleast_1d(
        np.asarray(named_values(argument("tolerance"), tolerance, [one.name for one in asked.inputs]), np.float64)
    )
    if still.shape != (len(asked.inputs),) or not (np.isfinite(still) & (still > 0.0)).all():
        raise ParameterError(f"{argument('tolerance')} = {tolerance}: must be > 0, one number for each input")
    return still


def run_until_still(plant: Plant, seeker: Any, cycles: int, asked: Question, tolerance: NDArray[np.float64]) -> LoopRun:
    """Run at most `cycles`, a few at a time; the partial result of an error holds those before as well."""
    parts, estimates = list[LoopRun](), [seeker.estimate.copy()]
    window = _CYCLES * len(asked.inputs) + math.ceil(asked.late_cycles)
    done = 0
    while done < cycles:
        count = min(_LOOK, cycles - done)
        try:
            parts.append(run_seeker(plant, seeker, count))
        except (Exception, Interrupted) as stop:
            part = getattr(stop, "partial", None)
            if isinstance(part, LoopRun):
                stop.partial = _joined([*parts, part], asked)  # type: ignore[union-attr]
            raise
        done += count
        estimates.append(seeker.estimate.copy())
        if done >= window and (np.ptp(estimates[-(window // _LOOK) - 1 :], axis=0) < tolerance).all():
            break
    return _joined(parts, asked)


def _joined(parts: list[LoopRun], asked: Question) -> LoopRun:
    import xarray as xr

    held = [one for one in parts if one.dataset.sizes["cycle"]] or parts[:1]
    whole = xr.concat(
        [one.dataset for one in held], "cycle", data_vars="minimal", coords="minimal", compat="override",
        combine_attrs="override",
    )  # fmt: skip
    whole.attrs["interrupted"] = int(parts[-1].interrupted)
    limits = {limit.name: limit.upper for limit in asked.limits}
    summary = Figures(summarize_cycles(whole, LoopCriteria(limits=limits or None)))
    return LoopRun(dataset=whole, summary=summary, interrupted=parts[-1].interrupted, findings=parts[-1].findings)
