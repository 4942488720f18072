"""Options for the parameters of a throttle: a preset and single fields over it."""

from __future__ import annotations

import argparse
import difflib
from typing import Any

from mgdd import presets
from mgdd.errors import ParameterError
from mgdd.throttle import Throttle

__all__ = ["add_throttle", "throttle_of"]

_DEFAULT_PRESET = "P1"


def add_throttle(parser: argparse.ArgumentParser) -> None:
    """Add preset and fields; the names are those of the parameters."""
    group = parser.add_argument_group("throttle")
    group.add_argument("--preset", metavar="NAME_OR_FILE.toml", help="P1, P2, P3 or a TOML file (default: P1)")
    group.add_argument(
        "--set", action="append", default=[], metavar="FIELD=VALUE",
        help="any field of the throttle, repeatable, for example coulomb_nm=0.3",
    )  # fmt: skip


def throttle_of(args: argparse.Namespace) -> tuple[Throttle, str]:
    """Make the throttle of a preset and the fields over it."""
    preset = presets.load(args.preset or _DEFAULT_PRESET)
    throttle = getattr(preset, "throttle", None)
    if throttle is None:
        raise ParameterError(f"--preset {args.preset}: is not a throttle; P1, P2 and P3 are")
    fields = Throttle.fields()
    values: dict[str, Any] = {}
    for item in args.set:
        name, sign, text = (part.strip() for part in item.partition("="))
        name = name.replace("-", "_")
        if not (sign and name and text):
            raise ParameterError(f"--set {item}: write FIELD=VALUE")
        if name not in fields:
            close = difflib.get_close_matches(name, fields, 1)
            guess = f"; did you mean {close[0]!r}?" if close else ""
            raise ParameterError(f"--set {item}: no field {name!r}{guess}; the fields are {', '.join(fields)}")
        if name in values:
            raise ParameterError(f"--set {name} is given twice: give it once")
        values[name] = text if "choices" in fields[name] else _number(name, text, str(fields[name]["unit"]))
    return throttle.replace(**values), str(preset.name)


def _number(name: str, text: str, unit: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"{name} = {text!r}: must be a number [{unit}]") from None
