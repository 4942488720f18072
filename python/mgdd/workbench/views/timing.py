"""Best timing: calibrate the loaded traces, and the range of what all plausible models answer."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from typing import Any

from mgdd import presets
from mgdd.errors import ParameterError
from mgdd.rig.live.figures import COLOURS, with_legend
from mgdd.workbench import work
from mgdd.workbench.calls import Call, Named, Script
from mgdd.workbench.forms import Sliders
from mgdd.workbench.parts import View, button, column, number, page, panel, side, table, text
from mgdd.workbench.pictures import canvas, line, mark, side_by_side
from mgdd.workbench.session import MEAN, file_word, words
from mgdd.workbench.views.files import Files

_LIMITS = {"p_max_bar": ("p_max at most [bar]", 400.0), "dp_max_bar_per_cad": ("dp_max at most [bar/°CA]", 30.0)}
_OPEN = {"not determined": "no direction is determined", "earlier": "earlier", "later": "later"}
_EMPTY = "Drop traces and state the engine on the first page."


class Timing(View):
    """The fourth page."""

    title = "Best timing"

    def __init__(self, files: Files) -> None:
        super().__init__(files.session)
        widgets, self.files = panel().widgets, files
        self.rows: list[dict[str, Any]] = []
        self.traces = widgets.MultiChoice(label="traces, all of one engine", options=[], width=300)
        self.limits = Sliders(_LIMITS)
        self._answers = page(text(_EMPTY, "quiet"))
        self._picture = column()
        start = button("Calibrate", self.calibrate, first=True)
        self.layout = column(
            side(self.traces, *self.limits.widgets.values(), start), self.work.layout, self._answers, self._picture,
            self.same.layout,
        )  # fmt: skip

    def show(self) -> None:
        """Offer the files that were read."""
        names = [name for name, one in self.session.files.items() if one.check is not None]
        if self.traces.options != names:
            before = self.traces.options
            self.traces.options = names
            if not self.rows:
                self._answers.object = "" if names else text(_EMPTY, "quiet")
            if not self.traces.value or self.traces.value == before:
                self.traces.value = names

    def script(self) -> Script:
        """Write the work: all traces are read in the same way, as the command does."""
        session = self.session
        chosen = [session.files[name] for name in self.traces.value]
        lines = list(session.engine_lines(chosen[0]))
        named = []
        for k, one in enumerate(chosen, 1):
            lines.append((f"trace_{k}", session.trace_line(one)))
            if one.trace is not None and "cycle" in one.trace.dims:
                lines.append((f"trace_{k}", replace(MEAN, of=Named(f"trace_{k}"))))
            named.append(Named(f"trace_{k}"))
        limits = self.limits.values
        fuel_mg = session.point.get("fuel_mg")
        heat = None
        if fuel_mg is not None:
            cylinder = presets.load(session.preset_file).cylinder.replace(**session.cylinder)
            heat = fuel_mg * cylinder.lower_heating_value_mj_per_kg
        options = {"point": Named("point"), "limits": limits, "fuel_heat_j": heat, **chosen[0].pegging}
        lines.append(("rows", Call("identify.best_timing", (named, Named("cylinder")), options, watched="progress")))
        command = (
            "engine", "optimum", *(file_word(name) for name in self.traces.value), "--mean-cycle",
            *session.engine_words(), *words(chosen[0].options),
            *(f"--limit={name}={value!r}" for name, value in limits.items()),
        )  # fmt: skip
        return Script(tuple(lines), command, ("rows",))

    def calibrate(self) -> None:
        """Begin, with progress and a button that cancels."""
        files = self.session.files
        if not self.traces.value or not self.session.preset:
            self.work.say("drop traces and state the engine on the first page", "bad")
            return
        first = files[self.traces.value[0]]
        other = [name for name in self.traces.value if files[name].options != first.options]
        if other:
            names = ", ".join(other)
            self.work.say(f"{names}: read or pegged otherwise than {first.path.name}: take them apart", "bad")
            return
        try:
            script = self.script()
        except ParameterError as error:  # a geometry that is none
            self.work.say(str(error), "bad")
            return
        self.run("calibrating; about a minute", work.timed, script, done=self.answer)

    def answer(self, rows: list[dict[str, Any]]) -> None:
        """Show the range over the plausible models."""
        self.rows = rows
        body = []
        for row in rows:
            best = row["best"]
            name = escape(best["name"]) if best else "<span class=bad>no plausible model</span>"
            if best is None:
                body.append([escape(row["file"]), name, "–", "–", "–", "–"])
                continue
            body.append([
                escape(row["file"]), name, number(best["fitted_ca50_cad"], ".1f"), _range(row["ca50_cad"]),
                _range(row["free_ca50_cad"]), f"{_OPEN[row['free_direction']]}; {_range(row['free_gain_percent'])}",
            ])  # fmt: skip
        heads = ("trace", "best model", "CA50 now [°CA aTDC]", "best, own p_max kept", "best, limits only", "gain [%]")
        note = text("Ranges are over all plausible models: what the traces leave open. Angles are °CA aTDC.", "quiet")
        self._answers.object = table(heads, body, numbers=(2,)) + note
        self._picture.objects = [side_by_side(*(self._drawn(row) for row in rows if row["best"]))]

    def _drawn(self, row: dict[str, Any]) -> Any:
        """Set every plausible model's answer beside the measured timing."""
        members = [member for member in row["members"] if member["plausible"]]
        figure = canvas("best CA50, limits only [°CA aTDC]", "gain over the measured timing [%]", title=row["file"])
        groups = sorted({member["wall_heat_model"] for member in members})
        for colour, group in zip(COLOURS, groups, strict=False):
            own = [member for member in members if member["wall_heat_model"] == group]
            best, gain = ([one[name] for one in own] for name in ("free_ca50_cad", "free_gain_percent"))
            line(figure, best, gain, group, colour, points=True)
        mark(figure, "height", row["best"]["fitted_ca50_cad"])
        return with_legend(figure)


def _range(pair: list[float]) -> str:
    return f"{number(pair[0], '.1f')} to {number(pair[1], '.1f')}"
