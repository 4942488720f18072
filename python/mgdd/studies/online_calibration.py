"""What an engine teaches its cycle model while it runs: wall heat from twice the truth, and errors of the sensor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.guide import OnlineCalibration
from mgdd.loop import EngineBench
from mgdd.optimize import ExtremumSeeking
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.calibration_facts import ENGINE_KNOWN, EXACT, TRUE_SCALE, WRONG, calibration_facts, fact_bars
from mgdd.studies.guide_cases import BOUNDS_CAD, first_within, stays_within, verdict_on
from mgdd.studies.online_calibration_figures import draw
from mgdd.studies.statistics import with_interval, with_median_interval

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["run_online_calibration"]

CYCLES, SETTLED = 150, 40
_START_CAD, _NEAR_PERCENT, _WRONG_PERCENT, _NOISE_BAR, _SCATTER_CAD = -12.0, 3.0, 5.0, 0.1, 0.3
_GAIN = 0.98  # of the seeker: time constant 40 cycles at a curvature of -0.051 points per CAD**2


@dataclass(frozen=True, kw_only=True)
class Way:
    """One way to calibrate: a method, and what it is told."""

    name: str
    method: str
    exact: bool = False  # everything but the wall heat counts as known exactly
    timing_measured: bool = False

    def calibration(self) -> OnlineCalibration:
        """Make the calibration, with a guide of twice the wall heat."""
        return OnlineCalibration(
            WRONG, method=self.method, uncertainty=EXACT if self.exact else ENGINE_KNOWN,
            soc_scatter_cad=0.0 if self.timing_measured else _SCATTER_CAD,
        )  # fmt: skip


WAYS = (
    Way(name="Gauss-Newton", method="gauss_newton"),
    Way(name="recursive", method="recursive"),
    Way(name="extremum seeking", method="extremum_seeking"),
    Way(name="extremum seeking, timing measured", method="extremum_seeking", timing_measured=True),
    Way(name="Gauss-Newton, all else taken as exact", method="gauss_newton", exact=True),
)


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A pressure sensor: its noise [bar], and what is wrong with it."""

    name: str
    noise_bar: float = _NOISE_BAR
    tdc_cad: float = 0.0
    gain: float = 0.0
    offset_bar: float = 0.0

    def bench(self, seed: int) -> EngineBench:
        """Make the engine that it sits on."""
        return EngineBench(
            seed=seed, pressure_noise_bar=self.noise_bar, tdc_error_cad=self.tdc_cad, pressure_gain_error=self.gain,
            pressure_offset_bar=self.offset_bar,
        )  # fmt: skip


NOISES = (
    Sensor(name="clean", noise_bar=0.0),
    Sensor(name="0.1 bar of noise"),
    Sensor(name="0.5 bar of noise", noise_bar=0.5),
)
ERRORS = (
    *(Sensor(name=f"TDC read {cad:g} CAD late", tdc_cad=cad) for cad in (0.1, 0.3, 0.5)),
    Sensor(name="TDC read 0.5 CAD early", tdc_cad=-0.5),
    Sensor(name="pressure 1 % high", gain=0.01),
    Sensor(name="pressure 1 % low", gain=-0.01),
    Sensor(name="pegging 0.1 bar high", offset_bar=0.1),
)


@dataclass(frozen=True, kw_only=True)
class Taught:
    """Runs of one way on one sensor, a row per seed: wall heat after every cycle, and what was said of it."""

    way: Way
    sensor: Sensor
    scale: NDArray[np.float64]
    determined: NDArray[np.bool_]
    stated: NDArray[np.float64]  # standard error at the end [-]

    @property
    def error_percent(self) -> NDArray[np.float64]:
        """How far the wall heat is off after every cycle."""
        return 100.0 * (self.scale / TRUE_SCALE - 1.0)


