"""Seekers in Python: ask and tell, bad input, history, files, pickles."""

from __future__ import annotations

import copy
import inspect
import json
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd.errors import DataError, Interrupted, ParameterError, ShapeError
from mgdd.optimize import (
    ComponentLag,
    ExtremumSeeking,
    GaussianProcessSeeking,
    GoldenSection,
    GradientDescent,
    Limit,
    Seeker,
    Spsa,
)
from mgdd.results.labels import check_labels, label_of

LIMITS = [Limit("p_max_bar", 150.0, margin=1.0), Limit("rise", 4.0, method="penalty", weight=2.0, scale=1.0)]
BOX = {"bounds": (-40.0, 40.0)}
ONE = stepped(start=8.0, **BOX)
LIMITED = stepped(start=8.0, limits=LIMITS, **BOX) | stepped(start=[8.0, -6.0, 4.0], limits=LIMITS, **BOX)
MAKERS = ONE | {f"{name}, limited": make for name, make in LIMITED.items()}
MAKERS["lagged"] = lambda: ExtremumSeeking(start=8.0, **BOX, components=[ComponentLag(), ComponentLag(delay_cycles=3)])
every = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
FREE = {"failing_above_edge", "failing_below_edge"}  # infinite where nothing fails
HUGE = (1e308, -1e308, 1.001e30, np.nan, np.inf, -np.inf)


def run(seeker: Any, cycles: int) -> list[list[float]]:
    """Drive a seeker on a quadratic with ripple; returns what it applied."""
    applied = []
    for _ in range(cycles):
        x = seeker.ask()
        applied.append(x.tolist())
        x = np.clip(x, -1e6, 1e6)
        j = -0.03 * float((x - 1.0) @ (x - 1.0)) + 0.2 * np.sin(1.7 * seeker.cycle)
        parts = [j] if seeker.component_count == 1 else [0.7 * j, 0.3 * j]
        limits = {"p_max_bar": 140.0 + x[0], "rise": 2.0 - 0.1 * x[0]} if seeker.limit_names else None
        seeker.tell(parts, limits, misfire=seeker.cycle % 40 == 17)
    return applied


# --- what it accepts ----------------------------------------------------------------------------------------
def test_tell_takes_numbers_of_every_kind() -> None:
    seeker = ExtremumSeeking(start=np.float32(2.0), bounds=(np.array([-9.0]), np.inf))
    for j in (1.0, 2, np.float32(3.0), np.array(4.0), np.array([5.0]), [6.0], (7.0,)):
        seeker.ask()
        seeker.tell(j)
    assert seeker.history["objective"].values.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]


def test_limits_by_name_or_in_order() -> None:
    first, second = (ExtremumSeeking(start=8.0, limits=LIMITS) for _ in range(2))
    for k in range(30):
        first.ask()
        first.tell(float(k), [149.0 + k, 2.0])
        second.ask()
        second.tell(float(k), {"rise": 2.0, "p_max_bar": 149.0 + k})
    assert first.state == second.state


@every
def test_a_refused_value_names_the_cycle_and_changes_nothing(make: Any) -> None:
    seeker, untouched = make(), make()
    limits = [100.0, 1.0] if seeker.limit_names else None
    for one in (seeker, untouched):
        run(one, 25)
        one.ask()
    before = seeker.state
    for bad in HUGE:
        with pytest.raises(DataError, match=r"cycle 25: J = "):
            seeker.tell([bad] * seeker.component_count, limits)
        if limits:
            with pytest.raises(DataError, match=r"cycle 25: limits\[1\] = "):
                seeker.tell(1.0, [100.0, bad])
    with pytest.raises(ShapeError, match="cycle 25: J has 3 components"):
        seeker.tell([1.0, 2.0, 3.0], limits)
    with pytest.raises(ShapeError, match=r"cycle 25: limits has 3 values|limits: 'p_max_bar' is missing"):
        seeker.tell([1.0] * seeker.component_count, {"other": 1.0} if limits else [1.0, 2.0, 3.0])
    size = seeker.estimate.size
    for applied in ([0.0] * (size + 1), [np.nan] * size, [-1e31] * size):
        for misfire in (False, True):
            with pytest.raises((DataError, ShapeError), match="cycle 25: applied"):
                seeker.tell([1.0] * seeker.component_count, limits, applied=applied, misfire=misfire)
    assert seeker.state == before
    assert seeker.history.sizes["cycle"] == 25
    assert run(seeker, 40) == run(untouched, 40)
    assert seeker.state == untouched.state
    with pytest.raises(ParameterError, match="cycle 65: tell without ask"):
        seeker.tell([1.0] * seeker.component_count, limits)


