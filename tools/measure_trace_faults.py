"""Measure which faults of a pressure file are found or doubted: the table of docs/validation.md.

Each case puts one fault into simulated traces of both engine presets and asks whether the answer is right, or whether
an error or a doubt names the cause. Run: python tools/measure_trace_faults.py [--cycles N] [--only NAME]
"""

from __future__ import annotations

import argparse
import logging
import re
import tempfile
from pathlib import Path

import numpy as np
from measure_trace_analysis import NOISE_BAR, draw_cycle

from mgdd import errors, presets
from mgdd.engine import OperatingPoint, analyze, simulate
from mgdd.identify import estimate_tdc
from mgdd.io import pressure_trace, read_pressure

LEVEL = r"level|pegging|offset of the pressure"
TDC = r"TDC|top dead centre"
MASS = r"mass|temperature"
UNIT = r"MPa|psi|kPa|unit"


def trace_of(random, cycle, *, angle_cad=0.0, level_bar=0.0, noise_bar=NOISE_BAR, mass=1.0):
    """Give a simulated cycle as a measured one, with errors."""
    noise = noise_bar * random.standard_normal(cycle.sizes["crank_angle_cad"])
    made = pressure_trace(cycle.crank_angle_cad.values + angle_cad, cycle.pressure_bar.values + noise + level_bar)
    said = {"speed_rpm": cycle.attrs["speed_rpm"], "trapped_mass_g": cycle.attrs["trapped_mass_g"] * mass}
    return made.assign_attrs(said)


def outcome(call, is_right, cause):
    """Return right, found (an error or a doubt names the cause), other (another doubt), or silent (wrong, no word)."""
    try:
        result = call()
    except errors.Error as error:
        return "found" if re.search(cause, str(error)) else "other"
    except (TypeError, ValueError, IndexError):  # no error of the package: nothing that a user could use
        return "other"
    doubts = str(getattr(result, "attrs", {}).get("warnings", ""))
    if is_right(result):
        return "right" if not doubts else "other"
    return "found" if re.search(cause, doubts) else "other" if doubts else "silent"


def never(_):
    """Return that no figure of a faulty trace is right."""
    return False


def errored(random, cause, *, motored=False, **error):
    """Analyse a cycle with an error of level, angle or mass."""
    cylinder, point, cycle = draw_cycle(random, motored=motored)
    trace = trace_of(random, cycle, **error)
    return outcome(lambda: analyze(trace, cylinder, point=point, quiet=True), never, cause)


def clean(random, *, motored=False):
    """Analyse a clean cycle: a doubt is a false one."""
    cylinder, point, cycle = draw_cycle(random, motored=motored)
    trace = trace_of(random, cycle)
    return outcome(lambda: analyze(trace, cylinder, point=point, quiet=True), lambda _: True, "$^")


def spoilt(random, spoil, cause, *said, is_right=never):
    """Analyse a cycle whose samples were spoilt, where fuel or brake work are said."""
    cylinder, point, cycle = draw_cycle(random)
    trace = trace_of(random, cycle)
    spoil(random, trace["crank_angle_cad"].values, trace["pressure_bar"].values)
    work = float(cycle["imep_gross_bar"]) - random.uniform(0.8, 2.5)
    figures = {"fuel_mg": point.fuel_mg, "bmep_bar": max(0.0, work)}
    trace = trace.assign_attrs({name: figures[name] for name in said})
    return outcome(lambda: analyze(trace, cylinder, point=point, quiet=True), is_right, cause)


def stated(random, *said):
    """Analyse a clean cycle with stated fuel or brake work: a doubt is a false one."""
    return spoilt(random, lambda *_: None, "^$", *said, is_right=lambda _: True)


def clip(_random, _angle, pressure):
    """Cut the top off at 0.9 of the peak."""
    np.minimum(pressure, 0.9 * pressure.max(), out=pressure)


def stick(random, angle, pressure):
    """Hold one sample for 10 CAD in compression or late expansion."""
    start = random.choice([random.uniform(-90.0, -40.0), random.uniform(80.0, 105.0)])
    held = (angle >= start) & (angle <= start + 10.0)
    pressure[held] = pressure[held][0]


