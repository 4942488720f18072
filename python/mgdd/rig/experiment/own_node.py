"""The other process of ``hil``: a hub and a node with the plant of the experiment, for as long as the run lasts."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from mgdd.errors import RigError
from mgdd.rig.experiment.checked import CheckedExperiment
from mgdd.rig.experiment.experiment import Experiment

__all__ = ["own_node"]

_START_S = 60.0
_END_S = 5.0


@contextmanager
def own_node(checked: CheckedExperiment, *, truth: Path | None = None) -> Iterator[str]:
    """Start the process, give what its bus is called, and end it.

    Parameters
    ----------
    checked : CheckedExperiment
        What it simulates, with which map and pace.
    truth : pathlib.Path, optional
        CSV file for what really happened, sample by sample.

    Yields
    ------
    str
        As `mgdd.rig.CanTransport.parse` reads it.

    Raises
    ------
    mgdd.errors.RigError
        It did not start.
    """
    with TemporaryDirectory(prefix="mgdd-node-") as folder:
        file = Path(folder) / "experiment.toml"
        file.write_text(_absolute(checked).to_toml(), encoding="utf-8")
        own = [str(file), str(checked.sample_s or ""), str(truth or "")]
        command = [sys.executable, "-m", "mgdd.rig.experiment.own_node", *own]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True,
        )  # fmt: skip - a Ctrl-C in the terminal is for the run, which then ends the node
        watchdog = threading.Timer(_START_S, process.kill)
        watchdog.start()
        try:
            said = process.stdout.readline().strip() if process.stdout else ""
            watchdog.cancel()
            if not said.startswith("socketcand:"):
                _, complaint = process.communicate(timeout=_END_S)
                raise RigError(f"the node of this run did not start: {complaint.strip()[-400:] or said or 'no answer'}")
            yield said
        finally:
            watchdog.cancel()
            process.terminate()
            try:
                process.communicate(timeout=_END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()


def _absolute(checked: CheckedExperiment) -> Experiment:
    """Give the experiment with the map by its full path: the file that the node reads stands elsewhere."""
    experiment = checked.experiment
    if checked.signal_map is None:
        raise RigError("a node needs the map of a bus")
    bus = replace(experiment.bus, map=str(checked.signal_map.file.resolve()))
    plant = experiment.plant
    beside = experiment.folder / plant.preset
    if beside.is_file():
        plant = replace(plant, preset=str(beside.resolve()))
    return replace(experiment, bus=bus, plant=plant)


def _serve(file: str, sample_s: str, truth: str) -> None:
    from mgdd.rig.can.hub import Hub
    from mgdd.rig.can.node import TruthLog, parent_watch, run_node
    from mgdd.rig.can.node_core import NodeCore, node_plant
    from mgdd.rig.can.signal_map import SignalMap
    from mgdd.rig.can.transport import CanTransport
    from mgdd.rig.experiment.stand import simulated_plant

    experiment = Experiment.load(file)
    signal_map = SignalMap.load(experiment.map_name)
    pace = experiment.bus.pace
    inputs = (*signal_map.input_names, "bridge_open")
    plant = simulated_plant(experiment, sample_s=float(sample_s) if sample_s else None, inputs=inputs)
    listening = threading.Event()
    hub = Hub()
    threading.Thread(
        target=lambda: asyncio.run(hub.run(lambda _: listening.set(), asyncio.Event())), name="mgdd hub", daemon=True
    ).start()
    if not listening.wait(_START_S):
        raise RigError("the hub of this run did not start")
    connection = f"socketcand:can0?host={hub.host}&port={hub.port}"
    with ExitStack() as stack:
        bus = stack.enter_context(CanTransport.parse(connection))
        log = None if not truth else stack.enter_context(TruthLog(truth))
        sys.stdout.write(connection + "\n")
        sys.stdout.flush()
        run_node(NodeCore(node_plant(plant), signal_map), bus, step=pace == "step", log=log, keep_on=parent_watch())


if __name__ == "__main__":
    _serve(*sys.argv[1:])
