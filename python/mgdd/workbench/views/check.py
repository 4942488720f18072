"""Check: what speaks against a file, the cause, and the remedy, which a click applies and another takes back."""

from __future__ import annotations

from functools import partial
from html import escape
from typing import Any

from mgdd.workbench import work
from mgdd.workbench.parts import View, badge, button, column, number, page, panel, side, text
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


class Check(View):
    """The second page."""

    title = "Check"

    def __init__(self, files: Files) -> None:
        super().__init__(files.session)
        widgets, self.files = panel().widgets, files
        self._head, self._applied = page(), page()
        self._checks = column()
        self.unit = widgets.Select(
            label="pressure unit", options={"as the file says": "", **{one: one for one in UNITS}}, width=150
        )
        self.offset = widgets.FloatInput(label="angles too large by [°CA]", value=None, placeholder="0", width=190)
        self.speed = widgets.FloatInput(label="speed [rpm]", value=None, placeholder="of the point", width=150)
        self.own_speed = button("", self.take_speed)
        self.tdc = button("Estimate TDC and take it off", self.estimate)
        self.undo = button("Undo the last remedy", self.take_back)
        self.layout = column(
            self._head, self.work.layout, self._checks, page("<h2>Remedies</h2>"),
            side(self.unit, self.offset, self.speed, button("Apply", self.apply), self.own_speed, self.tdc, self.undo),
            self._applied, self.same.layout,
        )  # fmt: skip
        self.show()

    def apply(self) -> None:
        """Set unit, offset and speed."""
        self.remedy({"pressure_unit": self.unit.value or None, "tdc_offset_cad": self.offset.value or None,
                     "speed_rpm": self.speed.value})  # fmt: skip

    def take_speed(self) -> None:
        """Take the speed that the file gives."""
        self.remedy({"speed_rpm": self._speed_of_file})

    @property
    def _speed_of_file(self) -> float | None:
        """Speed that stands in the chosen file."""
        trace = None if self.files.file is None else self.files.file.trace
        return None if trace is None else trace.attrs.get("speed_rpm")

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
        if one is None or not self.session.preset:
            self.work.say("state the engine on the first page", "bad")
            return

        def done(found: dict[str, Any]) -> None:
            tdc = found["tdc"]
            before = one.options.get("tdc_offset_cad", 0.0)
            place = f"{tdc.tdc_offset_cad:+.2f} °CA, {tdc.low_cad:+.2f} to {tdc.high_cad:+.2f} possible"
            self.work.say(f"TDC offset {place}; {tdc.cost}")
            self.remedy({"tdc_offset_cad": before + tdc.tdc_offset_cad})

        self.work.begin("estimating TDC", work.run, self.session.tdc_script(one), done=done)

    def show(self) -> None:
        """Show the checks of the chosen file."""
        one = self.files.file
        self.undo.disabled = one is None or not one.before
        speed = self._speed_of_file
        in_force = None if one is None else one.options.get("speed_rpm", self.session.point.get("speed_rpm"))
        self.own_speed.visible = speed is not None and speed != in_force
        self.own_speed.label = f"Take the speed of the file, {number(speed)} rpm"
        if one is None:
            self._head.object, self._checks.objects = text("Drop a file on the first page.", "quiet"), []
            return
        self.same.show(self.session.check_script(one))
        self.unit.value = one.options.get("pressure_unit", "")
        self.offset.value, self.speed.value = (one.options.get(name) for name in ("tdc_offset_cad", "speed_rpm"))
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
        rows, together = list[Any](), ""
        for check in one.check.checks:
            together += _row(check)
            if check.verdict in ("doubt", "fail") and check.name in REMEDIES:
                cures = (button(name, partial(self.remedy, own)) for name, own in REMEDIES[check.name])
                rows += [page(together), side(*cures)]
                together = ""
        self._checks.objects = [*rows, page(together)]


def _row(check: Any) -> str:
    said = f" {escape(check.text)}" if check.text else ""
    cure = f"<br><span class=quiet>→ {escape(check.remedy)}</span>" if check.remedy else ""
    return f"<div class=check><b>{escape(check.name)}</b> {badge(check.verdict)}{said}{cure}</div>"