def spike(random, angle, pressure):
    """Add 5 bar to a sample of late expansion."""
    pressure[random.choice(np.flatnonzero((angle > 90.0) & (angle < angle[-1] - 5.0)))] += 5.0


def shock(_random, angle, pressure):
    """Read 1 bar low from 30 CAD behind top dead centre on."""
    pressure -= np.clip(angle / 30.0, 0.0, 1.0)


def gain(factor):
    """Multiply the pressure."""

    def spoil(_random, _angle, pressure):
        pressure *= factor

    return spoil


def calibrated(random, angle_cad, *, motored=False):
    """Estimate TDC of a cycle whose angles are off: found if the true offset is in the range and zero is not."""
    cylinder, point, cycle = draw_cycle(random, motored=motored, step_cad=0.5)
    trace = trace_of(random, cycle, angle_cad=angle_cad)
    found = estimate_tdc([trace], cylinder, point=point, span_cad=4.0)
    inside = found.low_cad <= angle_cad <= found.high_cad
    if angle_cad == 0.0:
        return "right" if not found.suspect else "other"
    return "found" if inside and found.suspect else "silent" if not found.suspect else "other"


def without_mass(random):
    """Leave the trapped mass out: the peak temperature must come within 12 %."""
    cylinder, point, cycle = draw_cycle(random)
    trace = trace_of(random, cycle).drop_attrs().assign_attrs(speed_rpm=cycle.attrs["speed_rpm"])
    true = float(cycle["t_max_k"])
    hot = analyze(trace, cylinder, point=point, quiet=True)["t_max_k"]
    return "right" if abs(float(hot) / true - 1.0) < 0.12 else "silent"


def early_burn(random):
    """Burn a spark-ignition charge early: CA50 within 1 CAD of that of the same analysis given the true window."""
    cylinder = presets.load("puma_single").cylinder.replace(
        burn_shape="wiebe", compression_ratio=10.5, gamma=1.33, wall_heat_scale=random.uniform(0.5, 1.2)
    )
    soc = random.uniform(-40.0, -30.0)
    point = OperatingPoint(
        speed_rpm=1500.0, fuel_mg=15.0, intake_pressure_kpa=70.0, burn_duration_cad=random.uniform(35.0, 55.0)
    )
    cycle = simulate(cylinder, point, soc_cad=soc, step_cad=0.5)
    trace = trace_of(random, cycle, noise_bar=0.02)
    end = soc + point.burn_duration_cad + 5.0
    true = float(analyze(trace, cylinder, point=point, heat_window_cad=(soc, end), quiet=True)["ca50_cad"])
    call = {"point": point, "quiet": True}
    return outcome(lambda: analyze(trace, cylinder, **call), lambda r: abs(float(r["ca50_cad"]) - true) < 1.0, "window")


def low_load(random):
    """Fire little: it must not be called motored."""
    cylinder, point, _ = draw_cycle(random)
    heat = 1.0e2 * cylinder.swept_volume_l * random.uniform(0.5, 1.0) / 0.45  # 0.5 to 1 bar of work at 45 %
    weak = point.replace(fuel_mg=heat / cylinder.lower_heating_value_mj_per_kg)
    cycle = simulate(cylinder, weak, soc_cad=random.uniform(-8.0, 2.0), step_cad=0.5)
    result = analyze(trace_of(random, cycle), cylinder, point=weak, quiet=True)
    return "right" if not result.attrs["motored"] else "silent"


def impossible_work(random):
    """State a BMEP of 1.08 times what the cylinder gave."""
    cylinder, point, cycle = draw_cycle(random)
    trace = trace_of(random, cycle).assign_attrs(bmep_bar=1.08 * float(cycle["imep_gross_bar"]))
    return outcome(lambda: analyze(trace, cylinder, point=point, quiet=True), never, "IMEP|BMEP|bmep")


