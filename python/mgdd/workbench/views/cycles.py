"""Cycles: pressure, heat release, log p over log V, any figure from cycle to cycle, files over each other; saved."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from mgdd.results.labels import label_of
from mgdd.workbench import work
from mgdd.workbench.parts import View, button, column, page, panel, save, side, text
from mgdd.workbench.pictures import cycle_map, side_by_side, spectrum, traces
from mgdd.workbench.views.files import Files

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.workbench.session import Loaded

_FIRST = ("imep_net_bar", "imep_gross_bar", "imep_closed_bar", "p_max_bar", "ca50_cad", "mapo_bar")
_HEAT, _SPECTRUM = "heat_release_net_j_per_cad", "pressure_psd_bar2_per_khz"
_MOST_OVERLAID = 6  # colours that can be told apart


class Cycles(View):
    """The third page."""

    title = "Cycles"

    def __init__(self, files: Files) -> None:
        super().__init__(files.session)
        widgets, self.files = panel().widgets, files
        self._found: dict[str, tuple[str, xr.Dataset]] = {}  # by file: the command that made it, and the figures
        self.others = widgets.MultiChoice(label="drawn over it", options=[], width=300)
        self.others.param.watch(lambda _: self.analyze(), "value")
        self.figure = widgets.Select(label="from cycle to cycle", options=[], width=300)
        self.figure.param.watch(lambda _: self.draw(), "value")
        self.saved, self._pictures = panel().Row(), column()
        self._said = page(text("Drop a file and state the engine on the first page.", "quiet"))
        self.layout = column(
            side(button("Analyse", self.analyze, first=True), self.others, self.figure), self.work.layout, self._said,
            self._pictures,
            side(*(button(f"Make the {what}", partial(self.export, what)) for what in ("page", "figure", "table")),
                 self.saved),
            self.same.layout,
        )  # fmt: skip

    @property
    def ready(self) -> bool:
        """Whether there is a file that was read, and an engine."""
        return self.files.file is not None and self.files.file.check is not None

    @property
    def shown(self) -> dict[str, xr.Dataset]:
        """Figures of the chosen file and of those over it, the chosen one first."""
        names = [self.files.which.value, *self.others.value]
        return {name: self._found[name][1] for name in dict.fromkeys(names) if name in self._found}

    def show(self) -> None:
        """Follow the chosen file."""
        self.others.options = [name for name in self.session.files if name != self.files.which.value]
        if self.ready and self.files.file is not None:
            self.same.show(self.session.analyze_script(self.files.file))
            if self.files.which.value in self._found:
                self.draw()

    def analyze(self) -> None:
        """Analyse the chosen files that were not, as they are read now."""
        names = [self.files.which.value, *self.others.value[: _MOST_OVERLAID - 1]]
        files = self.session.files
        for name in names:
            one = files.get(name or "")
            if one is None or one.check is None:
                continue
            script = self.session.analyze_script(one)
            if self._found.get(name, ("",))[0] != script.shell:
                self._one(one, script)
                return
        self.draw()

    def _one(self, one: Loaded, script: Any) -> None:
        def done(found: Mapping[str, Any]) -> None:
            self._found[one.path.name] = (script.shell, found["figures"])
            self.analyze()

        self.work.begin(f"analysing {one.path.name}", work.analyzed, script, done=done)

    def draw(self) -> None:
        """Draw what was analysed."""
        shown = self.shown
        if not shown:
            return
        first = next(iter(shown.values()))
        known = [str(name) for name, v in first.data_vars.items() if v.dims == ("cycle",) and v.notnull().any()]
        names = [*(name for name in _FIRST if name in known), *(name for name in known if name not in _FIRST)]
        options = {f"{label_of(first[name]).long_name} [{label_of(first[name]).units}]": name for name in names}
        if self.figure.options != options:
            self.figure.options = options
        if self.figure.value not in names and names:
            self.figure.value = names[0]
        drawn = [traces(shown, name) for name in ("pressure_bar", _HEAT) if all(name in one for one in shown.values())]
        drawn.append(traces(shown, "pressure_bar", over="volume_l", log="xy"))
        if self.figure.value and all(self.figure.value in one for one in shown.values()):
            drawn.append(traces(shown, self.figure.value, over="cycle"))
        if all(_SPECTRUM in one for one in shown.values()):
            drawn.append(spectrum(shown))
        if "cycle" in first.dims:
            drawn += [cycle_map(first, name) for name in ("pressure_bar", _HEAT) if name in first]
        self._pictures.objects = [side_by_side(*drawn)]
        self._said.object = ""

    def export(self, what: str) -> None:
        """Make a page, a figure or a table of the chosen file, to be saved."""
        one = self.files.file
        if one is None or not self.ready:
            self.work.say("drop a file and state the engine on the first page", "bad")
            return
        stem = one.path.stem
        name = {"page": f"{stem}.html", "figure": f"{stem}.svg", "table": f"{stem}_cycles.csv"}[what]

        def done(content: bytes) -> None:
            self.saved.objects = [save(name, content)]

        scripts = self.session.check_script(one), self.session.analyze_script(one)
        self.work.begin(f"making {name}", work.exported, what, *scripts, self.session.preset, done=done)
