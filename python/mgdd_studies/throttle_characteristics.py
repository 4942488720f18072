"""Why a throttle needs an adaptive controller: hysteresis of the holding duty, rate dependence, and air flow."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import presets
from mgdd.plot.style import drawn
from mgdd.results.labels import labelled_dataset
from mgdd.throttle import Throttle, characteristics, simulate_throttle
from mgdd_studies.base import Parts, Progress, StudyResult

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_throttle_characteristics"]

FREQUENCIES_HZ = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
OFFSET, AMPLITUDE = 0.15, 0.18
AIR_NM = (0.0, -0.1, -0.2, -0.3, -0.4)
AIR_ANGLE_DEG, AIR_FROM_S, AIR_LENGTH_S = 45.0, 0.5, 3.0
RAMP_PER_S, WIDTH_AT_DEG = 0.005, 45.0
_PHASES = 400
# How the plate came to rest decides how much of the friction band is left to a closing torque.
_ARRIVALS = {"opening": "duty_rising", "unloaded": "duty_spring", "closing": "duty_falling"}


def run_throttle_characteristics(
    *, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Show three habits of a throttle that a fixed controller cannot know.

    Hysteresis: the duty of a slow ramp differs between opening and closing by twice the friction. Rate dependence: the
    swing under ``0.15 + 0.18 sin(2 pi f t)`` from limp-home shrinks with the frequency. Air flow: at constant duty a
    closing torque moves the plate, and how far depends on how the plate came to rest.

    Parameters
    ----------
    quick : bool
        Preset P1 only.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``effect preset condition value unit closed_form``; ``closed_form`` is None where there is none.

    References
    ----------
    Tan (2018), section 2.2 and figures 2-4 and 2-5, which show both effects of a measured throttle; the numbers are
    those of the presets of this package.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> rows = run_study("throttle-characteristics", quick=True, figures=False).summary["rows"]
    >>> [round(row["value"], 1) for row in rows if row["effect"] == "rate dependence"]
    [82.2, 82.3, 62.0, 33.0, 16.2, 5.8, 2.4]
    """
    names = presets.available("throttle")[: 1 if quick else None]
    work = Parts(progress)
    done = work((f"throttle {name}", partial(_one, name)) for name in names)
    dataset = _dataset([one for _, one in done], [str(name) for name in names[: len(done)]])
    return work.finish(
        "throttle-characteristics", dataset, _draw if figures else None,
        seeds=0,
        rows=[row for rows, _ in done for row in rows],
        ramp_per_s=RAMP_PER_S,
        offset=OFFSET,
        amplitude=AMPLITUDE,
        air_angle_deg=AIR_ANGLE_DEG,
    )  # fmt: skip


def _one(name: str) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Give rows and curves of one preset."""
    throttle = presets.load(name).throttle
    ramp, width = _ramp(throttle)
    expected = 2.0 * float(characteristics(throttle)["coulomb"])
    rows = [_row("hysteresis", name, f"width at {WIDTH_AT_DEG:g} deg", width, "-", expected)]
    loops = []
    for frequency in FREQUENCIES_HZ:
        loop = _loop(throttle, frequency)
        loops.append(loop)
        rows.append(_row("rate dependence", name, f"span at {frequency:g} Hz", float(np.ptp(loop[1])), "deg"))
    air = {arrival: _air(throttle, column) for arrival, column in _ARRIVALS.items()}
    onset = round(AIR_FROM_S / 1e-3)
    for arrival, runs in air.items():
        for torque, angle in zip(AIR_NM, runs, strict=True):
            condition = f"{torque:g} N m, at rest after {arrival}"
            rows.append(_row("air flow", name, condition, float(angle[-1] - angle[onset]), "deg"))
    return rows, {"ramp": ramp, "loops": np.array(loops), "air": np.array(list(air.values()))}


def _row(
    effect: str, preset: str, condition: str, value: float, unit: str, closed_form: float | None = None
) -> dict[str, Any]:
    names = ("effect", "preset", "condition", "value", "unit", "closed_form")
    return dict(zip(names, (effect, preset, condition, value, unit, closed_form), strict=True))


def _ramp(throttle: Throttle) -> tuple[xr.Dataset, float]:
    """Ramp the duty up and down slowly; give the run and the duty between both passages of one angle."""
    top = float(characteristics(throttle, [throttle.open_deg])["duty_breakaway_up"][0]) + 0.05
    bottom = float(characteristics(throttle, [throttle.closed_deg])["duty_breakaway_down"][0]) - 0.05
    sample = 0.01
    steps = [round(abs(way) / RAMP_PER_S / sample) for way in (top, top - bottom, bottom)]
    duty = np.concatenate(
        [
            np.linspace(0.0, top, steps[0], endpoint=False),
            np.linspace(top, bottom, steps[1], endpoint=False),
            np.linspace(bottom, 0.0, steps[2] + 1),
        ]
    )
    run = simulate_throttle(throttle, duty, sample_s=sample)
    angle = run["angle_deg"].to_numpy()
    rising = int(np.argmax(angle >= WIDTH_AT_DEG))
    peak = int(np.argmax(duty))
    falling = peak + int(np.argmax(angle[peak:] <= WIDTH_AT_DEG))
    return run, float(duty[rising] - duty[falling])


def _loop(throttle: Throttle, frequency_hz: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give duty and angle over the last period, from 3 s or 3 periods, whichever is longer."""
    periods = max(3, math.ceil(3.0 * frequency_hz))
    time = np.arange(round(periods / frequency_hz / 1e-3) + 1) * 1e-3
    duty = OFFSET + AMPLITUDE * np.sin(2.0 * np.pi * frequency_hz * time)
    run = simulate_throttle(throttle, duty, time_s=time)
    at = (periods - 1 + np.linspace(0.0, 1.0, _PHASES + 1)) / frequency_hz
    return np.interp(at, time, duty), np.interp(at, time, run["angle_deg"].to_numpy())


