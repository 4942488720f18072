"""`mgdd rig run | check`: an experiment from a file, and what it would do."""

from __future__ import annotations

import argparse
import contextlib
import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.cli.from_library import Options
from mgdd.cli.options import add_command, refuse_idle
from mgdd.cli.output import Stopped, check_output, emit, is_terminal, lines, wrote
from mgdd.rig import CanRig, Experiment, run_experiment
from mgdd.rig.can.modes import MODES
from mgdd.rig.experiment import CheckedExperiment, ExperimentResult, check_experiment

if TYPE_CHECKING:
    from mgdd.rig.experiment.stand import Cycle

__all__ = ["add"]

_LOG = logging.getLogger(__name__)
_WHERE = Options(Experiment.with_mode, "connection", "pace", "record")
_ARMED = Options(run_experiment, "arm", "key_file")


def add(verbs: Any) -> None:
    """Add both commands."""
    run = add_command(
        verbs, "run", _run,
        help_text="run an experiment: identify or track on a throttle, seek on an engine; in process, over a bus, on a "
        "record or on a bench",
        example="mgdd rig run track.toml --mode hil --folder runs/first",
    )  # fmt: skip
    _add_experiment(run)
    run.add_argument(
        "--folder", metavar="DIR", help="new folder for record, signals, timing, result and figures (default: "
        "mgdd-runs/TASK-MODE-TIME)",
    )  # fmt: skip
    _ARMED.add(run)
    check = add_command(
        verbs, "check", _check,
        help_text="check an experiment, its map, DBC, envelope and bus, and say what would run; nothing is sent",
        example="mgdd rig check track.toml --mode bench --connection socketcan:can0 --pace real_time --json",
    )  # fmt: skip
    _add_experiment(check)


def _add_experiment(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="EXPERIMENT.toml", help="what to do; the page Experiments lists its keys")
    parser.add_argument("--mode", choices=MODES, help="instead of the mode of the file")
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
    check_output(args)
    checked = _checked(args)
    for doubt in checked.to_dict().get("warnings", []):
        _LOG.warning("%s", doubt)
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
    from mgdd.cli.rig_live import LiveView

    args.progress.close()
    with LiveView(f"{checked.experiment.task}, {checked.experiment.mode}", checked.plan.samples) as view:
        yield view


def _text(result: ExperimentResult, folder: str) -> str:
    said = lines({name: value for name, value in result.figures.items() if not isinstance(value, (dict, list))})
    return f"{said}\n\nrecord, signals and figures: {folder}"


def _check(args: argparse.Namespace) -> None:
    check_output(args)
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
