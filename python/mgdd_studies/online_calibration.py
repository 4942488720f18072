"""What an engine teaches its cycle model while it runs: wall heat from twice the truth, and errors of the sensor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.guide import OnlineCalibration
from mgdd.loop import VirtualEngine
from mgdd.optimize import ExtremumSeeking
from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE, minus, new_figure
from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.figures import band, legend_outside, names_of
from mgdd_studies.guide_cases import BOUNDS_CAD, PLANT, WRONG, verdict_on, verdicts
from mgdd_studies.statistics import (
    band_variables,
    first_within,
    mean_interval,
    sd_of,
    stays_within,
    with_interval,
    with_median_interval,
    with_quantiles,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_online_calibration"]

TRUE_SCALE = float(PLANT.wall_heat_scale)
# Everything but the wall heat taken as known exactly.
EXACT = {name: 0.0 for name in OnlineCalibration("puma_single").parameters if name != "wall_heat_scale"}
# The engine itself, as its virtual compression ratio and temperatures are: what is asked then is what a sensor does.
ENGINE_KNOWN = dict.fromkeys(
    ["compression_ratio_offset", "charge_temperature_offset_k", "wall_temperature_offset_k"], 0.0
)
_FACT_CAD, _TRIALS, _STEADY_CYCLES = -6.0, 200, 40
# Shift of the wall heat by a timing given 0.5 CAD late, at these timings, found by an independent program.
_SHIFTS = {-10.0: 0.053, -6.0: 0.075, 0.0: 0.114}
_SHIFT_MARGIN = 0.02


def calibration_facts() -> list[dict[str, Any]]:
    """Give rows ``fact value expected margin``: trials of extremum seeking, and the shift by a wrong timing."""
    trials, final = _seeking()
    found = [
        ("extremum seeking: trials until it stays within 2 %", trials, 137.0, 13.0),
        ("extremum seeking: wall heat in the end", final, TRUE_SCALE, 0.01),
    ]
    for soc, shift in _SHIFTS.items():
        early, late = (_told(soc, late) for late in (-0.5, 0.5))
        text = f"shift of the wall heat by 0.5 CAD of given timing, at {soc:g} CAD"
        found.append((text, 0.5 * abs(late - early), shift, _SHIFT_MARGIN))
    return [dict(zip(("fact", "value", "expected", "margin"), row, strict=True)) for row in found]


def fact_bars(facts: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Compare each fact with what was expected."""
    return [
        verdict_on(
            fact["fact"], [fact["value"]], f"{fact['expected']:g} ± {fact['margin']:g}",
            low=fact["expected"] - fact["margin"], high=fact["expected"] + fact["margin"],
        )
        for fact in facts
    ]  # fmt: skip


def _seeking() -> tuple[float, float]:
    """Count trials until the wall heat stays within 2 % of the truth, one trial per update; and where it ends."""
    bench = VirtualEngine(soc_scatter_cad=0.0)
    calibration = OnlineCalibration(
        WRONG, method="extremum_seeking", uncertainty=EXACT, window_cycles=2, soc_scatter_cad=0.0, trials_per_update=1
    )
    scale: list[float] = []
    while len(scale) < _TRIALS:
        bench.step(_FACT_CAD)
        calibration.offer(bench.pressure()[1], bench.point, _FACT_CAD)
        if calibration.update() == "updated":
            scale.append(calibration.parameters["wall_heat_scale"])
    return 1.0 + stays_within(np.array(scale), TRUE_SCALE, 0.02 * TRUE_SCALE), scale[-1]


def _told(soc_cad: float, late_cad: float) -> float:
    """Fit the wall heat alone where the given timing is wrong."""
    bench = VirtualEngine(soc_scatter_cad=0.0)
    calibration = OnlineCalibration(WRONG, uncertainty=EXACT, soc_scatter_cad=0.0)
    for _ in range(_STEADY_CYCLES):
        bench.step(soc_cad)
        calibration.offer(bench.pressure()[1], bench.point, soc_cad + late_cad)
        calibration.update()
    return calibration.parameters["wall_heat_scale"]


