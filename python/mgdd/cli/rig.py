"""`mgdd rig hub | node | selftest`: the other side of a bus, for experiments without hardware."""

from __future__ import annotations

import argparse
import asyncio
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

from mgdd.cli.from_library import Options
from mgdd.cli.options import option, refuse_idle, require_positive
from mgdd.cli.output import check_file, emit
from mgdd.cli.rig_run import add_bus
from mgdd.report import Table
from mgdd.rig import Experiment, SafetyEnvelope, SignalMap
from mgdd.rig.can.hub import BusFault, Hub
from mgdd.rig.can.node import TruthLog, node_of, parent_watch, run_node
from mgdd.rig.can.node_core import NodeCore, NodePlant, node_plant
from mgdd.rig.can.processes import noted_signals
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.experiment.checked import simulated_plant
from mgdd.rig.experiment.self_test import WAYS_OF, run_self_test

_HUB = Options(Hub, "host", "seed")
_NODE, _PLANT = Options(run_node, "step"), Options(node_of, "seed")
_SELF_TEST = Options(run_self_test, "loop")
_FAILED = 1
_LOOK_S = 0.2  # how often the hub looks for the process that started it


def _add_hub(parser: Any) -> None:
    _HUB.add(parser)
    option(parser, "--port N", "0 takes a free one", default=29536)
    option(parser, "--fault KIND:KEY=VALUE,... ...",
           "drop, duplicate, delay, reorder, corrupt, error or freeze, with p, id, from_s, until_s, ms, class, "
           "client; repeatable, for example delay:ms=5,id=0x121")  # fmt: skip


def _add_node(parser: Any) -> None:
    option(parser, "--map NAME_OR_FILE.toml", "etb, engine or a file", default="etb")
    add_bus(parser)
    option(parser, "--envelope NAME_OR_FILE.toml",
           "of the safety gate of the node; cycle and time limit come from the map", default="etb_node")  # fmt: skip
    _NODE.add(parser)
    option(parser, "--period-ms X", "between samples (default: that of the map)")
    option(parser, "--sample-ms X", "time in the throttle per sample (default: the same)")
    option(parser, "--fault KIND:KEY=VALUE,... ...",
           "of the throttle and its sensors, with from_s, until_s, size, sensor; repeatable, for example "
           "offset:sensor=2,size=0.3,from_s=1")  # fmt: skip
    _PLANT.add(parser)
    option(parser, "--experiment FILE.toml", "serve the plant of this experiment, with its seed")
    option(parser, "--truth FILE.csv", "write a line per sample: what really happened")
    option(parser, "--duration-s X", "end after this time (default: never)")


def _hub(args: argparse.Namespace) -> None:
    hub = Hub(port=args.port, faults=[BusFault.parse(text) for text in args.fault], **_HUB.given(args))
    args.progress.close()
    asyncio.run(_serve(args, hub))
    emit(args, hub.counts)


async def _serve(args: argparse.Namespace, hub: Hub) -> None:
    stop, alive = asyncio.Event(), parent_watch()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, stop.set)

    async def watch() -> None:
        while alive():
            await asyncio.sleep(_LOOK_S)
        stop.set()

    watching = asyncio.create_task(watch())
    await hub.run(lambda ready: _say(args, f"socketcand:can0?host={ready.host}&port={ready.port}"), stop)
    watching.cancel()


def _node(args: argparse.Namespace) -> None:
    check_file("--truth", args.truth, (".csv",))
    require_positive(args, "period_ms", "sample_ms", "duration_s")
    signal_map = SignalMap.load(args.map)
    period_s = None if args.period_ms is None else args.period_ms * 1e-3
    sample_s = period_s if args.sample_ms is None else args.sample_ms * 1e-3
    core = NodeCore(_plant_of(args, signal_map, sample_s), signal_map, SafetyEnvelope.load(args.envelope))
    log = None if args.truth is None else TruthLog(args.truth)
    try:
        with noted_signals() as stopped, CanTransport.parse(args.bus) as bus:
            args.progress.close()
            _say(args, f"{signal_map.file.stem} on {bus.name}: ready")
            run_node(
                core, bus, period_s=period_s, log=log, keep_on=_until(args.duration_s, stopped), **_NODE.given(args)
            )
            counts = {
                "samples": core.samples,
                "late": core.late,
                "foreign": core.foreign,
                "mode": core.gate.mode,
                "reason": core.gate.reason,
            }
            counts |= {"gate": core.gate.counts, **bus.counters}
    finally:
        if log is not None:
            log.close()
    emit(args, counts)


def _plant_of(args: argparse.Namespace, signal_map: SignalMap, sample_s: float | None) -> NodePlant:
    if args.experiment is None:
        return node_of(signal_map, faults=args.fault, sample_s=sample_s, **_PLANT.given(args))
    refuse_idle(args, "fault", why="--experiment says what the plant is")
    inputs = (*signal_map.input_names, "bridge_open")
    sample_s = signal_map.cycle_s if sample_s is None else sample_s
    return node_plant(simulated_plant(Experiment.load(args.experiment), sample_s=sample_s, inputs=inputs))


def _until(duration_s: float | None, stopped: list[int]) -> Callable[[], bool]:
    """Return the question whether to go on: no signal, a parent, time left."""
    alive = parent_watch()
    end = float("inf") if duration_s is None else time.monotonic() + duration_s
    return lambda: not stopped and alive() and time.monotonic() < end


def _say(args: argparse.Namespace, text: str) -> None:
    """Say that the command is ready; beside a JSON object on stderr."""
    print(text, file=sys.stderr if args.json else sys.stdout, flush=True)


def _selftest(args: argparse.Namespace) -> None:
    how = _SELF_TEST.of(args)
    test = run_self_test(progress=args.progress.expect(len(WAYS_OF[how["loop"]])), **how)
    rows = tuple(
        (way, "–" if time is None else f"{time:.3f}", test.notes.get(way, "")) for way, time in test.ways_to_die.items()
    )
    verdict = "passed" if test.passed else "failed"
    said = f"\n{verdict}: at most {test.limit_s:g} s are allowed"
    emit(args, test.to_dict(), text=[Table(columns=("way to die", "home after [s]", "note"), rows=rows), said])
    if not test.passed:
        args.exit_code = _FAILED


COMMANDS = {"hub": (_add_hub, _hub), "node": (_add_node, _node), "selftest": (_SELF_TEST.add, _selftest)}
