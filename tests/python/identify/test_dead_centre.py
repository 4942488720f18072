"""Top dead centre on engines that share no code with the package, and what a degree of it costs.

``python tests/python/identify/test_dead_centre.py N`` prints the shares of docs/validation.md over N engines each.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from independent_engine import LAWS, Engine, draw, record
from mgdd.engine import OperatingPoint, analyze, check_pressure, simulate
from mgdd.identify import estimate_tdc
from mgdd.identify.engine.tdc import TdcEstimate
from mgdd.io import pressure_trace

KINDS = ("spark", "diesel")
CYCLES = (1, 5, 40)
HELD, DOUBTED, WIDEST_CAD = 0.85, 0.02, 0.35


def engine_of(kind: str, seed: int) -> tuple[Engine, np.random.Generator]:
    random = np.random.default_rng([seed, KINDS.index(kind)])
    return draw(random, kind, LAWS[seed % len(LAWS)]), random


def motored(kind: str, seed: int, *, cycles: int, step: float = 1.0, **changed: float):
    """Give engine, angle and pressure of a motored record."""
    engine, random = engine_of(kind, seed)
    engine = replace(engine, **changed)
    drawn = record(random, engine, cycles, step=step, motored=True)
    return engine, drawn.angle, drawn.bar


def said_of(engine: Engine, angle: np.ndarray, bar: np.ndarray):
    """Give a trace with what a bench states."""
    trace = pressure_trace(angle, bar if len(bar) > 1 else bar[0])
    return trace.assign_attrs(speed_rpm=engine.speed, intake_temperature_k=engine.intake_k)


def estimated(engine: Engine, angle: np.ndarray, bar: np.ndarray) -> TdcEstimate:
    return estimate_tdc([said_of(engine, angle, bar.mean(axis=0, keepdims=True))], engine.cylinder())


def doubted(engine: Engine, angle: np.ndarray, bar: np.ndarray) -> bool:
    return check_pressure(said_of(engine, angle, bar), engine.cylinder())["top dead centre"].verdict == "doubt"


def motored_shares(kind: str, seeds: range) -> dict[str, float]:
    """Count what holds over records with one to many cycles and with offsets; widths are medians."""
    held, widths, false, met = [], [], [], []
    for seed in seeds:
        engine, angle, bar = motored(kind, seed, cycles=CYCLES[seed % len(CYCLES)])
        false.append(doubted(engine, angle, bar))
        offset = (-1.0, -0.5, 0.5, 1.0)[seed % 4]
        found = estimated(engine, angle + offset, bar)
        held.append(found.low_cad <= offset <= found.high_cad)
        widths.append(found.high_cad - found.low_cad)
        met.append(doubted(engine, angle + offset, bar))
    return {"held": np.mean(held), "width": np.median(widths), "false": np.mean(false), "met": np.mean(met)}


@pytest.mark.parametrize("kind", KINDS)
def test_the_range_of_a_motored_tdc_holds_over_wall_heat_laws(kind: str) -> None:
    found = motored_shares(kind, range(4))
    assert found["held"] >= HELD, found
    assert found["width"] <= 2.0 * WIDEST_CAD, found
    assert found["false"] == 0.0
    assert found["met"] == 1.0, found


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_range_of_a_motored_tdc_holds_over_forty_engines(kind: str) -> None:
    found = motored_shares(kind, range(40))
    assert found["held"] >= HELD, found
    assert found["width"] <= 2.0 * WIDEST_CAD, found
    assert found["false"] <= DOUBTED, found
    assert found["met"] >= 0.95, found


def test_strokes_that_no_sound_engine_has_are_doubted_and_their_wall_heat_is_said() -> None:
    """Four times the wall heat; a ring gap that leaks forty times as much."""
    for changed in ({"wall_scale": 4.0}, {"gap": 40.0}):
        sound, angle, bar = motored("diesel", 1, cycles=4)
        own = {name: getattr(sound, name) * factor for name, factor in changed.items()}
        engine, angle, bar = motored("diesel", 1, cycles=4, **own)
        found = estimated(engine, angle, bar)
        assert found.wall_heat_scale > 2.5
        assert found.figures["wall_heat_scale"] == found.wall_heat_scale
        (said,) = (text for text in found.doubts() if "wall heat" in text)
        assert f"{found.wall_heat_scale:.2g} times Hohenberg's wall heat, sound engines 0.1 to 2.5" in said
        check = check_pressure(said_of(engine, angle, bar), engine.cylinder())["top dead centre"]
        assert check.verdict == "doubt"
        assert "times Hohenberg's wall heat" in check.text


def test_a_peak_far_before_tdc_is_doubted() -> None:
    """A slow engine that leaks: the angles are right, and the peak is not where a sound engine has it."""
    sound, *_ = motored("diesel", 2, cycles=1)
    engine, angle, bar = motored("diesel", 2, cycles=4, speed=500.0, gap=12.0 * sound.gap)
    found = estimated(engine, angle, bar)
    assert found.loss_angle_cad > 1.3
    assert any("before TDC, in sound engines at most 1.3" in text for text in found.doubts())


@pytest.mark.parametrize("level", [-3.0, -0.5, 5.0])
def test_a_motored_record_of_a_wrong_level_is_judged_all_the_same(level: float) -> None:
    engine, angle, bar = motored("spark", 0, cycles=2)
    found = check_pressure(said_of(engine, angle, bar + level), engine.cylinder())
    assert found.verdict in ("doubt", "fail")


@pytest.mark.parametrize("kind", KINDS)
def test_a_fired_trace_says_what_a_degree_costs(kind: str) -> None:
    """Against the work of the engine's own volumes, with the angles half a degree to each side."""
    engine, random = engine_of(kind, 0)
    drawn = record(random, engine, 3, step=0.5)
    closed = (drawn.angle >= engine.ivc) & (drawn.angle <= engine.evo)
    bar = drawn.bar.mean(axis=0)[closed]

    def imep(error: float) -> float:
        return float(np.trapezoid(bar, engine.volume(drawn.angle[closed] + error)) / engine.swept)

    cost = imep(0.5) - imep(-0.5)
    said = f"1 °CA moves the closed IMEP by {cost:.2g} bar ({100.0 * cost / imep(0.0):.2g} %)"
    trace = said_of(engine, drawn.angle, drawn.bar)
    whole = analyze(trace, engine.cylinder())
    assert whole.attrs["open"] == f"a fired trace hardly shows an error of TDC, and {said}"
    assert "TDC" not in whole.attrs["warnings"]  # nothing is wrong with it
    late = analyze(said_of(engine, drawn.angle - 2.0, drawn.bar), engine.cylinder()).attrs["open"]
    assert late.startswith("a fired trace hardly shows an error of TDC, and 1 °CA moves")
    parts = iter([trace.isel(cycle=slice(0, 1)), trace.isel(cycle=slice(1, 3))])
    assert analyze(parts, engine.cylinder(), keep_traces=False).attrs["open"] == whole.attrs["open"]
    found = estimate_tdc(
        [said_of(engine, drawn.angle, drawn.bar.mean(axis=0, keepdims=True))], engine.cylinder(), span_cad=0.5
    )
    assert found.imep_error_bar == pytest.approx(cost, rel=1e-6)
    assert found.cost == said


