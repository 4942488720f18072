"""`mgdd throttle excite`: a duty signal that the prior model has been asked about."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd import identify, signals
from mgdd.cli.options import add_command, as_option
from mgdd.cli.output import check_output, emit
from mgdd.cli.throttle_parameters import add_throttle, throttle_of
from mgdd.errors import ParameterError
from mgdd.identify.throttle.excitation_design import EXCITATIONS

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.identify.throttle.excitation_check import ExcitationCheck

__all__ = ["add"]

# Options that only some of the signals have, as the arguments of their functions.
_OF_KIND = {
    "chirp": ("duration_s", "low_hz", "high_hz"),
    "multisine": ("duration_s", "fundamental_hz", "high_hz", "harmonics"),
    "prbs": ("duration_s", "hold_s", "register"),
    "amplitude_random_steps": ("duration_s", "hold_s", "seed"),
    "staircase": ("rise", "hold_s", "cycles"),
    "triangle": ("duration_s", "frequency_hz"),
}
_HELP = {
    "duration_s": (float, "length [s]"),
    "low_hz": (float, "first frequency of a chirp [Hz]"),
    "high_hz": (float, "last frequency of a chirp, band of a multisine [Hz]"),
    "fundamental_hz": (float, "of a multisine [Hz]"),
    "harmonics": (int, "of a multisine"),
    "frequency_hz": (float, "of a triangle [Hz]"),
    "hold_s": (float, "time on a level [s]"),
    "rise": (float, "height of a step of a staircase"),
    "cycles": (int, "of a staircase"),
    "register": (int, "length of the register of a PRBS"),
    "seed": (int, "of random steps (default: golden-ratio levels)"),
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
        "--side", choices=("above", "below", "both"), default="above",
        help="of limp-home; offset and amplitude are designed for it unless they are given (default: above)",
    )  # fmt: skip
    group.add_argument(
        "--offset", type=float, metavar="X", help="mean duty, with --amplitude: no design, only the check"
    )
    group.add_argument("--amplitude", type=float, metavar="X", help="half the swing of the duty")
    for name, (kind, text) in _HELP.items():
        group.add_argument(as_option(name), type=kind, metavar="X", help=text)
    group.add_argument("--step-s", type=float, default=1e-3, metavar="X", help="sample time [s] (default: 0.001)")
    limits = parser.add_argument_group("limits")
    limits.add_argument(
        "--angle-window-deg", type=float, nargs=2, metavar=("LOW", "HIGH"),
        help="where the plate may go (default: 1 deg off its stops)",
    )  # fmt: skip
    limits.add_argument("--max-rate-deg-per-s", type=float, metavar="X", help="highest speed [deg/s]")
    limits.add_argument("--max-current-a", type=float, metavar="X", help="highest motor current [A]")
    limits.add_argument("--start-deg", type=float, metavar="X", help="where the plate starts (default: limp-home)")


def _excite(args: argparse.Namespace) -> None:
    check_output(args, ".csv", ".json")
    throttle, preset = throttle_of(args)
    window = None if args.angle_window_deg is None else tuple(args.angle_window_deg)
    limits = {name: getattr(args, name) for name in ("max_rate_deg_per_s", "max_current_a", "start_deg")}
    given = {name: getattr(args, name) for name in _HELP if getattr(args, name) is not None}
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
        signal, check = identify.design_excitation(
            args.kind, throttle, side=args.side, duration_s=args.duration_s, step_s=args.step_s,
            angle_window_deg=window, **limits,
        )  # fmt: skip
    else:
        make = getattr(signals, args.kind)
        signal = make(offset=args.offset, amplitude=args.amplitude, step_s=args.step_s, **given)
        check = identify.check_excitation(signal, throttle, angle_window_deg=window, **limits)
        if not check.passed:
            raise ParameterError("this signal must not be sent: " + "; ".join(map(str, check.findings)))
    attrs = {name: value for name, value in signal.attrs.items() if name != "kind"}
    payload = {"kind": args.kind, "preset": preset, "samples": signal.sizes["time_s"], "step_s": args.step_s}
    payload |= attrs | check.to_dict()
    emit(args, payload, text=_text(args.kind, attrs, check), traces=_table(args.output, check))


def _text(kind: str, attrs: dict[str, Any], check: ExcitationCheck) -> str:
    return f"{kind}, offset {attrs['offset']:.4g}, amplitude {attrs['amplitude']:.4g}\n{check.summary()}"


def _table(output: str | None, check: ExcitationCheck) -> xr.Dataset | None:
    return check.prediction if output is not None and Path(output).suffix == ".csv" else None
