"""Timing, EGR and boost of the virtual bench under two limits, both of which hold the optimum back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import Cylinder
from mgdd.loop import VirtualEngine, run_seeker
from mgdd.optimize import ExtremumSeeking, GaussianProcessSeeking, Limit, Seeker, Spsa
from mgdd.optimize.optimum import Optimum
from mgdd_studies.several_maps import EARLY
from mgdd_studies.statistics import band_variables, with_interval, with_quantiles

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = [
    "BOUNDS", "GUIDED", "LIMITS", "LIMITS_TOO", "PLAIN", "SEEKERS", "START", "BenchRun", "OnBench", "bench_optimum",
    "bench_run", "bench_variables", "noisy_bench", "on_bench", "told",
]  # fmt: skip

BOUNDS = {"soc_cad": (-25.0, 10.0), "egr": (0.0, 0.4), "intake_pressure_kpa": (120.0, 220.0)}
START = {"soc_cad": 2.0, "egr": 0.35, "intake_pressure_kpa": 200.0}
LIMITS = {"p_max_bar": 118.0, "nox_fast_ppm": 150.0}
UNTIL = (EARLY, 200)  # cycles after which the study looks at the estimate
PLAIN, GUIDED, LIMITS_TOO, SPSA, DITHER = SEEKERS = (
    "Gaussian process", "Gaussian process, guide of J", "Gaussian process, guide of J and limits", "SPSA",
    "extremum seeking",
)  # fmt: skip
_MODEL_WALL_HEAT = 0.65  # of the guide, where the bench has 0.5
_MODEL_NODES = 15  # per input
_PERIOD, _HARMONICS = 20, (3, 4, 5)  # of extremum seeking


@dataclass(frozen=True, kw_only=True)
class BenchRun:
    """One run: what was applied without its noise, and estimates after some of the cycles."""

    excess: NDArray[np.float64]  # of each limit by what was applied, shape (cycles, limits) [-]
    estimates: tuple[dict[str, float], ...]
    lost: tuple[float, ...]  # steady J of the optimum less that of the estimate [points]
    estimate_excess: tuple[float, ...]  # of the limit that the estimate is farthest beyond [-]


def noisy_bench(seed: int) -> VirtualEngine:
    """Make the bench of a run, with its default noise."""
    return VirtualEngine(inputs=list(BOUNDS), limits=list(LIMITS), seed=seed)


def _quiet_bench(engine: Any = "puma_single") -> VirtualEngine:
    """Make the bench without noise, of this engine."""
    return VirtualEngine(
        engine, inputs=list(BOUNDS), limits=list(LIMITS), soc_scatter_cad=0.0, efficiency_noise_percent=0.0
    )


def bench_optimum() -> Optimum:
    """Find the best inputs within bounds and limits."""
    return VirtualEngine(inputs=list(BOUNDS)).find_optimum(LIMITS, bounds=BOUNDS)


def told(bench: VirtualEngine) -> list[Limit]:
    """Say what stands between the plant and a limit: the fast sensor is 0.05 s late and slow, a cycle takes 0.08 s."""
    cycle_s = 120.0 / bench.point.speed_rpm
    sensor = bench.settings["fast_sensor"]
    late = {"delay_cycles": round(sensor.delay_s / cycle_s), "lag_cycles": sensor.lag_s / cycle_s}
    return [Limit(name, upper, **(late if name.startswith("nox") else {})) for name, upper in LIMITS.items()]


def bench_run(bench: VirtualEngine, seeker: Seeker, until: Sequence[int], best_j: float) -> BenchRun:
    """Run a seeker on the bench and look at its estimate after each of these counts of cycles."""
    quiet, uppers = _quiet_bench(), np.array(list(LIMITS.values()))
    parts: list[xr.Dataset] = []
    estimates, lost, excess = [], [], []
    for cycles in np.diff(until, prepend=0):
        parts.append(run_seeker(bench, seeker, int(cycles)).dataset)
        at = dict(zip(BOUNDS, map(float, seeker.estimate), strict=True))
        estimates.append(at)
        lost.append(best_j - float(quiet.steady_map({name: [value] for name, value in at.items()})["j"].squeeze()))
        first, *further = ([value] for value in at.values())
        excess.append(float((quiet.noise_free_limits(first, [0], further)[0] / uppers - 1.0).max()))
    applied = np.concatenate([part["noise_free_limits"].to_numpy() for part in parts])
    return BenchRun(
        excess=applied / uppers - 1.0, estimates=tuple(estimates), lost=tuple(lost), estimate_excess=tuple(excess)
    )


@dataclass(frozen=True, kw_only=True)
class OnBench:
    """The runs of one seeker."""

    seeker: str
    runs: list[BenchRun]

    def row(self) -> dict[str, Any]:
        """Give the row of this seeker."""
        over = [run.excess > 0.0 for run in self.runs]
        lost = np.array([run.lost for run in self.runs])
        return {
            "seeker": self.seeker,
            **with_interval("j_lost_after_40", lost[:, 0]),
            **with_interval("j_lost_after_200", lost[:, 1]),
            "estimates_above_percent": 100.0 * float(np.mean([run.estimate_excess[0] > 0.0 for run in self.runs])),
            **with_interval("above_percent", [100.0 * own.any(axis=1).mean() for own in over]),
            **{
                f"above_{name}_percent": 100.0 * float(np.mean([own[:, at] for own in over]))
                for at, name in enumerate(LIMITS)
            },
            "worst_percent": 100.0 * max(float(run.excess.max()) for run in self.runs),
        }


def on_bench(seeker: str, n_seeds: int, best: Optimum) -> OnBench:
    """Run a seeker on the bench for each seed."""
    guides = _model(limits=seeker == LIMITS_TOO) if seeker in (GUIDED, LIMITS_TOO) else {}
    runs = []
    for seed in range(n_seeds):
        bench = noisy_bench(seed)
        own = _bench_seeker(seeker, told(bench), seed, guides)
        runs.append(bench_run(bench, own, UNTIL, best.value))
    return OnBench(seeker=seeker, runs=runs)


def _bench_seeker(seeker: str, limits: list[Limit], seed: int, guides: dict[str, Any]) -> Seeker:
    space: dict[str, Any] = {"inputs": BOUNDS, "start": START, "limits": limits}
    if seeker == SPSA:
        return Spsa(**space, seed=seed)
    if seeker == DITHER:
        return ExtremumSeeking(**space, period=_PERIOD, harmonics=_HARMONICS)
    return GaussianProcessSeeking(**space, seed=seed, **guides)


def _model(*, limits: bool) -> dict[str, Any]:
    """Draw what the wrong model says of J, and of both limits; a model has no sensor, so its NOx is the true one."""
    nodes = {name: np.linspace(*bounds, _MODEL_NODES) for name, bounds in BOUNDS.items()}
    drawn = _quiet_bench(Cylinder(wall_heat_scale=_MODEL_WALL_HEAT)).steady_map(nodes)
    of_limits = {"p_max_bar": drawn["p_max_bar"], "nox_fast_ppm": drawn["nox_true_ppm"]}
    return {"guide": drawn["j"], **({"limit_guides": of_limits} if limits else {})}


def bench_variables(bench: Sequence[OnBench]) -> dict[str, tuple[Any, ...]]:
    """Give the course of the limited quantities, as variables of a Dataset."""
    if not bench:
        return {}
    over = ("bench_seeker", "bench_cycle")
    variables: dict[str, tuple[Any, ...]] = {
        "bench_seeker": ("bench_seeker", [own.seeker for own in bench], "-", "seeker"),
        "bench_cycle": ("bench_cycle", np.arange(UNTIL[-1]), "-", "engine cycle"),
    }
    for at, (name, upper) in enumerate(LIMITS.items()):
        label, _, unit = name.rpartition("_")
        runs = [[upper * (1.0 + run.excess[:, at]) for run in own.runs] for own in bench]
        said = with_quantiles(f"{label}, applied, without noise")
        variables |= band_variables(f"applied_{label}_{{}}_{unit}", over, runs, unit, said)
        variables[f"upper_{name}"] = ((), upper, unit, f"limit of {label}")
    return variables
