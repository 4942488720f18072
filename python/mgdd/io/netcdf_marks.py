"""What the conventions of netCDF say of the numbers of an array: which are missing or not valid, and their scale."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.io.array_table import marked

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MISSING = ("_FillValue", "missing_value")
MARKS = (*_MISSING, "valid_min", "valid_max", "valid_range", "scale_factor", "add_offset")
# What stands where nothing was written, by type; of bytes every value is data ("NetCDF Users Guide", fill values).
_UNWRITTEN = {
    "f4": 9.969209968386869e36, "f8": 9.969209968386869e36, "i2": -32767, "u2": 65535, "i4": -2147483647,
    "u4": 4294967295, "i8": -9223372036854775806, "u8": 18446744073709551614,
}  # fmt: skip


class Decoded:
    """An array that gives what is missing as NaN, and packed numbers unpacked."""

    def __init__(self, values: Any, marks: Mapping[str, Any], *, unwritten: bool = False) -> None:
        self._values, self.shape = values, values.shape
        given = {key: np.ravel(marks[key]) for key in MARKS if key in marks}
        least = {"valid_range": 2}
        self._marks = {
            key: numbers
            for key, numbers in given.items()
            if numbers.dtype.kind in "fiu" and numbers.size >= least.get(key, 1)
        }
        usual = _UNWRITTEN.get(f"{values.dtype.kind}{values.dtype.itemsize}")
        if unwritten and usual is not None:
            self._marks.setdefault("_FillValue", np.array([usual]))
        self.dtype = np.dtype(np.float64) if self._marks and values.dtype.kind in "fiu" else values.dtype

    def __getitem__(self, index: Any) -> NDArray[Any]:
        raw = np.asarray(self._values[index])
        if not self._marks or raw.dtype.kind not in "fiu":
            return raw
        missing = np.isin(raw, [value for key in _MISSING for value in self._of_type(key, raw.dtype)])
        low, high = self._marks.get("valid_range", [-np.inf, np.inf])[:2]
        for key, end in (("valid_min", low), ("valid_max", high)):
            bound = self._marks.get(key, [end])[0]
            missing |= raw < bound if key == "valid_min" else raw > bound
        found = marked(raw.astype(np.float64), missing)
        (scale, *_), (offset, *_) = self._marks.get("scale_factor", [1.0]), self._marks.get("add_offset", [0.0])
        return found if (scale, offset) == (1.0, 0.0) else found * scale + offset

    def _of_type(self, key: str, dtype: np.dtype[Any]) -> list[Any]:
        """Return the values of a mark as the array would hold them; one that it cannot hold marks nothing."""
        with np.errstate(all="ignore"):
            held = np.asarray(self._marks.get(key, []))
            cast = held.astype(dtype)
        return [one for one, given in zip(cast, held, strict=True) if dtype.kind == "f" or one == given]
