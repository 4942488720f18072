"""Search: seek the best inputs of a virtual engine, cycle by cycle, stopped and resumed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from mgdd.results.labels import named_label
from mgdd.rig.live.figures import COLOURS, with_legend
from mgdd.workbench import work
from mgdd.workbench.calls import Call, File, Named, Script
from mgdd.workbench.drop import dropper
from mgdd.workbench.forms import Form, Ranges
from mgdd.workbench.jobs import READ_S
from mgdd.workbench.parts import View, button, card, column, page, panel, pre, side, text
from mgdd.workbench.pictures import canvas, line, mark, side_by_side
from mgdd.workbench.session import MOST_FILE_MB, Session, file_word, words

INPUTS = {"soc_cad": (-20.0, 5.0), "egr": (0.0, 0.3), "intake_pressure_kpa": (120.0, 180.0)}
LIMITS = ("p_max_bar", "dp_max_bar_per_cad", "nox_true_ppm")
_SEEKERS = ("auto", "curve_seeking", "gaussian_process_seeking", "extremum_seeking", "spsa", "gradient_descent",
            "golden_section")  # fmt: skip
_PACES = {"as fast as it goes": 0.0, "20 cycles a second": 0.05, "5 cycles a second": 0.2}
_NO_GUIDE = "no guide"
_GUIDES = [_NO_GUIDE, "curve", "calibrated", "feed_forward"]


def engine_form(session: Session) -> Any:
    """Offer the engines as plants."""
    return panel().widgets.Select(label="virtual engine", options=session.engines, value="puma_single", width=180)


def bench_lines(
    session: Session, engine: str, inputs: Any, limits: Any, seed: int
) -> tuple[list[tuple[str, Any]], list[str]]:
    """Give the lines that make a virtual engine, and the words of the command."""
    own = session.point if engine == session.preset else {}
    point = Call("point.replace", of=Named("preset"), options=own) if own else Call(
        "point", of=Named("preset"), reads=True)  # fmt: skip
    lines: list[tuple[str, Any]] = [
        ("preset", Call("presets.load", (session.preset_of(engine),))),
        ("point", point),
        ("performance", Call("efficiency_only", of=Call("engine.Performance", reads=True))),
        ("bench", Call("loop.VirtualEngine", (Call("cylinder", of=Named("preset"), reads=True), Named("point")),
                       {"performance": Named("performance"), "nox_sensor": "none", "limits": list(limits),
                        "inputs": ["soc_cad", *(name for name in inputs if name != "soc_cad")], "seed": seed})),
    ]  # fmt: skip
    command = [f"--preset={file_word(engine)}", f"--seed={seed}", *words(own)]
    command += [f"--input={name}={low!r}:{high!r}" for name, (low, high) in inputs.items()]
    command += [f"--limit={name}={value!r}" for name, value in limits.items()]
    return lines, command


class Search(View):
    """The fifth page."""

    title = "Search"

    def __init__(self, session: Session) -> None:
        super().__init__(session, stops=True)
        widgets = panel().widgets
        self.engine = engine_form(session)
        self.inputs = Ranges("inputs", INPUTS, ["soc_cad"])
        self.limits = Form({name: (f"limit of {name}", "none") for name in LIMITS})
        self.seeker = widgets.Select(label="seeker", options=[*_SEEKERS], width=180)
        self.guide = widgets.Select(label="guide", options=_GUIDES, width=150)
        self.wall_heat = widgets.FloatInput(label="its wall heat [-], a model that is wrong", value=1.0, width=230)
        self.cycles = widgets.IntInput(label="cycles", value=200, start=1, width=110)
        self.seed = widgets.IntInput(label="seed", value=0, start=0, width=90)
        self.pace = widgets.Select(label="pace", options=_PACES, width=180)
        self.resume = button("Resume", self.go_on)
        self.resume.disabled = True
        self.found: dict[str, Any] = {}
        self._state: Any = None
        self._said, self._pictures = page(), column()
        self._sources: dict[str, Any] = {}
        self.total = 0
        self.done_cycles = self._first = 0  # first cycle of what runs now
        self.layout = column(
            page(text("A virtual engine: nothing here can drive a bench.", "quiet")),
            side(self.engine, self.seeker, self.guide, self.wall_heat, self.cycles, self.seed, self.pace),
            self.inputs.layout, self.limits.layout(), side(button("Seek", self.begin, first=True), self.resume),
            card("An experiment from a file (TOML, task = \"seek\"), or the record of a rig (REC)",
                 dropper(self.open, MOST_FILE_MB), collapsed=False),
            self.work.layout, self._said, self._pictures, self.same.layout,
        )  # fmt: skip

    def script(self) -> Script:
        """Write the work."""
        inputs, limits, seed = self.inputs.values, self.limits.values, int(self.seed.value)
        lines, command = bench_lines(self.session, self.engine.value, inputs, limits, seed)
        guide = None
        if self.guide.value != _NO_GUIDE:
            cylinder = Call("cylinder.replace", of=Named("preset"), options={"wall_heat_scale": self.wall_heat.value})
            options = {"cylinder": cylinder, "kind": self.guide.value, "performance": Named("performance")}
            lines.append(("guide", Call("loop.EngineGuide", (), options)))
            guide = Named("guide")
            command += [f"--guide={self.guide.value}", f"--guide-set=wall_heat_scale={self.wall_heat.value!r}"]
        options = {"seeker": self.seeker.value, "limits": limits, "cycles": int(self.cycles.value), "guide": guide,
                   "seed": seed}  # fmt: skip
        lines.append(("found", Call("loop.seek", (Named("bench"), inputs), options)))
        command += [f"--seeker={self.seeker.value}", f"--cycles={self.cycles.value}"]
        return Script(tuple(lines), ("engine", "seek", *command), ("found",))

    def begin(self) -> None:
        """Seek from the start."""
        self._state, self.total = None, int(self.cycles.value)
        self._prepare(list(self.inputs.values), self.limits.values)
        self._go(self.script())

    def go_on(self) -> None:
        """Seek on from where it was stopped."""
        if self._state is not None and self.same.script is not None:
            self.total = int(self.cycles.value)
            self._go(self.same.script)

    def _go(self, script: Script) -> None:
        self.resume.disabled = True
        rest = self.total - self.done_cycles
        self.run("seeking", work.sought, script, self.pace.value, self._state, max(rest, 1), told=self.told,
                 done=self.done)  # fmt: skip

    def open(self, name: str, content: bytes) -> None:
        """Run the experiment of a file, or draw what a rig has recorded."""
        file = self.take(name, content)
        if file is None:
            return
        self._state, self._said.object, self.resume.disabled = None, "", True
        if file.suffix == ".toml":
            load = Call("load", (File(file),), of=Call("rig.Experiment", reads=True))
            run = Call("rig.run_experiment", (Named("experiment"),), watched="watch")
            script = Script((("experiment", load), ("found", run)), ("rig", "run", file_word(file.name)), ("found",))
            self.run(f"running {name}", work.experimented, script, told=self.told, done=self.done)
        elif file.suffix == ".rec":
            read = Call("rig.read_record", (File(file),))
            script = Script((("found", read),), ("rig", "watch", file_word(file.name)), ("found",))
            self.run(f"reading {name}", work.recorded, script, told=self.told, done=self.done, seconds=READ_S)
        else:
            self.work.say(f"{name}: must be an experiment (.toml) or a record (.rec): drop one of these", "bad")

    def _prepare(self, inputs: Sequence[str], limits: Mapping[str, float | None]) -> None:
        """Make empty figures: J, every input, every limit."""
        self._sources, self.drawn_inputs, self.drawn_limits = {}, tuple(inputs), dict(limits)
        self.done_cycles = self._first = 0
        drawn = []
        names = [("j", "objective J, efficiency [%]")]
        names += [(name, _spoken(name)) for name in (*inputs, *limits)]
        for colour, (name, label) in zip(COLOURS * 2, names, strict=False):
            figure = canvas("cycle [-]", label)
            figure.height = 260
            self._sources[name] = line(figure, [], [], "reading" if name not in inputs else "asked", colour,
                                       points=True)  # fmt: skip
            if name in inputs:
                self._sources[f"estimate {name}"] = line(figure, [], [], "estimate", "#d55e00" if colour != "#d55e00"
                                                         else "#0072b2")  # fmt: skip
            if limits.get(name) is not None:
                mark(figure, "width", cast("float", limits[name]))
            drawn.append(with_legend(figure))
        self._pictures.objects = [side_by_side(*drawn)]

    def told(self, cycles: list[Any]) -> None:
        """Draw the cycles that were measured since the last look; a file first says what it has."""
        if cycles and isinstance(cycles[0], dict):
            self._prepare(cycles[0]["inputs"], cycles[0]["limits"])
            self.total = cycles[0]["cycles"]
            cycles = cycles[1:]
        at = np.arange(self.done_cycles, self.done_cycles + len(cycles))
        self.done_cycles += len(cycles)
        columns = {"j": [j for _, j, _ in cycles]}
        columns |= {name: [inputs.get(name) for inputs, _, _ in cycles] for name in self.drawn_inputs}
        columns |= {name: [limits.get(name) for _, _, limits in cycles] for name in self.drawn_limits}
        for name, values in columns.items():
            if name in self._sources:
                self._sources[name].stream({"x": at, "y": np.asarray(values, np.float64)})
        self.work.say(f"seeking: cycle {self.done_cycles} of {self.total or '?'}")

    def done(self, found: dict[str, Any]) -> None:
        """Show what was found, and the estimate over all cycles of this part."""
        self.found, self._state = found, found["state"]
        first, estimates = self._first, found["estimates"]
        self.done_cycles = self._first = first + found["cycles"]
        if found["interrupted"] and self._state is not None:
            self.work.say(f"stopped after {self.done_cycles} cycles: Resume goes on")
        for name, estimate in estimates.items():
            self._sources[f"estimate {name}"].stream({"x": np.arange(first, first + len(estimate)), "y": estimate})
        self.resume.disabled = self._state is None or self.done_cycles >= self.total
        self._said.object = pre(found["text"]) + "".join(text(each) for each in found["findings"])


def _spoken(name: str) -> str:
    label = named_label(name)
    long = label.long_name.strip() or name
    return f"{long} [{label.units}]"