def _air(throttle: Throttle, column: str) -> list[NDArray[np.float64]]:
    """Hold a constant duty at one angle, let air flow from a time on, and give the angle for each torque."""
    duty = float(characteristics(throttle, [AIR_ANGLE_DEG])[column][0])
    time = np.arange(round(AIR_LENGTH_S / 1e-3) + 1) * 1e-3
    flows = time >= AIR_FROM_S
    return [
        simulate_throttle(
            throttle,
            np.full(time.size, duty),
            time_s=time,
            start_deg=AIR_ANGLE_DEG,
            airflow_torque_nm=np.where(flows, torque, 0.0),
        )["angle_deg"].to_numpy()
        for torque in AIR_NM
    ]


def _dataset(done: list[dict[str, Any]], names: list[str]) -> xr.Dataset:
    time = np.arange(done[0]["air"].shape[-1]) * 1e-3
    ramp = done[0]["ramp"]
    return labelled_dataset(
        {
            "preset": ("preset", names, "-", "preset"),
            "frequency_hz": ("frequency_hz", list(FREQUENCIES_HZ), "Hz", "frequency of the duty"),
            "phase": ("phase", np.linspace(0.0, 1.0, _PHASES + 1), "-", "part of the last period"),
            "loop_duty": (("frequency_hz", "phase"), done[0]["loops"][:, 0], "-", "duty"),
            "loop_angle_deg": (
                ("preset", "frequency_hz", "phase"), [one["loops"][:, 1] for one in done], "deg", "plate angle",
            ),
            "arrival": ("arrival", list(_ARRIVALS), "-", "how the plate came to rest"),
            "airflow_torque_nm": ("airflow_torque_nm", list(AIR_NM)),
            "time_s": ("time_s", time),
            "air_angle_deg": (
                ("preset", "arrival", "airflow_torque_nm", "time_s"),
                [one["air"] for one in done], "deg", "plate angle",
            ),
            "ramp_time_s": ("ramp_time_s", ramp["time_s"].to_numpy(), "s", "time of the slow ramp"),
            "ramp_duty": ("ramp_time_s", ramp["duty"].to_numpy(), "-", f"duty of the slow ramp, {names[0]}"),
            "ramp_angle_deg": ("ramp_time_s", ramp["angle_deg"].to_numpy(), "deg", f"plate angle, {names[0]}"),
        },
        attrs={"air_from_s": AIR_FROM_S},
    )  # fmt: skip


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    from mgdd import plot
    from mgdd_studies.throttle_habits import air_flow, rate_dependence

    size = (6.8, 4.2)
    ramp = labelled_dataset(
        {
            "time_s": ("time_s", dataset["ramp_time_s"].to_numpy()),
            "duty": ("time_s", dataset["ramp_duty"].to_numpy()),
            "angle_deg": ("time_s", dataset["ramp_angle_deg"].to_numpy()),
        }
    )
    first = str(dataset["preset"].to_numpy()[0])
    rest = presets.load(first).throttle.limp_home_deg
    held = drawn(plot.holding_duty, ramp, size=size, limp_home_deg=rest)
    out = {f"Duty of a slow ramp over the angle, {first}: opening and closing differ by twice the friction": held}
    for name in dataset["preset"].to_numpy():
        own = dataset.sel(preset=name)
        out |= {
            f"Rate dependence of {name}: the loop of angle over duty shrinks with the frequency": (
                drawn(rate_dependence, own, size=size)
            ),
            f"Air flow moves the plate of {name} at constant duty, at rest after closing": (
                drawn(air_flow, own.sel(arrival="closing"), size=size)
            ),
        }
    return out
