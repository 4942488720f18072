"""Analysis of a record of cycles: every cycle, the scatter of the figures, and the averaged cycle."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.engine.dead_centre import degree_cost
from mgdd.engine.doubts import expansion_doubts, sample_doubts
from mgdd.errors import DataError
from mgdd.results.labels import ANGLE, VARIABLES, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.results.dataset import Dataset

CYCLE = "cycle"
# Net heat over the median of the record; own choices, in the spirit of a fifth and four fifths of the IMEP.
_MISFIRE, _PARTIAL, _NAMED = 0.2, 0.8, 8
_COUNTED = re.compile(r"(\d+) of \d+ cycles: (.*) \(cycle (\d+)\)", re.DOTALL)  # as the core counts warnings
_OFFSETS = ("pegging_bar", "compression_offset_bar", "pmep_bar")
_ANGLES = ("°CA aTDC", "°CA")
COLUMNS = (
    "pressure_bar",
    "temperature_k",
    "heat_release_net_j_per_cad",
    "heat_release_gross_j_per_cad",
    "heat_loss_j_per_cad",
    "heat_net_cumulative_j",
    "heat_gross_cumulative_j",
)


def is_of_cycles(trace: Any) -> bool:
    """Whether this is a Dataset whose pressure has the dimensions cycle and crank angle."""
    variables = getattr(trace, "variables", {})
    return "pressure_bar" in variables and set(variables["pressure_bar"].dims) == {CYCLE, ANGLE}


def of_cycles(
    parts: Iterable[xr.Dataset],
    cylinder: Cylinder,
    point: OperatingPoint,
    options: dict[str, Any],
    attrs: dict[str, Any],
    given: str | None,
    knock_threshold_bar: float | None,
    *,
    traces: bool = True,
) -> Dataset:
    """Analyse every cycle, and the cycle of their mean pressure; what varies has a mean, a deviation and a COV.

    A record in several parts has the same figures as in one; its traces are of one part.
    """
    # Brake work and fuel are stated as means: they judge the mean cycle, not one that misfired.
    alone = _core.engine.TraceOptions(**options | dict.fromkeys(("bmep_bar", "fuel_heat_j")))
    raws: list[dict[str, Any]] = []
    samples: dict[str, str] = {}  # of each kind what the first part shows
    numbers: list[np.ndarray] = []
    angle, total, spectrum, n = np.empty(0), np.empty((0, 0)), None, 0
    for trace in parts:
        own_angle, pressure = trace[ANGLE].values, trace["pressure_bar"].transpose(CYCLE, ANGLE).to_numpy()
        angle = angle if raws else own_angle
        if not np.array_equal(own_angle, angle):
            raise DataError(f"the chunk from cycle {n + 1} on has other crank angles than the first: read it again")
        try:
            raws.append(_core.engine.analyze_cycles(own_angle, pressure, cylinder, point, alone, traces))
        except DataError as error:
            raise error.reworded(f"from cycle {n + 1} on, {error}" if n else str(error)) from None
        for kind, text in sample_doubts(own_angle, pressure, n + 1):
            samples.setdefault(kind, text)
        numbers.append(trace[CYCLE].values if CYCLE in trace.coords else np.arange(n + 1, n + 1 + len(pressure)))
        total = np.vstack([*total, pressure]).sum(axis=0, keepdims=True)  # one row after the other, as in one part
        n += len(pressure)
        if np.isfinite(raws[-1]["scalars"]["mapo_bar"]).any():
            spectra = spectrum_of(own_angle, pressure, options, point.speed_rpm, keep=traces)
            spectrum = spectra if spectrum is None else spectra._replace(total=spectrum.total + spectra.total)
    raw = raws[0]
    motored = int(sum(sum(each["motored"]) for each in raws))
    mean = _core.engine.analyze(angle, total[0] / n, cylinder, point, _core.engine.TraceOptions(**options))
    columns: dict[str, tuple[Any, ...]] = {}
    if traces:
        columns = {ANGLE: (ANGLE, raw[ANGLE]), "volume_l": (ANGLE, raw["volume_l"])}
        columns |= {name: ((CYCLE, ANGLE), raw[name]) for name in COLUMNS}
    scalars = {name: np.concatenate([each["scalars"][name] for each in raws]) for name in raw["scalars"]}
    figures, densities = ringing(
        spectrum, scalars, options, bore_mm=cylinder.bore_mm, threshold_bar=knock_threshold_bar, spectra=traces
    )
    marks = burn_marks(scalars)
    unburnt = burn_warnings(marks)
    counted = _counted(raws, n)
    single = {**samples, **counted, **unburnt}
    judged = [*zip(mean["doubts"], mean["warnings"], strict=True), *expansion_of(mean, cylinder, point)]
    lines = [*single.values(), *(f"mean of {n} cycles: {text}" for _, text in judged)]
    kinds = [*single, *(kind for kind, _ in judged)]
    return labelled_dataset(
        {
            **columns,
            CYCLE: (CYCLE, np.concatenate(numbers)),
            **{name: (CYCLE, values) for name, values in {**scalars, **marks}.items()},
            **scatter(scalars),
            **figures,
            **densities,
            **{
                f"cycle_mean_{name}": ((), v, *_label(name, "of the mean cycle")) for name, v in mean["scalars"].items()
            },
        },
        attrs={
            **attrs,
            "smoothing": raw["smoothing"],
            "mass_source": raw["mass_source"],
            "heat_window": given or ("found" if any(any(each["window_found"]) for each in raws) else "no burn found"),
            "cycles": n,
            "knock_band_hz": (options["knock_low_hz"], options["knock_high_hz"]),
            "motored": motored,
            "warnings": "\n".join(lines),
            "doubts": "\n".join(kinds),
            "open": "" if motored == n else degree_cost(mean[ANGLE], mean["pressure_bar"], cylinder).of_fired(),
        },
    )


def expansion_of(raw: dict[str, Any], cylinder: Cylinder, point: OperatingPoint) -> list[tuple[str, str]]:
    """Doubt the expansion of one analysed cycle that burns."""
    if raw["motored"] or np.isnan(raw["scalars"]["ca50_cad"]):
        return []
    figures = raw["scalars"]
    columns = (raw[ANGLE], raw["pressure_bar"], raw["volume_l"])
    return expansion_doubts(*columns, figures["trapped_mass_g"], cylinder, point.speed_rpm)


def _counted(raws: list[dict[str, Any]], n: int) -> dict[str, str]:
    """Give the warnings of all parts by their kind, counted together: how many of n cycles, and the first of them."""
    counts: dict[str, tuple[int, str, int]] = {}
    before = 0
    for raw in raws:
        for kind, line in zip(raw["doubts"], raw["warnings"], strict=True):
            count, text, first = _COUNTED.fullmatch(line).groups()  # type: ignore[union-attr]
            earlier, text, at = counts.get(kind, (0, text, before + int(first)))
            counts[kind] = (earlier + int(count), text, at)
        before += len(raw["motored"])
    return {kind: f"{count} of {n} cycles: {text} (cycle {at})" for kind, (count, text, at) in counts.items()}


def _label(name: str, which: str) -> tuple[str, str]:
    unit, text = VARIABLES[name]
    return unit, f"{text}, {which}"


def burn_marks(scalars: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Mark cycles without a burn and those that burn too little, where most cycles of the last axis burn."""
    heat, burns = scalars["heat_net_j"], ~np.isnan(scalars["ca50_cad"])
    usual = np.median(heat, axis=-1, keepdims=True)
    share = np.divide(heat, usual, out=np.ones_like(heat), where=usual > 0.0)
    fired = burns.mean(axis=-1, keepdims=True) > 0.5
    misfire = fired & (~burns | (share < _MISFIRE))
    return {"misfire": misfire, "partial_burn": fired & (share < _PARTIAL) & ~misfire}


