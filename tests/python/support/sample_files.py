"""A good file of every kind that mgdd reads, and the readers that take it."""

import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from map_cases import timing_table
from mgdd import io, presets
from mgdd.design import design_points
from mgdd.identify import load_throttle_model
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.io.binary_files import read_netcdf
from mgdd.io.parameters import ParameterFile
from mgdd.io.point_table import read_conditions, read_points
from mgdd.loop import Reference
from mgdd.maps import CalibrationMap, read_dcm, read_map, write_map
from mgdd.optimize import GradientDescent, Limit, MapSeeking, Seeker
from mgdd.rig import (  # fmt: skip
    Experiment,
    Recorder,
    SafetyEnvelope,
    SignalMap,
    export_record,
    read_record,
    repair_record,
)
from mgdd.rig.can.dbc import DbcFile
from mgdd.rig.exchange import RigRecord  # fmt: skip
from mgdd.surrogate import ResponseModel, fit_response
from mgdd.throttle import DemandChain, PseudoWiener, SensorPair
from recorded_rig import write as write_record
from user_buses import FOREIGN_MAP, write_foreign

CONDITIONS = (
    "file,speed_rpm,soi_cad,fuel_mg,bmep_bar,intake_pressure_kpa\n"
    "a.csv,1200,-5.25,21.5,4.75,101.3\nb.csv,1800,-8,34,,150.25\nc.csv,2400.5,2.5,0,9.125,\n"
)
GRID = "BSFC [g/kWh]\nspeed [1/min]\\torque [Nm],10,20.5,40\n900,310,275,\n1500,300.25,250,231\n3000,320,270,240\n"
POINTS = "speed_rpm,torque [Nm],bsfc_g_per_kwh\n900,10,310\n1500,10,300.25\n900,20.5,275\n1500,20.5,250\n900,10,312\n"
EXPERIMENT = (
    'kind = "experiment"\nformat = 1\nseed = 5\ntask = "track"\n[track]\nreference = "step:20:35"\ncontroller = "pid"\n'
)


class Sample(NamedTuple):
    """A reader with the ending of its files and a good one.

    Parameters
    ----------
    read : callable
        Reads a path.
    ending : str
        Of the file.
    make : callable
        Writes a good file.
    """

    read: Callable[[Path], Any]
    ending: str
    make: Callable[[Path], None]


def _text(text: str) -> Callable[[Path], None]:
    return lambda path: _write(path, text)


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _pressure(path: Path) -> None:
    rows = "".join(f"{angle},{60.0 - 0.01 * angle * angle:.4f}\n" for angle in range(-60, 61, 4))
    _write(path, f"crank_angle_cad,p [bar]\n{rows}")


def _log(path: Path) -> None:
    time = np.arange(80) * 0.01
    rows = zip(time, 0.3 * np.sin(9.0 * time), 25.0 + 15.0 * np.sin(9.0 * time - 0.5), strict=True)
    _write(path, "time_s,duty,angle_deg\n" + "".join(f"{t:.2f},{u:.4f},{a:.3f}\n" for t, u, a in rows))


def _map_search(path: Path) -> None:
    search = MapSeeking({"soc_cad": (-20.0, 5.0)}, {"fuel_mg": [10.0, 20.0]}, limits={"p_max_bar": 95.0})
    search.tell({"fuel_mg": 12.0}, {"soc_cad": -3.0}, 41.0, [80.0])
    search.save(path)


def _seeker(path: Path) -> None:
    limit = Limit(name="p_max_bar", upper=110.0)
    seeker = GradientDescent(start=-6.0, bounds=(-20.0, 10.0), limits=[limit])
    for _ in range(5):
        u = float(seeker.ask()[0])
        seeker.tell(0.0 - 0.01 * u * u, limits={"p_max_bar": 90.0 - u})
    seeker.save(path)


def _dbc(path: Path) -> None:
    write_foreign(path.parent)
    (path.parent / "foreign.dbc").rename(path)


def _signal_map(path: Path) -> None:
    write_foreign(path.parent)
    _write(path, FOREIGN_MAP)


def _record(path: Path) -> None:
    write_record(path)


def _exchanges(path: Path) -> None:
    with Recorder(path) as record:
        for k in range(3):
            record.sample(
                "rig", {"input.duty": 0.1 * k, "component.0": 4.25 - k, "value.angle_deg": 9.5, "misfire": 0.0}
            )