@every
def test_a_misfire_is_counted_and_not_read(make: Any) -> None:
    seeker = make()
    run(seeker, 14)
    x, before = seeker.ask(), seeker.state
    seeker.tell(np.nan, misfire=True)
    assert (seeker.cycle, seeker.misfires) == (15, 1)
    assert seeker.history["misfire"].values.tolist() == [0] * 14 + [1]
    assert np.isnan(seeker.history["objective"].values[-1]).all()
    if "delay" not in str(before):  # what comes late goes on
        np.testing.assert_array_equal(seeker.ask(), x)
        counted = {name: before[name] for name in before if name.startswith("failing_")}
        assert seeker.state | counted == before | {"cycle": [15.0], "misfires": [1.0]}


@every
def test_what_is_asked_stays_finite_and_within_bounds_whatever_is_told(make: Any) -> None:
    for size in (1.0, 1e6, 9e29):
        seeker, rng = make(), np.random.default_rng(3)
        reach = np.array(seeker.settings.get("amplitude", [0.0]))
        lower, upper = map(np.array, seeker.settings["bounds"])
        for k in range(150):
            x = seeker.ask()
            assert np.all((lower <= x) & (x <= upper))
            told = size * rng.choice([-1.0, 1.0])
            seeker.tell([told] * seeker.component_count, [told, -told * (k % 2)] if seeker.limit_names else None)
            assert np.all((lower + reach <= seeker.estimate) & (seeker.estimate <= upper - reach))
        assert all(math.isfinite(value) or name in FREE for name, column in seeker.state.items() for value in column)