def burn_warnings(marks: dict[str, np.ndarray]) -> dict[str, str]:
    """Name the cycles that are marked; a line for each mark that one has."""
    lines = {}
    for name, text in (("misfire", "do not burn"), ("partial_burn", "burn less than four fifths of the median heat")):
        cycles = (np.flatnonzero(marks[name]) + 1).tolist()
        if cycles:
            shown = ", ".join(map(str, cycles[:_NAMED])) + (", ..." if len(cycles) > _NAMED else "")
            lines[name] = f"{len(cycles)} of {marks[name].size} cycles {text}: cycle {shown}"
    return lines


def scatter(scalars: dict[str, np.ndarray], dims: tuple[str, ...] = ()) -> dict[str, tuple[Any, ...]]:
    """Mean, deviation (n - 1), percentiles and, where zero is not a convention, the COV over the last axis."""
    table = np.stack(list(scalars.values()))
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # all NaN, or one cycle: the answer is NaN
        means, stds, least = np.nanmean(table, axis=-1), np.nanstd(table, axis=-1, ddof=1), np.nanmin(table, axis=-1)
        low, high = _percentiles(table, (0.05, 0.95))
        covs, lowest = 100.0 * stds / np.abs(means), 100.0 * least / means
    out: dict[str, tuple[Any, ...]] = {}
    for k, name in enumerate(scalars):
        unit, text = _label(name, "standard deviation of the cycles")
        out[f"mean_{name}"] = (dims, means[k], *_label(name, "mean of the cycles"))
        out[f"std_{name}"] = (dims, stds[k], unit.removesuffix(" aTDC"), text)
        out[f"p5_{name}"] = (dims, low[k], *_label(name, "5th percentile of the cycles"))
        out[f"p95_{name}"] = (dims, high[k], *_label(name, "95th percentile of the cycles"))
        named = VARIABLES[name].long_name
        if name.startswith("imep"):
            out[f"lnv_{name.removesuffix('_bar')}_percent"] = (
                dims,
                lowest[k],
                "%",
                f"lowest over the mean (LNV), {named}",
            )
        if name not in _OFFSETS and VARIABLES[name].units not in _ANGLES:
            out[f"cov_{name}_percent"] = (dims, covs[k], "%", f"{named}, coefficient of variation")
    return out