def test_what_is_motored_or_simulated_leaves_nothing_open() -> None:
    engine, angle, bar = motored("spark", 3, cycles=2)
    assert analyze(said_of(engine, angle, bar), engine.cylinder()).attrs["open"] == ""
    assert analyze(simulate("puma_single"), "puma_single").attrs["open"] == ""


def fired(kind: str, seed: int, span_cad: float) -> TdcEstimate:
    engine, random = engine_of(kind, seed)
    drawn = record(random, engine, 10, step=0.5)
    point = OperatingPoint(
        speed_rpm=engine.speed, fuel_mg=float(drawn.fuel_mg.mean()), intake_pressure_kpa=100.0 * engine.intake_bar,
        intake_temperature_k=engine.intake_k,
    )  # fmt: skip
    trace = pressure_trace(drawn.angle, drawn.bar.mean(axis=0))
    return estimate_tdc([trace], engine.cylinder(), point=point, span_cad=span_cad)


@pytest.mark.slow
def test_the_range_of_a_fired_tdc_holds() -> None:
    found = [fired(kind, seed, 1.5) for kind in KINDS for seed in range(6)]
    assert sum(each.low_cad <= 0.0 <= each.high_cad for each in found) >= HELD * len(found), found


if __name__ == "__main__":
    count = int(sys.argv[1])
    for kind in KINDS:
        sys.stdout.write(f"{kind}, motored: {motored_shares(kind, range(count))}\n")
        ranges = [fired(kind, seed, 2.0) for seed in range(count)]
        held = sum(each.low_cad <= 0.0 <= each.high_cad for each in ranges)
        width = np.median([each.high_cad - each.low_cad for each in ranges])
        late = np.mean([each.tdc_offset_cad for each in ranges])
        sys.stdout.write(f"{kind}, fired: held {held} of {count}, width {width:.2f}, mean error {late:+.2f}\n")
