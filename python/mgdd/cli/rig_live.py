"""The live view of a run in a terminal: what was asked, applied and measured last, and how far the run is."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from mgdd.rig.experiment.stand import Cycle

__all__ = ["LiveView"]

_REFRESH_S = 0.125
_BAR = 30  # characters


class LiveView:
    """A table that follows a run; it leaves the terminal as it was.

    Parameters
    ----------
    title : str
        What runs.
    cycles : int
        How many there will be.
    console : rich.console.Console, optional
        Where to draw; standard output if left out.
    """

    def __init__(self, title: str, cycles: int, *, console: Any = None) -> None:
        from rich.console import Console
        from rich.live import Live

        self._title, self._cycles = title, cycles
        self._live = Live(console=console or Console(), auto_refresh=False, transient=True)
        self._begun = self._drawn = time.monotonic()

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def __call__(self, cycle: Cycle) -> None:
        """Take a cycle; it is drawn if the last one was drawn long enough ago."""
        now = time.monotonic()
        if now - self._drawn >= _REFRESH_S or cycle.number + 1 == self._cycles:
            self._drawn = now
            self._live.update(self._table(cycle, now - self._begun), refresh=True)

    def _table(self, cycle: Cycle, elapsed_s: float) -> Any:
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        bar = "█" * round((cycle.number + 1) / max(self._cycles, 1) * _BAR)
        table = Table(box=None, pad_edge=False, show_header=False)
        for justify in ("left", "right", "left"):
            table.add_column(justify=justify)
        for kind, values in (
            ("asked", cycle.asked), ("applied", cycle.measured.applied), ("limit", cycle.measured.limits),
            ("measured", cycle.measured.values),
        ):  # fmt: skip
            _add(table, kind, values)
        head = Text(f"{self._title}  {elapsed_s:.1f} s", style="bold")
        return Group(head, table, Text(f"{bar:░<{_BAR}} {cycle.number + 1} of {self._cycles}"))


def _add(table: Any, kind: str, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        table.add_row(name, f"{value:.4g}", kind)