def of_file(random, write, cause, *, cycles=1, **options):
    """Write a file, read and analyse it with what its header does not say left out."""
    cylinder, point, cycle = draw_cycle(random, step_cad=0.5)
    angle, pressure = cycle.crank_angle_cad.values, cycle.pressure_bar.values
    many = np.array([pressure + NOISE_BAR * random.standard_normal(angle.size) for _ in range(cycles)])
    true = float(np.max(pressure))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.csv"
        write(file, angle, many)

        def right(result):
            found = np.atleast_1d(np.asarray(result["p_max_bar"], float))
            return found.size == cycles and bool(np.all(np.abs(found / true - 1.0) < 0.02))

        return outcome(lambda: analyze(read_pressure(file, **options), cylinder, point=point, quiet=True), right, cause)


def columns(head, scale=1.0, angle_of=lambda angle: angle):
    """Return a writer of one angle column and the cycles beside it."""

    def write(file, angle, many):
        rows = np.column_stack([angle_of(angle), *(scale * many)])
        names = ",".join([head[0], *(head[1] if len(many) == 1 else f"{head[1]}_{k + 1}" for k in range(len(many)))])
        np.savetxt(file, rows, delimiter=",", header=names, comments="", fmt="%.6f")

    return write


def whole(angle, pressure):
    """Close a simulated part to 720 degrees at its first pressure."""
    step = float(np.median(np.diff(angle)))
    full = np.arange(-360.0, 360.0, step)
    return full, np.interp(full, angle, pressure, left=pressure[0], right=pressure[0])


def stacked(running):
    """Return a writer of cycles of 720 degrees one below the other, or with angles that run on."""

    def write(file, angle, many):
        parts = []
        for k, pressure in enumerate(many):
            full, values = whole(angle, pressure)
            parts.append(
                np.column_stack([full + (720.0 * k if running else 0.0) + (360.0 if running else 0.0), values])
            )
        np.savetxt(file, np.vstack(parts), delimiter=",", header="angle_deg,p_bar", comments="", fmt="%.6f")

    return write


def over_time(random, error, cycles=20):
    """Read cycles of scattered fuel, charge and burn over time, with an error of the stated speed, as a share.

    Met is a speed told right or corrected to 3e-5, 0.4 CAD from the first cycle to the last, or one that is refused.
    """
    cylinder, point, first = draw_cycle(random, step_cad=0.5)
    speed, soc = first.attrs["speed_rpm"], float(first["soc_cad"])
    parts = []
    for _ in range(cycles):
        fuel, charge = 1.0 + 0.03 * random.standard_normal(), 1.0 + 0.01 * random.standard_normal()
        drawn = point.replace(fuel_mg=point.fuel_mg * fuel, intake_pressure_kpa=point.intake_pressure_kpa * charge)
        cycle = simulate(cylinder, drawn, soc_cad=soc + random.uniform(-1.0, 1.0), step_cad=0.5)
        _, pressure = whole(cycle.crank_angle_cad.values, cycle.pressure_bar.values)
        parts.append(pressure + NOISE_BAR * random.standard_normal(pressure.size))
    seconds = 0.5 / (6.0 * speed) * np.arange(sum(map(len, parts)))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.csv"
        rows = np.column_stack([seconds, np.concatenate(parts)])
        np.savetxt(file, rows, delimiter=",", header="time_s,p_bar", comments="", fmt="%.9f")
        call = {"speed_rpm": speed * (1.0 + error), "firing_tdc_deg": 360.0}
        try:
            trace = read_pressure(file, **call)
        except errors.DataError as refused:
            return "found" if error and "engine ran at" in str(refused) else "other"
    if abs(trace.attrs["speed_rpm"] / speed - 1.0) > 3e-5:
        return "silent" if not trace.attrs["warnings"] else "other"
    told = "engine ran at" in trace.attrs["warnings"]
    return ("found" if told else "silent") if error else ("other" if trace.attrs["warnings"] else "right")


