"""Running an experiment: check, open, steer, record, report."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import shutil
import sys
import time
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, RigError, argument
from mgdd.io.files import write_whole
from mgdd.results.describe import Row, rows_of
from mgdd.results.labels import to_jsonable
from mgdd.results.result import Result
from mgdd.rig.experiment.checked import CheckedExperiment, LoopChoice, check_experiment
from mgdd.rig.experiment.core_samples import loop_rows, replayed
from mgdd.rig.experiment.core_track import track_on_core
from mgdd.rig.experiment.engine_tasks import MapPlan, SeekPlan
from mgdd.rig.experiment.experiment import Experiment
from mgdd.rig.experiment.settings import MapTask
from mgdd.rig.experiment.stand import Cycle, RunRecord, Stand, Watched, guarded, opened_rig
from mgdd.rig.experiment.tasks import Outcome, TrackPlan

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_INPUTS = "inputs"
_PACKAGES = ("numpy", "scipy", "xarray", "python-can", "cantools")


class RunFolder:
    """A new or empty folder that takes the files of one run."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self._made = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            held = sorted(entry.name for entry in self.path.iterdir())
        except OSError as error:
            raise RigError(f"run folder {self.path}: {error.strerror or error}; name another one") from error
        if held:
            raise RigError(f"run folder {self.path}: holds {held[0]} already; name a new folder, no run is overwritten")

    def discard(self) -> None:
        """Take back what was written, and the folder where it was made: the run never began."""
        for entry in self.path.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry)
            else:
                entry.unlink()
        for folder in self._made:
            with contextlib.suppress(OSError):  # another run has come into a folder above
                folder.rmdir()

    def keep(self, path: Path) -> str:
        """Copy a file that a run reads, and give its name in the folder; bulk and maps stay where they are.

        A map reads its DBC beside it, a record may be large: both are named by their full path.
        """
        is_map = path.suffix == ".toml" and 'kind = "signal_map"' in path.read_text(encoding="utf-8", errors="replace")
        if path.suffix == ".rec" or is_map:
            return str(path.resolve())
        inputs = self.path / _INPUTS
        inputs.mkdir(exist_ok=True)
        name = path.name
        for number in range(2, 1000):
            if not (inputs / name).exists():
                break
            name = f"{path.stem}_{number}{path.suffix}"
        self._whole(f"{_INPUTS}/{name}", lambda half: half.write_bytes(path.read_bytes()))
        return f"{_INPUTS}/{name}"

    def text(self, name: str, text: str) -> None:
        """Write a text."""
        self._whole(name, lambda path: path.write_text(text, encoding="utf-8", newline="\n"))

    def json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write JSON; NaN and infinity as null."""
        self.text(name, json.dumps(to_jsonable(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n")

    def dataset(self, name: str, dataset: xr.Dataset) -> None:
        """Write netCDF."""
        self._whole(name, lambda path: dataset.to_netcdf(path, engine="scipy"))

    def figure(self, name: str, figure: Figure) -> None:
        """Write a PNG."""
        self._whole(name, lambda path: figure.savefig(path, dpi=150, format="png"))

    def _whole(self, name: str, write: Any) -> None:
        """Write under another name, and give it its own when it is on the disk."""
        try:
            write_whole(self.path / name, write)
        except OSError as error:
            raise RigError(
                f"{self.path / name}: {error.strerror or error}; free some space, or name a folder elsewhere"
            ) from error


def versions() -> dict[str, Any]:
    """Give time, versions and machine of a run."""
    packages: dict[str, str | None] = {}
    for name in _PACKAGES:
        try:
            packages[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            packages[name] = None
    return {
        "begun": datetime.now(UTC).isoformat(timespec="seconds"),
        "mgdd": _core.__version__,
        "python": platform.python_version(),
        "packages": packages,
        "system": platform.platform(),
        "arguments": sys.argv[1:],
    }


@dataclass(frozen=True, kw_only=True, repr=False)
class ExperimentResult(Result):
    """What an experiment came to."""

    experiment: Experiment
    figures: dict[str, Any]  # numbers and short texts of the task
    dataset: xr.Dataset  # signals over time or cycle
    timing: dict[str, Any]  # cycles, percentiles of thinking and waiting [us]; which loop, and its account
    counters: dict[str, Any]  # of rig and guard
    events: tuple[str, ...] = ()  # what gate or guard had to say
    interrupted: bool = False  # whether Ctrl-C cut it
    folder: Path | None = None  # where its files are

    def _rows(self) -> list[Row]:
        return rows_of({**self.figures, "folder": str(self.folder)})

    def _draw(self, ax: Axes | None) -> Axes:
        from mgdd.plot import map_cells, seeking, throttle_run

        if isinstance(self.experiment.settings, MapTask):
            return map_cells(self.dataset, next(iter(self.experiment.settings.inputs)), ax=ax)
        return (seeking if "cycle" in self.dataset.dims else throttle_run)(self, ax=ax)

    def to_dict(self) -> dict[str, Any]:
        """Give all but the signals, as JSON holds it."""
        return {
            "task": self.experiment.task,
            "mode": self.experiment.mode,
            "seed": self.experiment.seed,
            "interrupted": self.interrupted,
            "result": self.figures,
            "timing": self.timing,
            "counters": self.counters,
            "events": list(self.events),
        }


def run_experiment(
    experiment: Experiment | CheckedExperiment,
    folder: str | os.PathLike[str] | None = None,
    *,
    arm: bool = False,
    key_file: str | os.PathLike[str] | None = None,
    watch: Callable[[Cycle], None] | None = None,
) -> ExperimentResult:
    """Run an experiment and keep everything that belongs to it.

    All files are checked first; then the folder is made, and takes ``experiment.toml``, ``run.json`` with versions, map
    and envelope, and ``run.rec``, to which every cycle is appended. At the end come ``result.json``, ``signals.nc``,
    files of the task and its figures. A killed process loses what was not done, and nothing else.

    Parameters
    ----------
    experiment : Experiment or CheckedExperiment
        What is to be run.
    folder : path-like, optional
        A new or empty folder; nothing is written if left out.
    arm : bool
        Must be True for the mode ``bench``, and for ``hil`` with a ``connection`` that leaves this machine.
    key_file : path-like, optional
        Confirms them instead of a person at the terminal.
    watch : callable, optional
        Called with every `Cycle`; what it raises ends the run.

    Returns
    -------
    ExperimentResult
        Ctrl-C gives the cycles until then, ``interrupted``.

    Raises
    ------
    mgdd.errors.RigError
        No plant where it should be, a safety gate that took the drive away, a folder that holds another run. What was
        recorded until then is in the folder; where nothing was, no folder is left.
    mgdd.errors.Error
        As `check_experiment`.

    Examples
    --------
    >>> from mgdd.rig import Experiment, run_experiment
    >>> text = '''
    ... kind = "experiment"
    ... format = 1
    ... task = "track"
    ... [track]
    ... reference = "step:20:60"
    ... '''
    >>> result = run_experiment(Experiment.from_toml(text))
    >>> result.figures["settling_ms"] < 150.0, result.events[-1]
    (True, 'safety gate: armed -> run: requested')
    """
    checked = experiment if isinstance(experiment, CheckedExperiment) else check_experiment(experiment)
    mode = checked.experiment.mode
    may_be_real = mode == "bench" or (mode == "hil" and checked.experiment.bus.connection is not None)
    for name, value in (("arm", arm), ("key_file", key_file)):
        if value and not may_be_real:
            raise ParameterError.of(
                argument(name), value,
                f"left out with mode = {mode!r}: only 'bench', and 'hil' with a connection, may drive hardware",
            )  # fmt: skip
    run, record = None if folder is None else RunFolder(folder), None
    try:
        if run is not None:
            run.text("experiment.toml", checked.experiment.with_files(run.keep).to_toml())
            run.json("run.json", {**versions(), **checked.to_dict()})
        with RunRecord(None if run is None else run.path / "run.rec", checked) as record:
            outcome, counters, timing = _steered(checked, record, arm=arm, key_file=key_file, watch=watch)
    except BaseException:
        if run is not None and (record is None or not record.began):
            run.discard()
        raise
    result = ExperimentResult(
        experiment=checked.experiment,
        figures=dict(outcome.figures),
        dataset=outcome.dataset,
        timing=timing,
        counters=counters,
        events=tuple(record.events),
        interrupted=outcome.interrupted,
        folder=None if run is None else run.path,
    )
    if run is not None:
        _keep(run, outcome, result)
    return result


def _steered(
    checked: CheckedExperiment,
    record: RunRecord,
    *,
    arm: bool,
    key_file: str | os.PathLike[str] | None,
    watch: Callable[[Cycle], None] | None,
) -> tuple[Outcome, dict[str, Any], dict[str, Any]]:
    times = (array("d"), array("d"))  # thinking and waiting, 16 bytes a cycle

    def listen(cycle: Cycle) -> None:
        times[0].append(cycle.thinking_s)
        times[1].append(cycle.waiting_s)
        if watch is not None:
            watch(cycle)

    plan, choice = checked.plan, checked.loop
    timing: dict[str, Any]
    account: dict[str, Any] = {}
    if isinstance(plan, TrackPlan) and checked.recorded is not None and (rows := loop_rows(checked.recorded)):
        begun = time.monotonic()
        outcome, counters = replayed(checked, plan, rows, record)
        choice = LoopChoice("core", "mode = 'replay': the record is one of that loop, computed again cycle by cycle")
        timing = {"cycles": len(outcome.dataset["time_s"]), "elapsed_s": time.monotonic() - begun}
    else:
        with opened_rig(checked, record.recorder, arm=arm, key_file=key_file) as rig:
            begun = time.monotonic()
            if isinstance(plan, TrackPlan) and choice is not None and choice.name == "core":
                outcome, counters, account = track_on_core(checked, plan, rig, record, listen)
            else:
                outcome, counters = _run(checked, guarded(checked, rig, record), record, listen)
            timing = {**_timing(times, time.monotonic() - begun), **account}
    if choice is None:
        return outcome, counters, timing
    figures = {**outcome.figures, "loop": choice.name, "loop_reason": choice.reason}
    return replace(outcome, figures=figures), counters, {"loop": choice.name, **timing}


def _run(
    checked: CheckedExperiment, stand: Stand, record: RunRecord, listen: Callable[[Cycle], None]
) -> tuple[Outcome, dict[str, Any]]:
    def listen_here(cycle: Cycle) -> None:
        record.say(stand.events())
        if isinstance(checked.plan, SeekPlan | MapPlan) and record.recorder is not None:
            record.recorder.sample("seeker", checked.plan.estimate())
        listen(cycle)

    try:
        first = stand.start()
        plant, most = Watched(stand.plant, listen_here), stand.left()
        if most is not None and most < 1:
            raise DataError(f"{checked.record}: ends before the first cycle of the task")
        return checked.plan.run(plant, first, most), stand.counters()
    finally:
        record.say(stand.events())


def _timing(times: tuple[array[float], array[float]], elapsed_s: float) -> dict[str, Any]:
    out: dict[str, Any] = {"cycles": len(times[0]), "elapsed_s": elapsed_s}
    if times[0]:
        for name, seconds in zip(("thinking_us", "waiting_us"), times, strict=True):
            column = np.array(seconds) * 1e6
            out[name] = {f"p{q:g}": float(np.percentile(column, q)) for q in (50, 99, 99.9)} | {
                "max": float(column.max())
            }
    return out


def _keep(run: RunFolder, outcome: Outcome, result: ExperimentResult) -> None:
    run.json("timing.json", result.timing)
    run.dataset("signals.nc", outcome.dataset)
    for name, content in outcome.files.items():
        if isinstance(content, str):
            run.text(name, content)
        else:
            run.dataset(name, content)
    run.json("result.json", result.to_dict())
    for name, draw in outcome.drawings.items():
        run.figure(f"{name}.png", draw())
