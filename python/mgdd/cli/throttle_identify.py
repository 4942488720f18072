"""`mgdd throttle excite | identify | validate`: a signal, a model from its log, and a model against a log."""

from __future__ import annotations

import argparse
import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd import identify, signals
from mgdd.cli.from_library import Options, as_option, default_of, shown
from mgdd.cli.options import option
from mgdd.cli.output import check_file, emit, warn, wrote
from mgdd.cli.throttle import LOG, add_throttle, log_in, plate_in
from mgdd.errors import ConvergenceError, ParameterError
from mgdd.identify.throttle.excitation import EXCITATIONS
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.io.files import write_whole_text
from mgdd.loop.plates import model_of
from mgdd.optimize import FitOptions
from mgdd.plot.identification import validation_figure
from mgdd.presets.preset import Preset
from mgdd.throttle import Throttle

if TYPE_CHECKING:
    from mgdd.identify.throttle.excitation import ExcitationCheck


_MODEL = Options(identify.identify_throttle, "model")
_FIT = Options(identify.identify_throttle, "limp_home_deg", "two_sided", "closed_deg", "open_deg")
_SEARCH = Options(FitOptions, "seed")
_MEASURED, _ONE_OF = ("resistance_ohm", "supply_v"), ("inertia_kgm2", "torque_constant_nm_per_a")
_KNOWN = Options(FirstPrincipleModel.to_throttle, *_ONE_OF)
_LOG_TITLE = "columns of the log, by name, or by number from 0"

# Searches that ended without a tolerance met, but with a model: stiction makes the last of the cost rough.
_ENDED = ("stalled", "iteration_limit")


def _add_identify(parser: Any) -> None:
    option(parser, "file FILE", "log to fit: CSV, plain columns or .mat")
    _MODEL.add(parser)
    option(parser, "--test FILE", "log to test on, with the same columns")
    _FIT.add(parser)
    option(parser, "--delay-samples N[,N...]",
           "samples until the duty acts; of several the best (default: searched for the groups, 0 for pw_*)",
           type=_counts)  # fmt: skip
    _SEARCH.add(parser)
    option(parser, "--figure FILE", "draw the validation (.png, .svg or .pdf)")
    group = parser.add_argument_group("throttle of the fit")
    option(group, "--throttle FILE.toml", "also write it as a preset, for --preset of the other commands")
    option(group, "--resistance-ohm X", "measured at the terminals [ohm]", type=float)
    option(group, "--supply-v X", "measured at the terminals [V]", type=float)
    _KNOWN.add(group)
    LOG.add(parser, _LOG_TITLE)


def _add_validate(parser: Any) -> None:
    option(parser, "fit FIT.toml", "parameters written by identify")
    option(parser, "file FILE", "log: CSV, plain columns or .mat")
    option(parser, "--figure FILE", "draw the validation (.png, .svg or .pdf)")
    LOG.add(parser, _LOG_TITLE)


