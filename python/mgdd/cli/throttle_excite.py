"""`mgdd throttle excite`: a duty signal that the prior model has been asked about."""

from __future__ import annotations

import argparse
import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd import identify, signals
from mgdd.cli.from_library import Options, as_option, default_of, shown
from mgdd.cli.options import add_command
from mgdd.cli.output import check_output, emit
from mgdd.cli.throttle_parameters import add_throttle, throttle_of
from mgdd.errors import ParameterError
from mgdd.identify.throttle.excitation_design import EXCITATIONS

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.identify.throttle.excitation_check import ExcitationCheck

__all__ = ["add"]

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


def add(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "excite", _excite,
        help_text="make a duty signal, after the prior model has shown that the plate stays inside its limits",
        example="mgdd throttle excite chirp --preset P1 --side above --output chirp.csv",
        endings=".csv, the signal with the predicted angle, or .json",
    )  # fmt: skip
    parser.add_argument("kind", choices=EXCITATIONS, metavar="KIND", help=", ".join(EXCITATIONS))
    add_throttle(parser)
    group = parser.add_argument_group("signal")
    group.add_argument(
        "--offset", type=float, metavar="X", help="mean duty, with --amplitude: no design, only the check"
    )
    group.add_argument("--amplitude", type=float, metavar="X", help="half the swing of the duty")
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
    check_output(args, ".csv", ".json")
    throttle, preset = throttle_of(args)
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
        signal, check = identify.design_excitation(args.kind, throttle, **designed, **limits)
    else:
        make = getattr(signals, args.kind)
        signal = make(offset=args.offset, amplitude=args.amplitude, sample_s=sample_s, **given)
        check = identify.check_excitation(signal, throttle, **limits)
        if not check.passed:
            raise ParameterError("this signal must not be sent: " + "; ".join(map(str, check.findings)))
    attrs = {name: value for name, value in signal.attrs.items() if name != "kind"}
    payload = {"kind": args.kind, "preset": preset, "samples": signal.sizes["time_s"], "sample_s": sample_s}
    payload |= attrs | check.to_dict()
    emit(args, payload, text=_text(args.kind, attrs, check), traces=_table(args.output, check))


def _text(kind: str, attrs: dict[str, Any], check: ExcitationCheck) -> str:
    return f"{kind}, offset {attrs['offset']:.4g}, amplitude {attrs['amplitude']:.4g}\n{check.summary()}"


def _table(output: str | None, check: ExcitationCheck) -> xr.Dataset | None:
    return check.prediction if output is not None and Path(output).suffix == ".csv" else None
