"""One question: how near to the best IMEP under a NOx limit does a search come in 60 cycles on a measured engine.

    python benchmarks/seeking_measured_engine.py [--seeds 50] [--cycles 60] [--nox-limit 600]

The surrogate of the measured hydrogen-diesel engine (data set "h2df_502") with all its four inputs, its recorded
residuals and its late NOx sensor. `GaussianProcessSeeking` begins at the medians of the records. Against the surfaces,
without residuals: IMEP that is missing at the last estimate (median, nine in ten stay below) and in the last ten
cycles, the share of commands above the limit, and of commands outside the support of the records. The best input is
found by drawing points. "Read" is the share of NOx readings above the limit: recorded residuals stay for many cycles,
and what is read is all that a seeker can keep.

Rows: the bounds of the records alone; with the leverage as one more limit and a plant that clamps to the support. NOx:
behind its sensor, whose lag is told; with the first-order lag of the sensor inverted, its delay told; as an analyser
would read it that is as fast as the engine.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mgdd import datasets
from mgdd.loop import Measurement, run_seeker
from mgdd.optimize import ComponentLag, GaussianProcessSeeking, Limit
from mgdd_studies.measured_engine import EngineSurrogate, SurrogatePlant, fit_surrogate
from mgdd_studies.measured_engine_cases import lag_of

NOX = "nox_ppm"
DRAWN, NEARER = 400_000, (0.05, 0.02, 0.01, 0.004)


class InvertedSensor:
    """A plant whose NOx reading is that of before the first-order lag."""

    def __init__(self, plant: SurrogatePlant, lag: ComponentLag) -> None:
        self._plant, self._keep, self._last = plant, math.exp(-1.0 / lag.lag_cycles), math.nan
        self.input_names, self.limit_names = plant.input_names, plant.limit_names

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs of the next cycle."""
        self._plant.apply(inputs)

    def measure(self) -> Measurement:
        """Run it."""
        found = self._plant.measure()
        read = found.limits[NOX]
        before, self._last = self._last, read
        if not math.isnan(before):
            read = (read - self._keep * before) / (1.0 - self._keep)
        return replace(found, limits={**found.limits, NOX: read})


def best_imep(surrogate: EngineSurrogate, nox_limit: float) -> float:
    support, rng = surrogate.support, np.random.default_rng(0)
    width = support.upper - support.lower
    imep, nox = (list(surrogate.signals).index(name) for name in ("imep_bar", NOX))
    best, most = support.lower, -math.inf
    points = rng.uniform(support.lower, support.upper, (DRAWN, width.size))
    for nearer in (*NEARER, None):
        values, supported = surrogate.evaluate(points)
        allowed = np.where(supported & (values[:, nox] <= nox_limit), values[:, imep], -math.inf)
        if allowed.max() > most:
            best, most = points[allowed.argmax()], float(allowed.max())
        if nearer is not None:
            about = best + nearer * width * rng.standard_normal((DRAWN // 4, width.size))
            points = np.clip(about, support.lower, support.upper)
    return most


def runs(
    surrogate: EngineSurrogate, sensor: str, *, keeps_in: bool, seeds: int, cycles: int, nox_limit: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the inputs that were commanded, shape (seeds, cycles, inputs), the last estimates, and NOx as read."""
    support, lag = surrogate.support, lag_of(surrogate, NOX)
    medians = {name: surrogate.medians[name] for name in surrogate.inputs}
    told_lag = 0.0 if sensor == "inverted" else lag.lag_cycles
    limits = [Limit(NOX, nox_limit, delay_cycles=lag.delay_cycles, lag_cycles=told_lag)]
    if keeps_in:
        limits.append(Limit("leverage_share", 1.0))
    commands, ends, read = [], [], []
    for seed in range(seeds):
        plant = SurrogatePlant(
            surrogate, limits=limits, inputs=surrogate.inputs, seed=seed, outside="clamp" if keeps_in else "flag"
        )
        seeker = GaussianProcessSeeking(
            start=medians,
            inputs=dict(zip(surrogate.inputs, zip(support.lower, support.upper, strict=True), strict=True)),
            limits=limits,
            seed=seed,
        )
        run = run_seeker(InvertedSensor(plant, lag) if sensor == "inverted" else plant, seeker, cycles)
        commands.append(run.dataset["applied"].to_numpy())
        ends.append(seeker.estimate)
        read.append(run.dataset[NOX].to_numpy())
    return np.array(commands), np.array(ends), np.array(read)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--cycles", type=int, default=60)
    parser.add_argument("--nox-limit", type=float, default=600.0, help="[ppm]")
    options = parser.parse_args()
    measured = fit_surrogate(datasets.read("h2df_502"))
    first = min(model.lag_cycles for model in measured.signals.values())
    quick = {**measured.signals, NOX: replace(measured.signals[NOX], lag_cycles=first, sensor=None)}
    fast = replace(measured, signals=quick)
    best = best_imep(measured, options.nox_limit)
    imep, nox = (list(measured.signals).index(name) for name in ("imep_bar", NOX))
    print(f"{options.seeds} seeds, {options.cycles} cycles, NOx <= {options.nox_limit:g} ppm: best IMEP {best:.3f} bar")
    heads = ("median", "90 %", "last ten", "above", "read", "outside", "estimate")
    print(f"{'IMEP missing [bar], shares':54s}" + "".join(f"{head:>10s}" for head in heads))
    for keeps_in in (False, True):
        for sensor in ("told", "inverted", "fast"):
            surrogate = fast if sensor == "fast" else measured
            commands, ends, read = runs(
                surrogate,
                sensor,
                keeps_in=keeps_in,
                seeds=options.seeds,
                cycles=options.cycles,
                nox_limit=options.nox_limit,
            )
            values, supported = measured.evaluate(commands.reshape(-1, commands.shape[-1]))
            late, inside = measured.evaluate(ends)
            missing, reached = best - late[:, imep], values[:, imep].reshape(commands.shape[:2])
            name = f"{'leverage as a limit, clamped' if keeps_in else 'bounds alone'}; NOx {sensor}"
            print(
                f"{name:54s}{np.median(missing):10.3f}{np.quantile(missing, 0.9):10.3f}"
                f"{best - reached[:, -10:].mean():10.3f}{np.mean(values[:, nox] > options.nox_limit):10.1%}"
                f"{np.mean(read > options.nox_limit):10.1%}{1.0 - supported.mean():10.1%}"
                f"{1.0 - inside.mean():10.1%}",
                flush=True,
            )


if __name__ == "__main__":
    main()