def numbers_of(make: Any) -> list[str]:
    """Names of the settings that are numbers, or may be."""
    seeker = make()
    takes = inspect.signature(type(seeker)).parameters
    plain = (float, int, type(None), list)
    none = {"inputs", "components", "limits", "harmonics", "guide", "limit_guides", "limit_curves"}
    return [
        name for name, value in seeker.settings.items() if name in takes and name not in none and type(value) in plain
    ]


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", ONE)
def test_each_setting_refuses_by_name_or_bears_its_value(name: str) -> None:
    """Not a number is refused by all of them; of both ends of a domain, what is not refused is asked with."""
    cls, own = type(ONE[name]()), {k: v for k, v in ONE[name]().settings.items() if v is not None}
    assert len(numbers_of(ONE[name])) > 4
    for field in numbers_of(ONE[name]):
        for value in (np.nan, -np.inf, -1e9, -1.0, 0.0, 1e300, np.inf):
            try:
                seeker = cls(**{**own, field: value})
            except (ParameterError, ShapeError, TypeError) as refusal:
                said = str(refusal)
            else:
                said = field
                assert not np.isnan(value), field
                run(seeker, 12)
                assert np.isfinite(seeker.ask()).all(), (field, value)
            assert field in said, (field, value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ExtremumSeeking(start=30.0, bounds=(None, 10.0)), r"start = 30: must lie in \[-inf, 9\]"),
        (lambda: ExtremumSeeking(start=0.0, bounds=(5.0, None)), "start = 0: must lie in"),
        (lambda: ExtremumSeeking(start=0.0, bounds=(-0.5, 0.5), amplitude=1.0), "room for the perturbation"),
        (lambda: Spsa(start=0.0, bounds=(math.nan, 1.0)), "lower = nan"),
        (lambda: Spsa(start=[0.0, 0.1], bounds={"a": (0.0, 1.0), "b": (0.0, 1.0)}), "bounds = .*a pair.*inputs="),
        (lambda: ExtremumSeeking(start=0.0, period=3), "period = 3: must be at least 4"),
        (lambda: ExtremumSeeking(start=[0, 0, 0], period=40, harmonics=[3, 4, 7]), "mix to"),
        (lambda: ExtremumSeeking(start=[0, 0]), "harmonics has 1 entry: 2 inputs need one each"),
        (lambda: ExtremumSeeking(start=0.0, form="median"), "form = .median.*batch"),
        (lambda: ExtremumSeeking(start=[0.0] * 9), "at most 8"),
        (lambda: ExtremumSeeking(start=0.0, washout_pole=1.0), "washout_pole = 1: must lie between 0 and 1"),
        (lambda: ExtremumSeeking(start=0.0, hold_cycles=-1), "hold_cycles = -1: must be >= 0"),
        (lambda: Spsa(start=0.0, gain=0.0), "gain = 0.*: must be > 0"),
        (lambda: Spsa(start=0.0, gain_exponent=0.55), "gain_exponent = 0.55: must exceed"),
        (lambda: Spsa(start=0.0, form="second_order", initial_hessian=0.0), "initial_hessian = 0: must be < 0"),
        (lambda: GoldenSection(start=0.0, bounds=(-np.inf, 1.0)), "lower = -inf: must be finite"),
        (lambda: GoldenSection(start=0.0, **BOX, samples_max=0), "samples_max = 0: must be >= 1"),
        (lambda: ComponentLag(delay_cycles=-1.0), "delay_cycles = -1"),
        (lambda: ExtremumSeeking(start=0.0, components=[]), "components is empty"),
        (
            lambda: GaussianProcessSeeking(start=0.0, **BOX, delay_cycles=2.0, components=[ComponentLag()]),
            "delay_cycles = 2: must be left out",
        ),
    ],
)
def test_settings_are_refused_by_name(make: Any, message: str) -> None:
    with pytest.raises((ParameterError, ShapeError), match=message):
        make()


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (ExtremumSeeking, "gain"),
        (Spsa, "gain"),
        (GradientDescent, "step_size"),
    ],
)
def test_a_gain_left_open_is_made_of_first_readings_and_fits_any_unit_of_j(make: Any, name: str) -> None:
    """Percent or fraction: the optimum is found, and `settings` leave the gain open again."""
    found = []
    for unit in (1.0, 0.01, 3000.0):
        seeker, noise = make(start=-12.0, bounds=(-30.0, 10.0)), np.random.default_rng(2)
        for k in range(800):
            assert (getattr(seeker, name) is None) == (k < 24)
            seeker.tell(unit * (40.0 - 0.06 * (seeker.ask()[0] + 5.5) ** 2 + 0.2 * noise.normal()))
        assert seeker.settings[name] is None
        assert getattr(make(**seeker.settings), name) is None
        found.append((seeker.estimate[0], np.squeeze(getattr(seeker, name)) * unit))
    np.testing.assert_allclose(found, [found[0]] * 3, rtol=1e-6)
    assert abs(found[0][0] + 5.5) < 1.5


def test_a_gain_above_the_bound_of_averaging_warns_with_the_bound() -> None:
    with pytest.warns(UserWarning, match=r"gain = 9 is above 3\.92\d+, the bound of averaging"):
        ExtremumSeeking(start=0.0, gain=9.0, curvature=-0.051)
    with pytest.warns(UserWarning, match=r"gain = 3 is above 1\.96"):
        ExtremumSeeking(start=0.0, gain=3.0, form="moving_average", curvature=-0.051)
    with pytest.warns(UserWarning, match=r"step_size = 45 is not below 39\.2"):
        GradientDescent(start=0.0, step_size=45.0, curvature=-0.051)
    ExtremumSeeking(start=0.0, gain=9.0)


# --- history ------------------------------------------------------------------------------------------------
@every
def test_history_holds_what_was_applied_and_told(make: Any) -> None:
    seeker = make()
    estimate = seeker.estimate
    applied = run(seeker, 50)
    history = seeker.history
    check_labels(history)
    assert history["applied"].dims == ("cycle", "input")
    np.testing.assert_array_equal(history["applied"], applied)
    np.testing.assert_array_equal(history["estimate"][0], estimate)
    assert history["misfire"].values.sum() == seeker.misfires == 1
    assert np.isnan(history["objective"]).values.tolist() == [k == 17 for k in range(50)]
    assert {label_of(history[name]).units for name in ("applied", "estimate")} == {"unit of the input"}
    seeker.clear_history()
    run(seeker, 3)
    assert seeker.history["cycle"].values.tolist() == [50, 51, 52]


