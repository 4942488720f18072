"""How far the torque of an engine follows the pedal through its throttle, and which part of the way loses what."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.control import SlidingMode
from mgdd.loop import simulate_drive
from mgdd.plot.style import drawn
from mgdd.results.labels import label_of, labelled_dataset
from mgdd.throttle import DemandChain, SensorPair
from mgdd_studies.base import Parts, Progress, StudyResult
from mgdd_studies.statistics import rms

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_torque_demand"]

# Tip-in, tip-out, and a ramp under rising speed: (time [s], pedal [%]) and (time [s], speed [rpm]).
PEDAL = ((0.0, 10.0), (1.0, 10.0), (1.0, 60.0), (3.0, 60.0), (3.0, 15.0), (4.5, 15.0), (6.5, 80.0), (8.0, 80.0))
SPEED = ((0.0, 2000.0), (4.5, 2000.0), (7.0, 3000.0), (8.0, 3000.0))
SAMPLE_S = 1e-3
TIP_IN_S, TIP_OUT_S, HOLD_S = 1.0, 3.0, 0.2
_KEPT = ("wanted_torque_nm", "torque_nm", "wanted_pressure_kpa", "pressure_kpa", "reference_deg", "angle_deg")
_CHAIN = DemandChain()
_WEAK = _CHAIN.replace(volumetric_efficiency=0.765)
_FREE = {name: 1.1 * value for name, value in _CHAIN.to_dict().items() if name[-2:] in ("_5", "20", "45", "90")}
_CASES: dict[str, dict[str, Any]] = {
    "as believed": {},
    "no filling fed forward": {"chain": _CHAIN.replace(filling_share=0.0)},
    "no measured pressure": {"measured_pressure": False},
    "no air torque on the plate": {"air_torque": False},
    "sliding mode": {"controller": SlidingMode},
    "breathes 10 % less": {"engine": _WEAK},
    "breathes 10 % less, no measured pressure": {"engine": _WEAK, "measured_pressure": False},
    "throttle flows 10 % more": {"engine": _CHAIN.replace(**_FREE)},
    "air 20 K warmer": {"engine": _CHAIN.replace(ambient_temperature_k=318.15, manifold_temperature_k=330.0)},
}


def run_torque_demand(*, quick: bool = False, figures: bool = True, progress: Progress | None = None) -> StudyResult:
    """Drive one pedal trace through the demand chain, with parts left out and with engines that it does not know.

    A tip-in, a tip-out and a ramp under rising speed; throttle ``P1`` with its default PID, sensors without noise. Each
    case changes one thing.

    Parameters
    ----------
    quick : bool
        The first three cases only.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``case torque_rms_nm pressure_rms_kpa tip_in_t90_s overshoot_nm hold_error_nm end_error_nm plate_rms_deg``:
        torque against the one that the pedal wants at once, pressure against the wanted one behind its lag, time after
        the tip-in to 90 % of the torque's step and what it overshoots by, mean torque error over the last 0.2 s of the
        tip-in and of the run, and the plate against its reference.

    References
    ----------
    Tan (2018), figure 2-2, names the blocks of the chain; its numbers are not known.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> rows = run_study("torque-demand", quick=True, figures=False).summary["rows"]
    >>> [round(row["tip_in_t90_s"], 2) for row in rows]
    [0.17, 0.34, 0.17]
    """
    names = list(_CASES)[: 3 if quick else None]
    work = Parts(progress)
    runs = work((f"case {name}", partial(_run, name)) for name in names)
    return work.finish(
        "torque-demand", _dataset(runs, names[: len(runs)]), _draw if figures else None,
        seeds=0,
        rows=[_row(name, run) for name, run in zip(names, runs, strict=False)],
        sample_s=SAMPLE_S,
    )  # fmt: skip


def _run(name: str) -> xr.Dataset:
    time = np.arange(round(PEDAL[-1][0] / SAMPLE_S), dtype=np.float64) * SAMPLE_S
    case = dict(_CASES[name])
    chain = case.pop("chain", _CHAIN)
    controller = case.pop("controller", None)
    return simulate_drive(
        chain,
        _along(PEDAL, time),
        _along(SPEED, time),
        controller=None if controller is None else controller(),
        sensors=SensorPair(noise_v=0.0),
        sample_s=SAMPLE_S,
        **case,
    )


def _along(points: tuple[tuple[float, float], ...], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give a polyline; of two values at one time the later holds."""
    at, values = np.array(points).T
    apart = 1e-9 * np.arange(at.size)[::-1]  # so that the order of equal times is kept
    return np.asarray(np.interp(time, at - apart, values), np.float64)


def _row(name: str, run: xr.Dataset) -> dict[str, Any]:
    time, torque = run["time_s"].to_numpy(), run["torque_nm"].to_numpy()
    wanted = run["wanted_torque_nm"].to_numpy()
    held = (time >= TIP_IN_S) & (time < TIP_OUT_S)
    low, high = wanted[np.argmax(held) - 1], wanted[held][-1]
    passed = torque[held] >= low + 0.9 * (high - low)
    error = torque - wanted
    return {
        "case": name,
        "torque_rms_nm": rms(error),
        "pressure_rms_kpa": rms(run["pressure_kpa"].to_numpy() - run["wanted_pressure_kpa"].to_numpy()),
        "tip_in_t90_s": float(time[held][np.argmax(passed)] - TIP_IN_S) if passed.any() else None,
        "overshoot_nm": float(torque[held].max() - high),
        "hold_error_nm": float(error[held & (time >= TIP_OUT_S - HOLD_S)].mean()),
        "end_error_nm": float(error[time >= time[-1] - HOLD_S].mean()),
        "plate_rms_deg": rms(run["angle_deg"].to_numpy() - run["reference_deg"].to_numpy()),
    }


def _dataset(runs: list[xr.Dataset], names: list[str]) -> xr.Dataset:
    first = runs[0]
    return labelled_dataset(
        {
            "time_s": ("time_s", first["time_s"].to_numpy()),
            "case": ("case", names, "-", "case"),
            "pedal_percent": ("time_s", first["pedal_percent"].to_numpy(), "%", "pedal"),
            "speed_rpm": ("time_s", first["speed_rpm"].to_numpy(), "rpm", "engine speed"),
            **{
                name: (("case", "time_s"), [run[name].to_numpy() for run in runs], *label_of(first[name]))
                for name in _KEPT
            },
        }
    )


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    from mgdd_studies.curves import drive

    caption = "A tip-in, a tip-out and a ramp under rising speed, the engine as the chain believes: wanted and obtained"
    return {caption: drawn(drive, dataset.isel(case=0), size=(6.8, 7.6))}
