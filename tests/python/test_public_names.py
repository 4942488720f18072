"""What is public: each name in one place, with a page."""

from __future__ import annotations

import importlib
import pkgutil
import re
from pathlib import Path

import mgdd


def public() -> dict[str, list[str]]:
    modules = sorted(m.name for m in pkgutil.iter_modules(mgdd.__path__) if not m.name.startswith("_"))
    return {module: list(importlib.import_module(f"mgdd.{module}").__all__) for module in modules}


def test_each_public_name_has_a_page(root: Path) -> None:
    names = public()
    for module, own in names.items():
        print(f"mgdd.{module} ({len(own)}): {', '.join(own)}")  # noqa: T201
    pages = (root / "docs" / "api.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## mgdd\.(\w+)$(.*?)(?=^## |\Z)", pages, re.MULTILINE | re.DOTALL))
    missing = [
        f"mgdd.{module}.{name}"
        for module, own in names.items()
        for name in own
        if not re.search(rf"^(   |.*autodata:: mgdd\.{module}\.){name}$", sections.get(module, ""), re.MULTILINE)
    ]
    assert missing == []


def test_nothing_is_exported_twice() -> None:
    homes: dict[int, list[str]] = {}
    for module, own in public().items():
        room = importlib.import_module(f"mgdd.{module}")
        for name in own:
            homes.setdefault(id(getattr(room, name)), []).append(f"mgdd.{module}.{name}")
    assert [places for places in homes.values() if len(places) > 1] == []


def test_what_is_not_listed_is_not_handed_out() -> None:
    """A module's names are those of `__all__`: nothing public is imported into it beside them."""
    for module, own in public().items():
        room = importlib.import_module(f"mgdd.{module}")
        if not hasattr(room, "__path__") or any(
            getattr(getattr(room, name), "__module__", "") == room.__name__ for name in own
        ):
            continue  # a module that is one file: its helpers are its own business
        extra = [
            name
            for name, value in vars(room).items()
            if not name.startswith("_") and name not in own and name != "annotations" and not hasattr(value, "__spec__")
        ]
        assert extra == [], f"mgdd.{module}"
