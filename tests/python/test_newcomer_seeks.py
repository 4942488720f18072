"""Twenty searches as a newcomer writes them, at most six lines each: they run, find the best, and say what they did."""

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mgdd
from mgdd.loop import VirtualEngine, run_seeker, seek
from mgdd.optimize import GaussianProcessSeeking, Input, Seeker, Spsa

RNG = np.random.default_rng(4)


def hill(x: dict[str, float]) -> float:
    """The newcomer's engine: best at -4 and 0.15."""
    egr = x.get("egr", 0.15)
    return 56.0 - 0.03 * (x["soc_cad"] + 4.0) ** 2 - 300.0 * (egr - 0.15) ** 2 + 0.05 * RNG.standard_normal()


ONE, TWO = {"soc_cad": (-25.0, 15.0)}, {"soc_cad": (-25.0, 15.0), "egr": (0.0, 0.4)}


def own_function() -> bool:
    found = seek(hill, ONE, cycles=60)
    return abs(found.inputs["soc_cad"] + 4.0) < 1.0


def two_inputs() -> bool:
    found = seek(hill, TWO, cycles=80)
    return abs(found.inputs["soc_cad"] + 4.0) < 2.0 and abs(found.inputs["egr"] - 0.15) < 0.03


def a_plain_number() -> bool:
    return abs(seek(lambda x: -((x - 1.0) ** 2), {"x": (-5.0, 5.0)}, cycles=40).inputs["x"] - 1.0) < 0.2


def two_plain_numbers() -> bool:
    found = seek(lambda a, b: -((a - 1.0) ** 2) - (b + 2.0) ** 2, {"a": (-5.0, 5.0), "b": (-5.0, 5.0)}, cycles=60)
    return abs(found.inputs["a"] - 1.0) < 0.3 and abs(found.inputs["b"] + 2.0) < 0.3


def to_minimise() -> bool:
    return abs(seek(lambda x: (x - 1.0) ** 2, {"x": (-5.0, 5.0)}, maximize=False, cycles=40).inputs["x"] - 1.0) < 0.2


def a_bench() -> bool:
    found = seek(VirtualEngine(seed=1), {"soc_cad": (-20.0, 5.0)})
    return abs(found.inputs["soc_cad"] + 5.63) < 1.5


def a_limit() -> bool:
    bench = VirtualEngine(seed=1, limits=["p_max_bar"])
    found = seek(bench, {"soc_cad": (-20.0, 8.0)}, limits={"p_max_bar": 95.0}, start=4.0)
    return found.limits["p_max_bar"] < 97.0 and found.inputs["soc_cad"] > -4.0


def a_lower_limit() -> bool:
    timed = lambda x: (hill(x), {"ca50_cad": x["soc_cad"] + 9.0})  # noqa: E731
    found = seek(timed, ONE, limits={"ca50_cad": (8.0, 15.0)}, start=3.0, cycles=80)
    return 7.8 < found.limits["ca50_cad"] < 10.0 and "(lower limit 8)" in found.summary()


def a_seeker_by_name() -> bool:
    found = seek(VirtualEngine(seed=1), {"soc_cad": (-20.0, 5.0)}, seeker="spsa", cycles=600)
    return found.seeker.kind == "Spsa" and abs(found.inputs["soc_cad"] + 5.63) < 2.0


def a_seeker_by_class_with_settings() -> bool:
    settings = {"form": "second_order"}
    return seek(hill, ONE, seeker=Spsa, settings=settings, cycles=40).seeker.settings["form"] == "second_order"


def going_on() -> bool:
    bench = VirtualEngine(seed=1)
    first = seek(bench, {"soc_cad": (-20.0, 5.0)}, cycles=30)
    more = seek(bench, {"soc_cad": (-20.0, 5.0)}, seeker=first.seeker, cycles=20)
    return type(more) is type(first) and more.seeker.cycle == bench.cycle == 50


def going_on_tomorrow(folder: Path) -> bool:
    seek(hill, TWO, cycles=30).seeker.save(folder / "seeker.json")
    return seek(hill, seeker=Seeker.load(folder / "seeker.json"), cycles=5).seeker.cycle == 35


def what_was_measured_before() -> bool:
    pd = pytest.importorskip("pandas")
    rows = [
        {"soc_cad": a, "egr": b, "j": hill({"soc_cad": a, "egr": b})} for a in (-12, -2, 6) for b in (0.05, 0.2, 0.3)
    ]
    found = seek(hill, TWO, known=pd.DataFrame(rows), cycles=15)
    return hill(found.start) > 54.5 and abs(found.inputs["soc_cad"] + 4.0) < 2.5


