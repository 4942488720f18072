"""Search: seek the best inputs of a virtual engine, cycle by cycle, stopped and resumed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.labels import named_label
from mgdd.workbench import work
from mgdd.workbench.calls import Call, Named, Script
from mgdd.workbench.parts import Form, SameAs, Work, button, column, page, panel, pre, side, text
from mgdd.workbench.pictures import COLOURS, canvas, line, mark, side_by_side, with_legend
from mgdd.workbench.session import Session, engines

if TYPE_CHECKING:
    import xarray as xr

INPUTS = {"soc_cad": (-20.0, 5.0), "egr": (0.0, 0.3), "intake_pressure_kpa": (120.0, 180.0)}
LIMITS = ("p_max_bar", "dp_max_bar_per_cad", "nox_true_ppm")
_SEEKERS = ("auto", "curve_seeking", "gaussian_process_seeking", "extremum_seeking", "spsa", "gradient_descent",
            "golden_section")  # fmt: skip
_PACES = {"as fast as it goes": 0.0, "20 cycles a second": 0.05, "5 cycles a second": 0.2}
_NO_GUIDE = "no guide"
_GUIDES = [_NO_GUIDE, "curve", "calibrated", "feed_forward"]


def engine_form(session: Session) -> Any:
    """Offer the engines as plants."""
    return panel().widgets.Select(label="virtual engine", options=engines(), value=session.preset or "puma_single",
                                  width=180)  # fmt: skip


class Bounds:
    """Inputs with their bounds, by mouse."""

    def __init__(self, choices: Mapping[str, tuple[float, float]], least: str) -> None:
        widgets = panel().widgets
        self.which = widgets.MultiChoice(label="inputs", options=[*choices], value=[least], width=300)
        self.ends: dict[str, tuple[Any, ...]] = {}
        for name, ends in choices.items():
            self.ends[name] = tuple(
                widgets.FloatInput(label=f"{name} {end}", value=value, width=190)
                for end, value in zip(("from", "to"), ends, strict=True)
            )
        self._shown = side()
        self.which.param.watch(lambda _: self.show(), "value")
        self.layout = column(self.which, self._shown)
        self.show()

    def show(self) -> None:
        """Show the bounds of the chosen inputs."""
        self._shown.objects = [field for name in self.which.value for field in self.ends[name]]

    @property
    def values(self) -> dict[str, tuple[float, float]]:
        """Bounds by input."""
        return {name: tuple(field.value for field in self.ends[name]) for name in self.which.value}


def bench_lines(
    session: Session, engine: str, inputs: Any, limits: Any, seed: int
) -> tuple[list[tuple[str, Any]], list[str]]:
    """Give the lines that make a virtual engine, and the words of the command."""
    own = session.point if engine == session.preset else {}
    point = Call("point.replace", of=Named("preset"), options=own) if own else Call(
        "point", of=Named("preset"), reads=True)  # fmt: skip
    lines: list[tuple[str, Any]] = [
        ("preset", Call("presets.load", (engine,))),
        ("point", point),
        ("performance", Call("efficiency_only", of=Call("engine.Performance", reads=True))),
        ("bench", Call("loop.VirtualEngine", (Call("cylinder", of=Named("preset"), reads=True), Named("point")),
                       {"performance": Named("performance"), "nox_sensor": "none", "limits": list(limits),
                        "inputs": ["soc_cad", *(name for name in inputs if name != "soc_cad")], "seed": seed})),
    ]  # fmt: skip
    command = [f"--preset={engine}", f"--seed={seed}", *(f"--{k.replace('_', '-')}={v!r}" for k, v in own.items())]
    command += [f"--input={name}={low!r}:{high!r}" for name, (low, high) in inputs.items()]
    command += [f"--limit={name}={value!r}" for name, value in limits.items()]
    return lines, command


class Search:
    """The fifth page."""

    title = "Search"

    def __init__(self, session: Session) -> None:
        widgets = panel().widgets
        self.session, self.work, self.same = session, Work(stops=True), SameAs()
        self.engine = engine_form(session)
        self.inputs = Bounds(INPUTS, "soc_cad")
        self.limits = Form({name: (f"limit of {name}", "none") for name in LIMITS})
        self.seeker = widgets.Select(label="seeker", options=[*_SEEKERS], width=180)
        self.guide = widgets.Select(
            label="guide", options=[_NO_GUIDE, "curve", "calibrated", "feed_forward"], width=150
        )
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
        self.done_cycles = self._first = 0  # first cycle of what runs now
        self.layout = column(
            page(text("A virtual engine: nothing here can drive a bench.", "quiet")),
            side(self.engine, self.seeker, self.guide, self.wall_heat, self.cycles, self.seed, self.pace),
            self.inputs.layout, self.limits.layout(), side(button("Seek", self.begin, first=True), self.resume),
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
        script = self.script()
        self.same.show(script)
        self._state, self.done_cycles, self._first = None, 0, 0
        self._prepare()
        self._run(script)

    def go_on(self) -> None:
        """Seek on from where it was stopped."""
        if self._state is not None and self.same.script is not None:
            self._run(self.same.script)

    def _run(self, script: Script) -> None:
        self.resume.disabled = True
        rest = int(self.cycles.value) - self.done_cycles
        self.work.begin("seeking", work.sought, script, self.pace.value, self._state, max(rest, 1), told=self.told,
                        done=self.done)  # fmt: skip

    def _prepare(self) -> None:
        """Make empty figures: J, every input, every limit."""
        self._sources = {}
        drawn = []
        names = [("j", "objective J, efficiency [%]")]
        names += [(name, _spoken(name)) for name in (*self.inputs.values, *self.limits.values)]
        for colour, (name, label) in zip(COLOURS * 2, names, strict=False):
            figure = canvas("cycle [-]", label)
            figure.height = 260
            self._sources[name] = line(figure, [], [], "reading" if name not in self.inputs.values else "asked", colour,
                                       points=True)  # fmt: skip
            if name in self.inputs.values:
                self._sources[f"estimate {name}"] = line(figure, [], [], "estimate", "#d55e00" if colour != "#d55e00"
                                                         else "#0072b2")  # fmt: skip
            if name in self.limits.values:
                mark(figure, "width", self.limits.values[name])
            drawn.append(with_legend(figure))
        self._pictures.objects = [side_by_side(*drawn)]

    def told(self, cycles: list[Any]) -> None:
        """Draw the cycles that were measured since the last look."""
        at = np.arange(self.done_cycles, self.done_cycles + len(cycles))
        self.done_cycles += len(cycles)
        columns = {"j": [j for _, j, _ in cycles]}
        columns |= {name: [inputs.get(name) for inputs, _, _ in cycles] for name in self.inputs.values}
        columns |= {name: [limits.get(name) for _, _, limits in cycles] for name in self.limits.values}
        for name, values in columns.items():
            if name in self._sources:
                self._sources[name].stream({"x": at, "y": np.asarray(values, np.float64)})
        self.work.say(f"seeking: cycle {self.done_cycles} of {self.cycles.value}")

    def done(self, found: dict[str, Any]) -> None:
        """Show what was found, and the estimate over all cycles of this part."""
        self.found, self._state = found, found["state"]
        data: xr.Dataset = found["dataset"]
        first = self._first
        self.done_cycles = self._first = first + data.sizes["cycle"]
        if found["result"]["interrupted"]:
            self.work.say(f"stopped after {self.done_cycles} cycles: Resume goes on")
        for name in self.inputs.values:
            estimate = np.asarray(data["estimate"].sel(input=name))
            self._sources[f"estimate {name}"].stream({"x": np.arange(first, first + len(estimate)), "y": estimate})
        self.resume.disabled = self.done_cycles >= int(self.cycles.value)
        self._said.object = pre(found["text"]) + "".join(text(each) for each in found["findings"])


def _spoken(name: str) -> str:
    label = named_label(name)
    long = label.long_name.strip() or name
    return f"{long} [{label.units}]"
