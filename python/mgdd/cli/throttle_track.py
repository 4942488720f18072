"""`mgdd throttle track | tune | export`: a controller along a reference, the tuner of its numbers, and as C++."""

from __future__ import annotations

import argparse
import json
import shlex
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from mgdd.cli.from_library import Options, default_of, named_options
from mgdd.cli.options import option
from mgdd.cli.output import emit, lines, warn
from mgdd.cli.ranges import number_pairs
from mgdd.cli.throttle import add_preset, add_throttle, known_only, plate_in
from mgdd.errors import DataError, ParameterError
from mgdd.identify import load_throttle_model
from mgdd.loop import Reference, export_controller, track, tune_controller
from mgdd.loop.controller_families import FAMILIES
from mgdd.loop.export import CPP, FILES
from mgdd.loop.track import FIGURES, step_times_us
from mgdd.loop.tune import with_stiction
from mgdd.loop.tuned import tuned_with_doubts
from mgdd.plot import throttle_run
from mgdd.plot.style import drawn
from mgdd.report import Table
from mgdd.throttle import Throttle

_AIR = Options(track, airflow_torque_nm="airflow")
_RUN = Options(track, "delay_samples", "noise_deg", "seed")
_EXPORT = Options(export_controller, single_precision="float")
_TUNE = Options(tune_controller, "spread", "budget", "seed", "delay_samples", "noise_deg", n_throttles="throttles")


def _add_track(parser: Any) -> None:
    _add_controller(parser)
    _add_loop(parser, "step:40:42")
    _AIR.add(parser)
    option(parser, "--figure FILE", "draw the run (.png, .svg or .pdf)")


def _add_export(parser: Any) -> None:
    kinds = [kind for kind in FAMILIES if kind != "mgdd1"]
    option(parser, "controller CONTROLLER", f"kind: {', '.join(kinds)}", choices=kinds)
    option(parser, "--language", "of the target", default="c++", choices=("c++",))
    _EXPORT.add(parser)
    _add_loop(parser, default_of(export_controller, "reference"))


def _add_loop(parser: Any, reference: str) -> None:
    option(parser, "--reference REFERENCE",
           "step:FROM:TO, sine:MEAN:AMPLITUDE:HZ, or a CSV file with time_s, reference_deg",
           default=reference)  # fmt: skip
    group = parser.add_argument_group("plant")
    add_preset(group)
    option(group, "--plant-scale FIELD=FACTOR ...",
           "multiply a field of the plant, repeatable; the controller does not know, for example coulomb_nm=1.4 "
           "(stiction goes with it)")  # fmt: skip
    _RUN.add(group)
    option(parser, "--model FIT.toml", "what the controller knows: a fit of mgdd throttle identify (default: preset)")
    option(parser, "--numbers FILE.json", "of the controller: what mgdd throttle tune --json has printed")


def _add_tune(parser: Any) -> None:
    _add_controller(parser)
    _TUNE.add(parser)
    add_throttle(parser)


def _add_controller(parser: argparse.ArgumentParser) -> None:
    option(parser, "--controller", "kind", default="guided", choices=tuple(FAMILIES))


@dataclass(frozen=True)
class _Loop:
    """What `track` and `export` run, as their options say, and the first keys of what they print."""

    controller: Any
    reference: Reference
    how: dict[str, Any]  # keywords of the run
    payload: dict[str, Any]
    doubts: tuple[str, ...]


def _loop_in(args: argparse.Namespace) -> _Loop:
    plate, preset = plate_in(args)
    numbers = [name for name, field in Throttle.fields().items() if "choices" not in field]
    scales = with_stiction(known_only(number_pairs(args.plant_scale, "--plant-scale"), numbers, "--plant-scale"))
    known = plate.plant
    if scales and not isinstance(known, Throttle):
        raise ParameterError.of("--plant-scale", args.plant_scale, "left out: a pseudo-Wiener fit has no such fields")
    changes = {name: getattr(known, name) * factor for name, factor in scales.items()}
    plant: Any = replace(plate, plant=known.replace(**changes)) if isinstance(known, Throttle) else plate
    model: Any = plate if args.model is None else load_throttle_model(args.model)
    reference = Reference.parse(args.reference)
    how = _RUN.of(args)
    controller, doubts = tuned_with_doubts(
        args.controller,
        model,
        numbers=None if args.numbers is None else _numbers_in(args.numbers, args.controller),
        sample_s=reference.sample_s,
        delay_samples=None if args.model is not None else plate.delay_samples(how["delay_samples"], reference.sample_s),
        noise_deg=how["noise_deg"],
    )
    warn(*doubts)
    payload = {
        "controller": args.controller,
        "reference": reference.name,
        "preset": preset,
        "plant_scale": scales,
        "seed": how["seed"],
    }
    return _Loop(controller, reference, {"throttle": plant, **how}, payload, doubts)


