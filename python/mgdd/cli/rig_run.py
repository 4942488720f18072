"""`mgdd rig run | check`: an experiment from a file, with a live view in a terminal, and what it would do."""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from mgdd.cli.from_library import Options
from mgdd.cli.options import option, refuse_idle
from mgdd.cli.output import emit, lines, warn, wrote
from mgdd.cli.progress import Stopped, is_terminal
from mgdd.rig import CanRig, Experiment, run_experiment
from mgdd.rig.can.can_rig import MODES
from mgdd.rig.experiment import CheckedExperiment, ExperimentResult, check_experiment

if TYPE_CHECKING:
    from mgdd.rig.experiment.stand import Cycle


_WHERE = Options(Experiment.with_mode, "connection", "pace", "record")
_ARMED = Options(run_experiment, "arm", "key_file")


def _add_run(parser: Any) -> None:
    _add_experiment(parser)
    option(parser, "--folder DIR",
           "new folder for record, signals, timing, result and figures (default: mgdd-runs/TASK-MODE-TIME)",
    )  # fmt: skip
    _ARMED.add(parser)


def _add_experiment(parser: argparse.ArgumentParser) -> None:
    option(parser, "file EXPERIMENT.toml", "what to do; the page Experiments lists its keys")
    option(parser, "--mode", "instead of the mode of the file", choices=MODES)
    _WHERE.add(parser)


def _checked(args: argparse.Namespace) -> CheckedExperiment:
    experiment = Experiment.load(args.file)
    mode = args.mode or experiment.mode
    if mode in ("simulate", "replay"):
        refuse_idle(args, "connection", "pace", why=f"mode = {mode!r} has no bus")
    if mode != "replay":
        refuse_idle(args, "record", why=f"mode = {mode!r} replays nothing")
    return check_experiment(experiment.with_mode(mode, **_WHERE.given(args)))


def _run(args: argparse.Namespace) -> None:
    checked = _checked(args)
    warn(*checked.to_dict().get("warnings", []))
    experiment = checked.experiment
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    folder = args.folder or str(Path("mgdd-runs") / f"{experiment.task}-{experiment.mode}-{stamp}")
    args.progress(f"{experiment.task}, {experiment.mode}")
    with _watching(args, checked) as watch:
        result = run_experiment(checked, folder, watch=watch, **_ARMED.given(args))
    emit(args, {**result.to_dict(), "folder": folder}, text=_text(result, folder))
    wrote(folder)
    if result.interrupted:
        raise Stopped(f"{result.timing['cycles']} of {checked.plan.samples} cycles are kept in {folder}")


@contextlib.contextmanager
def _watching(args: argparse.Namespace, checked: CheckedExperiment) -> Iterator[Callable[[Cycle], None] | None]:
    """Give the live view where a person looks, and nothing elsewhere."""
    if args.quiet or args.json or not is_terminal():
        yield None
        return
    args.progress.close()
    with LiveView(f"{checked.experiment.task}, {checked.experiment.mode}", checked.plan.samples) as view:
        yield view


def _text(result: ExperimentResult, folder: str) -> str:
    said = lines({name: value for name, value in result.figures.items() if not isinstance(value, (dict, list))})
    return f"{said}\n\nrecord, signals and figures: {folder}"


def _check(args: argparse.Namespace) -> None:
    checked = _checked(args)
    found = checked.to_dict()
    if checked.experiment.bus.connection is not None and checked.signal_map is not None:
        found["bus"] = _listen(checked)
    emit(args, {"ok": True, **found}, text=f"{lines(_flat(found))}\n\nall checks passed; nothing was sent")
    sys.stdout.flush()


def _flat(found: Mapping[str, Any], path: str = "") -> dict[str, Any]:
    """Give one entry per value: keys of tables with the table in front, lists as text."""
    out: dict[str, Any] = {}
    for name, value in found.items():
        if isinstance(value, Mapping):
            out |= _flat(value, f"{path}{name}.")
        else:
            out[path + name] = ", ".join(map(str, value)) if isinstance(value, list) else value
    return out


def _listen(checked: CheckedExperiment) -> dict[str, Any]:
    """Listen on the bus without sending; RigError where nobody is there, or another one sends our commands."""
    with CanRig(checked.bus_map, checked.experiment.bus.connection, mode="dry_run") as rig:
        return {"connection": checked.experiment.bus.connection, "state": rig.state, **rig.counters}


_REFRESH_S = 0.125
_BAR = 30  # characters


class LiveView:
    """A table that follows a run of `cycles` cycles on the console (stdout); it leaves the terminal as it was."""

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


COMMANDS = {"run": (_add_run, _run), "check": (_add_experiment, _check)}
