"""What a model says of one quantity over the inputs of a seeker, as the table that the core reads."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from mgdd._core.optimize import Surface
from mgdd.errors import Error, ParameterError, ShapeError

_NODES = {1: 41, 2: 17, 3: 11, 4: 7, 5: 5}  # per input: 5 inputs are asked for 3,125 times


def surface_of(
    guide: Any, names: Sequence[str], lower: Sequence[float], upper: Sequence[float], *, argument: str
) -> Any:
    """Read a guide in any of its forms."""
    if guide is None or isinstance(guide, Surface):
        return guide
    if hasattr(guide, "dims") and hasattr(guide, "coords"):
        return _of_map(guide, names, argument)
    if len(lower) not in _NODES:
        raise ShapeError(f"{argument}: a guide is over one to five inputs, and there are {len(lower)}: leave it out")
    if not np.isfinite([*lower, *upper]).all():
        raise ParameterError(f"{argument}: a guide is asked between the bounds, and some are infinite: give both")
    axes = [np.linspace(low, high, _NODES[len(lower)]) for low, high in zip(lower, upper, strict=True)]
    model = getattr(guide, "model", guide)
    if hasattr(model, "predict"):
        if not names:
            raise ParameterError(
                f"{argument}: a fitted response goes by names: give `inputs` with the names of its factors"
            )
        columns = [column.ravel() for column in np.meshgrid(*axes, indexing="ij")]
        predicted = model.predict(dict(zip(names, columns, strict=True)))
        values = np.asarray(predicted["mean"], np.float64)
    elif callable(guide):
        values = np.array([_asked(guide, names, point, argument) for point in product(*axes)])
    else:
        raise ParameterError(
            f"{argument} = {guide!r}: must be a callable of the inputs, a fitted response, or a DataArray over them"
        )
    return Surface(axes, values)


def _asked(guide: Callable[[Any], Any], names: Sequence[str], point: Sequence[float], argument: str) -> float:
    at: Any = dict(zip(names, map(float, point), strict=True)) if names else np.asarray(point, np.float64)
    where = ", ".join(f"{name} = {value:.6g}" for name, value in at.items()) if names else f"{at}"
    try:
        value = float(guide(at))
    except (Error, ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise ParameterError(f"{argument} fails at {where}: {error}") from error
    if not math.isfinite(value):
        raise ParameterError(f"{argument} gives {value} at {where}: it must be finite between the bounds; narrow them")
    return value


def _of_map(guide: Any, names: Sequence[str], argument: str) -> Any:
    order = tuple(names) or tuple(guide.dims)
    if set(map(str, guide.dims)) != set(map(str, order)):
        raise ShapeError(
            f"{argument} is over {', '.join(map(str, guide.dims)) or 'nothing'}: must be over {', '.join(order)}; "
            "select the others away"
        )
    missing = [name for name in order if name not in guide.coords]
    if missing:
        raise ParameterError(
            f"{argument}: {', '.join(map(str, missing))} has no coordinates: say where its values stand"
        )
    sorted_map = guide.transpose(*order).sortby(list(order))
    axes = [np.asarray(sorted_map[name], np.float64) for name in order]
    values = np.asarray(sorted_map, np.float64)
    if not np.isfinite(values).all():
        first = dict(zip(order, np.argwhere(~np.isfinite(values))[0], strict=True))
        where = ", ".join(f"{name} = {float(sorted_map[name][k]):.6g}" for name, k in first.items())
        raise ParameterError(f"{argument} has no value at {where}: fill the map first, for example by smooth_map")
    return Surface(axes, values.ravel())


def with_guides(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Give the settings of a seeker with its guides as surfaces."""
    out = dict(settings)
    if out.get("guide") is None and out.get("limit_guides") is None:
        return out
    inputs = out.get("inputs") or []
    names = [one.name for one in inputs]
    if inputs:
        lower, upper = [one.lower for one in inputs], [one.upper for one in inputs]
    else:
        size = np.size(out.get("start", 0.0))
        lower, upper = (np.broadcast_to(np.asarray(out.get(side, far), np.float64), size).tolist()
                        for side, far in (("lower", -math.inf), ("upper", math.inf)))  # fmt: skip
    for argument, of in (("guide", None), ("limit_guides", [one.name for one in out.get("limits", ())])):
        given = out.get(argument)
        if given is None:
            continue
        if isinstance(given, Mapping) and of is not None:
            given = _in_order(given, of, argument)
        several = isinstance(given, list | tuple)
        out[argument] = [
            surface_of(one, names, lower, upper, argument=f"{argument}[{k}]" if several else argument)
            for k, one in enumerate(given if several else [given])
        ]
    return out


def _in_order(given: Mapping[str, Any], limits: Sequence[str], argument: str) -> list[Any]:
    unknown = [name for name in given if name not in limits]
    if unknown:
        raise ParameterError(f"{argument} names {', '.join(unknown)}: the limits are {', '.join(limits) or 'none'}")
    return [given.get(name) for name in limits]