def _figures_of(loop: _Loop, run: Any) -> dict[str, Any]:
    """Give what both print of a run, and warn of what it shows."""
    swings = str(run.attrs.get("findings", "")).splitlines()
    warn(*swings)
    figures = {name: float(run[name]) for name in FIGURES}
    return {**loop.payload, **figures, "band_deg": loop.reference.band_deg, "warnings": [*loop.doubts, *swings]}


def _track(args: argparse.Namespace) -> None:
    loop = _loop_in(args)
    with named_options(airflow_torque_nm="airflow"):
        run = track(loop.controller, loop.reference, **_AIR.given(args), **loop.how)
    p50, p999 = step_times_us(loop.controller, run)
    payload = _figures_of(loop, run) | {"step_us_p50": p50, "step_us_p999": p999}
    traces = run.drop_vars([name for name in FIGURES if name in run])
    emit(args, payload, traces=traces, figure=partial(drawn, throttle_run, run, size=(7.0, 5.4)))


def _export(args: argparse.Namespace) -> None:
    folder, args.output = args.output, None
    if folder is None:
        raise ParameterError("-o is needed: name the folder to write into, for example -o target")
    loop = _loop_in(args)
    with named_options(single_precision="float"):
        run = export_controller(loop.controller, folder, reference=loop.reference, **_EXPORT.given(args), **loop.how)
    payload = _figures_of(loop, run) | {
        "samples": run.sizes["time_s"],
        "allowed_difference": run.attrs["allowed_difference"],
        "files": [str(Path(folder) / name) for name in FILES],
        "cmake_dir": str(CPP / "cmake"),
    }
    build = shlex.join(["cmake", "-S", folder, "-B", f"{folder}/build", f"-Dmgdd_DIR={CPP / 'cmake'}"])
    text = [lines(payload), *payload["files"], "", f"{build} && cmake --build {shlex.quote(folder)}/build"]
    emit(args, payload, text="\n".join(text))


def _tune(args: argparse.Namespace) -> None:
    plate, preset = plate_in(args)
    found = tune_controller(args.controller, plate, **_TUNE.given(args))
    payload = {
        "controller": found.kind,
        "preset": preset,
        "cost": found.cost,
        "start_cost": found.start_cost,
        "evaluations": found.evaluations,
        "numbers": dict(found.numbers),
        **found.settings,
    }
    said = (
        f"{FAMILIES[found.kind].label} for throttles around {preset}: cost {found.start_cost:.3f} -> {found.cost:.3f} "
        f"in {found.evaluations} runs of {found.settings['n_throttles']} throttles\n"
    )
    delay = f"delay_samples={found.settings['delay_samples']}"
    text: list[str | Table] = [
        said,
        Table(columns=("number", "tuned"), rows=tuple((name, f"{value:g}") for name, value in found.numbers.items())),
        f"\nIn Python: mgdd.loop.tuned_controller({found.kind!r}, throttle, numbers={{...}}, {delay})",
    ]
    emit(args, payload, text=text)


def _numbers_in(file: str, kind: str) -> dict[str, float]:
    """Read what `mgdd throttle tune --json` has printed for that kind."""
    try:
        found = json.loads(Path(file).read_text(encoding="utf-8"))
        own, numbers = found["controller"], {str(name): float(value) for name, value in found["numbers"].items()}
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise DataError(f"{file}: not what mgdd throttle tune --json prints: {error!r}") from error
    if own != kind:
        raise ParameterError.of("--numbers", file, f"of the controller {kind}: these are of {own}")
    return numbers


COMMANDS = {"track": (_add_track, _track), "tune": (_add_tune, _tune), "export": (_add_export, _export)}
