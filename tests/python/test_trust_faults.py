"""How many faults of records from an independent engine `trust` names, and how many sound records it doubts.

``python tests/python/test_trust_faults.py N`` prints the table of docs/validation.md.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from independent_cycle import Engine, draw, record
from mgdd.engine import Trust, trust
from mgdd.errors import DataError
from mgdd.io import pressure_trace

Array = np.ndarray
CYCLES = 30
REACHED = (0.95, 0.02)  # share of faults met, share of sound records doubted


def shifted(by: float) -> Callable[..., tuple[Array, Array]]:
    return lambda _r, angle, bar: (angle + by, bar)


def raised(by: float) -> Callable[..., tuple[Array, Array]]:
    return lambda _r, angle, bar: (angle, bar + by)


def gain(by: float) -> Callable[..., tuple[Array, Array]]:
    return lambda _r, angle, bar: (angle, bar * by)


def clipped(_random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    return angle, np.minimum(bar, 0.92 * np.median(bar.max(axis=1)))


def stuck(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    start = random.choice([random.uniform(-90.0, -50.0), random.uniform(75.0, 95.0)])
    held = (angle >= start) & (angle <= start + 10.0)
    rows = random.choice(len(bar), 3, replace=False)
    bar[np.ix_(rows, held)] = bar[rows][:, held][:, :1]
    return angle, bar


def spiked(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    places = np.flatnonzero((angle > 80.0) & (angle < 105.0))
    for row in random.choice(len(bar), 3, replace=False):
        bar[row, random.choice(places)] += 6.0
    return angle, bar


def moved(angle: Array, bar: Array, by: Array) -> Array:
    """Shift each cycle by its own angle."""
    return np.array([np.interp(angle, angle + late, row, period=720.0) for late, row in zip(by, bar, strict=True)])


def creeping(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    drift = random.choice([-1.0, 1.0]) * random.uniform(0.6, 1.5)
    return angle, moved(angle, bar, np.linspace(-0.5, 0.5, len(bar)) * drift)


def slipped(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    late = np.zeros(len(bar))
    late[random.integers(5, len(bar) - 5)] = random.choice([-1.0, 1.0]) * random.uniform(1.0, 3.0)
    return angle, moved(angle, bar, late)


def swapped(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    by = int(random.choice([180, 240, 360, 480, 540]) / (angle[1] - angle[0]))
    return angle, np.roll(bar, by, axis=1)


def settling(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    drift = random.choice([-1.0, 1.0]) * random.uniform(0.25, 0.6)
    return angle, bar + np.linspace(0.0, drift, len(bar))[:, None]


def shocked(_random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    return angle, bar - np.where((angle > 0.0) & (angle < 300.0), np.clip(angle / 30.0, 0.0, 1.0), 0.0) * 1.2


class Fault:
    """A fault, the checks that may name it, and whether it needs a fired, a motored or any record."""

    def __init__(self, spoil: Callable[..., tuple[Array, Array]], checks: str, *, needs: str = "", pairs: bool = True):
        self.spoil, self.checks, self.needs, self.pairs = spoil, checks.split(","), needs, pairs

    def met(self, seen: Trust) -> bool:
        named = [check for check in seen.checks if check.verdict in ("doubt", "fail")]
        return any(check.name in self.checks or check.name == "file" for check in named)


TDC = "top dead centre,compression,level"
FAULTS = {
    "clipped": Fault(clipped, "samples"),
    "stuck": Fault(stuck, "samples"),
    "spikes": Fault(spiked, "samples"),
    "angle creeps by 0.6 to 1.5": Fault(creeping, "crank angle"),
    "one cycle slips by 1 to 3": Fault(slipped, "crank angle"),
    "another cylinder": Fault(swapped, "file"),
    "level drifts by 0.25 to 0.6 bar": Fault(settling, "cycles"),
    "pegging -0.3 bar": Fault(raised(-0.3), "level,compression,gas exchange"),
    "pegging +0.3 bar": Fault(raised(0.3), "level,compression,gas exchange"),
    "misfires": Fault(lambda _r, angle, bar: (angle, bar), "cycles", needs="misfire"),
    "thermal shock": Fault(shocked, "expansion,gas exchange,level", needs="fired"),
    "gain 0.85, fuel and BMEP stated": Fault(gain(0.85), "work and heat,file", needs="fired"),
    "gain 1.25, fuel and BMEP stated": Fault(gain(1.25), "work and heat,file", needs="fired"),
    **{f"TDC {x:+g}, motored": Fault(shifted(x), TDC, needs="motored") for x in (-3.0, -1.0, -0.5, 0.5, 1.0, 3.0)},
    "TDC -3, fired": Fault(shifted(-3.0), TDC, needs="fired"),
}
# Nothing in the pressure alone shows these: an error of TDC of a fired record looks like another burn, and a gain below
# the spread of heat by constant gamma like other heat.
OUT_OF_REACH = {
    "TDC +1, fired": Fault(shifted(1.0), TDC, needs="fired"),
    "TDC +3, fired": Fault(shifted(3.0), TDC, needs="fired"),
    "gain 1.1, fuel and BMEP stated": Fault(gain(1.1), "work and heat,file", needs="fired"),
}


def made(random: np.random.Generator, faults: list[Fault]) -> Trust:
    engine = draw(random)
    needs = {fault.needs for fault in faults}
    motored = "motored" in needs
    step = float(random.choice([0.25, 0.5, 1.0]))
    angle, bar, fuel = record(random, engine, CYCLES, step=step, motored=motored)
    if "misfire" in needs:
        rows = random.choice(CYCLES, 2, replace=False)
        bar[rows] = record(random, engine, 2, step=step, motored=True)[1]
    gross = gross_imep_bar(engine, angle, bar)
    for fault in faults:
        angle, bar = fault.spoil(random, angle, bar.copy())
    try:
        trace = pressure_trace(angle, bar, name="bench")
    except DataError as error:
        return trust_of(error)
    trace = trace.assign_attrs(speed_rpm=engine.speed)
    if not motored and any("gain" in name for name, fault in ALL.items() if fault in faults):
        trace = trace.assign_attrs(fuel_mg=float(fuel.mean()), bmep_bar=max(0.0, gross - random.uniform(1.0, 2.2)))
    return trust(trace, engine.cylinder())


def trust_of(error: DataError) -> Trust:
    from mgdd.engine.trust import Check

    return Trust("bench", (Check("file", "fail", str(error)),))


def gross_imep_bar(engine: Engine, angle: Array, bar: Array) -> float:
    inside = (angle >= -180.0) & (angle <= 180.0)
    return float(np.trapezoid(bar.mean(axis=0)[inside], engine.volume(angle[inside])) / engine.swept)


ALL = {**FAULTS, **OUT_OF_REACH}


def counted(n: int, *, seed: int = 0) -> dict[str, tuple[int, int, Counter[str]]]:
    """Count, for every fault and for sound records, those met, all, and what else was doubted."""
    out: dict[str, tuple[int, int, Counter[str]]] = {}
    for name, fault in {"none, fired": None, "none, motored": None, **ALL}.items():
        random = np.random.default_rng([seed, len(out)])
        met, others = 0, Counter[str]()
        own = [fault] if fault else [Fault(raised(0.0), "", needs=name.split(", ")[1])]
        many = 4 * n if fault is None else n
        for _ in range(many):
            seen = made(random, own)
            met += own[0].met(seen)
            others.update(c.name for c in seen.checks if c.verdict in ("doubt", "fail") and c.name not in own[0].checks)
        out[name] = (met if fault else sum(others.values()), many, others)
    return out


def pairs(n: int, *, seed: int = 1) -> tuple[int, int, Counter[str]]:
    """Count pairs of faults of which both are named, or of which the file is refused for one."""
    random = np.random.default_rng(seed)
    both, missed = 0, Counter[str]()
    for _ in range(n):
        while True:
            names = [str(each) for each in random.choice(list(FAULTS), 2, replace=False)]
            needs = {FAULTS[each].needs for each in names} - {""}
            if len(needs) < 2 and names[0].split()[0] != names[1].split()[0]:
                break
        seen = made(random, [FAULTS[each] for each in names])
        lost = [each for each in names if not FAULTS[each].met(seen)]
        both += not lost
        missed.update(lost)
    return both, n, missed


@pytest.mark.slow
def test_faults_are_named_and_sound_records_are_not_doubted() -> None:
    found = counted(12)
    sound = [found.pop(name) for name in ("none, fired", "none, motored")]
    doubted, all_sound = (sum(each[k] for each in sound) for k in (0, 1))
    assert doubted / all_sound <= REACHED[1], sound
    reached = {name: found[name] for name in FAULTS}
    met, all_faulty = (sum(each[k] for each in reached.values()) for k in (0, 1))
    assert met / all_faulty >= REACHED[0], reached
    assert all(own[0] >= 0.75 * own[1] for own in reached.values()), reached


@pytest.mark.slow
def test_both_of_two_faults_are_named() -> None:
    both, n, missed = pairs(60)
    assert both / n >= 0.9, missed


if __name__ == "__main__":
    n = int(sys.argv[1])
    for fault, (met, many, others) in counted(n).items():
        sys.stdout.write(f"{fault:36} {met:4} of {many:4}   {dict(others)}\n")
    sys.stdout.write(f"pairs, both named {pairs(4 * n)}\n")