CYCLES, SETTLED = 150, 40
_START_CAD, _NEAR_PERCENT, _WRONG_PERCENT, _NOISE_BAR, _SCATTER_CAD = -12.0, 3.0, 5.0, 0.1, 0.3
_GAIN = 0.98  # of the seeker: time constant 40 cycles at a curvature of -0.051 points per CAD**2


@dataclass(frozen=True, kw_only=True)
class Way:
    """One way to calibrate: a method, and what it is given."""

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

    def bench(self, seed: int) -> VirtualEngine:
        """Make the engine that it sits on."""
        return VirtualEngine(
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
    """Runs of one way on one sensor, a row per seed: wall heat after every cycle, and the verdicts."""

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
    *, n_seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Calibrate the wall heat of a cycle model from twice the truth while an engine seeks its best timing.

    The engine is ``puma_single`` with 0.3 °CA of unmeasured scatter. Extremum seeking moves the timing from
    -12 °CA aTDC, every cycle is offered to `OnlineCalibration` with the timing that was asked for, and one update is
    made per cycle. Compression ratio and temperatures of the engine count as known. Three methods, and two more ways to
    use them: extremum seeking where the timing is measured, and Gauss-Newton that takes everything but the wall heat as
    exact. Each with a clean and a noisy sensor, then with errors of TDC, gain and pegging and 0.1 bar of noise.

    Parameters
    ----------
    n_seeds : int
        Runs of every case.
    quick : bool
        At most four seeds.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``way sensor median_first median_stays error_percent error_sd_percent stated_percent covered_percent
        determined_percent sure_and_wrong_percent``: cycle after which the wall heat first is, and from which it stays,
        within 3 % of the truth; mean error and its standard deviation over seeds at the end, the mean stated standard
        error; shares of runs whose 95 % interval holds the truth, that call the wall heat determined at the end, and
        that do so while it is more than 5 % off. ``summary["facts"]``: extremum seeking on a steady engine without
        noise, and what a wrong timing does. ``summary["bars"]``: what was demanded.

    References
    ----------
    Tan (2018), chapter 6, and Tan et al. (2016) (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies.online_calibration import run_online_calibration
    >>> result = run_online_calibration(n_seeds=2, quick=True, figures=False)
    >>> row = result.summary["rows"][0]
    >>> row["way"], row["sensor"], abs(row["error_percent"]) < 3.0
    ('Gauss-Newton', 'clean', True)
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=4)
    work = Parts(progress)
    done = work(
        (f"{way.name}, {sensor.name}", partial(teach, way, sensor, n_seeds))
        for sensor in (*NOISES, *ERRORS)
        for way in WAYS
    )
    found = work([("facts of a steady engine", calibration_facts)])
    facts = [row for rows in found for row in rows]
    rows = [row_of(taught) for taught in done]
    return work.finish(
        "online-calibration", _dataset(done), _draw if figures else None,
        seeds=n_seeds,
        rows=rows,
        facts=facts,
        bars=_bars(rows) + fact_bars(facts),
        true_wall_heat_scale=TRUE_SCALE,
    )  # fmt: skip


def teach(way: Way, sensor: Sensor, n_seeds: int) -> Taught:
    """Let a seeking engine teach its model, once per seed."""
    scale, determined, stated = np.empty((n_seeds, CYCLES)), np.empty((n_seeds, CYCLES), bool), np.empty(n_seeds)
    for seed in range(n_seeds):
        bench, calibration = sensor.bench(seed), way.calibration()
        seeker = ExtremumSeeking(start=_START_CAD, bounds=BOUNDS_CAD, gain=_GAIN)
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
        "error_sd_percent": sd_of(final),
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
    # Where the data determine the wall heat, the error counts; where the verdict says that they do not, it is said.
    said = [abs(row["error_percent"]) if row["determined_percent"] >= 50.0 else 0.0 for row in faulty]
    wrong = [row["sure_and_wrong_percent"] for row in faulty]
    return verdicts([
        ("clean sensor: mean error of the wall heat [%]", clean, 3.0),
        ("error of the sensor: mean error of a determined wall heat [%]", said, 5.0),
        ("error of the sensor: determined and more than 5 % off [% of runs]", wrong, 5.0),
    ])  # fmt: skip


def _dataset(done: list[Taught]) -> xr.Dataset:
    said = with_quantiles("wall heat over the textbook law")
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
        **band_variables("scale_{}", ("run", "cycle"), [taught.scale for taught in done], "-", said),
    }
    return labelled_dataset(variables)


