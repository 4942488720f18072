"""Forms: fields with units, limits as sliders, and ranges of what is chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mgdd.workbench.parts import column, panel, side


class Form:
    """Fields of numbers and choices; one that is left empty keeps what its placeholder shows.

    Parameters
    ----------
    fields : mapping of str to (str, str)
        Label with unit by name, and what holds where it is empty.
    choices : mapping of str to mapping of str to object
        Options of a field that is chosen.
    """

    def __init__(
        self, fields: Mapping[str, tuple[str, str]], choices: Mapping[str, Mapping[str, Any]] | None = None
    ) -> None:
        widgets, choices = panel().widgets, choices or {}
        self.widgets: dict[str, Any] = {}
        for name, (label, placeholder) in fields.items():
            if name in choices:
                made = widgets.Select(label=label, options=dict(choices[name]), width=200)
            elif placeholder.startswith("text"):
                made = widgets.TextInput(label=label, placeholder=placeholder.removeprefix("text").strip(), width=200)
            else:
                made = widgets.FloatInput(label=label, value=None, placeholder=placeholder, width=200)
            self.widgets[name] = made

    @property
    def values(self) -> dict[str, Any]:
        """What was given, by name; a text of digits is a number, of a column."""
        given = {name: widget.value for name, widget in self.widgets.items()}
        return {
            name: int(value) if str(value).isdigit() else value
            for name, value in given.items()
            if value not in (None, "")
        }

    def show(self, values: Mapping[str, Any]) -> None:
        """Write values into the fields; the others are empty."""
        for name, widget in self.widgets.items():
            widget.value = values.get(name) if hasattr(widget, "step") else str(values.get(name, ""))

    def hint(self, placeholders: Mapping[str, str]) -> None:
        """Show what holds where nothing is given."""
        for name, hint in placeholders.items():
            self.widgets[name].placeholder = hint

    def layout(self) -> Any:
        """Set the fields side by side, as many as fit."""
        return side(*self.widgets.values())


class Sliders:
    """Upper limits as sliders, by name with label and end; one at 0 limits nothing."""

    def __init__(self, limits: Mapping[str, tuple[str, float]]) -> None:
        slider = panel().widgets.EditableFloatSlider
        self.widgets = {
            name: slider(label=f"{label}; 0: none", start=0.0, end=end, step=end / 400.0, value=0.0, width=280)
            for name, (label, end) in limits.items()
        }

    @property
    def values(self) -> dict[str, float]:
        """Limits that are set, by name."""
        return {name: float(widget.value) for name, widget in self.widgets.items() if widget.value > 0.0}


class Ranges:
    """Ends of the inputs or axes that are chosen, of axes with a number of points behind them.

    Parameters
    ----------
    label : str
        Of the choice.
    choices : mapping of str to tuple
        Ends by name, and of axes the number of points.
    chosen : sequence of str
        Names at first.
    most : int, optional
        Of names.
    """

    def __init__(
        self, label: str, choices: Mapping[str, tuple[float, ...]], chosen: Sequence[str], most: int | None = None
    ) -> None:
        widgets = panel().widgets
        self.which = widgets.MultiChoice(label=label, options=[*choices], value=[*chosen], max_items=most, width=300)
        self.ends = {
            name: [widgets.FloatInput(label=f"{name} {end}", value=value, width=175)
                   for end, value in zip(("from", "to"), ends, strict=False)]
            + [widgets.IntInput(label=f"{name} points", value=n, start=2, end=12, width=175) for n in ends[2:]]
            for name, ends in choices.items()
        }  # fmt: skip
        self._shown = side()
        self.which.param.watch(lambda _: self.show(), "value")
        self.layout = column(self.which, self._shown)
        self.show()

    def show(self) -> None:
        """Show the ends of what is chosen."""
        self._shown.objects = [field for name in self.which.value for field in self.ends[name]]

    @property
    def values(self) -> dict[str, tuple[Any, ...]]:
        """Ends by name of what is chosen."""
        return {name: tuple(field.value for field in self.ends[name]) for name in self.which.value}
