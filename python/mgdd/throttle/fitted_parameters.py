"""Parameters of a fitted throttle as they stand in a TOML file: value, unit, standard error, origin."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from mgdd.errors import DataError, ParameterError

if TYPE_CHECKING:
    from mgdd.results import Fit

__all__ = ["KINDS", "FittedParameters", "parameter_text", "unit_of"]

KINDS = ("first_principle", "pw_r", "pw_w", "pw_p")
# Endings of parameter names, longest first, and the unit they stand for.
_UNITS = {
    "_deg_per_s2_per_duty": "deg/s² per duty",
    "_duty_per_deg": "duty/deg",
    "_per_deg2": "1/deg²",
    "_per_deg": "1/deg",
    "_deg_per_duty": "deg/duty",
    "_nms_per_rad": "N m s/rad",
    "_nm_per_rad": "N m/rad",
    "_nm_per_a": "N m/A",
    "_vs_per_rad": "V s/rad",
    "_deg_per_s": "deg/s",
    "_rad_per_s": "rad/s",
    "_per_s": "1/s",
    "_kgm2": "kg m²",
    "_samples": "samples",
    "_ohm": "ohm",
    "_deg": "deg",
    "_rad": "rad",
    "_duty": "-",
    "_nm": "N m",
    "_mh": "mH",
    "_ms": "ms",
    "_v": "V",
    "_a": "A",
    "_s": "s",
}


def unit_of(name: str) -> str:
    """Return the unit that a parameter name ends in, ``"-"`` if it names none."""
    return next((unit for ending, unit in _UNITS.items() if name.endswith(ending)), "-")


@dataclass(frozen=True, kw_only=True)
class FittedParameters:
    """Parameters of a fit as they stand in a TOML file, each with its unit and origin.

    Parameters
    ----------
    kind : str
        One of ``first_principle``, ``pw_r``, ``pw_w``, ``pw_p``.
    values, stderr : mapping of str to float
        By parameter name, in the unit that the name ends in; NaN where there is no standard error.
    source : str
        Where they come from, as the file says it.
    fit : mapping of str to float
        ``fit_percent_train``, ``fit_percent_test`` [%] and ``rmse_test_deg`` [deg], as far as known.
    unidentifiable : tuple of str
        Names that the log did not determine.

    Examples
    --------
    >>> from mgdd.throttle.fitted_parameters import FittedParameters
    >>> saved = FittedParameters(kind="pw_r", values={"tau_s": 0.0197}, source="fitted to ramp.csv")
    >>> FittedParameters.from_toml(saved.to_toml()) == saved
    True
    """

    kind: str
    values: Mapping[str, float]
    source: str
    stderr: Mapping[str, float] = field(default_factory=dict)
    fit: Mapping[str, float] = field(default_factory=dict)
    unidentifiable: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ParameterError(f"kind = {self.kind!r}: must be one of {', '.join(map(repr, KINDS))}")
        for name, value in self.values.items():
            if not math.isfinite(value):
                raise ParameterError(f"{name} = {value!r}: must be finite")
        known = {name: float(value) for name, value in self.stderr.items() if math.isfinite(value)}
        object.__setattr__(self, "stderr", MappingProxyType(known))
        for name in ("values", "fit"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def to_toml(self) -> str:
        """Write one line per value with unit, standard error and source.

        Returns
        -------
        str
            TOML that `from_toml` reads back equal.
        """
        lines = [f"kind = {_text(self.kind)}", f"source = {_text(self.source)}"]
        lines += [f"unidentifiable = {json.dumps(list(self.unidentifiable), ensure_ascii=False)}"]
        if self.fit:
            lines += ["", "[fit]", *(f"{name} = {float(value)!r}" for name, value in self.fit.items())]
        lines += ["", "[parameters]"]
        for name, value in self.values.items():
            error = f", stderr = {self.stderr[name]!r}" if name in self.stderr else ""
            lines.append(
                f"{name} = {{ value = {float(value)!r}, unit = {_text(unit_of(name))}{error}, "
                f"source = {_text(self.source)} }}"
            )
        return "\n".join(lines) + "\n"

    @classmethod
    def from_toml(cls, text: str, *, source: str = "fit") -> FittedParameters:
        """Read what `to_toml` wrote.

        Parameters
        ----------
        text : str
            The TOML text.
        source : str
            Name for the messages, for example the file.

        Returns
        -------
        FittedParameters
            The parameters.

        Raises
        ------
        DataError
            No TOML, a missing table, a value without number or with the wrong unit.
        ParameterError
            An unknown kind, or a value that is not finite.
        """
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise DataError(f"{source}: not valid TOML: {error}") from error
        table = data.get("parameters")
        if not isinstance(table, dict) or not table:
            raise DataError(f"{source}: no table [parameters]: mgdd throttle identify --output writes one")
        values: dict[str, float] = {}
        stderr: dict[str, float] = {}
        for name, entry in table.items():
            unit = unit_of(name)
            if not isinstance(entry, dict) or not isinstance(entry.get("value"), int | float):
                raise DataError(f'{source}: [parameters] {name}: write {{ value = ..., unit = "{unit}" }}')
            if entry.get("unit") != unit:
                raise DataError(
                    f"{source}: [parameters] {name}: unit = {entry.get('unit')!r}: must be {unit!r}; convert the "
                    "value, units stand in the names"
                )
            values[name] = float(entry["value"])
            if "stderr" in entry:
                stderr[name] = float(entry["stderr"])
        return cls(
            kind=str(data.get("kind", "")),
            values=values,
            source=str(data.get("source", source)),
            stderr=stderr,
            fit={str(name): float(value) for name, value in data.get("fit", {}).items()},
            unidentifiable=tuple(str(name) for name in data.get("unidentifiable", ())),
        )


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)


def parameter_text(
    kind: str, values: Mapping[str, float], *, options: Mapping[str, str] | None = None, fit: Fit | None = None
) -> str:
    """Write a model as TOML; with a fit also its record, standard errors, quality and open parameters."""
    if fit is None:
        text = FittedParameters(kind=kind, values=values, source="model").to_toml()
    else:
        figures = {
            "fit_percent_train": None if fit.train is None else fit.train.nrmse_fit_percent,
            "fit_percent_test": None if fit.test is None else fit.test.nrmse_fit_percent,
            "rmse_test_deg": None if fit.test is None else fit.test.rmse,
        }
        errors = fit.stderr
        text = FittedParameters(
            kind=kind,
            values=values,
            stderr={name: errors[own] for name in values if (own := _fitted_name(name, errors)) is not None},
            source=f"fitted to {fit.source}",
            fit={name: value for name, value in figures.items() if value is not None},
            unidentifiable=fit.unidentifiable,
        ).to_toml()
    head, parameters = text.split("\n\n", 1)
    return "\n".join([head, *(f"{name} = {_text(value)}" for name, value in (options or {}).items()), "", parameters])


def _fitted_name(name: str, fitted: Mapping[str, float]) -> str | None:
    """Return the fitted parameter that a model's parameter follows; sides that share one drop their prefix."""
    shared = name.removeprefix("above_").removeprefix("below_")
    return name if name in fitted else shared if shared in fitted else None