def the_cycles_of_yesterday() -> bool:
    yesterday = seek(hill, TWO, cycles=40)
    return abs(seek(hill, TWO, known=yesterday.dataset, cycles=5).inputs["soc_cad"] + 4.0) < 2.5


def names_and_units() -> bool:
    found = seek(lambda x: -((x["dwell"] - 3.0) ** 2), [Input("dwell", 0.0, 8.0, unit="ms")], cycles=30)
    return "dwell" in found.summary() and "ms" in found.summary()


def a_picture() -> bool:
    found = seek(hill, TWO, cycles=20)
    return found.plot().get_ylabel().startswith("soc_cad")


def a_table() -> bool:
    pytest.importorskip("pandas")
    table = seek(hill, TWO, cycles=20).dataset["applied"].to_pandas()
    return list(table.columns) == ["soc_cad", "egr"] and len(table) == 20


def a_guide_that_is_rough() -> bool:
    guide = lambda x: -0.04 * (x["soc_cad"] + 1.0) ** 2 - 250.0 * (x["egr"] - 0.2) ** 2  # noqa: E731
    return abs(seek(hill, TWO, guide=guide, cycles=30).inputs["soc_cad"] + 4.0) < 2.0


def a_failing_corner() -> bool:
    found = seek(lambda x: None if x["soc_cad"] > 8.0 else hill(x), TWO, cycles=60)
    return abs(found.inputs["soc_cad"] + 4.0) < 2.0


def several_at_once() -> bool:
    seeker = GaussianProcessSeeking(inputs=TWO, start={"soc_cad": 8.0, "egr": 0.3})
    for _ in range(15):
        for x in seeker.ask(4):
            seeker.tell(hill(x), applied=x)
    return abs(seeker.estimate[0] + 4.0) < 2.0 and seeker.cycle == 60


def until_it_is_good_enough() -> bool:
    found = seek(hill, TWO, tolerance={"soc_cad": 1.0, "egr": 0.02}, cycles=400)
    return 40 <= found.dataset.sizes["cycle"] < 300 and abs(found.inputs["soc_cad"] + 4.0) < 2.0


def in_steps() -> bool:
    found = seek(hill, {"soc_cad": (-25.0, 15.0, 0.5), "egr": (0.0, 0.4, 0.05)}, cycles=80)
    return found.inputs["egr"] == pytest.approx(0.15) and found.inputs["soc_cad"] % 0.5 == 0.0


PROGRAMS = [
    each for each in vars().copy().values()
    if inspect.isfunction(each) and each.__module__ == __name__ and each not in (hill,)
]  # fmt: skip


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda each: each.__name__)
def test_a_newcomer_writes_a_search(program: Any, tmp_path: Path) -> None:
    assert program(tmp_path) if inspect.signature(program).parameters else program()
    lines = inspect.getsource(program).splitlines()[1:]
    assert len([line for line in lines if line.strip()]) <= 6


def test_points_that_are_asked_at_once_are_different_and_move_nothing() -> None:
    bench_limits = {"p_max_bar": 100.0}
    for limits in ({}, bench_limits):
        seeker = GaussianProcessSeeking(inputs=TWO, start={"soc_cad": 8.0, "egr": 0.3}, limits=limits)
        for cycle in range(12):
            state = seeker.state
            points = seeker.ask(3)
            assert seeker.state == state
            assert points[0] == seeker.ask()
            if cycle < 6:
                assert len({tuple(point.values()) for point in points}) == 3
            seeker.tell(
                hill(points[0]), {name: 90.0 - point["soc_cad"] for name in limits for point in points[:1]} or None
            )
    with pytest.raises(mgdd.errors.ParameterError, match="n = 0: must be a whole number"):
        seeker.ask(0)


def test_a_search_that_stops_early_is_the_beginning_of_the_whole_one() -> None:
    inputs = {"soc_cad": (-20.0, 5.0)}
    early = seek(VirtualEngine(seed=2), inputs, tolerance=1.5)
    count = early.dataset.sizes["cycle"]
    whole = seek(VirtualEngine(seed=2), inputs, cycles=count)
    assert 20 <= count < 200
    assert early.inputs == whole.inputs
    np.testing.assert_array_equal(early.dataset["j"], whole.dataset["j"])
    assert early.dataset.sizes == whole.dataset.sizes
    assert early.run.summary.keys() == whole.run.summary.keys()


