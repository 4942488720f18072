"""Random files of LabVIEW and of calibration maps, records beside an encoder, logs of throttles and of rigs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fuzz_files import Case, Random, bench, case_of, chance, in_a_folder, pick, read_text, table
from mgdd.errors import Error
from mgdd.io import Encoder, read, read_pressure, read_throttle_log
from mgdd.maps import CalibrationMap, read_dcm, read_map, write_map
from mgdd.rig import Recorder, read_record, repair_record
from table_files import write_mat5, write_npz, write_parquet

__all__ = ["OTHERS"]

WRONG_CAD = 0.5


def lvm(rng: Random, _: Path) -> Case:
    """Write a measurement file of LabVIEW: one header, a section with its channels, X columns none, one or several."""
    mark, decimal = pick(rng, [("\t", "."), ("\t", ","), (",", ".")])
    form = pick(rng, ["{:.6f}", "{:.9E}"])

    def written(values: Any) -> Any:
        return np.vectorize(lambda value: float(form.format(float(value))))(values)

    content = bench(rng, written=written, matrix=False) if chance(rng, 0.5) else table(rng, ("f4",))
    content.columns = [each._replace(values=written(np.asarray(each.values))) for each in content.columns]
    content.has_units = False
    content.text["decimal"] = decimal
    columns, count = content.columns, len(content.columns)
    size = len(columns[0].values)
    kind = pick(rng, ["One", "No", "Multi"])
    lines: list[list[str]] = [
        ["LabVIEW Measurement", ""], ["Writer_Version", "2"], ["Reader_Version", "2"],
        ["Separator", "Tab" if mark == "\t" else "Comma"], ["Decimal_Separator", decimal], ["Multi_Headings", "No"],
        ["X_Columns", kind], ["Time_Pref", "Absolute"], ["Operator", "Öz"], ["Date", "2026/11/05"],
        ["Time", f"11:22:33{decimal}5"], ["***End_of_Header***", ""], [""],
        ["Channels", str(count), ""], ["Samples", *[str(size)] * count, ""], ["Date", *["2026/11/05"] * count, ""],
        ["Time", *["11:22:33"] * count, ""], ["Y_Unit_Label", *["Volts"] * count, ""],
        ["X_Dimension", *["Time"] * count, ""], ["X0", *["0.0E+0".replace(".", decimal)] * count, ""],
        ["Delta_X", *["0.001000".replace(".", decimal)] * count, ""], ["***End_of_Header***", *[""] * (count + 1)],
    ]  # fmt: skip
    heads = [cell for each in columns for cell in ("X_Value", each.name)] if kind == "Multi" else [
        "X_Value", *(each.name for each in columns)]  # fmt: skip
    lines.append([*heads, "Comment"])
    for row in range(size):
        x = form.format(0.001 * row)
        cells = [form.format(float(each.values[row])) for each in columns]
        if kind == "Multi":
            cells = [cell for own in cells for cell in (x, own)]
        else:
            cells = [x if kind == "One" else "", *cells]
        lines.append([cell.replace(".", decimal) for cell in cells])
    whole = "\n".join(mark.join(row) for row in lines) + "\n"
    encoding = pick(rng, ["utf-8", "cp1252"])
    return case_of(content, whole.encode(encoding, "replace"), pick(rng, ["a.lvm", "a.txt"]), encoding, read_text)


# --- an encoder ---------------------------------------------------------------------------------------------
def encoder(rng: Random, path: Path) -> Case:
    """Write a record over time beside a wheel, with edges lost and extra, or told wrong: no angle may be off unsaid."""
    speed, turns = rng.uniform(600.0, 4000.0), int(rng.integers(7, 13))
    teeth, missing = pick(rng, [(60, 2), (36, 1), (60, 0), (180, 0), (360, 0), (58, 0), (24, 2)])
    pitch = 360.0 / teeth
    per_tooth = int(rng.integers(6, 40) + pitch / 0.4)  # an edge between two samples may stand anywhere
    rate = speed * 6.0 / (360.0 / teeth) * per_tooth
    time = np.arange(0.0, turns * 60.0 / speed, 1.0 / rate)
    mean = 6.0 * speed * time * (1.0 + rng.uniform(-0.02, 0.02) * time / time[-1])
    phase = rng.uniform(0.0, 360.0)
    swing = min(0.8, 0.8 * (6.0 / pitch) ** 2)  # between edges nobody knows the angle
    behind = mean + rng.uniform(0.0, swing) * np.sin(np.deg2rad(2.0 * mean - phase)) + rng.uniform(0.0, 360.0)
    place = (behind % 360.0) / pitch
    if chance(rng, 0.6):
        signal = np.where((place < teeth - missing) & (place % 1.0 < 0.5), 4.8, 0.2)
    else:  # a coil: its edge is where it crosses 0 upwards
        signal = np.where(place < teeth - missing, np.sin(2.0 * np.pi * place), -0.3) * 3.0
    index = np.where((behind % 360.0) < 3.0 * pitch, 5.0, 0.0)
    edges = np.flatnonzero((signal[1:] > 1.0) & (signal[:-1] <= 1.0))
    faults = int(rng.integers(0, 6)) if chance(rng, 0.6) else 0
    for _ in range(faults):
        at = int(pick(rng, edges))
        wide = int(per_tooth * pick(rng, [0.3, 0.6, 1.0, 1.5, 2.0, 5.0 if pitch < 7.0 else 2.5]))
        level = pick(rng, [signal.min(), signal.max()])
        signal[at : at + max(wide, 1)] = level
    if chance(rng, 0.2):
        index[int(rng.integers(index.size))] = 5.0
    signal = signal + rng.normal(0.0, pick(rng, [0.0, 0.01, 0.05]), signal.size)
    tdc = rng.uniform(0.0, 360.0)
    cad = (behind - tdc + 180.0) % 720.0 - 180.0
    motored = 1.2 * (13.0 / (1.0 + 6.0 * (1.0 - np.cos(np.deg2rad(cad))))) ** 1.33
    bar = np.where(np.abs(cad) <= 180.0, motored + 40.0 * np.exp(-(((cad - 12.0) / 14.0) ** 2)), 1.2)
    has_index = missing == 0 and chance(rng, 0.8)
    told = {"teeth": teeth, "missing_teeth": missing}
    wrong = chance(rng, 0.25)
    if wrong:
        near = [(60, 1), (36, 1), (58, 0), (60, 2), (32, 0)]
        near += [(teeth * 2, 0), (teeth, missing + 1), (teeth - 1, missing)]
        told = dict(zip(told, pick(rng, near), strict=True))
    how: dict[str, Any] = {
        "encoder": Encoder(column="crank", **told, index_column="index" if has_index else None),
        "firing_tdc_deg": tdc if has_index or told["missing_teeth"] else (tdc - behind[edges[0]]) % 360.0,
        "pressure_column": "p",
    }  # fmt: skip
    if chance(rng, 0.3):
        how["angle_step_deg"] = pick(rng, [0.5, 1.0])
    columns: dict[str, Any] = {"time_s": time, "crank": signal, "p": bar, "index": index, "turned": behind}
    if not has_index:
        del columns["index"]
    write_npz(path, columns, {})
    no_mark = not has_index and not told["missing_teeth"]

    def check(file: Path) -> None:
        made = read(file, **how)
        angle, turned = made["crank_angle_cad"].to_numpy(), np.atleast_2d(made["turned"].to_numpy())
        off = (turned - tdc - angle + 180.0) % 360.0 - 180.0
        if no_mark:  # the angle counts from the first edge
            off = off - np.median(off)
        if no_mark and (faults or wrong):
            return  # that no edge is missing is taken for granted, and said
        if chance(np.random.default_rng(len(time)), 0.5):
            same = read_pressure(file, **how)["pressure_bar"]
            assert np.array_equal(same, made["pressure_bar"])
        most = max(WRONG_CAD, 2.5 * pitch / per_tooth)  # an edge is told by no more than its samples
        most *= 2.0 if "missing" in made.attrs["warnings"] else 1.0  # in a hole the speed is not known
        assert np.abs(off).max() <= most, (
            f"{np.abs(off).max():.3f} CAD off: {teeth}-{missing} told {told}, index {has_index}, {faults} faults, "
            f"{per_tooth} samples a tooth, {made.attrs['warnings']!r}"
        )

    return Case(path.read_bytes(), "a.npz", check, lambda file: read(file, **how))


# --- maps ---------------------------------------------------------------------------------------------------
def _words(rng: Random, plain: bool) -> str:
    parts = ["speed", "Moment", "Öl", "start of", "x'", "<b>", "&", "--", "°", "n/a", "[1]", "µ", "a]]>b", "*", "!"]
    return " ".join(pick(rng, parts[:4] if plain else parts) for _ in range(int(rng.integers(1, 4))))


def _map(rng: Random, name: str) -> CalibrationMap:
    sizes = [int(rng.integers(2, 12)) for _ in range(int(rng.integers(1, 3)))]
    names = [pick(rng, ["speed_rpm", "n", "a.b"]), pick(rng, ["fuel_mg", "load", "q[1]"])]
    scale = 10.0 ** rng.integers(-8, 8)
    axes = {each: np.unique(rng.normal(0.0, scale, size + 2))[:size] for each, size in zip(names, sizes, strict=False)}
    labels = {name: (pick(rng, ["-", "Nm", "°CA", "%", "bar"]), _words(rng, False))}
    return CalibrationMap(axes, rng.normal(0.0, scale, sizes), name=name, labels=labels)


def _labels(ending: str, rng: Random, path: Path) -> Case:
    """Write maps and values as mgdd does, or in a DCM file as other tools do; they come back bit for bit."""
    maps = {}
    for name in [*dict.fromkeys(pick(rng, ["Kf_A", "Kf.B[2]", "c%", "Kl_D_"]) for _ in range(int(rng.integers(1, 4))))]:
        maps[name] = _map(rng, name)
    values = {
        f"v{k}": (float(rng.normal(0.0, 1e3)), pick(rng, ["rpm", "-", "bar"])) for k in range(int(rng.integers(3)))
    }
    encoding = pick(rng, ["utf-8", "utf-8", "latin-1", "cp1252"])
    file = path.with_suffix(f".{ending}")
    try:
        write_map(maps, file, values=values, encoding=encoding)
    except Error:
        encoding = "utf-8"
        write_map(maps, file, values=values)
    raw = file.read_bytes()
    if chance(rng, 0.4) and ending == "dcm":
        raw = _foreign(rng, raw.decode(encoding)).encode(encoding, "replace")

    def check(made: Path) -> None:
        found = read_dcm(made)
        assert [*found.maps] == [*maps], found.skipped
        for name, one in maps.items():
            assert np.array_equal(found.maps[name].values, one.values), name
            for mine, own in zip(found.maps[name].axes.values(), one.axes.values(), strict=True):
                assert np.array_equal(mine, own), name
        assert {name: value for name, (value, _) in found.values.items()} == {
            name: v for name, (v, _) in values.items()
        }
        name = next(iter(maps))
        assert np.array_equal(read_map(made, name).values, maps[name].values)

    return Case(
        raw, f"a.{ending}", check, lambda made: (read_dcm(made), [read_map(made, name) for name in maps]), encoding
    )


def _foreign(rng: Random, text: str) -> str:
    """Write a DCM file as other tools do: tabs, comments, further keywords, other numbers in a line."""
    out = []
    for line in text.splitlines():
        if line.startswith(("KENN", "FEST")) and chance(rng, 0.3):
            out.append(pick(rng, ["* remark", "! remark", ".", 'FUNKTIONEN\n  FKT a "1" "b"\nEND']))
        words = line.split()
        if words and words[0] in ("WERT", "ST/X") and chance(rng, 0.5):
            out += [f"\t{words[0]}\t{word}" for word in words[1:]]
            continue
        out.append(line)
        if line.strip().startswith("LANGNAME") and chance(rng, 0.3):
            out.append(pick(rng, ['  FUNKTION "f"', "  DISPLAYNAME d", "  VAR a=b"]))
    return pick(rng, ["\n", "\r\n"]).join(out) + "\n"


# --- logs ---------------------------------------------------------------------------------------------------
def log(rng: Random, path: Path) -> Case:
    """Write a throttle log with its units, or the record of a rig."""
    if chance(rng, 0.3):
        return _record(rng, path)
    size, step = int(rng.integers(120, 900)), pick(rng, [0.001, 0.002, 0.005, 0.01])
    time = step * np.arange(size) + pick(rng, [0.0, 3.5])
    if time[-1] - time[0] < 0.6:
        return log(rng, path)
    units = {
        "time_s": pick(rng, ["s", "ms"]),
        "duty": pick(rng, ["-", "%"]),
        "angle_deg": pick(rng, ["deg", "rad", "%"]),
    }
    duty = np.clip(0.3 * np.sin(9.0 * time) + rng.normal(0.0, 0.05, size), -1.0, 1.0)
    angle = 30.0 + 20.0 * np.sin(9.0 * time - 0.5) + rng.normal(0.0, 0.1, size)
    held = {
        "t": time * (1e3 if units["time_s"] == "ms" else 1.0), "u": duty * (100.0 if units["duty"] == "%" else 1.0),
        "w": {"deg": angle, "rad": np.deg2rad(angle), "%": angle / 0.9}[units["angle_deg"]],
    }  # fmt: skip
    said = chance(rng, 0.5)
    how: dict[str, Any] = {"time": "t", "duty": "u", "angle": "w"}
    form, encoding = pick(rng, ["csv", "csv", "mat", "npz", "parquet"]), ""
    if form == "csv":
        mark = pick(rng, [";", "\t", ","])
        how["decimal"] = decimal = "," if mark != "," and chance(rng, 0.5) else "."
        cells = [[f"{value:.9g}" for value in column] for column in held.values()]
        held = {name: np.array([float(cell) for cell in column]) for name, column in zip(held, cells, strict=True)}
        rows = [mark.join(row).replace(".", decimal) for row in zip(*cells, strict=True)]
        head = [mark.join(held), *([mark.join(units.values())] if said else [])]
        encoding = pick(rng, ["utf-8", "utf-16", "utf-8-sig"])
        path.write_bytes("\n".join([*head, *rows, ""]).encode(encoding))
    else:
        said = said and form == "parquet"
        own = dict(zip(held, units.values(), strict=True)) if said else {}
        {"mat": write_mat5, "npz": write_npz, "parquet": write_parquet}[form](path, held, own)
    if not said:
        how |= {"time_unit": units["time_s"], "duty_unit": units["duty"], "angle_unit": units["angle_deg"]}
    raw = path.read_bytes()

    def check(file: Path) -> None:
        made = read_throttle_log(file, **how)
        assert np.allclose(made["time_s"], held["t"] * (1e-3 if units["time_s"] == "ms" else 1.0), rtol=1e-12)
        assert np.allclose(made["duty"], held["u"] * (0.01 if units["duty"] == "%" else 1.0), rtol=1e-12)
        scale = {"deg": 1.0, "rad": np.degrees(1.0), "%": 0.9}[units["angle_deg"]]
        assert np.allclose(made["angle_deg"], held["w"] * scale, rtol=1e-12)

    return Case(raw, f"a.{form}", check, lambda file: read_throttle_log(file, **how), encoding)


def _record(rng: Random, path: Path) -> Case:
    tables = {f"t{k}": [f"c{j}" for j in range(int(rng.integers(1, 5)))] for k in range(int(rng.integers(1, 4)))}
    rows: dict[str, list[Any]] = {name: [] for name in tables}
    with Recorder(path, config={"rig": "Öl", "gain": 2.5}) as record:
        for k in range(int(rng.integers(2, 60))):
            name = pick(rng, [*tables])
            rows[name].append(rng.normal(0.0, 1e3, len(tables[name])))
            record.sample(name, dict(zip(tables[name], rows[name][-1], strict=True)), monotonic_ns=1000 * k)
            if chance(rng, 0.1):
                record.event("state", "ARMED → RUN", monotonic_ns=1000 * k)

    def check(file: Path) -> None:
        run = read_record(file)
        for name, own in rows.items():
            if own:
                got = np.column_stack([run.samples[name][column] for column in tables[name]])
                assert np.array_equal(got, np.array(own)), name

    def damaged(file: Path) -> None:
        read_record(file)
        copy = file.with_name("b.rec")
        copy.write_bytes(file.read_bytes())
        repair_record(copy)
        assert read_record(copy).ignored_bytes == 0

    return Case(path.read_bytes(), "a.rec", check, damaged)


_MAKERS: dict[str, Callable[[Random, Path], Case]] = {
    "lvm": lvm, "encoder": encoder, "dcm": partial(_labels, "dcm"), "cdfx": partial(_labels, "cdfx"), "log": log,
}  # fmt: skip
OTHERS: dict[str, Callable[[Random, Path], Case]] = {name: partial(in_a_folder, make) for name, make in _MAKERS.items()}