# --- files and pickles --------------------------------------------------------------------------------------
@every
def test_it_goes_on_bit_for_bit_from_file_pickle_state_and_copies(make: Any, tmp_path: Path) -> None:
    seeker = make()
    run(seeker, 47)
    seeker.ask()
    seeker.save(tmp_path / "seeker.json")
    stated = make()
    stated.state = seeker.state
    others = [stated, Seeker.load(tmp_path / "seeker.json"), pickle.loads(pickle.dumps(seeker))]
    others += [copy.copy(seeker), copy.deepcopy(seeker)]
    ends, before = [(run(other, 120), other.state, other.findings) for other in others], seeker.state
    assert seeker.history.sizes["cycle"] == 47
    assert all(one.history.isel(cycle=slice(47)).identical(seeker.history) for one in others[2:])
    assert ends == [(run(seeker, 120), seeker.state, seeker.findings)] * 5
    assert before != seeker.state


@every
def test_file_is_legal_json_and_says_what_it_is(make: Any, tmp_path: Path) -> None:
    seeker = make()
    run(seeker, 30)
    seeker.save(tmp_path / "run.json")
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]

    def refuse(token: str) -> None:
        raise AssertionError(token)

    content = json.loads((tmp_path / "run.json").read_text(), parse_constant=refuse)
    assert content["kind"] == type(seeker).__name__
    assert content["mgdd_version"]
    assert set(content["settings"]) == set(seeker.settings)
    again = type(seeker).load(tmp_path / "run.json")
    again.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_text() == (tmp_path / "run.json").read_text()
    other = GradientDescent if isinstance(seeker, Spsa) else Spsa
    with pytest.raises(DataError, match=f"holds a {content['kind']}, not a {other.kind}"):
        other.load(tmp_path / "run.json")


def test_files_that_are_no_seekers_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    ExtremumSeeking(start=0.0).save(path)
    good = json.loads(path.read_text())
    for change in (
        {"format": 99},
        {"kind": "Oracle"},
        {"kind": 3},
        {"settings": {}},
        {"settings": good["settings"] | {"period": 3}},
        {"state": {}},
        {"state": good["state"] | {"phase": [77.0]}},
        {"state": good["state"] | {"estimate": "text"}},
    ):
        path.write_text(json.dumps(good | change))
        with pytest.raises(DataError, match=r"x\.json"):
            Seeker.load(path)
    for text in ("", "[]", "{}", "no json", '{"number": "abc"}'):
        path.write_text(text)
        with pytest.raises(DataError, match=r"x\.json"):
            Seeker.load(path)


@every
def test_a_state_that_is_not_its_own_is_refused_and_changes_nothing(make: Any) -> None:
    seeker = make()
    run(seeker, 25)
    before = seeker.state
    wrong = [{k: v for k, v in before.items() if k != "cycle"}, before | {"unheard_of": [1.0]}]
    wrong += [before | {"cycle": [value]} for value in (1.5, np.inf)]
    if min(before.get("first_bend", [0.0])) > 0.0:  # the first readings are done
        wrong += [before | {"first_bend": [value] * len(before["first_bend"])} for value in (0.0, -1.0, np.nan, np.inf)]
    wrong += [
        before | {name: [value]} for name in ("phase", "stage", "turn") if name in before for value in (-1.0, 1e6)
    ]
    far = [[value] * seeker.estimate.size for value in (500.0, np.nan, np.inf)]
    wrong += [before | {"estimate": value} for value in far]
    wrong += [other().state for name, other in MAKERS.items() if other().state.keys() != before.keys()]
    for state in wrong:
        with pytest.raises(ParameterError, match="state"):
            seeker.state = state
        assert seeker.state == before


# --- the loop -----------------------------------------------------------------------------------------------
def test_a_run_takes_limits_and_misfires_and_stops_cleanly() -> None:
    seeker = ExtremumSeeking(start=8.0, limits=LIMITS)

    def engine(x: Any) -> Any:
        if seeker.cycle == 60:
            raise KeyboardInterrupt
        return None if seeker.cycle % 20 == 3 else (-0.03 * x[0] ** 2, [140.0, 1.0])

    with pytest.raises(Interrupted, match="after cycle 60") as stop:
        seeker.run(engine, 500)
    history = stop.value.partial
    assert history.sizes["cycle"] == seeker.cycle == 60
    assert seeker.misfires == 3
    seeker.ask()
    seeker.tell(1.0, [140.0, 1.0])
    with pytest.raises(ParameterError, match="cycles = -1"):
        seeker.run(engine, -1)
