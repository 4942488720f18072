"""What one window holds: its files with how they are read, the engine that was stated, and what was found."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any
from weakref import finalize

from mgdd import presets
from mgdd.errors import DataError
from mgdd.workbench.calls import Call, File, Named, Script, Sum

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.engine import PressureCheck

MOST_FILE_MB, MOST_FILES_MB, MOST_FILES, MOST_PRESET_MB = 64, 512, 200, 1
_LONGEST_NAME = 150
MEAN = Call("mean", ("cycle",), {"keep_attrs": True}, of=Named("trace"))
PEGGING = ("pegging", "pegging_exponent", "inlet_pressure_kpa")


@dataclass(eq=False)
class Loaded:
    """A file of the session.

    Parameters
    ----------
    path : Path
        Where it lies.
    options : dict
        Of reading and pegging, as they were given.
    before : list of dict
        The options before each remedy, the latest last.
    """

    path: Path
    options: dict[str, Any] = field(default_factory=dict)
    before: list[dict[str, Any]] = field(default_factory=list)
    trace: xr.Dataset | None = None
    check: PressureCheck | None = None
    error: str = ""

    @property
    def reading(self) -> dict[str, Any]:
        """Options of the reader."""
        return {name: value for name, value in self.options.items() if name not in PEGGING}

    @property
    def pegging(self) -> dict[str, Any]:
        """Options of pegging."""
        return {name: value for name, value in self.options.items() if name in PEGGING}

    def remedy(self, options: Mapping[str, Any]) -> None:
        """Apply options over those of now; None takes one away."""
        self.before.append(dict(self.options))
        merged = self.options | dict(options)
        self.options = {name: value for name, value in merged.items() if value is not None}

    def undo(self) -> None:
        """Take the last remedy back; without one nothing happens."""
        if self.before:
            self.options = self.before.pop()


class Session:
    """Files, engine and operating point of one window; its folder is gone with it."""

    def __init__(self) -> None:
        self.folder = Path(mkdtemp(prefix="mgdd-workbench-"))
        self.close = finalize(self, shutil.rmtree, self.folder, ignore_errors=True)  # at the end of Python, too
        self.files: dict[str, Loaded] = {}
        self.preset = ""  # none stated
        self.own_engines: dict[str, Path] = {}  # presets that were dropped, by the name of their file
        self.cylinder: dict[str, Any] = {}  # fields that differ from the preset
        self.point: dict[str, float] = {}  # fields that were given

    def take(self, name: str, content: bytes) -> Loaded:
        """Write a dropped file; DataError for one too many, too large, or without a name."""
        own = "".join(c if c.isprintable() else "_" for c in Path(name.replace("\\", "/")).name).strip()
        if not own.strip(".") or len(own.encode()) > _LONGEST_NAME:
            raise DataError(f"{own[:40]!r} cannot be the name of a file here: rename it")
        held = sum(one.path.stat().st_size for key, one in self.files.items() if key != own)
        if len(content) > MOST_FILE_MB << 20 or held + len(content) > MOST_FILES_MB << 20:
            raise DataError(
                f"{own}: {len(content) / 1e6:.0f} MB; a file may have {MOST_FILE_MB} MB here, all {MOST_FILES_MB}: use "
                "mgdd engine analyze FILE --chunk-cycles 100, or cut it"
            )
        if own not in self.files and len(self.files) >= MOST_FILES:
            raise DataError(f"{own}: {MOST_FILES} files are open: use mgdd engine check FOLDER/*")
        path = self.folder / own
        path.write_bytes(content)
        self.files[own] = Loaded(path)
        return self.files[own]

    def drop(self, name: str) -> None:
        """Forget a file."""
        self.files.pop(name).path.unlink(missing_ok=True)

    @property
    def engines(self) -> list[str]:
        """Name the engines that can be stated."""
        return [*presets.available("engine"), *self.own_engines]

    @property
    def preset_file(self) -> str | Path:
        """The engine that was stated, by name or as its file."""
        return self.own_engines.get(self.preset, self.preset)

    def preset_of(self, engine: str) -> str | File:
        """Write what `presets.load` takes for an engine."""
        return File(self.own_engines[engine]) if engine in self.own_engines else engine

    def engine_lines(self, one: Loaded | None = None) -> tuple[tuple[str, Any], ...]:
        """Give the lines that make cylinder and point, with the speed of a file where it has its own."""
        own = {"speed_rpm": one.options["speed_rpm"]} if one is not None and "speed_rpm" in one.options else {}

        def of(part: str, changes: Mapping[str, Any]) -> Call:
            if not changes:
                return Call(part, of=Named("preset"), reads=True)
            return Call(f"{part}.replace", of=Named("preset"), options=changes)

        load = Call("presets.load", (self.preset_of(self.preset),))
        return ("preset", load), ("cylinder", of("cylinder", self.cylinder)), ("point", of("point", self.point | own))

    def engine_words(self) -> tuple[str, ...]:
        """Give the options of the command that state the same."""
        fields = (f"--set={name}={value!r}" for name, value in self.cylinder.items())
        return (f"--preset={file_word(self.preset)}", *fields, *words(self.point))

    def trace_line(self, one: Loaded) -> Call:
        """Read a file."""
        options = {"speed_rpm": self.point.get("speed_rpm")} | one.reading
        return Call("io.read_pressure", (File(one.path),), options)

    def check_script(self, one: Loaded) -> Script:
        """Read a file, and check it where the engine is stated."""
        read = ("trace", self.trace_line(one))
        name = one.path.name
        if not self.preset:
            return Script((read,), ("engine", "check", file_word(name)), ("trace",))
        options = {"point": Named("point"), **one.pegging, "fuel_mg": self.point.get("fuel_mg")}
        check = ("check", Call("engine.check_pressure", (Named("trace"), Named("cylinder")), options))
        command = ("engine", "check", file_word(name), *self.engine_words(), *words(one.options))
        return Script((*self.engine_lines(one), read, check), command, ("trace", "check"))

    def analyze_script(self, one: Loaded) -> Script:
        """Read and analyse a file, every cycle with its traces."""
        options = {"point": Named("point"), **one.pegging, "fuel_mg": self.point.get("fuel_mg"), "quiet": True}
        if "inlet_pressure_kpa" not in one.pegging:
            options["inlet_pressure_kpa"] = self.point.get("intake_pressure_kpa")
        lines = (
            *self.engine_lines(one),
            ("trace", self.trace_line(one)),
            ("figures", Call("engine.analyze", (Named("trace"), Named("cylinder")), options)),
        )
        command = ("engine", "analyze", file_word(one.path.name), *self.engine_words(), *words(one.options))
        return Script(lines, command, ("figures",))

    def tdc_script(self, one: Loaded) -> Script:
        """Estimate top dead centre by calibrations over a scan of the angle."""
        several = one.trace is not None and "cycle" in one.trace.dims
        lines = [*self.engine_lines(one), ("trace", self.trace_line(one))]
        if one.pegging:
            options = {"point": Named("point"), **one.pegging, "quiet": True}
            lines.append(("figures", Call("engine.analyze", (Named("trace"), Named("cylinder")), options)))
        if several:
            lines.append(("trace", MEAN))
        if one.pegging:
            offset = Call("mean_pegging_bar" if several else "pegging_bar", of=Named("figures"), reads=True)
            pressure = Sum(Call("pressure_bar", of=Named("trace"), reads=True), offset)
            lines.append(("trace", Call("assign", of=Named("trace"), options={"pressure_bar": pressure})))
        options = {"point": Named("point"), "span_cad": 4.0}
        estimate = Call("identify.estimate_tdc", ([Named("trace")], Named("cylinder")), options, watched="progress")
        lines.append(("tdc", estimate))
        command = ("engine", "analyze", file_word(one.path.name), "--tdc", *self.engine_words(), *words(one.options))
        return Script(tuple(lines), command, ("tdc",))


def words(options: Mapping[str, Any]) -> tuple[str, ...]:
    """Write arguments of the library as options of a command."""
    out = []
    for name, value in options.items():
        option = f"--{name.replace('_', '-')}"
        out.append(option if value is True else f"{option}={value}")
    return tuple(out)


def file_word(name: str) -> str:
    """Write a file so that no command takes it for an option."""
    return f"./{name}" if name.startswith("-") else name