def _percentiles(table: np.ndarray, shares: tuple[float, ...]) -> list[np.ndarray]:
    """Give linear percentiles of the numbers of the last axis; NaN stand at its end once it is sorted."""
    ordered = np.sort(table, axis=-1)
    last = np.maximum(np.count_nonzero(~np.isnan(table), axis=-1) - 1, 0)
    out = []
    for share in shares:
        below = np.floor(share * last).astype(int)
        above = np.minimum(below + 1, last)
        a, b = (np.take_along_axis(ordered, at[..., None], axis=-1)[..., 0] for at in (below, above))
        out.append(a + (b - a) * (share * last - below))
    return out


# A peak must stand so many times above both its shoulders, and above what noise of a known level hardly reaches.
_ABOVE, _BY_NOISE = 4.0, 0.001
_SHOULDERS = ((0.75, 0.9), (1.1, 1.25))  # of its frequency
_SHOWN = (0.5, 1.25)  # spectrum beyond the ends of the band
_TAPER = 0.5  # of the window, half at each end: of the combustion 0.01 bar is left at 4 kHz
_TOGETHER = 256  # cycles, for the memory of a long record
_TANGENTIAL, _GAMMA, _J_PER_KGK = 1.841, 1.3, 287.05


class Spectrum(NamedTuple):
    """Frequencies [kHz], density summed over the cycles [bar²/kHz], length of the window [ms], and each density."""

    khz: NDArray[np.float64]
    total: NDArray[np.float64]
    span_ms: float
    density: NDArray[np.float64]


