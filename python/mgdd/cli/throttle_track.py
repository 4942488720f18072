"""`mgdd throttle track | tune`: a controller along a reference, and the tuner that made the shipped numbers."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from mgdd.cli.from_library import Options, named_options
from mgdd.cli.options import option
from mgdd.cli.output import emit, warn
from mgdd.cli.ranges import number_pairs
from mgdd.cli.throttle import add_preset, add_throttle, known_only, plate_in
from mgdd.errors import DataError, ParameterError
from mgdd.identify import load_throttle_model
from mgdd.loop import Reference, track, tune_controller
from mgdd.loop.controller_families import FAMILIES
from mgdd.loop.track import FIGURES, step_times_us
from mgdd.loop.tune import with_stiction
from mgdd.loop.tuned import tuned_with_doubts
from mgdd.plot import throttle_run
from mgdd.plot.style import drawn
from mgdd.report import Table
from mgdd.throttle import Throttle

_AIR = Options(track, airflow_torque_nm="airflow")
_RUN = Options(track, "delay_samples", "noise_deg", "seed")
_TUNE = Options(tune_controller, "spread", "budget", "seed", "delay_samples", "noise_deg", n_throttles="throttles")


def _add_track(parser: Any) -> None:
    _add_controller(parser)
    option(parser, "--reference REFERENCE",
           "step:FROM:TO, sine:MEAN:AMPLITUDE:HZ, or a CSV file with time_s, reference_deg",
           default="step:40:42")  # fmt: skip
    _AIR.add(parser)
    group = parser.add_argument_group("plant")
    add_preset(group)
    option(group, "--plant-scale FIELD=FACTOR ...",
           "multiply a field of the plant, repeatable; the controller does not know, for example coulomb_nm=1.4 "
           "(stiction goes with it)")  # fmt: skip
    _RUN.add(group)
    option(parser, "--model FIT.toml", "what the controller knows: a fit of mgdd throttle identify (default: preset)")
    option(parser, "--numbers FILE.json", "of the controller: what mgdd throttle tune --json has printed")
    option(parser, "--figure FILE", "draw the run (.png, .svg or .pdf)")


def _add_tune(parser: Any) -> None:
    _add_controller(parser)
    _TUNE.add(parser)
    add_throttle(parser)


def _add_controller(parser: argparse.ArgumentParser) -> None:
    option(parser, "--controller", "kind", default="guided", choices=tuple(FAMILIES))


def _track(args: argparse.Namespace) -> None:
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
    with named_options(airflow_torque_nm="airflow"):
        run = track(controller, reference, throttle=plant, **_AIR.given(args), **how)
    swings = str(run.attrs.get("findings", "")).splitlines()
    warn(*swings)
    p50, p999 = step_times_us(controller, run)
    payload = {
        "controller": args.controller,
        "reference": reference.name,
        "preset": preset,
        "plant_scale": scales,
        "seed": how["seed"],
        **{name: float(run[name]) for name in FIGURES},
        "band_deg": reference.band_deg,
        "step_us_p50": p50,
        "step_us_p999": p999,
        "warnings": [*doubts, *swings],
    }
    traces = run.drop_vars([name for name in FIGURES if name in run])
    emit(args, payload, traces=traces, figure=partial(drawn, throttle_run, run, size=(7.0, 5.4)))


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
        raise ParameterError.of("--numbers", file, f"of --controller {kind}: these are of {own}")
    return numbers


COMMANDS = {"track": (_add_track, _track), "tune": (_add_tune, _tune)}