def _dcm(path: Path) -> None:
    table = CalibrationMap({"fuel_mg": [6, 20, 33.5]}, [-1.25, -4, -6], name="soc_cad")
    write_map({"SocBase": table}, path, values={"idle_rpm": (850.0, "rpm")})


@cache
def _response() -> str:
    plan = design_points({"speed_rpm": (1000.0, 3000.0), "fuel_mg": (5.0, 40.0)}, 24, method="lhs", seed=2)
    return fit_response(plan, 0.3 * plan["fuel_mg"].values + 1e-3 * plan["speed_rpm"].values).model.to_toml()


def _of_toml(cls: Any, make: Callable[[], str]) -> Sample:
    return Sample(lambda path: cls.of_file(ParameterFile.read(path)), "toml", lambda path: _write(path, make()))


def _export(path: Path) -> Any:
    shutil.rmtree(path.with_name("out"), ignore_errors=True)
    return export_record(path, path.with_name("out"), kind="csv")


SAMPLES: dict[str, Sample] = {
    "io.read": Sample(io.read, "csv", _pressure),
    "io.pressure_chunks": Sample(lambda path: list(io.pressure_chunks(path)), "csv", _pressure),
    "io.read_pressure": Sample(io.read_pressure, "csv", _pressure),
    "io.read_throttle_log": Sample(io.read_throttle_log, "csv", _log),
    "io.read_conditions": Sample(read_conditions, "csv", _text(CONDITIONS)),
    "points": Sample(read_points, "csv", _text("speed_rpm,fuel [mg],note\n900,6.5,cold\n1500,20,warm\n")),
    "loop.Reference.parse": Sample(
        lambda path: Reference.parse(str(path)), "csv", _text("time_s,reference_deg\n0,10\n0.002,11\n0.004,12\n")
    ),
    "maps.read_map": Sample(read_map, "csv", lambda path: write_map(timing_table(), path)),
    "maps.CalibrationMap.load": Sample(CalibrationMap.load, "nc", timing_table().save),
    "netcdf": Sample(read_netcdf, "nc", lambda path: write_map(timing_table(), path)),
    "maps.read_dcm": Sample(read_dcm, "dcm", _dcm),
    "maps.read_dcm cdfx": Sample(read_dcm, "cdfx", _dcm),
    "maps.read_map grid": Sample(read_map, "csv", _text(GRID)),
    "maps.read_map points": Sample(read_map, "csv", _text(POINTS)),
    "optimize.MapSeeking.load": Sample(MapSeeking.load, "json", _map_search),
    "optimize.Seeker.load": Sample(Seeker.load, "json", _seeker),
    "identify.load_throttle_model": Sample(
        load_throttle_model, "toml", lambda path: _write(path, FirstPrincipleModel().to_toml())
    ),
    "presets.load": Sample(presets.load, "toml", lambda path: _write(path, presets.load("puma_single").to_toml())),
    "presets.load throttle": Sample(presets.load, "toml", lambda path: _write(path, presets.load("P1").to_toml())),
    "rig.Experiment.load": Sample(Experiment.load, "toml", _text(EXPERIMENT)),
    "rig.SafetyEnvelope.load": Sample(
        SafetyEnvelope.load, "toml", lambda path: _write(path, SafetyEnvelope().to_toml())
    ),
    "rig.SignalMap.load": Sample(SignalMap.load, "toml", _signal_map),
    "dbc": Sample(DbcFile.read, "dbc", _dbc),
    "rig.read_record": Sample(read_record, "rec", _record),
    "rig.repair_record": Sample(repair_record, "rec", _record),
    "rig.export_record": Sample(_export, "rec", _record),
    "rig.RigRecord.read": Sample(RigRecord.read, "rec", _exchanges),
    "identify.FirstPrincipleModel": _of_toml(FirstPrincipleModel, lambda: FirstPrincipleModel().to_toml()),
    "surrogate.ResponseModel": _of_toml(ResponseModel, _response),
    "throttle.DemandChain": _of_toml(DemandChain, lambda: DemandChain().to_toml()),
    "throttle.PseudoWiener": _of_toml(PseudoWiener, lambda: PseudoWiener("pw_r").to_toml()),
    "throttle.SensorPair": _of_toml(SensorPair, lambda: SensorPair().to_toml()),
}


def sample_file(name: str, folder: Path) -> Path:
    """Write a good file of a reader."""
    path = folder / f"sample.{SAMPLES[name].ending}"
    SAMPLES[name].make(path)
    return path