def _counts(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: must be whole numbers, for example 0,2,4") from None


def _identify(args: argparse.Namespace) -> None:
    log = log_in(args, args.file)
    test = None if args.test is None else log_in(args, args.test)
    options = FitOptions(**_SEARCH.given(args))
    given = _MODEL.given(args) | _FIT.given(args)
    known = _known_of_throttle(args)
    fit = identify.identify_throttle(log, test=test, delay_samples=args.delay_samples, options=options, **given)
    validation = identify.validate_throttle(fit, log if test is None else test)
    emit(args, {**fit.to_dict(), "validation": validation.to_dict()}, text=f"{fit.summary()}\n\n{validation.summary()}",
         write={".toml": lambda file: write_whole_text(file, fit.to_toml())},
         figure=lambda: validation_figure(validation, fit.report.dataset))  # fmt: skip
    if args.throttle:
        _write_throttle(args, fit.model, known)
    report = fit.report
    if not report.success and report.status not in _ENDED:
        raise ConvergenceError(f"{args.file}: the fit has failed ({report.message}); look at the log, or excite more")
    if report.status == "iteration_limit":
        warn(f"the search {report.message}; the figures hold for what it has found", of=args.file)


def _known_of_throttle(args: argparse.Namespace) -> dict[str, float]:
    check_file("--throttle", args.throttle, (".toml",))
    known = _KNOWN.given(args) | {name: getattr(args, name) for name in _MEASURED if getattr(args, name) is not None}
    if args.throttle:
        missing = [as_option(name) for name in _MEASURED if name not in known]
        if sum(name in known for name in _ONE_OF) != 1:
            missing.append(f"one of {' and '.join(map(as_option, _ONE_OF))}")
        if missing:
            raise ParameterError(f"--throttle: a log in duty and angle leaves these open: give {', '.join(missing)}")
        if str(args.model).startswith("pw"):
            raise ParameterError(f"--throttle: --model {args.model} has no such numbers: leave it out")
        FirstPrincipleModel().to_throttle(**known)  # what is refused is refused before the search
    elif known:
        raise ParameterError(f"{as_option(next(iter(known)))} acts with --throttle FILE.toml only: give it")
    return known


def _write_throttle(args: argparse.Namespace, model: Any, known: dict[str, float]) -> None:
    if not isinstance(model, FirstPrincipleModel):
        raise ParameterError(f"--throttle: the model {model.kind} has no such numbers: fit --model first_principle")
    delay = model.parameters["delay_samples"]
    if delay >= 0.5:
        warn(f"the log has a delay of {delay:.2g} samples, a throttle none: track takes --delay-samples", of=args.file)
    title = f"fitted to {Path(args.file).name}"
    throttle = model.to_throttle(**known)
    default = Throttle().to_dict()
    sources = {
        f"throttle.{name}": "measured" if name in known else "default" if value == default[name] else title
        for name, value in throttle.to_dict().items()
    }
    preset = Preset(name=Path(args.throttle).stem, title=title, throttle=throttle, sources=sources)
    write_whole_text(args.throttle, preset.to_toml())
    wrote(args.throttle)


def _validate(args: argparse.Namespace) -> None:
    model = identify.load_throttle_model(args.fit)
    validation = identify.validate_throttle(model, log_in(args, args.file))
    emit(args, validation.to_dict(), text=validation.summary(), figure=lambda: validation_figure(validation))


_DESIGN = Options(identify.design_excitation, "side", "duration_s", "sample_s")
_CHECK = Options(
    identify.check_excitation, "angle_window_deg", "max_rate_deg_per_s", "max_current_a", "start_deg"
)  # fmt: skip
_COMMON = ("offset", "amplitude", "sample_s")
# Options that only some of the signals have, as the arguments of their functions.
_OF_KIND = {
    kind: tuple(name for name in inspect.signature(getattr(signals, kind)).parameters if name not in _COMMON)
    for kind in EXCITATIONS
}
_OWN = {
    name: Options(getattr(signals, kind), name)
    for kind in EXCITATIONS
    for name in _OF_KIND[kind]
    if name != "duration_s"
}


def _add_excite(parser: Any) -> None:
    option(parser, "kind KIND", ", ".join(EXCITATIONS), choices=EXCITATIONS)
    add_throttle(parser)
    group = parser.add_argument_group("signal")
    option(group, "--offset X", "mean duty, with --amplitude: no design, only the check")
    option(group, "--amplitude X", "half the swing of the duty")
    _DESIGN.add(group, **_defaults_of("duration_s"))
    for name, options in _OWN.items():
        options.add(group, **_defaults_of(name))
    _CHECK.add(parser, "limits")


def _defaults_of(name: str) -> dict[str, str]:
    """Write the default of every signal that has this option and a default."""
    kinds = (kind for kind, names in _OF_KIND.items() if name in names)
    own = {kind: default_of(getattr(signals, kind), name) for kind in kinds}
    said = ", ".join(f"{kind} {shown(value)}" for kind, value in own.items() if value is not None)
    return {name: said} if said else {}


def _excite(args: argparse.Namespace) -> None:
    plate, preset = plate_in(args)
    prior = model_of(plate)
    limits = _CHECK.given(args)
    designed = _DESIGN.given(args)
    sample_s = _DESIGN.of(args)["sample_s"]
    given = {name: getattr(args, name) for name in ("duration_s", *_OWN) if getattr(args, name) is not None}
    for name in given:
        if name not in _OF_KIND[args.kind]:
            have = ", ".join(as_option(n) for n in _OF_KIND[args.kind])
            raise ParameterError(f"{as_option(name)} is not an option of a {args.kind}, which has {have}")
    if (args.offset is None) != (args.amplitude is None):
        raise ParameterError("--offset and --amplitude belong together: give both, or none for a designed signal")
    if args.offset is None:
        others = [name for name in given if name != "duration_s"]
        if others:
            raise ParameterError(
                f"{as_option(others[0])} acts on a signal of your own only: give --offset and --amplitude too"
            )
        signal, check = identify.design_excitation(args.kind, prior, **designed, **limits)
    else:
        make = getattr(signals, args.kind)
        signal = make(offset=args.offset, amplitude=args.amplitude, sample_s=sample_s, **given)
        check = identify.check_excitation(signal, prior, **limits)
        if not check.passed:
            raise ParameterError("this signal must not be sent: " + "; ".join(map(str, check.findings)))
    attrs = {name: value for name, value in signal.attrs.items() if name != "kind"}
    payload = {"kind": args.kind, "preset": preset, "samples": signal.sizes["time_s"], "sample_s": sample_s}
    payload |= attrs | check.to_dict()
    emit(args, payload, text=_text(args.kind, attrs, check), traces=check.prediction)


def _text(kind: str, attrs: dict[str, Any], check: ExcitationCheck) -> str:
    return f"{kind}, offset {attrs['offset']:.4g}, amplitude {attrs['amplitude']:.4g}\n{check.summary()}"


COMMANDS = {
    "excite": (_add_excite, _excite),
    "identify": (_add_identify, _identify),
    "validate": (_add_validate, _validate),
}
