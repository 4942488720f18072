"""Sweeps whose optima are known in closed form: uneven axes, another optimum, bend and limit in every cell."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mgdd.maps import CalibrationMap, read_map
from mgdd.results.labels import labelled_dataset

SPEED = np.array([900.0, 1400.0, 3000.0])
FUEL = np.array([6.0, 10.0, 14.0, 25.0, 40.0])
SOC = np.concatenate([np.arange(-24.0, -6.0, 0.5), np.arange(-6.0, 9.0, 0.4)])  # uneven
VALUES = np.arange(15.0).reshape(3, 5) + 0.25  # nothing of it is symmetric
AXES = {"speed_rpm": SPEED, "fuel_mg": FUEL}


def centre(speed: Any, fuel: Any) -> Any:
    return -2.0 - 1.5e-3 * speed - 0.12 * fuel + 2e-5 * speed * fuel


def bend(speed: Any, fuel: Any) -> Any:
    return 1e-4 * (1.0 + 2e-4 * speed + 0.02 * fuel)


def efficiency(speed: Any, fuel: Any, soc: Any) -> Any:
    return 0.5 - bend(speed, fuel) * (soc - centre(speed, fuel)) ** 2


def p_max(speed: Any, fuel: Any, soc: Any) -> Any:
    """Falls with a later combustion; linear in it, so that a crossing is exact."""
    return 55.0 + 2.0 * fuel - 1e-3 * speed - 1.6 * soc


def least_soc(speed: Any, fuel: Any, upper: float) -> Any:
    """Earliest timing that keeps p_max."""
    return (55.0 + 2.0 * fuel - 1e-3 * speed - upper) / 1.6


def sweep(soc: np.ndarray = SOC) -> xr.Dataset:
    n, m, t = SPEED[:, None, None], FUEL[:, None], soc
    dims = ("speed_rpm", "fuel_mg", "soc_cad")
    return labelled_dataset({
        "speed_rpm": ("speed_rpm", SPEED, "rpm", "engine speed"), "fuel_mg": ("fuel_mg", FUEL, "mg", "fuel"),
        "soc_cad": ("soc_cad", soc), "efficiency_gross": (dims, efficiency(n, m, t)),
        "p_max_bar": (dims, p_max(n, m, t)),
    })  # fmt: skip


def timing_table() -> CalibrationMap:
    """A map with something in every column."""
    values = centre(SPEED[:, None], FUEL)
    values[2, 4] = np.nan
    sources = np.full(values.shape, "optimised", "U12")
    sources[0, 1], sources[2, 4] = "learned", "infeasible"
    held = np.full(values.shape, "", "U12")
    held[1, 3] = "p_max_bar"
    rng = np.random.default_rng(3)
    return CalibrationMap(
        {"speed_rpm": SPEED, "fuel_mg": FUEL},
        values,
        name="soc_cad",
        labels={"fuel_mg": ("mg", "fuel, main injection")},
        cells={
            "source": sources, "active_limit": held, "support": rng.integers(0, 60, values.shape),
            "sd": rng.uniform(0.1, 0.5, values.shape), "low": values - 1.3, "high": values + 0.1 / 3.0,
        },
        provenance={"from": 'bench run 7, "second half"', "date": "2024-05-17", "remark": "größer, kälter"},
    )  # fmt: skip


def read(text: str | bytes, folder: Path, called: str = "map.txt", **options: Any) -> CalibrationMap:
    """Read a text as a file, which stays as it is."""
    file = folder / called
    raw = text.encode() if isinstance(text, str) else text
    file.write_bytes(raw)
    try:
        return read_map(file, **options)
    finally:
        assert file.read_bytes() == raw
