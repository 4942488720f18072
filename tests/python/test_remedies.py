"""A message names an argument only where the function that was called takes it: every remedy is tried at its door."""

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.engine import analyze
from mgdd.errors import Error, arguments_written
from mgdd.identify import identify_throttle
from mgdd.io import pressure_trace, read, read_pressure, read_throttle_log, throttle_log
from mgdd.presets import load

ANGLE = np.arange(-180.0, 181.0)
BAR = 1.0 + 50.0 * np.exp(-((ANGLE / 30.0) ** 2))
TIME = np.arange(3000) * 1e-3
DUTY, PLATE = 0.2 * np.sin(6.0 * TIME), 20.0 + 15.0 * np.sin(6.0 * TIME - 0.5)
GAPS = np.delete(np.arange(3000), np.arange(400, 3000, 400))
# What was done to a sound record, as (angle, pressure) and (time, duty, plate angle).
TRACES: dict[str, tuple[Any, Any]] = {
    "kPa": (ANGLE, 100.0 * BAR),
    "radians": (np.deg2rad(ANGLE), BAR),
    "seconds": (np.arange(361) * 1e-4, BAR),
    "before TDC": (-ANGLE, BAR),
    "0 to 720": (ANGLE + 360.0, BAR),
    "runs on": (np.arange(2000.0), np.tile(BAR, 6)[:2000]),
    "a gap": (np.delete(ANGLE, [50, 51]), np.delete(BAR, [50, 51])),
    "not finite": (ANGLE, np.where(ANGLE == 7.0, np.nan, BAR)),
    "a few samples": (ANGLE[:12], BAR[:12]),
    "of a milliampere": (ANGLE, BAR * 1e-3),
    "all the same": (ANGLE, np.ones(361)),
}
LOGS: dict[str, tuple[Any, Any, Any]] = {
    "milliseconds": (1e3 * TIME, DUTY, PLATE),
    "percent": (TIME, 100.0 * DUTY, PLATE),
    "radians": (TIME, DUTY, np.deg2rad(PLATE)),
    "percent of travel": (TIME, DUTY, PLATE / 0.36),
    "exchanged": (TIME, PLATE, DUTY),
    "time exchanged": (DUTY, TIME, PLATE),
    "uneven": (TIME + 3e-4 * (np.arange(3000) % 2), DUTY, PLATE),
    "repeated": (np.where(np.arange(3000) == 5, TIME[4], TIME), DUTY, PLATE),
    "not finite": (TIME, DUTY, np.where(TIME == 0.5, np.nan, PLATE)),
    "gaps, each part short": tuple(each[GAPS] for each in (TIME, DUTY, PLATE)),
    "below zero": (TIME, DUTY, PLATE - 40.0),
    "still": (TIME, DUTY, 0.0 * PLATE),
    "short": (TIME[:100], DUTY[:100], PLATE[:100]),
}


def _file(folder: Path, names: str, columns: tuple[Any, ...]) -> Path:
    rows = "\n".join(",".join(map(repr, row)) for row in np.stack(columns, axis=1).tolist())
    (folder / "record.csv").write_text(f"{names}\n{rows}\n")
    return folder / "record.csv"


def _of_pressure_file(folder: Path, record: Any, **options: Any) -> Any:
    return read_pressure(_file(folder, "crank_angle_cad,p", record), **options)


def _of_bench_file(folder: Path, record: Any, **options: Any) -> Any:
    return read(_file(folder, "crank_angle_cad,p", record), **options)


def _analyzed(folder: Path, record: Any, **options: Any) -> Any:
    return analyze(_file(folder, "crank_angle_cad,p", record), load("puma_single").cylinder, **options)


def _analyzed_pair(_: Path, record: Any, **options: Any) -> Any:
    return analyze(record, load("puma_single").cylinder, **options)


def _of_log_file(folder: Path, record: Any, **options: Any) -> Any:
    return read_throttle_log(_file(folder, "time_s,duty,angle_deg", record), **options)


def _identified(_: Path, record: Any, **options: Any) -> Any:
    return identify_throttle(dict(zip(("time_s", "duty", "angle_deg"), record, strict=True)), "pw_r", **options)


DOORS: list[tuple[Callable[..., Any], Callable[..., Any], dict[str, Any]]] = [
    (read_pressure, _of_pressure_file, TRACES),
    (read, _of_bench_file, TRACES),
    (pressure_trace, lambda _, record, **options: pressure_trace(*record, **options), TRACES),
    (analyze, _analyzed, TRACES),
    (analyze, _analyzed_pair, TRACES),
    (read_throttle_log, _of_log_file, LOGS),
    (throttle_log, lambda _, record, **options: throttle_log(*record, **options), LOGS),
    (identify_throttle, _identified, LOGS),
]


@pytest.mark.parametrize(("door", "call", "records"), DOORS)
def test_a_remedy_is_taken_where_it_is_given(
    door: Callable[..., Any], call: Callable[..., Any], records: dict[str, Any], tmp_path: Path
) -> None:
    taken, named = set(inspect.signature(door).parameters), 0
    for what, record in records.items():
        with arguments_written(lambda name, text: f"<{name}={text or ''}>"), pytest.raises(Error) as refused:
            call(tmp_path, record)
        marked = re.findall(r"<(\w+)=([^>]*)>", str(refused.value))
        assert {name for name, _ in marked} <= taken, (what, str(refused.value))
        # Another function is named with what it takes.
        for owner, name in re.findall(r"mgdd\.io\.(\w+)\(\.\.\., (\w+)=", str(refused.value)):
            assert name in inspect.signature(getattr(__import__("mgdd.io").io, owner)).parameters
        given = {name: eval(text) for name, text in marked if text and text != "..."}
        named += len(given)
        for name, value in given.items():
            after = ""
            try:
                call(tmp_path, record, **{name: value})
            except Error as error:  # of something else that is wrong, or of one of two remedies tried alone
                after = str(error)
            assert after != str(refused.value), (what, name)
    assert named or door in (analyze, identify_throttle)


def test_a_remedy_for_arrays_is_done_to_the_arrays() -> None:
    with pytest.raises(Error, match=r"pass pressure_bar \* 0\.01"):
        pressure_trace(*TRACES["kPa"])
    with pytest.raises(Error, match=r"numpy\.rad2deg\(crank_angle_cad\)"):
        pressure_trace(*TRACES["radians"])
    with pytest.raises(Error, match=r"pass duty / 100"):
        throttle_log(*LOGS["percent"])
    with pytest.raises(Error, match=r"mgdd\.io\.throttle_log\(\.\.\., sample_s=0\.001\)"):
        _identified(Path(), LOGS["uneven"])
