"""CDFX files (ASAM CDF 2.0): the values, curves and maps of a control unit as XML, in the blocks of a DCM file.

A ``SW-INSTANCE`` has a name, a category and its values, ``V`` one by one; in a map each ``VG`` is a row with its
breakpoint of y as ``LABEL``. The first ``SW-AXIS-CONT`` is x, the second y; it holds its breakpoints, or names the
instance that does. Axes have no names of their own: those of mgdd stand in comments, as in a DCM file.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any
from xml.parsers import expat

from mgdd.errors import DataError
from mgdd.maps.dcm import DcmBlock, finite_number, share_breakpoints

_DEEPEST = 64  # levels
_AXES = {"VALUE": 0, "CURVE": 1, "MAP": 2, "COM_AXIS": 1}
_FORMAT = "CDF20"
_DOCTYPE = (
    '<!DOCTYPE MSRSW PUBLIC "-//ASAM//DTD CALIBRATION DATA FORMAT:V2.0.0:LAI:IAI:XML:CDF200.XSD//EN" '
    '"cdf_v2.0.0.sl.dtd">'
)
_AXIS = "axis: "  # begins the comment that names an axis
_FORBIDDEN = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")


def is_xml(raw: bytes) -> bool:
    """Whether a file begins as XML, in any encoding that XML files have."""
    return raw[:400].replace(b"\0", b"").lstrip(b"\xef\xbb\xbf\xff\xfe \t\r\n").startswith(b"<")


def cdfx_text(blocks: Sequence[DcmBlock], comments: Sequence[str], encoding: str = "utf-8") -> str:
    """Give the text of a file; numbers come back bit for bit."""
    root = ET.Element("MSRSW")
    _add(root, "SHORT-NAME", "mgdd")
    _add(root, "CATEGORY", _FORMAT)
    system = ET.SubElement(ET.SubElement(root, "SW-SYSTEMS"), "SW-SYSTEM")
    _add(system, "SHORT-NAME", "mgdd")
    tree = ET.SubElement(ET.SubElement(system, "SW-INSTANCE-SPEC"), "SW-INSTANCE-TREE")
    _add(tree, "SHORT-NAME", "mgdd")
    _add(tree, "CATEGORY", "NO_VCD")
    for text in comments:
        tree.append(ET.Comment(f" {re.sub('-(?=-|$)', '- ', _plain(text))} "))
    for block in blocks:
        instance = ET.SubElement(tree, "SW-INSTANCE")
        _add(instance, "SHORT-NAME", block.name)
        _add(instance, "LONG-NAME", block.long_name)
        _add(instance, "CATEGORY", "MAP" if block.y else "CURVE" if block.x else "VALUE")
        content = ET.SubElement(instance, "SW-VALUE-CONT")
        _add(content, "UNIT-DISPLAY-NAME", block.unit)
        values = ET.SubElement(content, "SW-VALUES-PHYS")
        for place, row in enumerate(block.values):
            group = ET.SubElement(values, "VG") if block.y else values
            if block.y:
                _add(group, "LABEL", repr(float(block.y[place])))
            _add_numbers(group, row)
        axes = ((block.x, block.unit_x, block.axis_x), (block.y, block.unit_y, block.axis_y))
        parent = ET.SubElement(instance, "SW-AXIS-CONTS") if block.x else instance
        for points, unit, name in axes:
            if points:
                axis = ET.SubElement(parent, "SW-AXIS-CONT")
                if name:
                    axis.append(ET.Comment(f"{_AXIS}{name}"))
                _add(axis, "CATEGORY", "STD_AXIS")
                _add(axis, "UNIT-DISPLAY-NAME", unit)
                _add_numbers(ET.SubElement(axis, "SW-VALUES-PHYS"), points)
    ET.indent(root)
    head = f'<?xml version="1.0" encoding="{encoding.replace("latin-1", "iso-8859-1").replace("cp", "windows-")}"?>'
    return f"{head}\n{_DOCTYPE}\n{ET.tostring(root, encoding='unicode')}\n"


def cdfx_blocks(raw: bytes, origin: str) -> tuple[list[DcmBlock], list[str]]:
    """Read values, curves, maps and shared axes, and name what is skipped."""
    root = _parsed(raw, origin)
    if root.tag != "MSRSW":
        raise DataError(f"{origin}: begins with <{root.tag}>: a CDFX file with <MSRSW>; export it as ASAM CDF 2.0")
    category = _text(root, "CATEGORY")
    if category not in ("", _FORMAT):
        raise DataError(f"{origin}: <CATEGORY> {category[:60]!r}: only {_FORMAT}, ASAM CDF 2.0, is read; export that")
    blocks: dict[str, DcmBlock] = {}
    skipped: list[str] = []
    for instance in root.iter("SW-INSTANCE"):
        block, why = _block(instance, origin)
        if block is None:
            skipped.append(why)
            continue
        if block.name in blocks:
            raise DataError(f"{origin}, line {block.line}: {block.name} stands in the file twice: keep one")
        blocks[block.name] = block
    share_breakpoints(blocks)
    for name, block in [*blocks.items()]:
        lacking = next((each for each in _lacking(block) if each), "")
        if lacking:
            skipped.append(f"{name}: the breakpoints of its axis {lacking} are not in the file")
            del blocks[name]
            continue
        _check_counts(block, f"{origin}, line {block.line}")
    return list(blocks.values()), skipped


def _lacking(block: DcmBlock) -> list[str]:
    """Name the axes that another instance should hold and does not."""
    axes = ((block.x, block.axis_x), (block.y, block.axis_y))[: len(block.sizes)]
    return [name for points, name in axes if not points and not block.is_axis]


def _check_counts(block: DcmBlock, where: str) -> None:
    wide, deep = len(block.x) if block.sizes else 1, len(block.y) if len(block.sizes) > 1 else 1
    if block.is_axis:
        return
    if len(block.values) != deep:
        raise DataError(
            f"{where}: {block.name} has {len(block.values)} VG for {deep} breakpoints of y: add what is missing"
        )
    for place, row in enumerate(block.values, start=1):
        if len(row) != wide:
            at = f" in VG {place}" if len(block.sizes) > 1 else ""
            raise DataError(f"{where}: {block.name} has {len(row)} values{at}: {wide} are needed; add what is missing")


def _plain(text: str) -> str:
    match = _FORBIDDEN.search(text)
    if match:
        raise DataError(f"{text!r}: {match[0]!r} is not allowed in XML: remove it")
    return text


def _add(parent: ET.Element, tag: str, text: str) -> None:
    if text:
        ET.SubElement(parent, tag).text = _plain(text)


def _add_numbers(parent: ET.Element, numbers: Sequence[float]) -> None:
    for number in numbers:
        _add(parent, "V", repr(float(number)))


def _parsed(raw: bytes, origin: str) -> ET.Element:
    """Parse XML that declares nothing, at most 64 levels deep; each element has its line, an axis its comment."""
    parser, builder, depth = expat.ParserCreate(), ET.TreeBuilder(), 0

    def refused(message: str) -> DataError:
        return DataError(f"{origin}, line {parser.CurrentLineNumber}: {message}")

    def start(tag: str, _: Any) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            raise refused(f"nests more than {_DEEPEST} levels deep: write it again")
        builder.start(tag.rpartition(":")[2], {"line": str(parser.CurrentLineNumber)})

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag.rpartition(":")[2])

    def comment(text: str) -> None:
        if text.startswith(_AXIS) and depth:
            builder.start("axis-name", {})
            builder.data(text.removeprefix(_AXIS).strip())
            builder.end("axis-name")

    def declared(*_: Any) -> None:
        raise refused("declares or names an entity: such a file is not read; export it without")

    def doctype(_: str, __: str | None, ___: str | None, has_own: int) -> None:
        if has_own:
            raise refused("has declarations in its DOCTYPE: such a file is not read; remove them")

    parser.StartElementHandler, parser.EndElementHandler, parser.CommentHandler = start, end, comment
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = parser.SkippedEntityHandler = declared
    parser.StartDoctypeDeclHandler = doctype
    parser.buffer_text = True
    try:
        parser.Parse(raw, True)
        return builder.close()
    except expat.ExpatError as error:
        message = expat.ErrorString(error.code)
        raise DataError(
            f"{origin}, line {error.lineno}: not valid XML: {message}: the file was cut off or damaged; write it again"
        ) from error
    except (LookupError, ValueError, AssertionError) as error:  # an encoding that is none
        if isinstance(error, DataError):
            raise
        raise DataError(f"{origin}: not valid XML: {error}: save it as UTF-8") from error


def _block(instance: ET.Element, origin: str) -> tuple[DcmBlock | None, str]:
    """Read an instance, or report why it is skipped."""
    name, kind, line = _text(instance, "SHORT-NAME"), _text(instance, "CATEGORY"), int(instance.get("line", "0"))
    if not name:
        return None, f"line {line}: SW-INSTANCE without SHORT-NAME"
    if kind not in _AXES:
        return None, f"{name}: category {kind or 'not given'}: only {', '.join(_AXES)} are read"
    variants = [*instance.iter("SW-INSTANCE-PROPS-VARIANT")]
    if len(variants) > 1:
        return None, f"{name}: {len(variants)} variants: export one"
    holder = variants[0] if variants else instance
    rows, unit = _rows(holder.find("SW-VALUE-CONT"), origin)
    if not rows or not rows[0]:
        return None, f"{name}: its values are texts, or not there"
    block = DcmBlock(name=name, long_name=_text(instance, "LONG-NAME"), line=line, is_axis=kind == "COM_AXIS")
    if block.is_axis:
        block.x, block.unit_x, block.sizes = rows[0], unit, [len(rows[0])]
        return block, ""
    block.unit, block.values = unit, rows
    axes = holder.findall("SW-AXIS-CONTS/SW-AXIS-CONT")
    if len(axes) != _AXES[kind]:
        message = f"{name} has {len(axes)} SW-AXIS-CONT: a {kind} has {_AXES[kind]}; add what is missing"
        raise DataError(f"{origin}, line {line}: {message}")
    block.sizes = [len(rows[0]), len(rows)][: len(axes)]
    for letter, axis in zip("xy", axes, strict=False):
        points, own_unit = _rows(axis, origin)
        if points is None:
            return None, f"{name}: its breakpoints are texts"
        setattr(block, letter, points[0] if points else [])
        setattr(block, f"unit_{letter}", own_unit)
        setattr(block, f"axis_{letter}", _text(axis, "axis-name") or _text(axis, "SW-INSTANCE-REF"))
    return block, ""


def _rows(content: ET.Element | None, origin: str) -> tuple[list[list[float]] | None, str]:
    """Give the rows of numbers, None where there is a text, and their unit."""
    if content is None:
        return None, ""
    unit, values = _text(content, "UNIT-DISPLAY-NAME"), content.find("SW-VALUES-PHYS")
    if values is None:
        return [], unit
    if next(values.iter("VT"), None) is not None:
        return None, unit
    groups = values.findall("VG") or [values]
    return [
        [finite_number((v.text or "").strip(), f"{origin}, line {v.get('line')}") for v in group.findall("V")]
        for group in groups
    ], unit


def _text(parent: ET.Element, tag: str) -> str:
    """Give the text of a child in one line, whatever is marked in it."""
    child = parent.find(tag)
    return "" if child is None else " ".join("".join(child.itertext()).split())
