"""What runs in a process of its own; this module is imported once, before any work comes."""

from __future__ import annotations

import contextlib
import dataclasses
import pickle
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from mgdd import loop, maps, plot, report, rig
from mgdd.errors import DataError, Interrupted, ParameterError
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
    state = pickle.dumps((benches[-1].plant, found.seeker))
    return _search(found, found.dataset, [str(finding) for finding in found.findings], state)


def _search(found: Any, data: xr.Dataset, findings: Sequence[str], state: bytes | None = None) -> dict[str, Any]:
    """Give what is shown of a search."""
    result = found.to_dict()
    return {
        "result": result, "text": found.summary(), "findings": findings, "state": state,
        "interrupted": result["interrupted"], "cycles": data.sizes["cycle"],
        "estimates": {str(name): data["estimate"].sel(input=name).to_numpy() for name in data["input"].to_numpy()},
    }  # fmt: skip


def experimented(watch: Watch, script: Script) -> dict[str, Any]:
    """Run the experiment of a file where it is a search; it drives a bench only where a person armed it."""

    def seeks(experiment: rig.Experiment) -> rig.Experiment:
        if experiment.task != "seek":
            raise ParameterError(f"task = {experiment.task!r}: must be 'seek' here: use mgdd rig run for another task")
        own: Any = experiment.settings
        uppers = {name: own.limits.get(name) for name in experiment.limit_names}
        numbers = {name: upper if isinstance(upper, float) else None for name, upper in uppers.items()}
        watch({"inputs": [*own.inputs], "limits": numbers, "cycles": own.cycles or 0})
        return experiment

    def cycle(one: Any) -> None:
        measured = one.measured
        watch((dict(one.asked) | dict(measured.applied), measured.performance, dict(measured.limits)))

    found = script.run(cycle, wraps={"experiment": seeks})["found"]
    return _search(found, found.dataset, [*(each["text"] for each in found.figures["findings"]), *found.events])


def recorded(watch: Watch, script: Script) -> dict[str, Any]:
    """Replay what a rig has recorded of a search: its readings, and the estimate."""
    found = script.run()["found"]
    tables = found.samples
    if "rig" not in tables or "value.j" not in tables["rig"]:
        raise DataError(f"tables = {', '.join(tables) or 'none'}: must hold the cycles of a search: use mgdd rig watch")
    data = tables["rig"]
    names = {part: [str(name).partition(".")[2] for name in data if str(name).startswith(f"{part}.")]
             for part in ("input", "limit")}  # fmt: skip
    columns = {part: {name: data[f"{part}.{name}"].to_numpy() for name in own} for part, own in names.items()}
    watch({"inputs": names["input"], "limits": dict.fromkeys(names["limit"]), "cycles": data.sizes["time_s"]})
    for k, j in enumerate(data["value.j"].to_numpy().tolist()):
        own = ({name: float(column[k]) for name, column in columns[part].items()} for part in ("input", "limit"))
        inputs, limits = own
        watch((inputs, j, limits))
    seen = tables.get("seeker", {})
    estimates = {name: seen[f"estimate.{name}"].to_numpy() for name in names["input"] if f"estimate.{name}" in seen}
    return {"result": {}, "text": found.summary(), "findings": [], "state": None, "interrupted": False,
            "cycles": data.sizes["time_s"], "estimates": estimates}  # fmt: skip


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
    return {"result": found.to_dict(), "cells": found.cells, "files": _map_files(found.map, endings),
            "text": found.summary(), "findings": [str(finding) for finding in found.findings]}  # fmt: skip


def made_maps(_: Watch, script: Script, endings: Sequence[str]) -> dict[str, Any]:
    """Run a script; of each map among its results come the cells and the forms of files."""
    return {
        name: {"cells": each.to_dataset(), "files": _map_files(each, endings)} if hasattr(each, "cells") else each
        for name, each in script.run().items()
    }


def _map_files(table: maps.CalibrationMap, endings: Sequence[str]) -> dict[str, bytes]:
    files = {}
    with TemporaryDirectory() as folder:
        for ending in endings:
            file = Path(folder) / f"map{ending}"
            with contextlib.suppress(DataError):  # a cell without a value does not go into every form
                maps.write_map(table, file)
                files[ending] = file.read_bytes()
    return files


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
