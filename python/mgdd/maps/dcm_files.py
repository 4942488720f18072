"""Calibration maps in DCM and CDFX files: what of a map such a file holds, and the unit of its texts."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mgdd.errors import DataError, Error, argument
from mgdd.io.column_names import check_choice
from mgdd.io.files import bytes_of, decoded, existing_file, write_whole_text
from mgdd.maps.calibration_map import CalibrationMap, map_of
from mgdd.maps.cdfx import cdfx_blocks, cdfx_text, is_xml
from mgdd.maps.cells import can_be_name, spoken_name
from mgdd.maps.dcm import DcmBlock, dcm_blocks, dcm_text
from mgdd.maps.written import unit_from, unit_to

ENCODINGS = ("utf-8", "latin-1", "cp1252")


@dataclass(frozen=True, kw_only=True)
class DcmFile:
    """Content of a DCM or CDFX file.

    Parameters
    ----------
    maps : mapping of str to CalibrationMap
        Curves and maps by the names of their labels.
    values : mapping of str to (float, str)
        Single values with their units.
    skipped : tuple of str
        What was not read: blocks of other kinds, as texts and lists of functions, labels that no map can be called,
        and keywords that are not known.
    breakpoints : mapping of str to (tuple of float, str)
        Axes that several maps share, with their units.
    """

    maps: Mapping[str, CalibrationMap]
    values: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    skipped: tuple[str, ...] = ()
    breakpoints: Mapping[str, tuple[tuple[float, ...], str]] = field(default_factory=dict)


def write_labels(
    maps: Sequence[CalibrationMap] | Mapping[str, CalibrationMap],
    path: str | os.PathLike[str],
    *,
    values: Mapping[str, tuple[float, str]] | None = None,
    encoding: str = "utf-8",
) -> None:
    """Write maps and single values to one file, DCM or CDFX by its ending; see `mgdd.maps.write_map`."""
    check_choice("encoding", encoding, ENCODINGS)
    given = [map_of(table) for table in (maps.values() if isinstance(maps, Mapping) else maps)]
    named = [*zip(maps if isinstance(maps, Mapping) else [table.name for table in given], given, strict=True)]
    blocks = []
    for name, (number, unit) in (values or {}).items():
        DataError.unless(np.isfinite(number), f"value {name}", number, "finite")
        long_name = spoken_name(name)
        blocks.append(DcmBlock(name=name, long_name=long_name, unit=unit_to(unit), values=[[float(number)]]))
    blocks += [_block_of(name, table) for name, table in named]
    names = [block.name for block in blocks]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DataError(f"{twice}: stands in the file twice: give the maps other names")
    comments = [f"{name}, {key}: {text}" for name, table in named for key, text in table.provenance.items()]
    if Path(path).suffix.lower() == ".cdfx":
        write_whole_text(path, _encoded(cdfx_text(blocks, comments, encoding), path, encoding), encoding=encoding)
        return
    for block in blocks:
        for text in (block.long_name, block.unit, block.unit_x, block.unit_y, block.name):
            if '"' in text or "\n" in text:
                raise DataError(f"{block.name}: {text!r}: a DCM text has no quotes and no line breaks")
        if block.name.split() != [block.name]:
            raise DataError(f"{block.name!r}: a label of a DCM file is one word: give the map another name")
    write_whole_text(path, _encoded(dcm_text(blocks, comments), path, encoding), encoding=encoding)


def _encoded(text: str, path: str | os.PathLike[str], encoding: str) -> str:
    """Give the text back where the encoding has all of its letters, and a reader finds the same ones again."""
    try:
        raw = text.encode(encoding)
    except UnicodeEncodeError as error:
        letter, line = text[error.start], text.count("\n", 0, error.start) + 1
        row = text.splitlines()[line - 1].strip()
        raise DataError(
            f"{path}, line {line}: {letter!r} in {row!r} is not a letter of {encoding}: change the text, or write it "
            f"with {argument('encoding', repr('utf-8'))}"
        ) from error
    if encoding != "utf-8" and Path(path).suffix.lower() == ".dcm":  # XML states its encoding itself
        with contextlib.suppress(DataError):
            if decoded(raw, str(path)) == text:
                return text
        raise DataError(
            f"{path}: its letters in {encoding} would be read as others: write it with "
            f"{argument('encoding', repr('utf-8'))}"
        )
    return text


def read_dcm(path: str | os.PathLike[str]) -> DcmFile:
    """Read the curves, maps and single values of a DCM or CDFX file.

    Parameters
    ----------
    path : path-like
        DCM, format 2.0, UTF-8 or Windows-1252, or CDFX (ASAM CDF 2.0); decided by its content. Axes have the names that
        ``*SSTX`` and ``*SSTY`` give, or the axis that several maps share, where an axis can be called so, else ``x``
        and ``y``.

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
        Another format, a file that is cut off, counts that contradict each other, breakpoints that do not increase, XML
        that declares entities; the message names file, line and remedy.

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
    file = existing_file(path)
    raw = bytes_of(file)
    if is_xml(raw):
        blocks, skipped = cdfx_blocks(raw, str(file))
    else:
        blocks, skipped = dcm_blocks(decoded(raw, str(file)), str(file))
    maps: dict[str, CalibrationMap] = {}
    values: dict[str, tuple[float, str]] = {}
    breakpoints: dict[str, tuple[tuple[float, ...], str]] = {}
    for block in blocks:
        if block.is_axis:
            breakpoints[block.name] = (tuple(block.x), unit_from(block.unit_x, block.name))
            continue
        if not block.x:
            values[block.name] = (block.values[0][0], unit_from(block.unit, block.name))
            continue
        if not can_be_name(block.name):
            skipped.append(f"{block.name}: a map is named by letters, digits, _ . % [ and ]: rename the label")
            continue
        try:
            given = (("x", block.axis_x, block.x, block.unit_x), ("y", block.axis_y, block.y, block.unit_y))
            axes: dict[str, list[float]] = {}
            labels: dict[str, tuple[str, str]] = {}
            for plain, label, points, unit in given if block.y else given[:1]:
                # The names of axes stand in comments, where other tools may write anything.
                name = label if can_be_name(label) and label not in (block.name, "x", "y", *axes) else plain
                axes[name] = points
                labels[name] = (unit_from(unit, name), label if label not in ("", name) else spoken_name(name))
            labels[block.name] = (unit_from(block.unit, block.name), block.long_name or spoken_name(block.name))
            rows = np.array(block.values)
            maps[block.name] = CalibrationMap(axes, rows.T if block.y else rows[0], name=block.name, labels=labels)
        except Error as error:
            raise DataError(f"{file}, line {block.line}, {block.name}: {error}") from error
    return DcmFile(maps=maps, values=values, skipped=tuple(skipped), breakpoints=breakpoints)


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
        unit=unit_to(table.unit),
        unit_x=unit_to(table.labels[x].units),
        unit_y=unit_to(table.labels[y].units) if y else "",
        axis_x=x,
        axis_y=y,
    )
