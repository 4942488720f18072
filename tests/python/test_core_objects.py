"""Every public class as an object: pickles and copies by each protocol or says why not; one never made is refused."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd.errors import Error
from mgdd.guide import Curve
from mgdd.loop import VirtualEngine, VirtualThrottle, monte_carlo
from mgdd.optimize import GaussianProcessSeeking, Input, Limit, Spsa
from mgdd.rig import GatedThrottle
from public_objects import bound_classes, public_objects, saved_state

REFUSED = (TypeError, ValueError, AttributeError, pickle.PicklingError)


def attempt(call: Callable[[], Any]) -> Any:
    """Give what a call gives, or the error by which it says why not."""
    try:
        return call()
    except REFUSED as error:
        return error


def same(one: Any, other: Any) -> bool:
    """Whether two objects are equal, by `==` where their class has one, else by their saved state."""
    if isinstance(one, xr.Dataset):
        return one.identical(other)
    if type(one).__eq__ is not object.__eq__:
        return bool(np.all(one == other))
    if hasattr(type(one), "state"):
        return bool(saved_state(one) == saved_state(other))
    return True


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_pickles_by_every_protocol_or_says_why_not(protocol: int) -> None:
    through = 0
    for name, thing in public_objects().items():
        again = attempt(lambda thing=thing: pickle.loads(pickle.dumps(thing, protocol)))
        if isinstance(again, REFUSED):
            assert len(str(again)) > 10, name
            continue
        assert type(again) is type(thing), name
        assert same(thing, again), name
        through += 1
    assert through > 60


def test_reduces_and_copies_or_says_why_not() -> None:
    for name, thing in public_objects().items():
        for way in (type(thing).__reduce__, lambda x: x.__reduce_ex__(0), copy.copy, copy.deepcopy):
            again = attempt(lambda thing=thing, way=way: way(thing))
            if isinstance(again, REFUSED):
                assert len(str(again)) > 10, name
            elif type(again) is type(thing):
                assert same(thing, again), name


def test_what_each_protocol_can_do_is_the_same() -> None:
    for name, thing in public_objects().items():
        able = []
        for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
            try:
                pickle.dumps(thing, protocol)
            except REFUSED:
                continue
            able.append(protocol)
        # Slots of Python itself need protocol 2.
        assert able in ([], list(range(pickle.HIGHEST_PROTOCOL + 1)), list(range(2, pickle.HIGHEST_PROTOCOL + 1))), name
        assert able != list(range(2, pickle.HIGHEST_PROTOCOL + 1)) or hasattr(type(thing), "__slots__"), name


def test_every_number_of_a_setting_is_refused_by_its_name() -> None:
    """Of every class of the core whose settings make it again."""
    refused = 0
    for cls in bound_classes().values():
        thing = next((each for each in public_objects().values() if type(each) is cls), None)
        settings = getattr(thing, "settings", None) or attempt(lambda thing=thing: thing.to_dict())
        if not isinstance(settings, dict) or isinstance(attempt(lambda s=settings, c=cls: c(**s)), REFUSED):
            continue
        assert not hasattr(cls, "fields") or set(cls.fields()) == set(settings)
        for name in (name for name, value in settings.items() if type(value) in (int, float)):
            with pytest.raises(Error) as caught:
                cls(**{**settings, name: float("nan")})
            assert caught.value.bound
            assert caught.value.field.endswith(name) or cls is Input, (cls, name)  # which names both of its bounds
            refused += 1
    assert refused > 200


@pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x, 0))])
def test_a_throttle_goes_on_bit_for_bit_in_a_copy(way: Any) -> None:
    plain = VirtualThrottle(inputs=("duty", "bridge_open"), start_deg=20.0, step_s=5e-5, seed=3)
    plain.apply({"duty": 0.4, "bridge_open": 0.0})
    plain.measure()
    gated = GatedThrottle(VirtualThrottle(inputs=("duty", "bridge_open"), seed=4))
    gated.start()
    for plant, inputs in ((plain, {"duty": 0.3, "bridge_open": 0.0}), (gated, {"duty": 0.3})):
        again = way(plant)
        for one in (plant, again) if way is not copy.copy else (again,):
            one.apply(inputs)
        if way is not copy.copy:
            assert again.measure() == plant.measure()


@pytest.mark.parametrize("name", sorted(bound_classes()))
def test_object_that_was_never_made_is_a_type_error(name: str) -> None:
    cls = bound_classes()[name]
    if cls.__new__ is object.__new__ or not hasattr(cls, "__init__"):
        return
    unmade = cls.__new__(cls)
    for member in [m for m in dir(cls) if isinstance(getattr(cls, m), property)]:
        with pytest.raises(TypeError, match="never made"):
            getattr(unmade, member)
    if "__repr__" in vars(cls):
        with pytest.raises(TypeError, match="never made"):
            repr(unmade)
    with pytest.raises(TypeError):
        unmade.__reduce__()


def test_object_that_was_never_made_is_no_argument_either() -> None:
    limit = Limit.__new__(Limit)
    with pytest.raises(TypeError, match="never made"):
        Spsa(start=0.0, bounds=(-1.0, 1.0), limits=[limit])
    with pytest.raises(TypeError, match="never made"):
        assert limit != Limit("p_max_bar", upper=90.0)


def test_frame_of_a_constructor_that_raised_can_be_shown() -> None:
    held: list[Any] = []

    class Kept(Spsa):
        def __init__(self, **keywords: Any) -> None:
            held.append(self)
            super().__init__(**keywords)

    with pytest.raises(Exception, match="lower"):
        Kept(start=0.0, bounds=(1.0, -1.0))
    with pytest.raises(TypeError, match="never made"):
        repr(held[0])


@pytest.mark.parametrize("value", [float("nan"), float("inf"), [0.0, float("nan")]])
def test_curve_is_not_read_where_nothing_is(value: Any) -> None:
    with pytest.raises(ValueError, match=r"inputs = .*finite"):
        Curve.parabola(curvature=-0.05, best=0.0, reach=20.0)(value)


@pytest.mark.parametrize("misfires", [0.0, 0.1])
@pytest.mark.parametrize("seeker", [GaussianProcessSeeking, Spsa])
def test_only_the_seed_of_the_run_counts(seeker: Any, misfires: float) -> None:
    ends = []
    for made in (0, 5):
        start = seeker(start=-2.0, bounds=(-20.0, 10.0), seed=made)
        run = monte_carlo(VirtualEngine(misfire_probability=misfires), [start], [5], cycles=120)
        ends.append(float(np.ravel(run["final_soc_cad"].values)[0]))
    assert ends[0] == ends[1]
