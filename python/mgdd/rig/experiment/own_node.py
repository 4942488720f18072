"""The other side of ``hil``: a hub and a node with the plant of the experiment, for as long as the run lasts."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from mgdd.errors import RigError
from mgdd.rig.can.processes import VirtualNode
from mgdd.rig.experiment.checked import CheckedExperiment

__all__ = ["own_node"]


@contextmanager
def own_node(checked: CheckedExperiment, *, truth: str | os.PathLike[str] | None = None) -> Iterator[str]:
    """Start both processes, give what their bus is called, and end them.

    Parameters
    ----------
    checked : CheckedExperiment
        What is simulated, with which map and pace.
    truth : path-like, optional
        CSV file for what really happened, sample by sample.

    Yields
    ------
    str
        As `CanTransport.parse` reads it.

    Raises
    ------
    mgdd.errors.RigError
        They did not start.
    """
    if checked.signal_map is None:
        raise RigError("a node needs the map of a bus")
    with TemporaryDirectory(prefix="mgdd-node-") as folder:
        file = Path(folder) / "experiment.toml"
        file.write_text(checked.experiment.with_files(lambda path: str(path.resolve())).to_toml(), encoding="utf-8")
        with VirtualNode(
            checked.signal_map.file.resolve(),
            step=checked.experiment.bus.pace == "step",
            truth=truth,
            sample_ms=None if checked.sample_s is None else checked.sample_s * 1e3,
            experiment=file,
        ) as node:
            yield node.bus
