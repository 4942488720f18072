"""Map: seek a map on a virtual engine, visit by visit; compare it, and save it for the tools of calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mgdd.errors import DataError
from mgdd.results.labels import label_of
from mgdd.workbench import work
from mgdd.workbench.calls import Call, File, Named, Script
from mgdd.workbench.jobs import READ_S
from mgdd.workbench.parts import (
    Form,
    SameAs,
    Work,
    button,
    card,
    column,
    dropper,
    number,
    page,
    panel,
    pre,
    save,
    side,
    table,
    text,
)
from mgdd.workbench.pictures import COLOURS, canvas, cells, line, side_by_side
from mgdd.workbench.session import Session, file_word
from mgdd.workbench.views.search import bench_lines, engine_form

if TYPE_CHECKING:
    import xarray as xr

AXES = {"speed_rpm": (1000.0, 2500.0, 4), "fuel_mg": (10.0, 25.0, 4), "intake_pressure_kpa": (120.0, 180.0, 3)}
ENDINGS = (".dcm", ".cdfx", ".csv", ".nc")
_COLUMNS = ("soc_cad", "regret", "sd", "objective")
_LATEST = 8  # visits that are listed


class Map:
    """The sixth page."""

    title = "Map"

    def __init__(self, session: Session) -> None:
        widgets = panel().widgets
        self.session, self.work, self.same = session, Work(stops=True), SameAs()
        self.engine = engine_form(session)
        self.axes = widgets.MultiChoice(label="axes, one or two", options=[*AXES], value=["speed_rpm", "fuel_mg"],
                                        max_items=2, width=300)  # fmt: skip
        self.ends = {
            name: [widgets.FloatInput(label=f"{name} {end}", value=value, width=150)
                   for end, value in zip(("from", "to"), ends[:2], strict=True)]
            + [widgets.IntInput(label=f"{name} points", value=ends[2], start=2, end=12, width=150)]
            for name, ends in AXES.items()
        }  # fmt: skip
        self.limits = Form({"p_max_bar": ("limit of p_max_bar", "none")})
        self.timing = [widgets.FloatInput(label=f"soc_cad {end}", value=value, width=150)
                       for end, value in (("from", -20.0), ("to", 8.0))]  # fmt: skip
        self.guided = widgets.Checkbox(label="a rough model guides", value=True, align="end")
        self.wall_heat = widgets.FloatInput(label="its wall heat [-], a model that is wrong", value=1.0, width=230)
        self.visits = widgets.IntInput(label="visits", value=24, start=1, end=500, width=100)
        self.seed = widgets.IntInput(label="seed", value=0, start=0, width=90)
        self.column = widgets.Select(label="shown", options=[*_COLUMNS], width=320)
        self.column.param.watch(lambda _: self.draw(), "value")
        self.other = dropper(self.compare, 8)
        self.found: dict[str, Any] = {}
        self.visited: list[dict[str, Any]] = []
        self._said, self._list, self._compared = page(), page(), page()
        self._ends, self.saved = side(), side()
        self.axes.param.watch(lambda _: self._show_ends(), "value")
        self._pictures = side_by_side(None, None)
        self._map, self._regret = (column[0] for column in self._pictures)
        self._source: Any = None
        self.layout = column(
            page(text("A virtual engine: nothing here can drive a bench.", "quiet")),
            side(self.engine, self.axes, *self.timing, *self.limits.widgets.values(), self.visits, self.seed,
                 self.guided, self.wall_heat),
            self._ends, side(button("Seek the map", self.begin, first=True), self.column), self.work.layout,
            self._pictures, self._list, self._said, self.saved,
            card("Compare with a map from a file (DCM, CDFX, CSV, netCDF)", self.other, self._compared),
            self.same.layout,
        )  # fmt: skip
        self._show_ends()

    def _show_ends(self) -> None:
        self._ends.objects = [field for name in self.axes.value for field in self.ends[name]]

    def script(self) -> Script:
        """Write the work."""
        limits, seed = self.limits.values, int(self.seed.value)
        inputs = {"soc_cad": tuple(field.value for field in self.timing)}
        lines, command = bench_lines(self.session, self.engine.value, inputs, limits, seed)
        spans = {name: [field.value for field in self.ends[name]] for name in self.axes.value}
        axes = {name: np.linspace(*span).tolist() for name, span in spans.items()}
        guide = None
        if self.guided.value:
            lines.append(("guide", Call("cylinder.replace", of=Named("preset"),
                                        options={"wall_heat_scale": self.wall_heat.value})))  # fmt: skip
            guide = Named("guide")
            command += ["--guide=model", f"--guide-set=wall_heat_scale={self.wall_heat.value!r}"]
        options = {"limits": limits, "guide": guide, "visits": int(self.visits.value), "seed": seed}
        call = Call("loop.seek_map", (Named("bench"), inputs, axes), options, watched="on_visit")
        lines.append(("found", call))
        command = [word for word in command if not word.startswith(tuple(f"--{n.replace('_', '-')}=" for n in axes))]
        command += [f"--over={name}={low!r}:{high!r}:{n}" for name, (low, high, n) in spans.items()]
        return Script(tuple(lines), ("map", "seek", *command, f"--visits={self.visits.value}"), ("found",))

    def begin(self) -> None:
        """Seek the map."""
        if not self.axes.value:
            self.work.say("choose one axis or two", "bad")
            return
        script = self.script()
        self.same.show(script)
        self.visited, self.found = [], {}
        figure = canvas("visit [-]", "expected regret [% efficiency]")
        self._source = line(figure, [], [], "", COLOURS[0], points=True)
        self._regret.object = figure
        self.saved.objects = []
        self.work.begin("seeking the map", work.mapped, script, ENDINGS, told=self.told, done=self.done)

    def told(self, visits: list[dict[str, Any]]) -> None:
        """Show the visits since the last look."""
        self.visited += visits
        self._source.stream({"x": [one["visit"] for one in visits], "y": [one["regret"] for one in visits]})
        self.work.say(f"visit {visits[-1]['visit']} of {self.visits.value}")
        self.draw()

    def done(self, found: dict[str, Any]) -> None:
        """Show the map at the end, and offer its files."""
        self.found = found
        self._said.object = pre(found["text"]) + "".join(text(each) for each in found["findings"])
        self.saved.objects = [save(f"map{ending}", content) for ending, content in found["files"].items()]
        self.draw()

    @property
    def cells(self) -> xr.Dataset | None:
        """What is known of every cell now."""
        if self.found:
            return cast("xr.Dataset", self.found["cells"])
        return self.visited[-1]["cells"] if self.visited else None

    def draw(self) -> None:
        """Draw the cells, and list the latest visits."""
        data = self.cells
        if data is None:
            return
        shown = {str(name): v for name, v in data.data_vars.items() if v.ndim == len(self.axes.value)
                 and v.dtype.kind == "f"}  # fmt: skip
        options = {f"{label_of(v).long_name or name} [{label_of(v).units}]": name for name, v in shown.items()}
        if self.column.options != options:
            self.column.options = options
        name = self.column.value if self.column.value in shown else next(iter(shown))
        self._map.object = cells(data[name])
        rows = [
            [str(one["visit"]), *(number(value) for value in {**one["at"], **one["inputs"]}.values()), number(one["j"]),
             number(one["regret"], ".3g")]
            for one in self.visited[-_LATEST:]
        ]  # fmt: skip
        if rows:
            last = self.visited[-1]
            heads = ("visit", *last["at"], *last["inputs"], "J [%]", "regret [%]")
            self._list.object = table(heads, rows, numbers=range(len(heads)))

    def compare(self, name: str, content: bytes | str) -> None:
        """Subtract the map of a file from the one that was found."""
        if ".nc" not in self.found.get("files", {}):
            self._compared.object = text("seek a map first, to its end", "bad")
            return
        own = self.session.folder / "maps"
        own.mkdir(exist_ok=True)
        try:
            file = self.session.take(name, content).path
            self.session.files.pop(file.name)
        except DataError as error:
            self._compared.object = text(str(error), "bad")
            return
        (own / "map.nc").write_bytes(self.found["files"][".nc"])
        lines = (
            ("first", Call("maps.read_map", (File(file),))),
            ("second", Call("maps.read_map", (File(own / "map.nc"),))),
            ("difference", Call("maps.compare_maps", (Named("first"), Named("second")))),
        )
        script = Script(lines, ("map", "diff", file_word(file.name), "map.nc"), ("difference",))
        self.same.show(script)

        def done(found: dict[str, Any]) -> None:
            data = found["difference"]
            said = f"largest difference {number(data['largest_difference'])}, root mean square "
            said += f"{number(data['rms_difference'])} {label_of(data['difference']).units}"
            self._compared.object = text(said)
            self._map.object = cells(data["difference"])

        self.work.begin(f"comparing with {file.name}", work.run, script, done=done, seconds=READ_S)
