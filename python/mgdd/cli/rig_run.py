"""`mgdd rig run | check | record | replay | export | watch`: experiments from a file, and the records of a bus."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.cli.browser import add_browser, before_serving, lower_priority, serve_page
from mgdd.cli.from_library import Options
from mgdd.cli.options import option, refuse_idle, require_positive
from mgdd.cli.output import emit, lines, warn, wrote
from mgdd.cli.progress import Stopped
from mgdd.errors import DataError
from mgdd.rig import CanRig, Experiment, Recorder, export_record, run_experiment, watch
from mgdd.rig.can.can_rig import MODES
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.experiment import CheckedExperiment, ExperimentResult, check_experiment
from mgdd.rig.recorder import RecordedBus

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


_KEEP, _EXPORT = Options(run_experiment, "folder"), Options(export_record, "kind")
_POLL_S = 0.1
_SYNC_S = 1.0
_DIFFERENT = 1


def _add_record(parser: Any) -> None:
    option(parser, "file FILE.rec", "new record")
    add_bus(parser)
    option(parser, "--duration-s X", "end after this time (default: never)")


def _add_replay(parser: Any) -> None:
    option(parser, "source DIR", "folder of a run, with experiment.toml and run.rec")
    _KEEP.add(parser)


def _add_export(parser: Any) -> None:
    option(parser, "file FILE.rec", "record")
    option(parser, "target TARGET", "file, or a new folder for netcdf, csv and parquet")
    _EXPORT.add(parser)


def add_bus(parser: argparse.ArgumentParser) -> None:
    """Add the bus of a command that needs one."""
    what = "any interface of python-can, ?OPTION=VALUE&... behind"
    option(parser, "--bus INTERFACE:CHANNEL", what, required=True)


def _record(args: argparse.Namespace) -> None:
    require_positive(args, "duration_s")
    transport, frames = CanTransport.parse(args.bus), 0
    with transport, Recorder(args.file, config={"bus": args.bus}) as recorder:
        synced = time.monotonic()  # the bus is open: python-can may take longer than a short recording
        ends = math.inf if args.duration_s is None else synced + args.duration_s
        bus = RecordedBus(transport, recorder)
        args.progress(f"listening on {bus.name}")
        try:
            while time.monotonic() < ends:
                frames += bus.receive(_POLL_S) is not None
                if time.monotonic() - synced > _SYNC_S:
                    recorder.sync()
                    synced = time.monotonic()
        except KeyboardInterrupt:
            recorder.event("note", "ended by Ctrl-C")
        counted = {"frames": frames, **transport.counters}
    emit(args, {"file": args.file, **counted})
    wrote(args.file)


def _replay(args: argparse.Namespace) -> None:
    folder = Path(args.source)
    for name in ("experiment.toml", "run.rec"):
        if not (folder / name).is_file():
            raise DataError(f"{folder}: holds no {name}: give the folder of a run of `mgdd rig run`")
    experiment = Experiment.load(folder / "experiment.toml").with_mode("replay", record=(folder / "run.rec").resolve())
    result = run_experiment(check_experiment(experiment), **_KEEP.given(args))
    compared = result.counters["replay"]
    same = compared["different"] == 0 and compared["samples"] > 0
    verdict = "every output is the recorded one, bit for bit" if same else "the outputs differ"
    emit(args, {"same": same, "replay": compared, "result": result.figures}, text=f"{lines(compared)}\n\n{verdict}")
    if not same:
        args.exit_code = _DIFFERENT


def _export(args: argparse.Namespace) -> None:
    written = [str(path) for path in export_record(args.file, args.target, **_EXPORT.given(args))]
    emit(args, {"files": written}, text="\n".join(written))


_NICE = 10  # a loop that is late costs more than a picture that is
_OPTIONS = Options(watch, signal_map="map")


def _add_watch(parser: Any) -> None:
    option(parser, "source RUN | FILE.rec | INTERFACE:CHANNEL | simulate",
           "folder of a run that goes on or is over, a record, a bus to listen on, or a simulated throttle",
           default="simulate", nargs="?")  # fmt: skip
    _OPTIONS.add(parser)
    add_browser(parser)


def _watch(args: argparse.Namespace) -> None:
    from mgdd.io.extras import import_extra
    from mgdd.rig.can.node import parent_watch
    from mgdd.rig.live.page import serve
    from mgdd.rig.live.sources import source_of

    before_serving(args)
    import_extra("bokeh", "watch", "a live page")  # before a simulation is started
    source = source_of(args.source, _OPTIONS.of(args)["signal_map"])

    def served(port: int, ready: Callable[[str], None]) -> None:
        def begun(address: str) -> None:
            lower_priority(_NICE)  # now that the simulation has begun: that one shall not yield
            ready(address)

        serve(source, port, begun, alive=parent_watch())

    try:
        serve_page(args, "mgdd rig watch", served)
    finally:
        source.close()
    emit(args, {"watched": source.name, "said": source.said, "trouble": source.trouble})


COMMANDS = {
    "run": (_add_run, _run),
    "check": (_add_experiment, _check),
    "record": (_add_record, _record),
    "replay": (_add_replay, _replay),
    "export": (_add_export, _export),
    "watch": (_add_watch, _watch),
}