_LOOKS = (("-", BLACK, "o"), ("--", BLUE, "s"), ("-.", ORANGE, "^"), (":", ORANGE, "v"), ("-", GREEN, "D"))
_SURE_PERCENT, _SHOWN = 50.0, 80


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    sensors = list(dict.fromkeys(names_of(dataset, "sensor")))
    noises = [name for name in sensors if "noise" in name or name == "clean"]
    errors = [name for name in sensors if name not in noises]
    out = {
        "Wall heat of the guide over cycles: median of the seeds, and the band that holds 80 % of them": _approach(
            dataset, noises
        )
    }
    if errors:
        out[
            "Error of the wall heat after 150 cycles: mean, and the range that holds 95 % of the seeds; filled where "
            "the verdict is determined in most runs"
        ] = _draw_errors(dataset, errors)
    return out


def _approach(dataset: xr.Dataset, sensors: list[str]) -> Figure:
    figure = new_figure(4.0 * len(sensors), 4.4)
    true = float(dataset["true_scale"])
    cycle = dataset["cycle"].to_numpy()
    axes = figure.subplots(1, len(sensors), sharey=True, squeeze=False)[0]
    for ax, sensor in zip(axes, sensors, strict=True):
        for way, (dash, color, _) in zip(dict.fromkeys(names_of(dataset, "way")), _LOOKS, strict=True):
            found = np.flatnonzero((dataset["sensor"] == sensor) & (dataset["way"] == way))
            if found.size:
                own = dataset.isel(run=int(found[0]))
                ends = [own[f"scale_{end}"] for end in ("low", "median", "high")]
                band(ax, cycle, *ends, dash=dash, color=color, linewidth=1.3, label=way)
        near = 0.01 * _NEAR_PERCENT * true
        ax.axhspan(true - near, true + near, color=GREY, alpha=0.25, linewidth=0.0, label="truth ± 3 %")
        ax.set_title(sensor, loc="left", fontsize="small")
        ax.set(xlim=(1, _SHOWN), ylim=(0.35, 1.05))
        ax.grid(alpha=0.3)
    figure.supxlabel("cycles since the start [-]", fontsize="medium")
    axes[0].set_ylabel("wall heat over the textbook law [-]")
    legend_outside(figure, axes[0], 3)
    return figure


def _draw_errors(dataset: xr.Dataset, sensors: list[str]) -> Figure:
    figure = new_figure(8.4, 4.8)
    ax = figure.subplots()
    true, ways = float(dataset["true_scale"]), dict.fromkeys(names_of(dataset, "way"))
    rows = np.arange(len(sensors))[::-1]
    for at, (way, (_, color, marker)) in enumerate(zip(ways, _LOOKS, strict=True)):
        for row, sensor in zip(rows, sensors, strict=True):
            found = np.flatnonzero((dataset["sensor"] == sensor) & (dataset["way"] == way))
            if not found.size:
                continue
            own = dataset.isel(run=int(found[0]))
            error = 100.0 * (own["final_scale"].to_numpy() / true - 1.0)
            sure = 100.0 * float(own["final_determined"].mean()) >= _SURE_PERCENT
            height = row + 0.3 - 0.15 * at
            ax.plot(np.quantile(error, [0.025, 0.975]), [height, height], "-", color=color, linewidth=1.2)
            ax.plot(
                mean_interval(error)[0], height, marker, color=color, markersize=5.0,
                markerfacecolor=color if sure else "white", label=way if row == rows[0] else None,
            )  # fmt: skip
    ax.axvspan(-5.0, 5.0, color=GREY, alpha=0.18, linewidth=0.0, label=minus("within 5 %"))
    ax.axvline(0.0, color=GREY, linewidth=0.8)
    ax.set_yticks(rows, [name.replace("CAD", "°CA") for name in sensors])
    ax.set_xlabel("error of the wall heat [%]")
    ax.grid(alpha=0.3, axis="x")
    legend_outside(figure, ax, 2)
    return figure