@pytest.mark.parametrize("inputs", [ONE, TWO])
def test_a_lower_limit_is_the_upper_one_of_the_negated_quantity(inputs: dict[str, tuple[float, float]]) -> None:
    def quiet(x: dict[str, float]) -> float:
        return -0.03 * (x["soc_cad"] + 4.0) ** 2 - 300.0 * (x.get("egr", 0.15) - 0.15) ** 2

    start = {"soc_cad": 4.0, "egr": 0.2}
    how: dict[str, Any] = {"start": {name: start[name] for name in inputs}, "cycles": 40}
    found = seek(lambda x: (quiet(x), {"y": x["soc_cad"]}), inputs, limits={"y": (0.0, None)}, **how)
    turned = seek(lambda x: (quiet(x), {"y": -x["soc_cad"]}), inputs, limits={"y": 0.0}, **how)
    assert found.inputs == turned.inputs
    assert found.limits["y"] == -turned.limits["y"]
    assert found.to_dict()["limits"] == {"y": found.limits["y"]}
    more = seek(lambda x: (quiet(x), {"y": x["soc_cad"]}), seeker=found.seeker, cycles=5)
    assert more.seeker.cycle == 45
    below = seek(lambda x: (quiet(x), {"y": x["soc_cad"]}), inputs, limits={"y": (30.0, None)}, **how)
    said = {finding.code: finding.text for finding in below.findings}
    assert said["start_above_limit"] == "the first reading of y, 4, is below its lower limit, 30"
    assert "below its lower limit, 30" in said["limit_broken"]


def test_a_lower_limit_of_a_bench_is_kept_and_is_no_new_operating_point() -> None:
    for seeker, least in (("auto", 120.0), ("extremum_seeking", 60.0)):  # a dither that begins anew never moves
        bench = VirtualEngine(seed=4, limits=["p_max_bar"])
        found = seek(bench, {"soc_cad": (-20.0, 8.0)}, seeker=seeker, limits={"p_max_bar": (least, None)}, start=-15.0)
        assert found.limits["p_max_bar"] > least - 2.0
        assert found.inputs["soc_cad"] > -12.0


def test_there_are_twenty() -> None:
    assert len(PROGRAMS) >= 20
    assert mgdd.loop.seek is seek


def test_every_seeker_says_what_it_takes() -> None:
    for cls in (*Seeker.__subclasses__(),):
        named = inspect.signature(cls).parameters
        assert {"start", "maximize", "limits"} <= named.keys(), cls
        assert "settings" not in named


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda _: seek(hill, ONE, seeker="spas"), "did you mean 'spsa'"),
        (lambda _: seek(hill, ONE, seeker=3.0), "seeker = 3: must be auto, a name"),
        (lambda _: seek(hill, ONE, seeker="golden_section"), "needs noise_sd"),
        (lambda _: seek(hill, ONE, seeker="spsa", delay_cycles=3), "takes J of the same cycle"),
        (lambda _: seek(hill, ONE, seeker="spsa", settings={"gian": 1.0}), "did you mean 'gain'"),
        (
            lambda _: seek(hill, ONE, seeker="spsa", known={"soc_cad": [1.0], "j": [2.0]}),
            "known: goes to curve_seeking",
        ),
        (lambda _: seek(hill, ONE, known={"soc": [1.0], "j": [2.0]}), "known: has no column 'soc_cad'"),
        (lambda _: seek(hill, ONE, known={"soc_cad": [40.0], "j": [2.0]}), "soc_cad = 40: must be in"),
        (lambda s: seek(hill, {"soc_cad": (-1.0, 1.0)}, seeker=s), "the seeker given has soc_cad in"),
        (lambda s: seek(hill, seeker=s, start=3.0), "start: the seeker given has its own"),
        (lambda s: seek(hill, seeker=s, maximize=False), "maximize: the seeker given has its own"),
        (lambda s: seek(hill, seeker=s, limits={"p_max_bar": 9.0}), "limits: the seeker given has none"),
        (lambda _: run_seeker(VirtualEngine(), "spsa", 5), r"seeker = 'spsa': must be a seeker.*seek\(plant, inputs"),
        (lambda _: seek(hill), "inputs: none given"),
        (lambda _: seek(hill, ONE, limits={"y": (5.0, 2.0)}), "limits: y = .*lower < upper"),
        (lambda _: seek(hill, ONE, limits={"y": (None, None)}), "limits: y = .*one may be None"),
        (lambda _: seek(hill, TWO, tolerance={"soc_cad": 0.0, "egr": 1.0}), "tolerance = .*must be > 0, one number"),
        (lambda _: seek(lambda: 3.0, ONE), "write lambda x: ... x\\['soc_cad'\\]"),
    ],
)
def test_what_cannot_be_sought_is_refused_and_nothing_has_moved(call: Any, said: str) -> None:
    seeker = seek(hill, ONE, cycles=5).seeker
    state = seeker.state
    with pytest.raises(mgdd.errors.ParameterError, match=said):
        call(seeker)
    assert seeker.state == state
