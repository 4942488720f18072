"""What is public: each name in one place; `test_docs.py` looks for its page."""

import importlib

from public_objects import ROOMS


def public() -> dict[str, list[str]]:
    return {module: list(importlib.import_module(module).__all__) for module in ROOMS}


def test_nothing_is_exported_twice() -> None:
    homes: dict[int, list[str]] = {}
    for module, own in public().items():
        room = importlib.import_module(module)
        for name in own:
            homes.setdefault(id(getattr(room, name)), []).append(f"{module}.{name}")
    assert [places for places in homes.values() if len(places) > 1] == []


def test_what_is_not_listed_is_not_handed_out() -> None:
    """A module's names are those of `__all__`: nothing public is imported into it beside them."""
    for module, own in public().items():
        room = importlib.import_module(module)
        if not hasattr(room, "__path__") or any(
            getattr(getattr(room, name), "__module__", "") == room.__name__ for name in own
        ):
            continue  # a module that is one file: its helpers are its own business
        extra = [
            name
            for name, value in vars(room).items()
            if not name.startswith("_") and name not in own and name != "annotations" and not hasattr(value, "__spec__")
        ]
        assert extra == [], module
