"""Records of a known engine under random steps: what a fit to measured records can be tried on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import ParameterError
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

_BOX = {"soi_cad": (-8.0, 10.0), "doi_main_ms": (0.25, 0.5), "doi_h2_ms": (2.5, 4.0), "p2m_us": (700.0, 1400.0)}
_LABELS = {
    "soi_cad": ("°CA aTDC", "start of injection"),
    "doi_main_ms": ("ms", "duration of main injection"),
    "doi_h2_ms": ("ms", "duration of hydrogen injection"),
    "p2m_us": ("µs", "pilot-to-main gap"),
    "imep_bar": ("bar", "IMEP"),
    "mfb50_cad": ("°CA aTDC", "MFB50, angle of 50 % burned"),
    "mprr": ("bar/°CA", "maximum pressure rise rate"),
    "nox_ppm": ("ppm", "NOx at the sensor"),
}
_NOISE = {"imep_bar": 0.1, "mfb50_cad": 0.8, "mprr": 0.6, "nox_ppm": 8.0}
_SHARED = 0.6  # correlation of the noise of two signals
_LAG, _DELAY, _TAU = 1, 3, 6.0


def random_step_records(cycles: int = 4000, *, seed: int = 0, noise: float = 1.0) -> xr.Dataset:
    """Make records of a known quadratic engine whose injection is stepped at random."""
    if cycles < 10:
        raise ParameterError.of("cycles", cycles, ">= 10")
    if not 0.0 <= noise < np.inf:
        raise ParameterError.of("noise", noise, "finite and >= 0")
    generator = np.random.default_rng(seed)
    holds = generator.integers(1, 31, size=cycles)
    which = np.repeat(np.arange(cycles), holds)[:cycles]
    inputs = {name: generator.uniform(low, high, size=cycles)[which] for name, (low, high) in _BOX.items()}
    independent, shared = generator.standard_normal((cycles, len(_NOISE))), generator.standard_normal((cycles, 1))
    scatter = noise * (np.sqrt(1.0 - _SHARED) * independent + np.sqrt(_SHARED) * shared)
    signals = _law(inputs, cycles)
    for column, (name, sd) in enumerate(_NOISE.items()):
        signals[name] = signals[name] + sd * scatter[:, column]
    variables: dict[str, tuple[object, ...]] = {"cycle": ("cycle", np.arange(cycles), "-", "engine cycle")}
    for name, values in {**inputs, **signals}.items():
        variables[name] = ("cycle", values, *_LABELS[name])
    return labelled_dataset(variables, attrs={"title": "records of a known quadratic engine", "seed": seed})


def _law(inputs: dict[str, np.ndarray], cycles: int) -> dict[str, np.ndarray]:
    rows = np.maximum(np.arange(cycles) - _LAG, 0)
    soi, doi, hydrogen, gap = (inputs[name] for name in _BOX)
    d, h, g = (doi - 0.37) / 0.1, (hydrogen - 3.2) / 0.4, (gap - 1000.0) / 200.0
    fast = {
        "imep_bar": 7.0 + 0.5 * d + 0.4 * h - 0.005 * (soi + 4.0) ** 2,
        "mfb50_cad": 10.0 + soi - 0.4 * h + 0.02 * soi**2,
        "mprr": 4.5 - 0.2 * soi + 0.3 * h * d + 0.2 * g,
    }
    static = 650.0 - 45.0 * soi + 1.5 * soi**2 + 60.0 * d + 40.0 * h
    nox, decay = np.empty(cycles), np.exp(-1.0 / _TAU)
    reading = static[0]
    for k in range(cycles):
        reading = decay * reading + (1.0 - decay) * static[max(k - _DELAY, 0)]
        nox[k] = reading
    return {**{name: values[rows] for name, values in fast.items()}, "nox_ppm": nox}
