"""`mgdd rig run | check`: an experiment from a file, and what it would do."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.cli.from_library import Options
from mgdd.cli.options import option, refuse_idle
from mgdd.cli.output import emit, lines, warn, wrote
from mgdd.cli.progress import Stopped
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
    progress = args.progress.expect(checked.plan.samples)

    def watch(cycle: Cycle) -> None:
        asked = ", ".join(f"{name} {value:.4g}" for name, value in cycle.asked.items())
        progress(f"{experiment.task}, {experiment.mode}: {asked}")

    result = run_experiment(checked, folder, watch=watch, **_ARMED.given(args))
    emit(args, {**result.to_dict(), "folder": folder}, text=_text(result, folder))
    wrote(folder)
    if result.interrupted:
        raise Stopped(f"{result.timing['cycles']} of {checked.plan.samples} cycles are kept in {folder}")


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


COMMANDS = {"run": (_add_run, _run), "check": (_add_experiment, _check)}
