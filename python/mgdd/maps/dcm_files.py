"""Calibration maps in DCM files: what of a map such a file holds, and the unit of its texts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, Error, argument
from mgdd.io.files import read_plain_text, write_whole_text
from mgdd.maps.calibration_map import CalibrationMap, map_of
from mgdd.maps.cells import can_be_name, spoken_name
from mgdd.maps.dcm import DcmBlock, dcm_blocks, dcm_text
from mgdd.results.units import attribute_units, unit_of

if TYPE_CHECKING:
    import os

__all__ = ["DcmFile", "read_dcm", "write_dcm"]

# Units as calibration tools write them; everything else stands as it is. Where an angle counts from they do not say.
_DCM_UNITS = {
    "°KW": "°CA", "°CRK": "°CA", "deg CA": "°CA", "degCA": "°CA", "1/min": "rpm", "U/min": "rpm", "Nm": "N m",
    "°C": "degC", "°": "deg",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class DcmFile:
    """Content of a DCM file.

    Parameters
    ----------
    maps : mapping of str to CalibrationMap
        Curves and maps by the names of their labels.
    values : mapping of str to (float, str)
        Single values with their units.
    skipped : tuple of str
        What was not read: blocks of other kinds, as texts and lists of functions, and labels that no map can be called.

    Examples
    --------
    >>> from mgdd.maps.dcm_files import DcmFile
    >>> DcmFile(maps={}, values={"idle_rpm": (850.0, "rpm")}).values["idle_rpm"]
    (850.0, 'rpm')
    """

    maps: Mapping[str, CalibrationMap]
    values: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    skipped: tuple[str, ...] = ()


def write_dcm(
    maps: Sequence[CalibrationMap] | Mapping[str, CalibrationMap],
    path: str | os.PathLike[str],
    *,
    values: Mapping[str, tuple[float, str]] | None = None,
) -> None:
    """Write maps and single values to one DCM file; see `mgdd.maps.write_map`."""
    given = [map_of(table) for table in (maps.values() if isinstance(maps, Mapping) else maps)]
    named = [*zip(maps if isinstance(maps, Mapping) else [table.name for table in given], given, strict=True)]
    blocks = []
    for name, (number, unit) in (values or {}).items():
        if not np.isfinite(number):
            raise DataError.of(f"value {name}", number, "finite")
        blocks.append(DcmBlock(name=name, long_name=spoken_name(name), unit=unit, values=[[float(number)]]))
    blocks += [_block_of(name, table) for name, table in named]
    for block in blocks:
        if [other.name for other in blocks].count(block.name) > 1:
            raise DataError(f"{block.name}: stands in the file twice: give the maps other names")
        for text in (block.long_name, block.unit, block.unit_x, block.unit_y, block.name):
            if '"' in text or "\n" in text:
                raise DataError(f"{block.name}: {text!r}: a DCM text has no quotes and no line breaks")
    comments = [f"{name}, {key}: {text}" for name, table in named for key, text in table.provenance.items()]
    write_whole_text(path, dcm_text(blocks, comments))


def read_dcm(path: str | os.PathLike[str]) -> DcmFile:
    """Read the curves, maps and single values of a DCM file.

    Parameters
    ----------
    path : path-like
        Format 2.0, UTF-8 or Windows-1252. Axes have the names that ``*SSTX`` and ``*SSTY`` give, where an axis can be
        called so, else ``x`` and ``y``.

    Returns
    -------
    DcmFile
        Values with the source ``given``; what else the file holds, and labels whose names no map can have, stand in
        ``skipped``.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.DataError
        Another format, a file that is cut off, counts that contradict each other, breakpoints that do not increase; the
        message names file, line and remedy.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.maps import CalibrationMap, read_dcm, write_map
    >>> soc = CalibrationMap({"fuel_mg": [6, 20]}, [-1, -4], name="soc_cad")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "engine.dcm"
    ...     write_map({"SocBase": soc}, file, values={"idle_rpm": (850.0, "rpm")})
    ...     print(file.read_text(encoding="utf-8"), end="")
    ...     read_dcm(file).values
    <BLANKLINE>
    KONSERVIERUNG_FORMAT 2.0
    <BLANKLINE>
    FESTWERT idle_rpm
       LANGNAME      "idle"
       EINHEIT_W     "rpm"
       WERT          850.0
    END
    <BLANKLINE>
    KENNLINIE SocBase 2
       LANGNAME      "start of combustion"
       EINHEIT_X     "mg"
       EINHEIT_W     "°CA aTDC"
    *SSTX   fuel_mg
       ST/X          6.0   20.0
       WERT          -1.0   -4.0
    END
    {'idle_rpm': (850.0, 'rpm')}
    >>> try:
    ...     read_dcm("no_such_file.dcm")
    ... except FileNotFoundError as error:
    ...     print(error.strerror)
    no such file: check the path
    """
    file = Path(path)
    blocks, skipped = dcm_blocks(read_plain_text(file), str(file))
    maps, values = {}, {}
    for block in blocks:
        if not block.x:
            values[block.name] = (block.values[0][0], _unit_from(block.unit, block.name))
            continue
        if not can_be_name(block.name):
            skipped.append(f"{block.name}: a map is named by letters, digits, _ . [ and ]: rename the label")
            continue
        try:
            maps[block.name] = _map_of(block)
        except Error as error:
            raise DataError(f"{file}, line {block.line}, {block.name}: {error}") from error
    return DcmFile(maps=maps, values=values, skipped=tuple(skipped))


def _block_of(name: str, table: CalibrationMap) -> DcmBlock:
    if not np.isfinite(table.values).all():
        raise DataError(
            f"{name}: {np.count_nonzero(~np.isfinite(table.values))} cells have no value, a DCM file needs all: "
            f"smooth the map with {argument('fill', 'True')}"
        )
    x, y = [*table.axes, ""][:2]
    rows = table.values.reshape(table.values.shape[0], -1).T
    return DcmBlock(
        name=name,
        x=table.axes[x].tolist(),
        y=table.axes[y].tolist() if y else [],
        values=rows.tolist(),
        long_name=table.labels[table.name].long_name,
        unit=table.unit,
        unit_x=table.labels[x].units,
        unit_y=table.labels[y].units if y else "",
        axis_x=x,
        axis_y=y,
    )


def _map_of(block: DcmBlock) -> CalibrationMap:
    given = (("x", block.axis_x, block.x, block.unit_x), ("y", block.axis_y, block.y, block.unit_y))
    axes: dict[str, list[float]] = {}
    labels: dict[str, tuple[str, str]] = {}
    for plain, said, points, unit in given if block.y else given[:1]:
        # The names of axes stand in comments, where other tools may write anything.
        name = said if can_be_name(said) and said not in (block.name, "x", "y", *axes) else plain
        axes[name] = points
        labels[name] = (_unit_from(unit, name), said if said not in ("", name) else spoken_name(name))
    labels[block.name] = (_unit_from(block.unit, block.name), block.long_name or spoken_name(block.name))
    rows = np.array(block.values)
    return CalibrationMap(axes, rows.T if block.y else rows[0], name=block.name, labels=labels)


def _unit_from(written: str, name: str) -> str:
    """Give a unit of a file as mgdd prints it; a name that says the same unit settles how."""
    unit = _DCM_UNITS.get(written, written) or "-"
    try:
        same = attribute_units(unit) == attribute_units(unit_of(name))
    except ValueError:
        return f"not given ({unit})"
    return unit_of(name) if same else unit
