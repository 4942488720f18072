"""Files: drop one or many, state the engine, and read which of them can be trusted."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mgdd import presets
from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError, Error
from mgdd.workbench import work
from mgdd.workbench.drop import dropper
from mgdd.workbench.forms import Form
from mgdd.workbench.jobs import READ_S
from mgdd.workbench.parts import (
    View,
    badge,
    button,
    card,
    column,
    number,
    page,
    panel,
    side,
    table,
    text,
)
from mgdd.workbench.pictures import side_by_side, traces
from mgdd.workbench.session import MOST_FILE_MB, MOST_PRESET_MB, Loaded, Session

if TYPE_CHECKING:
    import xarray as xr

_GEOMETRY = ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")
_NOT_STATED = "– state the engine –"
UNITS = ("bar", "mbar", "kPa", "Pa", "MPa", "psi", "kgf/cm2", "atm", "torr")
_READING = {
    "pressure_unit": ("pressure unit", ""),
    "pressure_column": ("pressure column", "text its name; as the file says"),
    "angle_column": ("angle column", "text its name; the first"),
    "angle_unit": ("angle unit", ""),
    "firing_tdc_deg": ("firing TDC stands at [deg]", "0: angles are °CA aTDC"),
    "tdc_offset_cad": ("angles too large by [°CA]", "0"),
    "angle_step_deg": ("angle step, without a column [deg]", "of the file"),
    "speed_rpm": ("speed of this file [rpm]", "of the operating point"),
    "gain_bar_per_v": ("gain of a pressure in volts [bar/V]", "of the file"),
}
_READING_CHOICES = {
    "pressure_unit": {"as the file says": "", **{unit: unit for unit in UNITS}},
    "angle_unit": {"as the file says": "", **{unit: unit for unit in ("deg", "rad", "s", "ms", "us")}},
}
WORK = ("imep_net_bar", "imep_gross_bar", "imep_closed_bar")


def figure_of(one: Loaded, name: str, form: str = "mean_{}") -> float | None:
    """Give a figure of a file: of a record the mean of its cycles, or as `form` has it."""
    data = None if one.check is None else one.check.analysis
    for key in (form.format(name), *([name] if form == "mean_{}" else [])):
        if data is not None and key in data and data[key].ndim == 0:
            return float(data[key])
    return None


class Files(View):
    """The first page."""

    title = "Files"

    def __init__(self, session: Session, changed: Callable[[], None]) -> None:
        super().__init__(session)
        widgets, self._changed = panel().widgets, changed
        self._waiting: list[Loaded] = []
        self.drop = dropper(self.add, MOST_FILE_MB, several=True)
        self.engine = widgets.Select(label="engine", options=[_NOT_STATED, *session.engines], width=200)
        self.engine.param.watch(lambda event: self.state(event.new), "value")
        self.cylinder = Form({name: _labelled(Cylinder.fields()[name], name) for name in _GEOMETRY})
        self.point = Form({name: _labelled(info, name) for name, info in OperatingPoint.fields().items()})
        self.reading = Form(_READING, _READING_CHOICES)
        self.which = widgets.Select(label="file", options=[], width=260)
        self.which.param.watch(lambda _: self.chosen(), "value")
        self._guesses, self._table = page(), page()
        self._picture, self._drawn = column(), cast("xr.Dataset | None", None)
        self.layout = column(
            page("<h2>Drop pressure files</h2>" + text(
                f"Any format that mgdd reads; up to {MOST_FILE_MB} MB each. Nothing leaves this machine.", "quiet")),
            self.drop, side(self.engine, self.which, button("Remove the file", self.forget)),
            self._guesses, self.work.layout, self._table, self._picture, self.same.layout,
            card("Geometry, where it is not that of the named engine", self.cylinder.layout()),
            card("An engine of your own, from a file (TOML)", dropper(self.add_engine, MOST_PRESET_MB)),
            card("Operating point", self.point.layout(), collapsed=False),
            card("How the files are to be read", self.reading.layout()),
            side(button("Read again with these", self.apply, first=True)),
        )  # fmt: skip
        self.show()

    @property
    def file(self) -> Loaded | None:
        """The chosen file."""
        return self.session.files.get(self.which.value or "")

    def add(self, name: str, content: bytes) -> None:
        """Take one file."""
        try:
            one = self.session.take(name, content)
        except DataError as error:
            self.work.say(str(error), "bad")
            return
        one.options = dict(self.reading.values)
        self.read(one)

    def add_engine(self, name: str, content: bytes) -> None:
        """Take the preset of an engine, and state it."""
        path = self.take(name, content)
        if path is None:
            return
        try:
            presets.load(path, kind="engine")
        except (Error, OSError) as error:
            self.work.say(str(error), "bad")
            return
        self.work.say("")
        self.session.own_engines[path.name] = path
        self.engine.options = [_NOT_STATED, *self.session.engines]
        if self.engine.value == path.name:  # the same once more
            self.apply()
        self.engine.value = path.name

    def state(self, name: str) -> None:
        """State the engine, and check every file anew."""
        self.session.preset = "" if name == _NOT_STATED else name
        self.apply()

    def apply(self) -> None:
        """Take all that the forms give, and read every file anew."""
        self.session.cylinder, self.session.point = self.cylinder.values, self.point.values
        for one in self.session.files.values():
            if one is self.file or not one.before:
                one.options = dict(self.reading.values) | one.pegging
        self._waiting = []
        self.read(*self.session.files.values())

    def forget(self) -> None:
        """Remove the chosen file."""
        if self.which.value in self.session.files:
            self.session.drop(self.which.value)
            self.show()

    def read(self, *files: Loaded) -> None:
        """Read files, one after the other, each in a process of its own."""
        self._waiting += [one for one in files if one not in self._waiting]
        if not self.work.busy:
            self._next()
        self.show()

    def _next(self) -> None:
        if not self._waiting:
            return
        one = self._waiting.pop(0)

        def told(traces: list[Any]) -> None:
            one.trace, one.check, one.error = traces[-1], None, ""
            self._arrived(one)

        def done(found: Any) -> None:
            one.check = found.get("check")
            self._arrived(one)
            self._next()

        def failed(why: str) -> None:
            one.trace = one.check = None
            one.error = why
            self.work.say("")
            self._arrived(one)
            self._next()

        self.work.begin(
            f"reading {one.path.name}", work.checked, self.session.check_script(one),
            done=done, told=told, failed=failed, seconds=READ_S,
        )  # fmt: skip

    def _arrived(self, one: Loaded) -> None:
        name = one.path.name
        self.which.options = list(self.session.files)
        if name in self.session.files and self.file is None:
            self.which.value = name  # which shows it
        else:
            self.show()

    def chosen(self) -> None:
        """Show how the chosen file is read."""
        if self.file is not None:
            self.reading.show(self.file.reading)
        self.show()

    def show(self) -> None:
        """Show everything as it is now."""
        names = list(self.session.files)
        if self.which.options != names:
            self.which.options = names
        self._guesses.object = self._guessed()
        self._table.object = self._rows()
        one = self.file
        trace = None if one is None else one.trace
        if one is not None and trace is not None and trace is not self._drawn:
            self._picture.objects = [side_by_side(traces({one.path.name: trace}, "pressure_bar"))]
        elif trace is None:
            self._picture.objects = []
        self._drawn = trace
        if one is not None:
            self.same.show(self.session.check_script(one))
        self._changed()

    def _guessed(self) -> str:
        """Mark what nobody stated."""
        if not self.session.preset:
            return text("No engine is stated: files are read and drawn, and nothing is judged.", "bad")
        preset = presets.load(self.session.preset_file)
        shown = {name: getattr(preset.cylinder, name) for name in _GEOMETRY}
        self.cylinder.hint({name: f"{value:g}" for name, value in shown.items()})
        own = {name: getattr(preset.point, name) for name in OperatingPoint.fields()}
        self.point.hint({name: _guess(value) for name, value in own.items()})
        left = [f"{name} = {value:g}" for name, value in own.items() if value is not None
                and name not in self.session.point]  # fmt: skip
        said = escape(f"{', '.join(left)} of {self.session.preset}: give the operating point below")
        return f"<p><span class='badge doubt'>guessed</span> {said}</p>" if left else ""

    def _rows(self) -> str:
        if not self.session.files:
            return ""
        rows = []
        for name, one in self.session.files.items():
            said = badge(one.check.verdict) if one.check is not None else ""
            if one.error:
                said = f"{badge('fail')} {escape(one.error)}"
            elif one.check is None:
                said = "<span class=quiet>" + ("no engine" if one.trace is not None else "waits") + "</span>"
            imep = next((w for w in WORK if _finite(figure_of(one, w))), WORK[0])
            kind = f" {imep.split('_')[1]}" if _finite(figure_of(one, imep)) else ""
            cells = (figure_of(one, imep, "cov_{}_percent"), figure_of(one, "p_max_bar"), figure_of(one, "ca50_cad"))
            rows.append([escape(name), said, number(figure_of(one, imep)) + kind, *map(number, cells)])
        heads = ("file", "verdict", "IMEP [bar]", "COV [%]", "p_max [bar]", "CA50 [°CA aTDC]")
        return table(heads, rows, numbers=range(2, 6))


def _finite(value: float | None) -> bool:
    return value is not None and bool(np.isfinite(value))


def _labelled(info: Any, name: str) -> tuple[str, str]:
    unit = "" if info["unit"] == "-" else f" [{info['unit']}]"
    spoken = name.removesuffix("_cad").removesuffix(f"_{info['unit'].lower()}").replace("_", " ")
    return f"{spoken.replace('ivc', 'IVC').replace('evo', 'EVO')}{unit}", "of the engine"


def _guess(value: float | None) -> str:
    return "left out" if value is None else f"guess: {value:g}"
