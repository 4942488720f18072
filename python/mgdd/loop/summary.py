"""What a closed loop is judged by, and what it came to: the same figures as those of the core, also for half a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core.optimize import Limit
from mgdd.errors import ParameterError
from mgdd.optimize.optimum import limits_of
from mgdd.results.labels import VARIABLES

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.guide import FeedForward, GuidedEngine
    from mgdd.optimize import Seeker

_LONGEST_SETTLING = 1000  # cycles that do not count for the limits unless the caller says so; as in the core


@dataclass(frozen=True, kw_only=True)
class LoopCriteria:
    """What a loop is judged by: where its estimate should go, and which limits count from when.

    Parameters
    ----------
    optimum : float, optional
        Where the estimate of the first input should go [its unit]; without it arrival and distance are not judged.
    arrival : float
        Distance to the optimum that counts as arrived [unit of the input].
    tail_cycles : int
        Cycles behind ``final_INPUT``.
    exceed_from : int, optional
        First cycle that counts for ``exceeded_fraction`` and the figures ``judged_...``; by default 1000, or the middle
        of a run of fewer than 2000 cycles. The summary repeats it as ``judged_from``.
    exceed_above : mapping of str to float
        Per limit, the value above which a cycle counts for ``exceeded_fraction``, for example the limit and a margin
        for its scatter; the summary repeats it as ``exceed_above_NAME``.
    limits : mapping of str to float, or sequence of Limit, optional
        Limits of which the summary gives ``worst_NAME``, ``above_fraction_NAME`` and so on, without any margin; those
        of the seeker if left out.

    Raises
    ------
    mgdd.errors.ParameterError
        A criterion outside its domain.

    Examples
    --------
    >>> from mgdd.loop import VirtualEngine, LoopCriteria, run_seeker
    >>> from mgdd.optimize import GoldenSection
    >>> seeker = GoldenSection(start=-20.0, bounds=(-30.0, 10.0), noise_sd=0.25)
    >>> run = run_seeker(VirtualEngine(seed=1), seeker, 300, criteria=LoopCriteria(optimum=-5.63))
    >>> run.summary["cycles_to"] < 100
    True
    """

    optimum: float | None = None
    arrival: float = 1.0
    tail_cycles: int = 100
    exceed_from: int | None = None
    exceed_above: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, float] | Sequence[Limit] | None = None

    def __post_init__(self) -> None:
        number = isinstance(self.optimum, int | float) and math.isfinite(self.optimum)
        ParameterError.unless(self.optimum is None or number, "optimum", self.optimum, "one finite number, or None")
        ParameterError.unless(self.arrival > 0.0, "arrival", self.arrival, "> 0")
        ParameterError.unless(self.tail_cycles >= 1, "tail_cycles", self.tail_cycles, ">= 1")
        if self.exceed_from is not None and self.exceed_from < 0:
            raise ParameterError.of("exceed_from", self.exceed_from, ">= 0")
        for what, values in (("exceed_above", self.exceed_above), ("limits", self._uppers())):
            for name, value in values.items():
                if math.isnan(value):
                    raise ParameterError(f"{what}: {name} = nan: give a number, or leave it out")

    def _uppers(self) -> Mapping[str, float]:
        own = self.limits or {}
        return own if isinstance(own, Mapping) else {limit.name: limit.upper for limit in limits_of(own)}

    def counted_from(self, cycles: int) -> int:
        """Give the first cycle that counts for ``exceeded_fraction``."""
        return min(_LONGEST_SETTLING, cycles // 2) if self.exceed_from is None else self.exceed_from

    def require_counted(self, cycles: int) -> None:
        """Raise where no cycle of a run would count for ``exceeded_fraction``."""
        if self.exceed_above and self.exceed_from is not None and self.exceed_from >= cycles:
            raise ParameterError.of("exceed_from", self.exceed_from, f"< cycles = {cycles}, or no cycle counts")

    def thresholds(self, names: tuple[str, ...]) -> list[float]:
        """Give ``exceed_above`` in the order of the limits, infinite where it has none; empty if it is empty."""
        return _in_order("exceed_above", self.exceed_above, names) if self.exceed_above else []

    def limits_of(
        self, names: tuple[str, ...], seeker: Seeker | FeedForward | GuidedEngine | None = None
    ) -> list[float]:
        """Give ``limits`` or those of the seeker in the order of the names, infinite where there is none."""
        if self.limits is not None or seeker is None:
            return _in_order("limits", self._uppers(), names)
        return _in_order("limits", {limit.name: limit.upper for limit in seeker.settings["limits"]}, names)

    def attributes(self, names: tuple[str, ...], uppers: Sequence[float]) -> dict[str, float]:
        """Give what a figure of the run marks: ``optimum``, and ``limit_NAME`` where there is one."""
        references = {f"limit_{name}": upper for name, upper in zip(names, uppers, strict=True) if math.isfinite(upper)}
        return references if self.optimum is None else {"optimum": float(self.optimum), **references}

    def to_core(self, names: tuple[str, ...]) -> dict[str, Any]:
        """Give what the loops of the core take."""
        return {
            "optimum_cad": math.nan if self.optimum is None else self.optimum,
            "arrival_cad": self.arrival,
            "tail_cycles": self.tail_cycles,
            "exceed_from": self.exceed_from,
            "exceed_above": self.thresholds(names),
            "limits": [] if self.limits is None else self.limits_of(names),
        }


def _in_order(what: str, values: Mapping[str, float], names: tuple[str, ...]) -> list[float]:
    if unknown := sorted(set(values) - set(names)):
        raise ParameterError(f"{what}: {unknown} not among the limits, {list(names)}")
    return [float(values.get(name, math.inf)) for name in names]


NOISE_FREE = "noise_free_"
_OWN = "unit of the limit"
FIGURES = {
    "limit": (_OWN, "limit itself"),
    "worst": (_OWN, "largest reading"),
    "worst_cycle": ("cycle", "cycle of the largest reading, from the first of the run"),
    "above_cycles": ("-", "cycles above the limit itself, from the first on"),
    "above_fraction": ("-", "share of all cycles above the limit itself"),
    "judged_above_cycles": ("-", "cycles above the limit itself, from judged_from on"),
    "judged_above_fraction": ("-", "share of the cycles from judged_from on above the limit itself"),
    "exceed_above": (_OWN, "threshold of exceeded_fraction"),
}


def limit_figures(
    readings: NDArray[np.float64], names: Sequence[str], uppers: Sequence[float], judged_from: int, prefix: str = ""
) -> dict[str, float]:
    """Give the figures of every finite limit; a cycle counts where it has a reading, and is above where it is >."""
    out: dict[str, float] = {}
    for column, name, upper in zip(readings.T, names, uppers, strict=True):
        read = np.isfinite(column)
        if not math.isfinite(upper) or (prefix and not read.any()):
            continue
        above, judged = column > upper, np.arange(column.size) >= judged_from
        worst = int(np.argmax(np.where(read, column, -math.inf))) if read.any() else None
        own = {
            "limit": float(upper),
            "worst": math.nan if worst is None else float(column[worst]),
            "worst_cycle": math.nan if worst is None else float(worst),
            "above_cycles": float(above.sum()),
            "above_fraction": _share(above, read),
            "judged_above_cycles": float((above & judged).sum()),
            "judged_above_fraction": _share(above & judged, read & judged),
        }
        if prefix:
            del own["limit"]
        out |= {f"{prefix}{figure}_{name}": value for figure, value in own.items()}
    return out


def limit_label(key: str, names: Sequence[str]) -> tuple[str, str]:
    """Give unit and long name of a figure named FIGURE_LIMIT."""
    for name in names:
        figure = key.removesuffix(f"_{name}")
        if figure in FIGURES and figure != key:
            unit, text = FIGURES[figure]
            return (VARIABLES[name].units if unit == _OWN else unit), f"{name}: {text}"
    raise KeyError(key)


def with_a_limit(raw: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Leave out what the core says of a limited quantity without a limit."""
    free = {f"{figure}_{name}" for name in names if not np.isfinite(raw[f"limit_{name}"]).any() for figure in FIGURES}
    return {key: value for key, value in raw.items() if key not in free}


