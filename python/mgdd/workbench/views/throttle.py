"""Throttle: drop a log, identify a model, look at its residuals, tune and compare controllers, and export one."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

from mgdd.workbench import work
from mgdd.workbench.calls import Call, File, Named, Script
from mgdd.workbench.drop import dropper
from mgdd.workbench.jobs import READ_S
from mgdd.workbench.parts import (
    View,
    button,
    column,
    number,
    page,
    panel,
    pre,
    save,
    side,
    table,
    text,
)
from mgdd.workbench.pictures import GREY, axis_text, line, runs, side_by_side, traces
from mgdd.workbench.session import MOST_FILE_MB, Session, file_word

KINDS = ("guided", "pid", "sliding_mode", "linear_mpc", "nmpc")
_MODELS = ("auto", "first_principle", "pw_r", "pw_w", "pw_p")
_FIGURES = ("settling_ms", "overshoot_deg", "static_error_deg", "rms_error_deg", "mse_deg2")


class Throttle(View):
    """The seventh page."""

    title = "Throttle"

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        widgets = panel().widgets
        self.log: Path | None = None
        self.numbers: dict[str, dict[str, float]] = {}  # of controllers that were tuned
        self.found: dict[str, Any] = {}
        self.runs: dict[str, Any] = {}
        self.drop = dropper(self.read, MOST_FILE_MB)
        self.model = widgets.Select(label="model", options=[*_MODELS], width=160)
        self.preset = widgets.Select(label="throttle", options=["P1", "P2", "P3"], width=120)
        self.kinds = widgets.MultiChoice(label="controllers", options=[*KINDS], value=["guided", "pid"], width=300)
        self.reference = widgets.TextInput(label="reference", value="step:40:42", width=160)
        self.kind = widgets.Select(label="tune or export", options=[*KINDS], value="pid", width=150)
        self.budget = widgets.IntInput(label="runs of the tuner", value=60, start=30, end=2000, width=130)
        self._fit, self._figures, self._tuned = page(), page(), page()
        self.saved, self._drawn, self._tracks = side(), column(), column()
        self.layout = column(
            page("<h2>Identify</h2>" + text("Drop a log with time, duty and angle.", "quiet")), self.drop,
            side(self.model, button("Identify", self.identify, first=True)), self.work.layout, self._fit, self._drawn,
            page("<h2>Controllers on the virtual throttle</h2>"),
            side(self.preset, self.kinds, self.reference, button("Compare", self.track, first=True)), self._figures,
            self._tracks,
            side(self.kind, self.budget, button("Tune", self.tuned), button("Export as C++", self.exported)),
            self._tuned, self.saved, self.same.layout,
        )  # fmt: skip

    def read(self, name: str, content: bytes) -> None:
        """Read a log, and draw it."""
        file = self.take(name, content)
        if file is None:
            return
        self.log = file
        script = Script((("log", Call("io.read_throttle_log", (File(file),))),), (), ("log",))

        def done(found: dict[str, Any]) -> None:
            self._drawn.objects = self._pair(found["log"], ["angle_deg"], ["duty"])

        self.work.begin(f"reading {name}", work.run, script, done=done, seconds=READ_S)

    def _pair(self, data: Any, *groups: list[str]) -> list[Any]:
        every = -(-data.sizes["time_s"] // work.MOST_POINTS)
        thin = data.isel(time_s=slice(None, None, every))
        return [side_by_side(*(runs(thin, names) for names in groups))]

    def fit_script(self, file: Path) -> Script:
        """Write the identification."""
        lines = (
            ("log", Call("io.read_throttle_log", (File(file),))),
            ("fit", Call("identify.identify_throttle", (Named("log"), self.model.value))),
            ("validation", Call("identify.validate_throttle", (Named("fit"), Named("log")))),
        )
        command = ("throttle", "identify", file_word(file.name), f"--model={self.model.value}")
        return Script(lines, command, ("fit", "validation"))

    def identify(self) -> None:
        """Fit a model to the log."""
        if self.log is None:
            self.work.say("drop a log first", "bad")
            return
        script = self.fit_script(self.log)

        def done(found: dict[str, Any]) -> None:
            self.found = found
            self._fit.object = pre(found["text"])
            self._drawn.objects = self._pair(found["run"], ["angle_deg", "model_deg"], ["residual_deg"])
            self.saved.objects = [save("fit.toml", found["toml"].encode())]

        self.run("identifying", work.identified, script, done=done)

    def _controller(self, kind: str) -> tuple[tuple[str, Any], ...]:
        throttle = Call("throttle", of=Call("presets.load", (self.preset.value,)), reads=True)
        options = {"numbers": self.numbers.get(f"{kind} {self.preset.value}"), "delay_samples": 1}
        return ("throttle", throttle), ("controller", Call("loop.tuned_controller", (kind, Named("throttle")), options))

    def track_script(self, kind: str) -> Script:
        """Write one run."""
        options = {"throttle": Named("throttle"), "delay_samples": 1}
        run = Call("loop.track", (Named("controller"), self.reference.value), options)
        command: tuple[str, ...] = (
            "throttle", "track", f"--controller={kind}", f"--preset={self.preset.value}",
            f"--reference={self.reference.value}", "--delay-samples=1",
        )  # fmt: skip
        if f"{kind} {self.preset.value}" in self.numbers:
            command = (*command, f"--numbers={kind}.json")
        return Script((*self._controller(kind), ("run", run)), command, ("run",))

    def track(self) -> None:
        """Run the chosen controllers along the reference."""
        scripts = {kind: self.track_script(kind) for kind in self.kinds.value}
        if not scripts:
            self.work.say("choose a controller", "bad")
            return
        self.same.show(next(iter(scripts.values())))
        self.work.begin("running", work.tracked, scripts, done=self.compared)

    def compared(self, found: dict[str, Any]) -> None:
        """Set the runs beside each other."""
        self.runs = found
        first = next(iter(found.values()))
        names = [name for name in _FIGURES if name in first]
        heads = ("controller", *(axis_text(first[name], name) for name in names))
        rows = [[escape(kind), *(number(run[name].item()) for name in names)] for kind, run in found.items()]
        self._figures.object = table(heads, rows, numbers=range(1, len(heads)))
        angle, duty = (traces(found, name, over="time_s") for name in ("angle_deg", "duty"))
        line(angle, first["time_s"], first["reference_deg"], "reference", GREY, dash="dashed")
        self._tracks.objects = [side_by_side(angle, duty)]

    def tuned(self) -> None:
        """Tune a controller for throttles around the preset."""
        kind = self.kind.value
        throttle = Call("throttle", of=Call("presets.load", (self.preset.value,)), reads=True)
        tuning = Call("loop.tune_controller", (kind, throttle), {"budget": int(self.budget.value)})
        command = ("throttle", "tune", f"--controller={kind}", f"--preset={self.preset.value}",
                   f"--budget={self.budget.value}")  # fmt: skip
        script = Script((("tuning", tuning),), command, ("tuning",))

        def done(found: dict[str, Any]) -> None:
            self.numbers[f"{kind} {self.preset.value}"] = found["numbers"]
            costs = f"{number(found['start_cost'])} → {number(found['cost'])}"
            said = f"{kind}: cost {costs} in {found['evaluations']} runs"
            rows = [[escape(name), number(value)] for name, value in found["numbers"].items()]
            self._tuned.object = text(said) + table(("number", "tuned"), rows, numbers=(1,))

        self.run(f"tuning {kind}", work.tuned, script, done=done)

    def exported(self) -> None:
        """Write a controller as C++."""
        kind = self.kind.value
        made = Call("loop.export_controller", (Named("controller"), "controller"),
                    {"throttle": Named("throttle"), "delay_samples": 1})  # fmt: skip
        command = ("throttle", "export", kind, f"--preset={self.preset.value}", "--delay-samples=1", "-o", "controller")
        script = Script((*self._controller(kind), ("run", made)), command, ("run",))

        def done(content: bytes) -> None:
            self.saved.objects = [save(f"{kind}.zip", content)]

        self.run(f"writing {kind} as C++", work.controller_files, script, done=done)