def ringing(
    spectrum: Spectrum | None,
    scalars: dict[str, NDArray[np.float64]],
    options: dict[str, Any],
    *,
    bore_mm: float,
    threshold_bar: float | None,
    spectra: bool,
) -> tuple[dict[str, tuple[Any, ...]], dict[str, tuple[Any, ...]]]:
    """Give figures of a record by name, and the spectrum of each cycle; neither where MAPO is not known."""
    mapo = scalars["mapo_bar"]
    figures: dict[str, tuple[Any, ...]] = {
        "ringing_frequency_khz": ((), math.nan),
        "tangential_mode_khz": ((), _tangential_khz(bore_mm, float(np.median(scalars["t_max_k"])))),
    }
    finite = np.isfinite(mapo)
    if threshold_bar is not None:
        share = 100.0 * float(np.mean(mapo[finite] > threshold_bar)) if finite.any() else math.nan
        figures["knock_share_percent"] = ((), share)
    if spectrum is None:
        return figures, {}
    low, high = 1e-3 * options["knock_low_hz"], 1e-3 * options["knock_high_hz"]
    khz, mean = spectrum.khz, spectrum.total / mapo.size
    figures["ringing_frequency_khz"] = ((), _peak_khz(khz, mean, (low, high), spectrum.span_ms, mapo.size))
    if not spectra:
        return figures, {}
    shown = (khz >= _SHOWN[0] * low) & (khz <= _SHOWN[1] * high)
    name = "frequency_khz"
    density = spectrum.density[:, shown]
    return figures, {name: (name, khz[shown]), "pressure_psd_bar2_per_khz": (("cycle", name), density)}


def _tangential_khz(bore_mm: float, kelvin: float) -> float:
    """First tangential mode of a cylinder of gas (Draper 1938), of the air that the ringing intensity takes."""
    return _TANGENTIAL * math.sqrt(_GAMMA * _J_PER_KGK * kelvin) / (math.pi * bore_mm)


def spectrum_of(
    angle_cad: NDArray[np.float64], bar: NDArray[np.float64], options: dict[str, Any], speed_rpm: float, *, keep: bool
) -> Spectrum:
    """Take the spectrum of each cycle in the window of knock."""
    from scipy.signal import periodogram

    low, high = options["knock_from_cad"], options["knock_to_cad"]
    inside = (angle_cad >= low - 1e-9) & (angle_cad <= high + 1e-9)
    per_ms = 6e-3 * speed_rpm / float(np.median(np.diff(angle_cad)))
    count = int(np.count_nonzero(inside))
    size = 2 ** math.ceil(math.log2(2 * count))
    total = np.zeros(size // 2 + 1)
    khz = np.arange(total.size) * (per_ms / size)
    spectra = np.empty((len(bar) if keep else 0, khz.size))
    for at in range(0, len(bar), _TOGETHER):
        window = bar[at : at + _TOGETHER, inside]
        _, density = periodogram(window, per_ms, window=("tukey", _TAPER), nfft=size, detrend="linear")
        total += density.sum(axis=0)
        if keep:
            spectra[at : at + _TOGETHER] = density
    return Spectrum(khz, total, count / per_ms, spectra)


def _peak_khz(
    khz: NDArray[np.float64], mean: NDArray[np.float64], band_khz: tuple[float, float], span_ms: float, n: int
) -> float:
    """Highest peak in the band of the mean spectrum of n cycles that stands out of both shoulders; NaN if none does."""
    from scipy.special import gammaincinv

    apart = max((band_khz[1] - band_khz[0]) * span_ms, 1.0)  # frequencies that the window resolves
    above = max(_ABOVE, gammaincinv(n, 1.0 - _BY_NOISE / apart) / gammaincinv(n, 0.5))
    peaks = 1 + np.flatnonzero((mean[1:-1] >= mean[:-2]) & (mean[1:-1] > mean[2:]))
    peaks = peaks[(khz[peaks] > band_khz[0]) & (khz[peaks] < band_khz[1])]
    for k in peaks[np.argsort(-mean[peaks])]:
        shoulders = [mean[(khz >= low * khz[k]) & (khz <= high * khz[k])] for low, high in _SHOULDERS]
        if all(side.size and mean[k] > above * np.median(side) for side in shoulders):
            left, top, right = np.log(mean[k - 1 : k + 2])
            return float(khz[k] + 0.5 * (left - right) / (left - 2.0 * top + right) * (khz[1] - khz[0]))
    return math.nan