def _share(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
    return float(part.sum() / whole.sum()) if whole.any() else math.nan


FIGURES_OF_INPUT = {
    "final": "mean estimate of the last cycles",
    "mean": "mean estimate, second half",
    "rms": "rms distance of the estimate to the optimum, second half",
    "mean_applied": "mean applied input, second half",
    "lowest": "lowest estimate",
    "highest": "highest estimate",
}


def of_first_input(figures: Mapping[str, Any], inputs: Sequence[str]) -> dict[str, Any]:
    """Name the figures that the core has of the first input alone, as angles, as FIGURE_INPUT."""
    new_names = {f"{figure}_cad": f"{figure}_{inputs[0]}" for figure in FIGURES_OF_INPUT}
    return {new_names.get(name, name): value for name, value in figures.items()}


def summarize_cycles(cycles: xr.Dataset, criteria: LoopCriteria | None = None) -> dict[str, float]:
    """Sum up the cycles of a run, whether it came to its end or not."""
    criteria = criteria or LoopCriteria()
    measured = tuple(str(name) for name in cycles["limit"].to_numpy()) if "limits" in cycles else ()
    uppers = list[float]()
    if cycles.sizes["cycle"]:  # a run that was interrupted before its first cycle has measured nothing
        criteria.thresholds(measured)
        uppers = criteria.limits_of(measured)
    n = cycles.sizes["cycle"]
    half = np.arange(n) >= n // 2
    misfire = cycles["misfire"].to_numpy().astype(bool)
    void = misfire | cycles["unphysical"].to_numpy().astype(bool) if "unphysical" in cycles else misfire

    def fired(name: str, factor: float = 1.0) -> float:
        return factor * _mean(cycles[name].to_numpy()[half & ~void]) if name in cycles else math.nan

    out = {
        **_of_inputs(cycles, half, criteria.tail_cycles),
        "cycles_to": math.nan,
        "cycles_stays": math.nan,
        "exceeded_fraction": _exceeded(cycles, criteria.counted_from(n), criteria.exceed_above),
        "mean_j": fired("j"),
        "mean_efficiency_percent": fired("efficiency_gross", 100.0),
        "mean_nox_ppm": fired("nox_true_ppm"),
        "misfires": float(misfire.sum()),
        "judged_from": float(criteria.counted_from(n)),
        **{f"exceed_above_{name}": float(value) for name, value in criteria.exceed_above.items()},
        **_of_limits(cycles, uppers, criteria.counted_from(n)),
    }
    if criteria.optimum is None:
        return out
    away = np.asarray(cycles["estimate"].to_numpy()[:, 0] - criteria.optimum, dtype=np.float64)
    out[f"rms_{cycles['input'].to_numpy()[0]}"] = math.sqrt(_mean(away[half] ** 2))
    near = np.abs(away) <= criteria.arrival
    if near.any():
        out["cycles_to"] = float(np.argmax(near))
    if n and near[-1]:
        out["cycles_stays"] = float(n - np.argmin(near[::-1])) if not near.all() else 0.0
    return out


def _of_limits(cycles: xr.Dataset, uppers: Sequence[float], judged_from: int) -> dict[str, float]:
    """Sum up the limits of a run as measured and, where the plant knows them, noise-free; `uppers` as in `limit`."""
    out: dict[str, float] = {}
    for variable, prefix in (("limits", ""), ("noise_free_limits", NOISE_FREE)):
        if variable in cycles:
            names = [str(name) for name in cycles["limit"].to_numpy()]
            out |= limit_figures(cycles[variable].to_numpy(), names, uppers, judged_from, prefix)
    return out


def _of_inputs(cycles: xr.Dataset, half: NDArray[np.bool_], tail_cycles: int) -> dict[str, float]:
    """Give the figures of every input; the distance to an optimum is NaN as yet."""
    out: dict[str, float] = {}
    columns = zip(
        cycles["input"].to_numpy(), cycles["estimate"].to_numpy().T, cycles["applied"].to_numpy().T, strict=True
    )
    for name, estimate, applied in columns:
        own = {
            "final": _mean(estimate[max(estimate.size - tail_cycles, 0) :]),
            "mean": _mean(estimate[half]),
            "rms": math.nan,
            "mean_applied": _mean(applied[half]),
            "lowest": float(np.min(estimate, initial=math.inf)),
            "highest": float(np.max(estimate, initial=-math.inf)),
        }
        out |= {f"{figure}_{name}": value for figure, value in own.items()}
    return out


def _exceeded(cycles: xr.Dataset, first: int, above: Mapping[str, float]) -> float:
    if not above or "limits" not in cycles or cycles.sizes["cycle"] <= first:
        return math.nan
    thresholds = np.array([above.get(str(name), math.inf) for name in cycles["limit"].to_numpy()])
    over = np.any(cycles["limits"].to_numpy()[first:] > thresholds, axis=1)
    return float(np.mean(over))


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean()) if values.size else math.nan
