"""How many faults of records from independent engines `trust` names, and how many sound records it doubts.

The engines are of both kinds and four wall-heat laws, and share no code with the package.

``python tests/python/engine/test_trust_faults.py N`` prints the table of docs/validation.md.
"""

from __future__ import annotations

import functools
import sys
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from independent_engine import LAWS, Engine, draw, record
from mgdd.engine import PressureCheck, check_pressure
from mgdd.errors import DataError
from mgdd.io import pressure_trace

Array = np.ndarray
CYCLES = 40
KINDS = ("spark", "diesel")
LOOKS = (1, 10, 40, 100, 300)  # cycles of sound records
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


def saturated(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    """Let the amplifier end at 0.93 of the usual peak, with noise behind it."""
    most = 0.93 * np.median(bar.max(axis=1))
    return angle, np.where(bar > most, most + random.normal(0.0, 0.03, bar.shape), bar)


def held(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    """Hold one cycle for 21 samples before its peak."""
    row = int(random.integers(len(bar)))
    end = int(bar[row].argmax())
    bar[row, end - 25 : end - 4] = bar[row, end - 25]
    return angle, bar


def copied(share: float) -> Callable[..., tuple[Array, Array]]:
    def spoil(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
        count = max(round(share * len(bar)), 1)
        start = int(random.integers(0, len(bar) - count)) if count < len(bar) else 0
        bar[start : start + count] = bar[start]
        return angle, bar

    return spoil


def buffered(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    """Write a part of the stream twice, at any place of it."""
    stream, size = bar.ravel(), bar.shape[1]
    old, new = random.integers(0, 15 * size), random.integers(20 * size, 35 * size)
    stream[new : new + 2 * size] = stream[old : old + 2 * size]
    return angle, stream.reshape(bar.shape)


def frozen(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    """Hold the channel for half a cycle to one and a half from any place on."""
    stream, size = bar.ravel(), bar.shape[1]
    start = int(random.integers(5 * size, 30 * size))
    stream[start : start + int(random.uniform(0.5, 1.5) * size)] = stream[start]
    return angle, stream.reshape(bar.shape)


def without_turn(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
    stream, size = bar.ravel(), bar.shape[1]
    start = int(random.integers(10 * size, 30 * size))
    return angle, np.delete(stream, np.arange(start, start + size // 2))[: (len(bar) - 1) * size].reshape(-1, size)


def lost(count: int) -> Callable[..., tuple[Array, Array]]:
    """Lose samples at one place; the angle runs on in even steps, as a recorder's file has it."""

    def spoil(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
        start = int(random.integers(bar.size // 8, 7 * bar.size // 8))
        stream = np.delete(bar.ravel(), np.arange(start, start + count))
        return (angle[1] - angle[0]) * np.arange(stream.size), stream

    return spoil


def late(by: float) -> Callable[..., tuple[Array, Array]]:
    def spoil(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
        shift = np.zeros(len(bar))
        shift[random.integers(len(bar))] = by
        return angle, moved(angle, bar, -shift)

    return spoil


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


def shocked(drop: float) -> Callable[..., tuple[Array, Array]]:
    """Read low behind the burn: the drop comes in 20 to 40 degrees and goes in 120 to 400."""

    def spoil(random: np.random.Generator, angle: Array, bar: Array) -> tuple[Array, Array]:
        behind = np.clip(angle, 0.0, None)
        low = np.clip(behind / random.uniform(20.0, 40.0), 0.0, 1.0) * np.exp(-behind / random.uniform(120.0, 400.0))
        return angle, bar - drop * low

    return spoil


class Fault:
    """A fault, the checks that may name it, and whether it needs a fired, a motored or any record."""

    def __init__(
        self,
        spoil: Callable[..., tuple[Array, Array]],
        checks: str,
        *,
        needs: str = "",
        pairs: bool = True,
        says: str = "",
    ):
        self.spoil, self.checks, self.needs, self.pairs, self.says = spoil, checks.split(","), needs, pairs, says

    def met(self, seen: PressureCheck) -> bool:
        if self.says:  # a cycle cut off at the end is a doubt of the file as well
            return self.says in seen["file"].text or seen.analysis is None
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
    "noisy saturation at 0.93": Fault(saturated, "samples"),
    "21 samples held before a peak": Fault(held, "samples"),
    "4 cycles copied": Fault(copied(0.1), "samples"),
    "half copied": Fault(copied(0.5), "samples"),
    "all copied": Fault(copied(1.0), "samples"),
    "a buffer written twice": Fault(buffered, "samples"),
    "the channel freezes": Fault(frozen, "samples,file"),
    "a turn is lost": Fault(without_turn, "crank angle", pairs=False),
    "4 samples lost": Fault(lost(4), "file,crank angle", pairs=False, says="are missing"),
    "one cycle +2": Fault(late(2.0), "crank angle"),
    "misfires": Fault(lambda _r, angle, bar: (angle, bar), "cycles", needs="misfire"),
    "gain 0.85, fuel and BMEP stated": Fault(gain(0.85), "work and heat,file", needs="fired"),
    **{f"TDC {x:+g}, motored": Fault(shifted(x), TDC, needs="motored") for x in (-3.0, -1.0, -0.5, 0.5, 1.0, 3.0)},
}
# Nothing in the pressure alone shows these: an error of TDC of a fired record looks like another burn, and a gain below
# the spread of heat by constant gamma like other heat.
OUT_OF_REACH = {
    "TDC -3, fired": Fault(shifted(-3.0), f"{TDC},expansion", needs="fired"),
    "gain 1.25, fuel and BMEP stated": Fault(gain(1.25), "work and heat,file", needs="fired"),
    "thermal shock -1": Fault(shocked(1.0), "expansion,gas exchange,level", needs="fired"),
    "thermal shock -0.5": Fault(shocked(0.5), "expansion,gas exchange,level", needs="fired"),
    "pegging -0.1": Fault(raised(-0.1), "level,compression,gas exchange,expansion"),
    "pegging +0.1": Fault(raised(0.1), "level,compression,gas exchange,expansion"),
    "1 sample lost": Fault(lost(1), "file,crank angle", pairs=False, says="are missing"),
    "TDC +1, fired": Fault(shifted(1.0), TDC, needs="fired"),
    "TDC +3, fired": Fault(shifted(3.0), TDC, needs="fired"),
    "gain 1.1, fuel and BMEP stated": Fault(gain(1.1), "work and heat,file", needs="fired"),
}


@functools.lru_cache(maxsize=64)
def drawn(seed: tuple[int, ...], number: int, cycles: int, kind: str, *, motored: bool = False):
    """Draw an engine and its record; both are read only, for they are drawn once."""
    random = np.random.default_rng(seed)
    engine = draw(random, kind, LAWS[number % 4])
    step, noise = float(random.choice([0.2, 0.5, 1.0])), float(random.choice([0.02, 0.03, 0.1]))
    return engine, step, record(random, engine, cycles, step=step, noise_bar=noise, motored=motored)


def made(
    random: np.random.Generator, faults: list[Fault], number: int, kind: str, seed: tuple[int, ...]
) -> PressureCheck:
    needs = {fault.needs for fault in faults}
    motored = "motored" in needs
    engine, step, whole = drawn(seed, number, CYCLES, kind, motored=motored)
    angle, bar, fuel = whole.angle, whole.bar.copy(), whole.fuel_mg
    if "misfire" in needs:
        rows = random.choice(CYCLES, 2, replace=False)
        bar[rows] = record(random, engine, 2, step=step, motored=True).bar
    gross = gross_imep_bar(engine, angle, bar)
    for fault in faults:
        angle, bar = fault.spoil(random, angle, bar.copy())
    try:
        runs_on = {"firing_tdc_deg": 360.0} if bar.ndim == 1 else {}
        trace = pressure_trace(angle, bar, name="bench", **runs_on)
    except DataError as error:
        return trust_of(error)
    trace = trace.assign_attrs(speed_rpm=engine.speed)
    if not motored and any("gain" in name for name, fault in ALL.items() if fault in faults):
        trace = trace.assign_attrs(fuel_mg=float(fuel.mean()), bmep_bar=max(0.0, gross - random.uniform(1.0, 2.2)))
    return check_pressure(trace, engine.cylinder())


def trust_of(error: DataError) -> PressureCheck:
    from mgdd.engine.pressure_check import Check

    return PressureCheck("bench", (Check("file", "fail", str(error)),))


def gross_imep_bar(engine: Engine, angle: Array, bar: Array) -> float:
    inside = (angle >= -180.0) & (angle <= 180.0)
    return float(np.trapezoid(bar.mean(axis=0)[inside], engine.volume(angle[inside])) / engine.swept)


ALL = {**FAULTS, **OUT_OF_REACH}


def doubted(seen: PressureCheck) -> list[str]:
    return [check.name for check in seen.checks if check.verdict in ("doubt", "fail")]


def sound(n: int, kind: str, looks: tuple[int, ...] = LOOKS, *, seed: int = 7) -> dict[int, Counter[str]]:
    """Count the doubts of n sound engines by the number of cycles that are looked at; "any" are engines."""
    out = {cycles: Counter[str]() for cycles in looks}
    for number in range(n):
        engine, _, whole = drawn((seed, number, kind == "spark"), number, max(looks), kind)
        for cycles in looks:
            bar = whole.bar[:cycles] if cycles > 1 else whole.bar[0]
            trace = pressure_trace(whole.angle, bar).assign_attrs(speed_rpm=engine.speed)
            names = doubted(check_pressure(trace, engine.cylinder()))
            out[cycles].update([*names, *(["any"] if names else [])])
    return out


def counted(
    n: int, kind: str, names: list[str], *, seed: int = 0, engines: int | None = None
) -> dict[str, tuple[int, Counter[str]]]:
    """Count for every fault those met of n, and what else was doubted; faults share so many engines, if given."""
    out: dict[str, tuple[int, Counter[str]]] = {}
    for name in names:
        fault, met, others = ALL[name], 0, Counter[str]()
        for number in range(n):
            place = (seed, number, list(ALL).index(name), kind == "spark")
            shared = (number + n * place[2]) % engines if engines else number
            of_engine = (seed, shared, kind == "spark") if engines else place
            seen = made(np.random.default_rng(place), [fault], shared, kind, of_engine)
            met += fault.met(seen)
            others.update(each for each in doubted(seen) if each not in fault.checks)
        out[name] = (met, others)
    return out


def pairs(n: int, *, seed: int = 1, engines: int | None = None) -> tuple[int, int, Counter[str]]:
    """Count pairs of faults of which both are named, or of which the file is refused for one."""
    random = np.random.default_rng(seed)
    both, missed = 0, Counter[str]()
    for _ in range(n):
        while True:
            names = [str(each) for each in random.choice([n for n in FAULTS if FAULTS[n].pairs], 2, replace=False)]
            needs = {FAULTS[each].needs for each in names} - {""}
            if len(needs) < 2 and names[0].split()[0] != names[1].split()[0]:
                break
        number, kind = int(random.integers(engines or n)), str(random.choice(KINDS))
        seen = made(random, [FAULTS[each] for each in names], number, kind, (seed, number, kind == "spark"))
        lost = [each for each in names if not FAULTS[each].met(seen)]
        both += not lost
        missed.update(lost)
    return both, n, missed


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_sound_records_are_not_doubted(kind: str) -> None:
    found = sound(12, kind, (1, 40, 300))
    assert sum(each["any"] for each in found.values()) <= REACHED[1] * 36, found


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_faults_are_named(kind: str) -> None:
    found = counted(4, kind, list(FAULTS), seed=3, engines=12)
    assert sum(met for met, _ in found.values()) >= REACHED[0] * 4 * len(found), found
    assert all(met >= 2 for met, _ in found.values()), found


@pytest.mark.slow
def test_both_of_two_faults_are_named() -> None:
    both, n, missed = pairs(40, engines=8)
    assert both / n >= 0.85, missed


@pytest.mark.parametrize("kind", KINDS)
def test_a_slice_of_them(kind: str) -> None:
    assert sound(1, kind, (1, 40))[40]["any"] == 0
    names = ["noisy saturation at 0.93", "4 cycles copied", "the channel freezes", "a turn is lost", "4 samples lost"]
    found = counted(1, kind, names)
    assert all(met for met, _ in found.values()), found


if __name__ == "__main__":
    n = int(sys.argv[1])
    for kind in KINDS:
        for cycles, names in sound(n, kind).items():
            sys.stdout.write(f"{kind:7} sound, {cycles:3} cycles {names['any']:4} of {n:4}   {dict(names)}\n")
            sys.stdout.flush()
        for fault in ALL:
            met, others = counted(n, kind, [fault])[fault]
            sys.stdout.write(f"{kind:7} {fault:36} {met:4} of {n:4}   {dict(others)}\n")
            sys.stdout.flush()
    sys.stdout.write(f"pairs, both named {pairs(4 * n)}\n")
