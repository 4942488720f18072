"""A fault to inject, as a user types it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mgdd.errors import ParameterError, did_you_mean

__all__ = ["fault_of"]


def fault_of(text: str, keys: Mapping[str, type]) -> tuple[str, dict[str, Any]]:
    """Read ``KIND:KEY=VALUE,...``, as ``drop:p=0.01,id=0x121``: kind, for the caller to check, and values by key."""
    kind, _, rest = text.partition(":")
    given: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        key, _, value = part.partition("=")
        if key not in keys:
            guess = did_you_mean(key, keys)
            raise ParameterError.of(
                "fault", text, f"KIND:KEY=VALUE,... with keys {', '.join(keys)}{'; ' + guess if guess else ''}"
            )
        try:
            given[key] = int(value, 0) if keys[key] is int else float(value)
        except ValueError:
            raise ParameterError.of(f"fault {kind}: {key}", value, "a number") from None
    return kind, given