CASES = {
    "clean, fired": clean,
    "clean, motored": lambda r: clean(r, motored=True),
    **{f"pegging {x:+.1f} bar, fired": lambda r, x=x: errored(r, LEVEL, level_bar=x) for x in (-0.3, 0.3)},
    **{
        f"TDC {x:+.1f} CAD, motored": lambda r, x=x: errored(r, TDC, motored=True, angle_cad=x)
        for x in (-3.0, -1.0, -0.5, 0.5, 1.0, 3.0)
    },
    **{f"TDC {x:+.1f} CAD, fired": lambda r, x=x: errored(r, TDC, angle_cad=x) for x in (-3.0, -1.0, 1.0, 3.0)},
    **{
        f"estimate_tdc {x:+.1f} CAD, motored": lambda r, x=x: calibrated(r, x, motored=True)
        for x in (-3.0, -1.0, -0.5, 0.0, 0.5, 1.0, 3.0)
    },
    **{f"estimate_tdc {x:+.1f} CAD, fired": lambda r, x=x: calibrated(r, x) for x in (-3.0, -1.0, 0.0, 1.0, 3.0)},
    "trapped mass in kg": lambda r: errored(r, MASS, mass=1e-3),
    "trapped mass in mg": lambda r: errored(r, MASS, mass=1e3),
    "no trapped mass": without_mass,
    "early burn, -40 to -30": early_burn,
    "low load, 0.5 to 1 bar": low_load,
    "BMEP above the gross IMEP": impossible_work,
    "clipped at 0.9 of the peak": lambda r: spoilt(r, clip, "clipped"),
    "stuck for 10 CAD": lambda r: spoilt(r, stick, "stuck"),
    "+5 bar in expansion": lambda r: spoilt(r, spike, "spike"),
    "thermal shock of -1 bar": lambda r: spoilt(r, shock, "thermal shock"),
    "fuel stated": lambda r: stated(r, "fuel_mg"),
    "BMEP stated": lambda r: stated(r, "bmep_bar"),
    **{f"gain {x}, fuel stated": lambda r, x=x: spoilt(r, gain(x), "gain", "fuel_mg") for x in (0.9, 1.1)},
    **{f"gain {x}, BMEP stated": lambda r, x=x: spoilt(r, gain(x), "gain|BMEP|bmep", "bmep_bar") for x in (0.9, 1.1)},
    "60 cycle columns": lambda r: of_file(r, columns(("angle_deg", "p_bar")), "cycle|column", cycles=60),
    "five cycles stacked": lambda r: of_file(r, stacked(False), "cycle", cycles=5),
    "angles running to 3600": lambda r: of_file(r, stacked(True), "cycle|firing_tdc", cycles=5),
    "MPa in the header": lambda r: of_file(r, columns(("angle_deg", "p [MPa]"), 0.1), UNIT),
    "MPa not stated": lambda r: of_file(r, columns(("angle", "p"), 0.1), UNIT),
    "psi not stated": lambda r: of_file(r, columns(("angle", "p"), 14.5038), UNIT),
    **{f"speed {100 * x:+.2f} %, over time": lambda r, x=x: over_time(r, x) for x in (0.0, 0.0003, -0.0003, 0.05)},
    "time_s": lambda r: of_file(r, columns(("time_s", "p_bar"), 1.0, lambda a: (a + 360.0) / 9000.0), "time|speed"),
    "time_ms": lambda r: of_file(r, columns(("time_ms", "p_bar"), 1.0, lambda a: (a + 360.0) / 9.0), "time|speed"),
}


def main():
    """Print one row per case: right or found, other doubts, silent."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=100)
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    logging.disable(logging.WARNING)
    for name, case in CASES.items():
        if args.only not in name:
            continue
        random = np.random.default_rng(11)
        n = (
            5 * args.cycles
            if name == "clean, fired"
            else min(args.cycles, 20)
            if "60" in name or "_tdc" in name
            else args.cycles
        )
        counts = dict.fromkeys(("right", "found", "other", "silent"), 0)
        for _ in range(n):
            counts[case(random)] += 1
        text = ", ".join(f"{word} {100.0 * count / n:.1f} %" for word, count in counts.items())
        print(f"{name:28} {text}", flush=True)


if __name__ == "__main__":
    main()
