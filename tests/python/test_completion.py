"""What a prompt offers: every public name has a signature, and a package shows its own names only."""

import importlib
import inspect
import pkgutil
from types import ModuleType

import pytest

import mgdd

PACKAGES = [each.name for each in pkgutil.iter_modules(mgdd.__path__) if not each.name.startswith("_")]


def package(name: str) -> ModuleType:
    return importlib.import_module(f"mgdd.{name}")


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_completes_to_its_own_names(name: str) -> None:
    own = package(name)
    assert dir(own) == sorted(own.__all__)
    assert all(hasattr(own, each) for each in dir(own))


@pytest.mark.parametrize("name", PACKAGES)
def test_every_public_name_has_a_signature(name: str) -> None:
    own = package(name)
    for each in own.__all__:
        thing = getattr(own, each)
        if callable(thing) and not isinstance(thing, type(int | str)):
            assert isinstance(inspect.signature(thing), inspect.Signature), each


def test_public_names_are_few_and_none_stands_twice() -> None:
    names = [each for name in PACKAGES for each in package(name).__all__]
    # 165 since inputs have names, a process seeks over several, and files larger than memory are read in chunks.
    assert len(names) <= 165, "unexport or merge a name before one is added"
    assert {name for name in names if names.count(name) > 1} == {"read"}


def test_a_class_of_the_core_shows_names_and_defaults_and_describes_them() -> None:
    from mgdd.control import Pid
    from mgdd.loop import EngineBench

    shown = inspect.signature(Pid).parameters
    assert list(shown) == list(Pid.fields())
    assert {name: each.default for name, each in shown.items()} == {
        name: field["default"] for name, field in Pid.fields().items()
    }
    assert "kick_width_deg : error at which the kick is full [deg]" in str(Pid.__init__.__doc__)
    assert str(inspect.signature(Pid.step)) == "(self, reference_deg, measurement_deg)"

    bench = inspect.signature(EngineBench).parameters
    assert bench["pressure_noise_bar"].default == 0.0
    assert set(EngineBench.fields()) - set(bench) == {"cylinder"}
    assert "\npressure_noise_bar : float\n    Noise of each sample" in str(EngineBench.__doc__)
    assert "**settings" not in str(EngineBench.__doc__)
