"""What a prompt offers: every public name has a signature, and a package shows its own names only."""

import importlib
import inspect

import pytest

from public_objects import ROOMS


@pytest.mark.parametrize("name", ROOMS)
def test_a_package_completes_to_its_own_names(name: str) -> None:
    own = importlib.import_module(name)
    assert dir(own) == sorted(own.__all__)
    assert all(hasattr(own, each) for each in dir(own))


@pytest.mark.parametrize("name", ROOMS)
def test_every_public_name_has_a_signature(name: str) -> None:
    own = importlib.import_module(name)
    for each in own.__all__:
        thing = getattr(own, each)
        if callable(thing) and not isinstance(thing, type(int | str)):
            assert isinstance(inspect.signature(thing), inspect.Signature), each


def test_public_names_are_few_and_none_stands_twice() -> None:
    names = [each for name in ROOMS for each in importlib.import_module(name).__all__]
    assert len(names) <= 168, "unexport or merge a name before one is added"
    assert {name for name in names if names.count(name) > 1} == {"read"}


def test_a_class_of_the_core_shows_names_and_defaults_and_describes_them() -> None:
    from mgdd.control import Pid
    from mgdd.loop import VirtualEngine

    shown = inspect.signature(Pid).parameters
    assert list(shown) == list(Pid.fields())
    assert {name: each.default for name, each in shown.items()} == {
        name: field["default"] for name, field in Pid.fields().items()
    }
    assert "kick_width_deg : error at which the kick is full [deg]" in str(Pid.__init__.__doc__)
    assert str(inspect.signature(Pid.step)) == "(self, reference_deg, measurement_deg)"

    bench = inspect.signature(VirtualEngine).parameters
    assert bench["pressure_noise_bar"].default == 0.0
    assert set(VirtualEngine.fields()) - set(bench) == {"cylinder"}
    assert "\npressure_noise_bar : float\n    Noise of each sample" in str(VirtualEngine.__doc__)
    assert "**settings" not in str(VirtualEngine.__doc__)
