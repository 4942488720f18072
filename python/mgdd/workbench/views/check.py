"""Check: what speaks against a file, the cause, and the remedy, which a click applies and another takes back."""

from __future__ import annotations

from functools import partial
from html import escape
from typing import Any

from mgdd.workbench import work
from mgdd.workbench.parts import SameAs, Work, badge, button, column, page, panel, side, text
from mgdd.workbench.views.files import UNITS, Files

# By the check that asks for it: what stands on the button, and the options that it sets.
_TWO_POINT = ("Peg by two points", {"pegging": "two_point"})
_LEAST_SQUARES = ("Peg by least squares", {"pegging": "least_squares"})
REMEDIES: dict[str, tuple[tuple[str, dict[str, Any]], ...]] = {
    "level": (_TWO_POINT, _LEAST_SQUARES),
    "compression": (_TWO_POINT, _LEAST_SQUARES),
    "expansion": (_TWO_POINT,),
    "cycles": (_TWO_POINT,),
    "gas exchange": (_TWO_POINT,),
}


class Check:
    """The second page."""

    title = "Check"

    def __init__(self, files: Files) -> None:
        widgets = panel().widgets
        self.files, self.work, self.same = files, Work(), SameAs()
        self._head, self._applied = page(), page()
        self._checks = column()
        self.unit = widgets.Select(
            label="pressure unit", options={"as the file says": "", **{one: one for one in UNITS}}, width=150
        )
        self.offset = widgets.FloatInput(label="angles too large by [°CA]", value=None, placeholder="0", width=190)
        self.speed = widgets.FloatInput(label="speed [rpm]", value=None, placeholder="guessed", width=150)
        self.tdc = button("Estimate TDC and take it off", self.estimate)
        self.undo = button("Undo the last remedy", self.take_back)
        self.layout = column(
            self._head, self.work.layout, self._checks, page("<h2>Remedies</h2>"),
            side(self.unit, self.offset, self.speed, button("Apply", self.apply), self.tdc, self.undo),
            self._applied, self.same.layout,
        )  # fmt: skip
        self.show()

    def apply(self) -> None:
        """Set unit, offset and speed."""
        one = self.files.file
        if one is None:
            return
        one.remedy({"pressure_unit": self.unit.value or None, "tdc_offset_cad": self.offset.value or None})
        if self.speed.value is not None:
            self.files.point.widgets["speed_rpm"].value = self.speed.value
            self.files.session.point = self.files.point.values
        self.files.read(one)

    def remedy(self, options: dict[str, Any]) -> None:
        """Apply the remedy of a check."""
        one = self.files.file
        if one is not None:
            one.remedy(options)
            self.files.read(one)

    def take_back(self) -> None:
        """Undo the last remedy."""
        one = self.files.file
        if one is not None and one.before:
            one.undo()
            self.files.read(one)

    def estimate(self) -> None:
        """Estimate TDC by a scan of the angle, and take it off."""
        one = self.files.file
        if one is None or not self.files.session.preset:
            self.work.say("state the engine on the first page", "bad")
            return

        def done(found: dict[str, Any]) -> None:
            tdc = found["tdc"]
            before = one.options.get("tdc_offset_cad", 0.0)
            place = f"{tdc.tdc_offset_cad:+.2f} °CA, {tdc.low_cad:+.2f} to {tdc.high_cad:+.2f} possible"
            self.work.say(f"TDC offset {place}; {tdc.cost}")
            self.remedy({"tdc_offset_cad": before + tdc.tdc_offset_cad})

        self.work.begin("estimating TDC", work.run, self.files.session.tdc_script(one), done=done)

    def show(self) -> None:
        """Show the checks of the chosen file."""
        one = self.files.file
        self.undo.disabled = one is None or not one.before
        if one is None:
            self._head.object, self._checks.objects = text("Drop a file on the first page.", "quiet"), []
            return
        self.same.show(self.files.session.check_script(one))
        self.unit.value = one.options.get("pressure_unit", "")
        self.offset.value = one.options.get("tdc_offset_cad")
        options = ", ".join(f"{name} = {value}" for name, value in one.options.items())
        self._applied.object = text(f"in force: {options}" if options else "in force: what the file says", "quiet")
        if one.check is None:
            why = one.error or "no engine is stated: nothing is judged"
            self._head.object = f"<h2>{escape(one.path.name)}</h2>" + text(why, "bad")
            self._checks.objects = []
            return
        self._head.object = f"<h2>{escape(one.path.name)} {badge(one.check.verdict)}</h2>" + text(
            f"{one.check.made} of {len(one.check.checks)} checks made", "quiet"
        )
        self._checks.objects = [self._row(each) for each in one.check.checks]

    def _row(self, check: Any) -> Any:
        said = f" {escape(check.text)}" if check.text else ""
        cure = f"<br><span class=quiet>→ {escape(check.remedy)}</span>" if check.remedy else ""
        shown = page(f"<div class=check><b>{escape(check.name)}</b> {badge(check.verdict)}{said}{cure}</div>")
        if check.verdict not in ("doubt", "fail") or check.name not in REMEDIES:
            return shown
        return column(shown, side(*(button(name, partial(self.remedy, own)) for name, own in REMEDIES[check.name])))