def run_online_calibration(
    *, seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Calibrate the wall heat of a cycle model from twice the truth while an engine seeks its best timing.

    The engine is ``puma_single`` with 0.3 °CA of scatter that nobody measures. Extremum seeking moves the timing from
    -12 °CA aTDC, every cycle is offered to `OnlineCalibration` with the timing that was asked for, and one update is
    made per cycle. Compression ratio and temperatures of the engine count as known. Three methods, and two more ways to
    use them: extremum seeking where the timing is measured, and Gauss-Newton that takes everything but the wall heat as
    exact. Each with a clean and a noisy sensor, then with errors of TDC, gain and pegging and 0.1 bar of noise.

    Parameters
    ----------
    seeds : int
        Runs of every case.
    quick : bool
        At most four seeds.
    figures : bool
        Draw figures.
    progress : callable, optional
        Called with a short text before each part.

    Returns
    -------
    StudyResult
        Rows ``way sensor median_first median_stays error_percent error_sd_percent stated_percent covered_percent
        determined_percent sure_and_wrong_percent``: cycle after which the wall heat first is, and from which it stays,
        within 3 % of the truth; mean error and its standard deviation over seeds at the end, the mean stated standard
        error; shares of runs whose 95 % interval holds the truth, that call the wall heat determined at the end, and
        that do so while it is more than 5 % off. ``summary["facts"]``: extremum seeking on a steady engine without
        noise, and what a wrong timing does. ``summary["bars"]``: what was demanded.

    Raises
    ------
    mgdd.errors.ParameterError
        Fewer than one seed.

    References
    ----------
    Tan (2018), chapter 6, and Tan et al. (2016) (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd.studies.online_calibration import run_online_calibration
    >>> result = run_online_calibration(seeds=2, quick=True, figures=False)
    >>> row = result.summary["rows"][0]
    >>> row["way"], row["sensor"], abs(row["error_percent"]) < 3.0
    ('Gauss-Newton', 'clean', True)
    """
    seeds = min(check_seeds(seeds), 4) if quick else check_seeds(seeds)
    parts = [
        (f"{way.name}, {sensor.name}", partial(teach, way, sensor, seeds))
        for sensor in (*NOISES, *ERRORS)
        for way in WAYS
    ]
    done, interrupted = run_parts(parts, progress)
    facts: list[dict[str, Any]] = []
    if not interrupted:
        found, interrupted = run_parts([("facts of a steady engine", calibration_facts)], progress)
        facts = [row for rows in found for row in rows]
    rows = [row_of(taught) for taught in done]
    summary = {
        "study": "online-calibration",
        "seeds": seeds,
        "rows": rows,
        "facts": facts,
        "bars": _bars(rows) + fact_bars(facts),
        "true_wall_heat_scale": TRUE_SCALE,
        "interrupted": interrupted,
    }
    return finish(_dataset(done), to_jsonable(summary), draw if figures else None)


def teach(way: Way, sensor: Sensor, seeds: int) -> Taught:
    """Let a seeking engine teach its model, once per seed."""
    scale, determined, stated = np.empty((seeds, CYCLES)), np.empty((seeds, CYCLES), bool), np.empty(seeds)
    for seed in range(seeds):
        bench, calibration = sensor.bench(seed), way.calibration()
        seeker = ExtremumSeeking(start=_START_CAD, lower=BOUNDS_CAD[0], upper=BOUNDS_CAD[1], gain=_GAIN)
        for k in range(CYCLES):
            point, asked = bench.point, float(seeker.ask()[0])
            cycle = bench.step(asked)
            seeker.tell(cycle["j"], misfire=cycle["misfire"])
            timing = cycle["soc_cad"] if way.timing_measured else asked
            calibration.offer(bench.pressure()[1], point, timing, misfire=cycle["misfire"])
            calibration.update()
            scale[seed, k] = calibration.parameters["wall_heat_scale"]
            determined[seed, k] = calibration.determined
        stated[seed] = calibration.standard_errors["wall_heat_scale"]
    return Taught(way=way, sensor=sensor, scale=scale, determined=determined, stated=stated)


def row_of(taught: Taught) -> dict[str, Any]:
    """Put one way on one sensor into figures."""
    error, near = taught.error_percent, _NEAR_PERCENT
    final, sure = error[:, -1], taught.determined[:, -1]
    # Cycles count from 1: after the first cycle there has been one.
    first = [1.0 + first_within(own, 0.0, near) for own in error]
    stays = [1.0 + stays_within(own, 0.0, near) for own in error]
    off = np.abs(taught.scale[:, -1] - TRUE_SCALE)
    return {
        "way": taught.way.name,
        "sensor": taught.sensor.name,
        **with_median_interval("median_first", first),
        **with_median_interval("median_stays", stays),
        "late_within_3_percent": 100.0 * float(np.mean(np.abs(error[:, SETTLED:]) <= near)),
        **with_interval("error_percent", final),
        "error_sd_percent": float(final.std(ddof=1)) if final.size > 1 else np.nan,
        "stated_percent": 100.0 * float(taught.stated.mean()) / TRUE_SCALE,
        "covered_percent": 100.0 * float(np.mean(off <= 1.96 * taught.stated)),
        "determined_percent": 100.0 * float(sure.mean()),
        "sure_and_wrong_percent": 100.0 * float(np.mean(sure & (np.abs(final) > _WRONG_PERCENT))),
    }


def _bars(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    names = {error.name for error in ERRORS}
    own = [row for row in rows if "exact" not in row["way"]]
    clean = [abs(row["error_percent"]) for row in own if row["sensor"] == "clean"]
    faulty = [row for row in own if row["sensor"] in names]
    bars = []
    if clean:
        bars.append(verdict_on("clean sensor: mean error of the wall heat [%]", clean, "at most 3", high=3.0))
    if faulty:
        # Where the data determine the wall heat, the error counts; where the verdict says that they do not, it is said.
        said = [abs(row["error_percent"]) if row["determined_percent"] >= 50.0 else 0.0 for row in faulty]
        wrong = [row["sure_and_wrong_percent"] for row in faulty]
        bars += [
            verdict_on("error of the sensor: mean error of a determined wall heat [%]", said, "at most 5", high=5.0),
            verdict_on(
                "error of the sensor: determined and more than 5 % off [% of runs]", wrong, "at most 5", high=5.0
            ),
        ]
    return bars


def _dataset(done: list[Taught]) -> xr.Dataset:
    over = ("run", "cycle")
    bands = [np.quantile(taught.scale, [0.5, 0.1, 0.9], axis=0) for taught in done]
    at_end = {
        "final_scale": ([taught.scale[:, -1] for taught in done], "wall heat at the end over the textbook law"),
        "final_error": ([taught.stated for taught in done], "its stated standard error"),
        "final_determined": (
            [taught.determined[:, -1].astype(np.int8) for taught in done], "whether it is called determined at the end",
        ),
    }  # fmt: skip
    variables: dict[str, tuple[Any, ...]] = {
        "run": ("run", [f"{taught.way.name}, {taught.sensor.name}" for taught in done], "-", "way and sensor"),
        "way": ("run", [taught.way.name for taught in done], "-", "way to calibrate"),
        "sensor": ("run", [taught.sensor.name for taught in done], "-", "pressure sensor"),
        "seed": ("seed", np.arange(done[0].scale.shape[0]), "-", "seed"),
        "cycle": ("cycle", np.arange(1, CYCLES + 1)),
        "true_scale": ((), TRUE_SCALE, "-", "wall heat of the engine over the textbook law"),
        **{name: (("run", "seed"), values, "-", text) for name, (values, text) in at_end.items()},
    }
    for at, name in enumerate(("median", "low", "high")):
        text = "wall heat over the textbook law" + ("", ", 10 % quantile", ", 90 % quantile")[at]
        variables[f"scale_{name}"] = (over, [band[at] for band in bands], "-", text)
    return labelled_dataset(variables)
