"""The envelope of a safety gate as a file."""

from __future__ import annotations

import os
from importlib import resources
from typing import Any

from mgdd import _core
from mgdd.errors import DataError, did_you_mean
from mgdd.io.parameters import ParameterFile, Parameters, Wanted, entries

__all__ = ["SafetyEnvelope"]

_KIND = "safety_envelope"
_CHOICE = "bus_fault_from"


class SafetyEnvelope(Parameters, _core.rig.SafetyEnvelope):  # noqa: D101 the core's text
    __doc__ = _core.rig.SafetyEnvelope.__doc__

    @classmethod
    def load(cls, name: str | os.PathLike[str]) -> SafetyEnvelope:
        """Read an envelope: a shipped one by its name, or a file.

        Parameters
        ----------
        name : str or path
            ``"etb"`` for the host of a throttle, ``"etb_node"`` for the node that drives its bridge, or the path of a
            file that `to_toml` wrote.

        Returns
        -------
        SafetyEnvelope
            Of that file.

        Raises
        ------
        FileNotFoundError
            No such file.
        mgdd.errors.DataError
            Neither a shipped name nor a file of this kind, a missing key.
        mgdd.errors.ParameterError
            An unknown key, another unit, a value outside its domain.

        Examples
        --------
        >>> from mgdd.rig import SafetyEnvelope
        >>> SafetyEnvelope.load("etb") == SafetyEnvelope()
        True
        """
        text = os.fspath(name)
        if "." in text or os.sep in text:
            return cls.of_file(ParameterFile.read(text))
        folder = resources.files("mgdd.rig").joinpath("envelopes")
        shipped = sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir())
        if text not in shipped:
            hint = did_you_mean(text, shipped) or f"shipped are {', '.join(shipped)}"
            raise DataError(f"no shipped envelope {text!r}: {hint}; the path of a file ends in .toml")
        shipped_text = folder.joinpath(f"{text}.toml").read_text(encoding="utf-8")
        return cls.from_toml(shipped_text, origin=f"envelope {text!r}")

    def to_parameters(self) -> ParameterFile:
        """Give all fields, as `to_toml` writes them."""
        units = {name: wanted.unit for name, wanted in _wanted().items()}
        return ParameterFile(kind=_KIND, tables={"parameters": entries(self.to_dict(), units)})

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> SafetyEnvelope:
        """Make the envelope of a file that `to_toml` wrote."""
        file.expect(kinds=(_KIND,), tables=("parameters",), notes=("name", "title", "source"))
        return cls(**file.values("parameters", _wanted()))

    def replace(self, **changes: Any) -> SafetyEnvelope:
        """Give a validated copy with some fields changed; an unknown name is a ParameterError."""
        return type(self)(**super().replace(**changes).to_dict())


def _wanted() -> dict[str, Wanted]:
    fields = _core.rig.SafetyEnvelope.fields()
    return {name: Wanted() if name != _CHOICE else Wanted(form="text") for name in fields} | {
        name: Wanted(field["unit"]) for name, field in fields.items() if name != _CHOICE
    }
