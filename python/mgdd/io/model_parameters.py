"""Models whose parameter file has two tables: numbers by name, and the fields that are their settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

from mgdd.io.parameter_entries import Wanted, entries, wanted, written
from mgdd.io.parameters import FIT_NOTES, ParameterFile, Parameters

__all__ = ["ModelParameters"]


class ModelParameters(Parameters):
    """Base of a model of ``parameters`` by name; what a fit wrote beside them is read over."""

    kind: str
    parameters: Mapping[str, float]
    parameter_names: ClassVar[tuple[str, ...]]
    settings: ClassVar[Mapping[str, Wanted]]

    def _written(self) -> Mapping[str, float]:
        return self.parameters

    def to_parameters(self) -> ParameterFile:
        """Give parameters and settings, as `to_toml` writes them."""
        settings = written({name: getattr(self, name) for name in self.settings}, self.settings)
        tables = {"parameters": entries(self._written()), "settings": settings}
        return ParameterFile(kind=self.kind, tables=tables)

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> Self:
        """Make the model of a file that `to_toml` or a fit wrote."""
        file.expect(kinds=(cls.kind,), tables=("parameters", "settings", "fit?"), notes=FIT_NOTES)
        make: Any = cls
        model: Self = make(
            parameters=file.values("parameters", wanted(cls.parameter_names)), **file.values("settings", cls.settings)
        )
        return model
