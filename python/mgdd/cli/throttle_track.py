"""`mgdd throttle track | tune`: a controller along a reference, and the tuner that made the shipped numbers."""

from __future__ import annotations

import argparse
import logging
from typing import Any

from mgdd import presets
from mgdd.cli.options import add_command, assignments
from mgdd.cli.output import check_figure, check_output, emit, save_figure
from mgdd.cli.throttle_parameters import add_throttle, throttle_of
from mgdd.errors import ParameterError, did_you_mean
from mgdd.loop import Reference, track, tune_controller
from mgdd.loop.controller_families import FAMILIES
from mgdd.loop.track import FIGURES, step_times_us
from mgdd.loop.tuned import tuned_with_doubts
from mgdd.plot.style import drawn
from mgdd.studies.sections import Table
from mgdd.throttle import Throttle

__all__ = ["add"]

_LOG = logging.getLogger(__name__)


def add(verbs: Any) -> None:
    """Add both commands."""
    _add_track(verbs)
    _add_tune(verbs)


def _add_track(verbs: Any) -> None:
    parser = add_command(
        verbs, "track", _track,
        help_text="run a controller on the virtual throttle along a reference; -o FILE.csv writes the run",
        example="mgdd throttle track --controller guided --reference step:40:42 --plant-scale coulomb_nm=1.2 --json",
        endings=".json or .csv",
    )  # fmt: skip
    parser.add_argument("--controller", choices=tuple(FAMILIES), default="guided", help="default: guided")
    parser.add_argument(
        "--reference", default="step:40:42", metavar="REFERENCE",
        help="step:FROM:TO, sine:MEAN:AMPLITUDE:HZ, or a CSV file with time_s, reference_deg (default: step:40:42)",
    )  # fmt: skip
    parser.add_argument(
        "--airflow", type=float, default=0.0, metavar="NM", help="torque of the air on the plate, positive opens"
    )
    _add_plant(parser)
    parser.add_argument(
        "--model",
        metavar="FIT.toml",
        help="what the controller knows: a fit of mgdd throttle identify (default: preset)",
    )
    parser.add_argument("--figure", metavar="FILE", help="draw the run (.png, .svg or .pdf)")


def _add_plant(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("plant")
    group.add_argument("--plant", dest="preset", metavar="NAME_OR_FILE.toml", help="P1, P2, P3 or a TOML file")
    group.add_argument(
        "--plant-scale", action="append", default=[], metavar="FIELD=FACTOR",
        help="multiply a field of the plant, repeatable; the controller does not know, for example coulomb_nm=1.4 "
        "(stiction goes with it)",
    )  # fmt: skip
    group.add_argument(
        "--delay-samples", type=int, default=1, metavar="N", help="from a duty to its effect (default: 1)"
    )
    group.add_argument(
        "--noise-deg", type=float, default=0.03, metavar="X", help="of the measured angle (default: 0.03)"
    )
    group.add_argument("--seed", type=int, default=0, metavar="N", help="of the noise (default: 0)")


def _add_tune(verbs: Any) -> None:
    parser = add_command(
        verbs, "tune", _tune,
        help_text="tune a controller for throttles around a preset, with one cost and budget for every kind",
        example="mgdd throttle tune --controller pid --preset P2 --budget 60 --throttles 8 --json",
    )  # fmt: skip
    parser.add_argument("--controller", choices=tuple(FAMILIES), default="guided", help="default: guided")
    parser.add_argument("--throttles", type=int, default=20, metavar="N", help="drawn around the preset (default: 20)")
    parser.add_argument("--spread", type=float, default=0.2, metavar="X", help="of each number (default: 0.2)")
    parser.add_argument("--budget", type=int, default=200, metavar="N", help="runs of the whole set (default: 200)")
    parser.add_argument(
        "--delay-samples", type=int, default=1, metavar="N", help="from a duty to its effect (default: 1)"
    )
    parser.add_argument(
        "--noise-deg", type=float, default=0.03, metavar="X", help="of the measured angle (default: 0.03)"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of throttles, noise and search (default: 0)")
    add_throttle(parser)


def _track(args: argparse.Namespace) -> None:
    check_output(args, ".json", ".csv")
    check_figure(args.figure)
    preset = presets.load(args.preset or "P1")
    known = getattr(preset, "throttle", None)
    if known is None:
        raise ParameterError(f"--plant {args.preset}: is not a throttle; P1, P2 and P3 are")
    scales = _scales(args.plant_scale)
    plant = known.replace(**{name: getattr(known, name) * factor for name, factor in scales.items()})
    model: Any = known
    if args.model is not None:
        from mgdd.identify import load_throttle_model

        model = load_throttle_model(args.model)
    reference = Reference.parse(args.reference)
    controller, doubts = tuned_with_doubts(
        args.controller,
        model,
        sample_s=reference.sample_s,
        delay_samples=None if args.model is not None else args.delay_samples,
        noise_deg=args.noise_deg,
    )
    for doubt in doubts:
        _LOG.warning("%s", doubt)
    run = track(
        controller,
        reference,
        throttle=plant,
        delay_samples=args.delay_samples,
        airflow_torque_nm=args.airflow or None,
        noise_deg=args.noise_deg,
        seed=args.seed,
    )
    p50, p999 = step_times_us(controller, run)
    payload = {
        "controller": args.controller,
        "reference": reference.name,
        "preset": str(preset.name),
        "plant_scale": scales,
        "seed": args.seed,
        **{name: float(run[name]) for name in FIGURES},
        "band_deg": reference.band_deg,
        "step_us_p50": p50,
        "step_us_p999": p999,
        "warnings": list(doubts),
    }
    if args.figure is not None:
        from mgdd.plot.throttle_track import throttle_track

        save_figure(drawn(throttle_track, run, size=(7.0, 5.4)), args.figure)
    emit(args, payload, traces=run.drop_vars([name for name in FIGURES if name in run]))


def _tune(args: argparse.Namespace) -> None:
    check_output(args)
    throttle, preset = throttle_of(args)
    found = tune_controller(
        args.controller,
        throttle,
        n_throttles=args.throttles,
        spread=args.spread,
        budget=args.budget,
        seed=args.seed,
        delay_samples=args.delay_samples,
        noise_deg=args.noise_deg,
    )
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
        f"in {found.evaluations} runs of {args.throttles} throttles\n"
    )
    delay = f"delay_samples={args.delay_samples}"
    text: list[str | Table] = [
        said,
        Table(columns=("number", "tuned"), rows=tuple((name, f"{value:g}") for name, value in found.numbers.items())),
        f"\nIn Python: mgdd.loop.tuned_controller({found.kind!r}, throttle, numbers={{...}}, {delay})",
    ]
    emit(args, payload, text=text)


def _scales(given: list[str]) -> dict[str, float]:
    fields = Throttle.fields()
    values = assignments(given, fields)
    out = {}
    for name, value in values.items():
        if name not in fields:
            guess = did_you_mean(name, fields)
            raise ParameterError(f"--plant-scale {name}: no field {name!r}; {guess + '; ' if guess else ''}see --set")
        if not isinstance(value, (int, float)):
            raise ParameterError(f"--plant-scale {name}={value}: must be a factor, for example {name}=1.2")
        out[name] = float(value)
    if "coulomb_nm" in out:  # more friction is more stiction, too
        out.setdefault("stiction_nm", out["coulomb_nm"])
    return out
