"""Map: seek a map on a virtual engine, visit by visit; beside it the sweep; smooth, compare and save them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mgdd.results.labels import label_of
from mgdd.rig.live.figures import COLOURS
from mgdd.workbench import work
from mgdd.workbench.calls import Call, File, Named, Script
from mgdd.workbench.drop import dropper
from mgdd.workbench.forms import Form, Ranges
from mgdd.workbench.jobs import READ_S
from mgdd.workbench.parts import View, button, card, column, number, page, panel, pre, save, side, table, text
from mgdd.workbench.pictures import canvas, cells, line, side_by_side
from mgdd.workbench.session import Session, file_word
from mgdd.workbench.views.search import bench_lines, engine_form

if TYPE_CHECKING:
    import xarray as xr

AXES = {"speed_rpm": (1000.0, 2500.0, 4), "fuel_mg": (10.0, 25.0, 4), "intake_pressure_kpa": (120.0, 180.0, 3)}
ENDINGS = (".dcm", ".cdfx", ".csv", ".nc")
_COLUMNS = ("soc_cad", "regret", "sd", "objective")
_LATEST = 8  # visits that are listed
_STEP_CAD = 0.5  # of the sweep
_OBJECTIVE = "efficiency_gross"
_COMPARED = ("largest_difference", "rms_difference")


class Map(View):
    """The sixth page."""

    title = "Map"

    def __init__(self, session: Session) -> None:
        super().__init__(session, stops=True)
        widgets = panel().widgets
        self.engine = engine_form(session)
        self.axes = Ranges("axes, one or two", AXES, ["speed_rpm", "fuel_mg"], most=2)
        self.limits = Form({"p_max_bar": ("limit of p_max_bar", "none")})
        self.timing = [widgets.FloatInput(label=f"soc_cad {end}", value=value, width=150)
                       for end, value in (("from", -20.0), ("to", 8.0))]  # fmt: skip
        self.guided = widgets.Checkbox(label="a rough model guides", value=True, align="end")
        self.wall_heat = widgets.FloatInput(label="its wall heat [-], a model that is wrong", value=1.0, width=230)
        self.visits = widgets.IntInput(label="visits", value=24, start=1, end=500, width=100)
        self.seed = widgets.IntInput(label="seed", value=0, start=0, width=90)
        self.column = widgets.Select(label="shown", options=[*_COLUMNS], width=320)
        self.column.param.watch(lambda _: self.draw(), "value")
        self.weight = widgets.FloatInput(label="weight of smoothness [-]", value=1.0, start=0.0, width=180)
        self.loss = widgets.FloatInput(label="sweep: efficiency may lose [-]", value=0.002, start=1e-5, width=210)
        self.tolerance = widgets.FloatInput(label="sought map may move by [°CA]", value=1.0, start=0.0, width=210)
        self.other = dropper(self.compare, 8)
        self.found: dict[str, Any] = {}
        self.made: dict[str, Any] = {}  # maps of the sweep, and the smoothed one
        self.visited: list[dict[str, Any]] = []
        self._said, self._list, self._compared, self._beside_said = page(), page(), page(), page()
        self.saved = side()
        self._pictures, self._beside = side_by_side(None, None), column()
        self._map, self._regret = (column[0] for column in self._pictures)
        self._source: Any = None
        self.layout = column(
            page(text("A virtual engine: nothing here can drive a bench.", "quiet")),
            side(self.engine, *self.timing, *self.limits.widgets.values(), self.visits, self.seed, self.guided,
                 self.wall_heat),
            self.axes.layout, side(button("Seek the map", self.begin, first=True), self.column), self.work.layout,
            self._pictures, self._list, self._said,
            side(self.weight, self.tolerance, button("Smooth it", self.smooth), self.loss,
                 button("Sweep, optimise, smooth", self.sweep)),
            self._beside_said, self._beside, self.saved,
            card("Compare with a map from a file (DCM, CDFX, CSV, netCDF)", self.other, self._compared),
            self.same.layout,
        )  # fmt: skip

    def _bench(self) -> tuple[list[tuple[str, Any]], list[str], dict[str, Any]]:
        """Give the lines of the engine, the words of its command, and the axes."""
        spans = self.axes.values
        inputs = {"soc_cad": tuple(field.value for field in self.timing)}
        lines, command = bench_lines(self.session, self.engine.value, inputs, self.limits.values, int(self.seed.value))
        varied = tuple(f"--{name.replace('_', '-')}=" for name in spans)
        return lines, [word for word in command if not word.startswith(varied)], _grid(spans)

    def script(self) -> Script:
        """Write the search."""
        lines, command, axes = self._bench()
        guide = None
        if self.guided.value:
            lines.append(("guide", Call("cylinder.replace", of=Named("preset"),
                                        options={"wall_heat_scale": self.wall_heat.value})))  # fmt: skip
            guide = Named("guide")
            command += ["--guide=model", f"--guide-set=wall_heat_scale={self.wall_heat.value!r}"]
        options = {"limits": self.limits.values, "guide": guide, "visits": int(self.visits.value),
                   "seed": int(self.seed.value)}  # fmt: skip
        inputs = {"soc_cad": tuple(field.value for field in self.timing)}
        lines.append(("found", Call("loop.seek_map", (Named("bench"), inputs, axes), options, watched="on_visit")))
        command += _over(self.axes.values)
        return Script(tuple(lines), ("map", "seek", *command, f"--visits={self.visits.value}"), ("found",))

    def sweep_script(self) -> Script:
        """Write the conventional way: a sweep over all cells and timings, the best of each cell, smoothed."""
        lines, command, axes = self._bench()
        low, high = (field.value for field in self.timing)
        timings = {"soc_cad": [low, high, round((high - low) / _STEP_CAD) + 1]}
        task = {"limits": self.limits.values or None, "max_loss": self.loss.value}
        cylinder = Call("cylinder", of=Named("preset"), reads=True)
        lines = [
            *(each for each in lines if each[0] in ("preset", "point")),
            ("table", Call("sweep.sweep", (cylinder, Named("point"), {**axes, **_grid(timings)}))),
            ("best", Call("maps.optimize_map", (Named("table"), _OBJECTIVE), task)),
            ("swept", Call("maps.smooth_map", (Named("best"),), {"weight": self.weight.value})),
            ("achieved", Call("maps.apply_map", (Named("swept"), Named("table")))),
        ]
        engine = [word for word in command if not word.startswith(("--input", "--limit", "--seed"))]
        limits = [word for word in command if word.startswith("--limit")]
        sweep = ("engine", "sweep", *engine, *_over({**self.axes.values, **timings}), "-o", "table.nc")
        best = ("map", "optimize", "table.nc", f"--maximize={_OBJECTIVE}", *limits, f"--max-loss={self.loss.value!r}",
                "-o", "best.nc")  # fmt: skip
        smooth = ("map", "smooth", "best.nc", f"--weight={self.weight.value!r}", "-o", "swept.nc")
        show = ("map", "show", "swept.nc", "--sweep", "table.nc")
        return Script(tuple(lines), show, ("swept", "achieved"), (sweep, best, smooth))

    def begin(self) -> None:
        """Seek the map."""
        if not self._has_axes():
            return
        self.visited, self.found, self.made = [], {}, {}
        figure = canvas("visit [-]", "expected regret [% efficiency]")
        self._source = line(figure, [], [], "", COLOURS[0], points=True)
        self._regret.object = figure
        self._show_made()
        self.run("seeking the map", work.mapped, self.script(), ENDINGS, told=self.told, done=self.done)

    def _has_axes(self) -> bool:
        if not self.axes.values:
            self.work.say("axes = none: choose one or two", "bad")
        return bool(self.axes.values)

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
        self.draw()
        self._show_made()

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
        shown = {str(name): v for name, v in data.data_vars.items() if {*v.dims} <= {*AXES} and v.dtype.kind == "f"}
        for limit in self.limits.values:
            shown |= {f"{name} of {limit}": data[name].sel(limit=limit) for name in data if "limit" in data[name].dims}
        options = {name if " of " in name else f"{label_of(v).long_name or name} [{label_of(v).units}]": name
                   for name, v in shown.items()}  # fmt: skip
        if self.column.options != options:
            self.column.options = options
        name = self.column.value if self.column.value in shown else next(iter(shown))
        self._map.object = cells(shown[name])
        rows = [
            [str(one["visit"]), *(number(value) for value in {**one["at"], **one["inputs"]}.values()), number(one["j"]),
             number(one["regret"], ".3g")]
            for one in self.visited[-_LATEST:]
        ]  # fmt: skip
        if rows:
            last = self.visited[-1]
            heads = ("visit", *last["at"], *last["inputs"], "J [%]", "regret [%]")
            self._list.object = table(heads, rows, numbers=range(len(heads)))

    def sweep(self) -> None:
        """Make the map of the same engine in the conventional way."""
        if self._has_axes():
            self.run("sweeping", work.made_maps, self.sweep_script(), ENDINGS, done=self._made)

    def smooth(self) -> None:
        """Smooth the map that was sought."""
        lines = self._sought_lines()
        if lines:
            options = {"weight": self.weight.value, "tolerance": self.tolerance.value}
            smooth = Call("maps.smooth_map", (Named("sought"),), options)
            command = ("map", "smooth", "map.nc", *(f"--{name}={value!r}" for name, value in options.items()))
            script = Script((*lines, ("smooth", smooth)), command, ("smooth",))
            self.run("smoothing", work.made_maps, script, ENDINGS, done=self._made)

    def _made(self, made: dict[str, Any]) -> None:
        self.made |= made
        self._show_made()

    def _show_made(self) -> None:
        """Set the sweep's map and the smoothed one beside that of the search, and offer all files."""
        shown = {name: one for name, one in self.made.items() if name != "achieved"}
        self._beside.objects = [side_by_side(*(cells(one["cells"]["soc_cad"], name) for name, one in shown.items()))]
        said = ""
        if "achieved" in self.made:
            loss = self.made["achieved"]["loss"]
            said = text(f"swept: every cell at every {_STEP_CAD:g} °CA; the smoothed map loses at most "
                        f"{number(loss.max())} of the efficiency of its cell")  # fmt: skip
        self._beside_said.object = said
        files = {"map": self.found.get("files", {}), **{name: one["files"] for name, one in shown.items()}}
        self.saved.objects = [save(f"{stem}{ending}", content) for stem, own in files.items()
                              for ending, content in own.items()]  # fmt: skip

    def _sought_lines(self) -> tuple[tuple[str, Any], ...]:
        """Give the line that reads the map that was sought, none and a sentence where there is none."""
        if ".nc" not in self.found.get("files", {}):
            self.work.say("seek a map first, to its end", "bad")
            return ()
        folder = self.session.folder / "maps"
        folder.mkdir(exist_ok=True)
        (folder / "map.nc").write_bytes(self.found["files"][".nc"])
        return (("sought", Call("maps.read_map", (File(folder / "map.nc"),))),)

    def compare(self, name: str, content: bytes) -> None:
        """Subtract the map of a file from the one that was found."""
        lines, file = self._sought_lines(), self.take(name, content)
        if not lines or file is None:
            return
        lines = (("other", Call("maps.read_map", (File(file),))), *lines,
                 ("difference", Call("maps.compare_maps", (Named("other"), Named("sought")))))  # fmt: skip
        script = Script(lines, ("map", "diff", file_word(file.name), "map.nc"), ("difference",))

        def done(found: dict[str, Any]) -> None:
            data = found["difference"]
            largest, rms = (number(data[name]) for name in _COMPARED)
            said = f"largest difference {largest}, root mean square {rms} {label_of(data['difference']).units}"
            self._compared.object = text(said)
            self._map.object = cells(data["difference"])

        self.run(f"comparing with {file.name}", work.run, script, done=done, seconds=READ_S)


def _grid(spans: dict[str, Any]) -> dict[str, list[float]]:
    return {name: np.linspace(*span).tolist() for name, span in spans.items()}


def _over(spans: dict[str, Any]) -> list[str]:
    return [f"--over={name}={low!r}:{high!r}:{n}" for name, (low, high, n) in spans.items()]
