"""`mgdd rig record | replay | export`: frames of a bus into a file, a recorded run again, a record for other tools."""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import Any

from mgdd.cli.from_library import Options
from mgdd.cli.options import add_command, require_positive
from mgdd.cli.output import check_output, emit, lines, wrote
from mgdd.errors import DataError
from mgdd.rig import Experiment, Recorder, export_record, run_experiment
from mgdd.rig.can.replay_bus import RecordedBus
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.experiment import check_experiment

__all__ = ["add", "add_bus"]

_KEEP, _EXPORT = Options(run_experiment, "folder"), Options(export_record, "kind")
_POLL_S = 0.1
_SYNC_S = 1.0
_DIFFERENT = 1


def add(verbs: Any) -> None:
    """Add the three commands."""
    record = add_command(
        verbs, "record", _record,
        help_text="listen on a bus and write every frame into a record, until Ctrl-C; nothing is sent",
        example="mgdd rig record bench.rec --bus socketcan:can0 --duration-s 60",
    )  # fmt: skip
    record.add_argument("file", metavar="FILE.rec", help="new record")
    add_bus(record)
    record.add_argument("--duration-s", type=float, metavar="X", help="end after this time (default: never)")
    replay = add_command(
        verbs, "replay", _replay,
        help_text="give the measurements of a recorded run to its controller again, and compare every output bit for "
        "bit; exit code 1 where one differs",
        example="mgdd rig replay mgdd-runs/first --json",
    )  # fmt: skip
    replay.add_argument("source", metavar="DIR", help="folder of a run, with experiment.toml and run.rec")
    _KEEP.add(replay)
    export = add_command(
        verbs, "export", _export,
        help_text="write a record in the format of other tools",
        example="mgdd rig export run.rec run.mf4",
    )  # fmt: skip
    export.add_argument("file", metavar="FILE.rec", help="record")
    export.add_argument("target", metavar="TARGET", help="file, or a new folder for netcdf, csv and parquet")
    _EXPORT.add(export)


def add_bus(parser: argparse.ArgumentParser) -> None:
    """Add the bus of a command that needs one."""
    what = "any interface of python-can, ?OPTION=VALUE&... behind"
    parser.add_argument("--bus", required=True, metavar="INTERFACE:CHANNEL", help=what)


def _record(args: argparse.Namespace) -> None:
    check_output(args)
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
    check_output(args)
    folder = Path(args.source)
    for name in ("experiment.toml", "run.rec"):
        if not (folder / name).is_file():
            raise DataError(f"{folder}: holds no {name}: give the folder of a run of `mgdd rig run`")
    experiment = Experiment.load(folder / "experiment.toml").with_mode("replay", record=(folder / "run.rec").resolve())
    result = run_experiment(check_experiment(experiment), **_KEEP.given(args))
    compared = result.counters["replay"]
    same = compared["different"] == 0 and compared["samples"] > 0
    verdict = "every output is the recorded one, bit for bit" if same else "the outputs differ"
    emit(
        args,
        {"same": same, "replay": compared, "result": result.figures},
        text=f"{lines(compared)}\n\n{verdict}",
    )
    if not same:
        args.exit_code = _DIFFERENT


def _export(args: argparse.Namespace) -> None:
    check_output(args)
    written = [str(path) for path in export_record(args.file, args.target, **_EXPORT.given(args))]
    emit(args, {"files": written}, text="\n".join(written))
