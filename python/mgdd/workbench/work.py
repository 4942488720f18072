"""What runs in a process of its own; this module is imported once, before any work comes."""

from __future__ import annotations

import dataclasses
import pickle
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from mgdd import loop, maps, plot, report
from mgdd.errors import DataError, Interrupted
from mgdd.io.plain_csv import write_traces
from mgdd.plot.style import drawn
from mgdd.report.records import record_section
from mgdd.results.result import Figures, Result
from mgdd.workbench.calls import Call, Script

if TYPE_CHECKING:
    import xarray as xr

Watch = Callable[[Any], object]
MOST_CYCLES, MOST_ANGLES, MOST_POINTS = 60, 1440, 4000  # that are drawn


def run(watch: Watch, script: Script) -> dict[str, Any]:
    """Run a script."""
    return script.run(watch)


def checked(watch: Watch, script: Script) -> dict[str, Any]:
    """Read a file, report its trace as it is drawn, and check it where the script does."""

    def read(trace: xr.Dataset) -> xr.Dataset:
        watch(thinned(trace))
        return trace

    found = script.run(wraps={"trace": read})
    return {name: result for name, result in found.items() if name != "trace"}


def analyzed(_: Watch, script: Script) -> dict[str, Any]:
    """Analyse a file; of its traces come as many cycles and angles as are drawn."""
    return {"figures": thinned(script.run()["figures"])}


def thinned(traces: xr.Dataset) -> xr.Dataset:
    """Take as many cycles and angles as a picture shows."""
    over = {"cycle": MOST_CYCLES, "crank_angle_cad": MOST_ANGLES}
    every = {dim: slice(None, None, -(-traces.sizes[dim] // most)) for dim, most in over.items() if dim in traces.dims}
    return traces.isel(every)


def exported(_: Watch, what: str, check: Script, analysis: Script, engine: str) -> bytes:
    """Give a page with checks and pictures of a file; or its pressure as a figure; or a table of its cycles."""
    figures = analysis.run()["figures"]
    with TemporaryDirectory() as folder:
        if what == "page":
            found = check.run()["check"]
            made = report.Report(
                name=f"mgdd workbench, {engine}", title="Measured pressure", dataset=figures, verdict=(found.title,),
                sections=(record_section(found, figures, thinned(figures)),), summary=Figures(engine=engine),
            )  # fmt: skip
            file = report.write_report(made, Path(folder) / "page.html")
        elif what == "figure":
            file = Path(folder) / "pressure.svg"
            drawn(plot.pressure, figures, size=(7.0, 4.4)).savefig(file)
        else:
            file = Path(folder) / "cycles.csv"
            over = "cycle" if "cycle" in figures.dims else "crank_angle_cad"
            write_traces(figures[[name for name, v in figures.data_vars.items() if v.dims == (over,)]], file)
        return file.read_bytes()


def timed(watch: Watch, script: Script) -> list[dict[str, Any]]:
    """Calibrate traces over the family of models, and give the best timing of each as plain values."""
    return [row.to_dict() for row in script.run(watch)["rows"]]


class Watched:
    """A plant that reports each of its cycles, at most so many in a second."""

    def __init__(self, plant: Any, watch: Watch, pause_s: float) -> None:
        self.plant, self._watch, self._pause_s, self._inputs = plant, watch, pause_s, dict[str, float]()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plant, name)

    def apply(self, inputs: Any) -> None:
        """Set the inputs of the next cycle."""
        self._inputs = dict(inputs)
        self.plant.apply(inputs)

    def measure(self) -> Any:
        """Measure a cycle, and report it."""
        time.sleep(self._pause_s)  # before it: a stop in the pause loses no reading
        measured = self.plant.measure()
        self._watch((self._inputs | dict(measured.applied), measured.performance, dict(measured.limits)))
        return measured


def sought(watch: Watch, script: Script, pause_s: float, state: Any, cycles: int) -> dict[str, Any]:
    """Seek on a virtual engine, from the start or from the `state` of an earlier search; a stop keeps what there is."""
    benches: list[Watched] = []

    def watched(bench: Any) -> Watched:
        benches.append(Watched(bench, watch, pause_s))
        return benches[-1]

    try:
        if state is None:
            found = script.run(wraps={"bench": watched})["found"]
        else:
            bench, seeker = pickle.loads(state)
            found = loop.seek(watched(bench), seeker=seeker, cycles=cycles)
    except Interrupted as stop:
        if not isinstance(stop.partial, Result):
            raise
        found = stop.partial
    return {
        "result": found.to_dict(), "dataset": found.dataset, "text": found.summary(),
        "findings": [str(finding) for finding in found.findings],
        "state": pickle.dumps((benches[-1].plant, found.seeker)),
    }  # fmt: skip


def mapped(watch: Watch, script: Script, endings: Sequence[str]) -> dict[str, Any]:
    """Seek a map visit by visit; at its end it comes in the forms of files too."""

    def visited(so_far: Any) -> None:
        last = so_far.last
        watch({"visit": so_far.visit, "regret": so_far.regret, "at": last.at, "inputs": last.inputs, "j": last.j,
               "cells": so_far.search.cells})  # fmt: skip

    try:
        found = script.run(visited)["found"]
    except Interrupted as stop:
        if not isinstance(stop.partial, Result):
            raise
        found = stop.partial
    files = {}
    with TemporaryDirectory() as folder:
        for ending in endings:
            file = Path(folder) / f"map{ending}"
            try:
                maps.write_map(found.map, file)
            except DataError:  # a cell without a value does not go into every form
                continue
            files[ending] = file.read_bytes()
    return {"result": found.to_dict(), "cells": found.cells, "files": files, "text": found.summary(),
            "findings": [str(finding) for finding in found.findings]}  # fmt: skip


def identified(_: Watch, script: Script) -> dict[str, Any]:
    """Fit a throttle model to a log and validate it."""
    found = script.run()
    fit, validation = found["fit"], found["validation"]
    return {
        "fit": fit.to_dict(), "text": f"{fit.summary()}\n\n{validation.summary()}", "toml": fit.to_toml(),
        "run": validation.free_run, "tests": validation.tests.dataset, "validation": validation.to_dict(),
    }  # fmt: skip


def tracked(watch: Watch, scripts: Mapping[str, Script]) -> dict[str, Any]:
    """Run controllers along one reference."""
    runs = {}
    for kind, script in scripts.items():
        watch(kind)
        runs[kind] = script.run()["run"]
    return runs


def tuned(_: Watch, script: Script) -> dict[str, Any]:
    """Tune a controller."""
    found = script.run()["tuning"]
    return {"kind": found.kind, "cost": found.cost, "start_cost": found.start_cost, "numbers": dict(found.numbers),
            "evaluations": found.evaluations}  # fmt: skip


def controller_files(_: Watch, script: Script) -> bytes:
    """Write a controller as C++, as an archive."""
    with TemporaryDirectory() as folder:
        made = dataclasses.replace(script, lines=tuple(
            (name, _into(value, Path(folder) / "controller")) for name, value in script.lines))  # fmt: skip
        made.run()
        archive = shutil.make_archive(str(Path(folder) / "controller"), "zip", folder, "controller")
        return Path(archive).read_bytes()


def _into(value: Any, folder: Path) -> Any:
    """Let the line that writes a folder write into another one."""
    if isinstance(value, Call) and value.name == "loop.export_controller":
        return dataclasses.replace(value, args=(value.args[0], folder))
    return value
