"""The verdict of a study: its answer in a sentence or two, made from the numbers of its summary."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

__all__ = ["verdict_of"]

_CYCLES = "cycles to within 1 °CA of the optimum"
_STAYS = "cycles until the estimate stays within 1.5 °CA"


class _Range(NamedTuple):
    """Smallest to largest size of a number over rows, and whose they are; the largest first where that is `wanted`."""

    what: str
    key: str
    who: tuple[str, ...]
    unit: str = ""
    wanted: str = "smallest"
    only: tuple[str, Any] | None = None
    rows: str = "rows"


class _Share(NamedTuple):
    """In how many rows something is true."""

    what: str
    key: str


_SAID: Mapping[str, tuple[_Range | _Share, ...]] = {
    "throttle-characteristics": (
        _Range("hysteresis of the holding duty", "value", ("preset",), only=("effect", "hysteresis"), wanted="largest"),
        _Range("swing of the plate under a sine of the duty", "value", ("preset", "condition"), "deg", "largest",
               ("effect", "rate dependence")),
        _Range("shift of the resting angle by air flow", "value", ("preset", "condition"), "deg", "largest",
               ("effect", "air flow")),
    ),
    "seeker-comparison": (
        _Range(_CYCLES, "cycles_to_1_cad", ("seeker",)),
        _Range("loss of efficiency at the end", "j_lost", ("seeker",), "percentage points"),
    ),
    "seekers-several-inputs": (
        _Range("loss of the objective per cycle on the maps", "j_lost", ("seeker", "map"), "points"),
        _Range("loss by the estimate after 40 cycles of the bench", "j_lost_after_40", ("seeker",), "points",
               rows="bench"),
        _Range("cycles of the bench truly above a limit", "above_percent", ("seeker",), "%", rows="bench"),
    ),
    "nox-sensors": (
        _Range("steady error", "steady_error_percent", ("sensor",), "%"),
        _Range("time to 90 % of a timing step", "timing_step_t90_s", ("sensor",), "s"),
    ),
    "sensor-delay": (
        _Range("cycles until the estimate stays at the optimum", "cycles_stays", ("case", "period_cycles")),
    ),
    "timing-tests": (
        _Range("gain", "gain_percent_points", ("test",), "percentage points", "largest"),
        _Range(_CYCLES, "cycles_to_1_cad", ("test",)),
    ),
    "guided-start-up": (
        _Range(f"feed-forward: {_CYCLES}", "cycles_to_1_cad", ("guide",)),
        _Range(f"curve: {_STAYS}", "median_stays", ("case",), rows="curve"),
    ),
    "guide-accuracy": (
        _Range("cost after a load step over that without a guide", "cost_over_unguided", ("form", "guide")),
    ),
    "guided-transients": (
        _Range("loss over that without a guide", "lost_over_unguided", ("form", "guide")),
    ),
    "ignition-delay": (
        _Range("mean loss with the assumed ignition delay", "lost_mean", ("truth", "assumed"), "%"),
        _Range("largest error of the start of injection", "soi_error_largest_cad", ("truth", "assumed"), "°CA"),
    ),
    "model-validation": (
        _Range("pressure RMSE", "rmse_percent", ("law", "stage", "file"), "% of p_max"),
        _Range("error of the best CA50", "best_ca50_error_cad", ("law", "stage", "file"), "°CA"),
    ),
    "online-calibration": (
        _Range("error of the wall heat in the end, clean sensor", "error_percent", ("way",), "%",
               only=("sensor", "clean")),
    ),
    "calibrated-guide": (_Range(_STAYS, "median_stays", ("engine", "calibrated", "start_cad")),),
    "from-design-to-map": (
        _Range("loss in the cells of the map", "lost_percent", ("way",), "%"),
        _Range("cost of the map", "cycles", ("way",), "cycles"),
    ),
    "map-that-seeks": (
        _Range("loss in the cells of the map", "lost_percent", ("engine", "guide", "visits"), "points"),
        _Range("loss of a drive per cycle", "lost_percent", ("way", "guide"), "points", rows="drives"),
    ),
    "torque-demand": (_Range("torque error, RMS", "torque_rms_nm", ("case",), "N m"),),
    "throttle-first-principle": (
        _Range("error of an identified group", "error_percent", ("case", "group"), "%"),
        _Range("fit of random steps not trained on", "random_steps_percent", ("case",), "%", "largest", rows="fits"),
    ),
    "throttle-pseudo-wiener": (
        _Range("fit of steps in free run", "fit_steps_percent", ("plant", "model", "lag_start"), "%", "largest"),
        _Range("error 50 ms ahead", "ahead_50_ms_deg", ("plant", "model", "lag_start"), "deg"),
    ),
    "throttle-tracking": (
        _Range("median settling time, 20 to 60 deg", "large_ms", ("case", "preset", "controller"), "ms"),
        _Range("median settling time, 40 to 42 deg", "small_ms", ("case", "preset", "controller"), "ms"),
    ),
    "throttle-faults": (
        _Share("faults end in their safe mode for the right reason", "kept"),
        _Share("recover", "recovered"),
        _Range("time to the safe state", "safe_ms", ("fault", "preset", "controller"), "ms", "largest"),
    ),
    "guided": (
        _Range(_CYCLES, "cycles_to_1_cad", ("case",)),
        _Range("loss at the start, times cycles", "lost_j_cycles", ("case",)),
    ),
    "measured-engine-seek": (
        _Range("final error of the timing", "error_cad", ("objective", "seeker"), "°CA"),
    ),
    "identification-benchmarks": tuple(
        _Range(f"{name}, not trained on, {metric}", "test", ("model",), unit, wanted, ("set", key))
        for key, name, metric, unit, wanted in (
            ("emps", "drive", "fit", "%", "largest"), ("cascaded_tanks", "tanks", "RMSE", "V", "smallest"),
            ("wh2009", "circuit", "RMSE", "mV", "smallest"),
        )
    ),
}  # fmt: skip


def verdict_of(study: str, summary: Mapping[str, Any]) -> tuple[str, ...]:
    """Give the verdict of a study as sentences; none for a study of somebody else without bars."""
    out = [text for said in _SAID.get(study, ()) if (text := _sentence(said, summary))]
    bars = summary.get("bars", ())
    if bars:
        missed = [f"{bar['bar']} (wanted {bar['limit']})" for bar in bars if not bar["met"]]
        ending = f"; missed: {'; '.join(missed[:3])}" + (" and others" if len(missed) > 3 else "") if missed else ""
        out.append(f"{len(bars) - len(missed)} of {len(bars)} bars are met{ending}.")
    return tuple(out)


def _sentence(said: _Range | _Share, summary: Mapping[str, Any]) -> str:
    if isinstance(said, _Share):
        rows = summary.get("rows", ())
        return f"{sum(bool(row[said.key]) for row in rows)} of {len(rows)} {said.what}." if rows else ""
    rows = [row for row in summary.get(said.rows, ()) if said.only is None or row[said.only[0]] == said.only[1]]
    known = sorted((row for row in rows if _known(row.get(said.key))), key=lambda row: abs(row[said.key]))
    if not rows:
        return ""
    what = said.what[:1].upper() + said.what[1:]
    if not known:
        return f"{what}: not known or never reached in all of {len(rows)}."
    known = known[::-1] if said.wanted == "largest" else known
    ends = " to ".join(_end(row, said, known) for row in known[:: max(1, len(known) - 1)])
    short = f"; not known or never reached in {len(rows) - len(known)} of {len(rows)}" if len(known) < len(rows) else ""
    return f"{what}: {ends}{short}."


def _end(row: Mapping[str, Any], said: _Range, rows: Sequence[Mapping[str, Any]]) -> str:
    """Give a number and whose it is; what all rows share is left out."""
    telling = [key for key in said.who if len({own.get(key) for own in rows}) > 1]
    named = [
        f"{key.removesuffix('_cad').replace('_', ' ')} {row[key]:g}" if _known(row[key]) else row[key].replace("_", " ")
        for key in telling if row[key] is not None
    ]  # fmt: skip
    size = abs(row[said.key])
    number = f"{size:.0f}" if size >= 1000.0 else f"{size:.3g}"
    who = f" ({', '.join(dict.fromkeys(named))})" if named else ""
    return f"{number} {said.unit}".strip() + who


def _known(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)
