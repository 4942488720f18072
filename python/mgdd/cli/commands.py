"""What can be typed: every command, built as far as the words ask, and where first guesses lead."""

from __future__ import annotations

import argparse
import importlib
import re
from collections.abc import Sequence
from typing import NamedTuple

from mgdd._core import __version__
from mgdd.cli.parser import Parser


class Command(NamedTuple):
    """A command, or a group of them, whose names begin with its own."""

    text: str
    example: str = ""  # what stands behind the name
    module: str = ""  # of mgdd.cli, whose COMMANDS say how options are added and what runs; none of a group
    endings: str = ".json"  # of -o FILE


_MAP = ".nc, which holds everything; .csv for spreadsheets, .dcm or .cdfx for calibration tools"
# fmt: off
COMMANDS = {
    "demo": Command("calibrate four measured traces, find their best timing, report; a guided seeker, a throttle",
                    "", "demo"),
    "engine": Command("one cycle: simulate, analyze, check, calibrate, optimum; many: seek, sweep"),
    "engine simulate": Command(
        "simulate one closed cycle and print its indicators; -o FILE.csv writes the traces",
        "--preset puma_single --soc-cad -6 --json", "engine", ".json or .csv"),
    "engine analyze": Command(
        "analyse measured pressure, one file or many: pegging, heat release, burn angles, work; as a page",
        "mean.csv --preset hd_diesel_128x144 --pressure-unit Pa --json", "analyze", ".json, of one file also .csv"),
    "engine check": Command(
        "check whether pressure files can be trusted: each check with its verdict, the cause and the remedy",
        "monday/*.csv --preset hd_diesel_128x144", "analyze"),
    "engine calibrate": Command(
        "calibrate the cycle model to measured traces, and name what the traces do not identify",
        "a25.csv a50.csv --preset hd_diesel_128x144 --conditions conditions.csv --json", "engine"),
    "engine optimum": Command(
        "find the best start of combustion of the model, or of measured traces after calibration",
        "--preset puma_single --limit p_max_bar=95 --json", "engine", ".json, without files also .csv"),
    "engine seek": Command(
        "seek the best start of combustion, or several inputs, on the virtual bench, one cycle at a time",
        "--input soc_cad=-20:5 --limit p_max_bar=95 --json", "seek", ".json or .csv, the cycles"),
    "engine sweep": Command(
        "simulate a cycle for every point of a grid, or of a file; -o FILE.nc or FILE.csv keeps the table",
        "--over soc_cad=-20:5:51 --over speed_rpm=1000:3000:9 -o table.nc --json", "sweep", ".nc, netCDF, or .csv"),
    "map": Command("calibration maps, from the points of an experiment to a DCM file"),
    "map design": Command(
        "choose the points of an experiment, inside limits that the model of the engine predicts",
        "--over speed_rpm=1000:3000 --over fuel_mg=6:30 --over soc_cad=-16:4 --points 64 --limit p_max_bar=130 "
        "-o design.csv", "map_design", ".csv or .nc, the points; .json"),
    "map fit": Command(
        "fit a model of one response to measured or simulated points, and say how far it may be believed",
        "table.nc --response efficiency_gross --factors speed_rpm,fuel_mg,soc_cad -o model.toml --figure fit.png",
        "map_fit", ".toml, the model with its points; .json, the figures of the fit"),
    "map predict": Command(
        "evaluate fitted models on a grid, as a table that mgdd map optimize reads",
        "efficiency.toml p_max.toml --over speed_rpm=1000:3000:9 --over fuel_mg=6:30:7 --over soc_cad=-16:4:81 "
        "-o table.nc", "map_fit", ".nc, netCDF, or .csv"),
    "map optimize": Command(
        "find the best value of an input at every operating point of a table, under limits",
        "table.nc --maximize efficiency_gross --along soc_cad --limit p_max_bar=130 --max-loss 0.002 -o best.nc",
        "maps", _MAP),
    "map seek": Command(
        "seek a map on the virtual engine, from a rough model and as few visits of operating points as possible",
        "--over speed_rpm=1000:2500:4 --over fuel_mg=10:25:4 --limit p_max_bar=120 --guide model "
        "--guide-set wall_heat_scale=1.0 --visits 16 -o map.nc", "map_seek", _MAP),
    "map smooth": Command(
        "smooth a map inside of the allowed ranges of its cells, under limits on its slopes",
        "best.nc --slope-limit speed_rpm=0.004 --slope-limit fuel_mg=0.6 -o smooth.nc", "maps", _MAP),
    "map show": Command(
        "show a map with breakpoints, units, and the limits and sources of its cells",
        "smooth.nc --sweep table.nc --figure smooth.png", "maps", _MAP),
    "map diff": Command(
        "subtract one map from another at the breakpoints of both",
        "best.nc smooth.nc --tolerance 1 --figure diff.png", "maps", ".nc, the differences, or .json"),
    "map trade-off": Command(
        "set two variables of a table against each other along an input: what one costs in the other",
        "table.nc --right p_max_bar --up efficiency_gross --at speed_rpm=2200 --map smooth.nc "
        "--figure trade_off.png", "map_trade_off"),
    "map export": Command(
        "write maps in another form: netCDF, CSV, DCM, CDFX", "smooth.nc --label SocBase -o engine.dcm", "maps",
        f"{_MAP}, which may hold several maps"),
    "throttle": Command("an electronic throttle: simulate, demand, excite, identify, validate, track, tune, export"),
    "throttle simulate": Command(
        "simulate a throttle from rest and print the summary of its step; -o FILE.csv writes the run",
        "--preset P1 --duty 0.6 --duration-s 0.3 --json", "throttle", ".json or .csv"),
    "throttle demand": Command(
        "steady torque, air flow, manifold pressure and opening that a pedal wants at a speed",
        "--pedal-percent 30 --speed-rpm 2000 --json", "throttle"),
    "throttle excite": Command(
        "make a duty signal, after the prior model has shown that the plate stays inside its limits",
        "chirp --preset P1 --side above --output chirp.csv", "throttle_identify",
        ".csv, the signal with the predicted angle, or .json"),
    "throttle identify": Command(
        "fit a model to a log, test it on another, and name the parameters that the log does not identify",
        "chirp.csv --model pw_r --test steps.csv --output fit.toml --json", "throttle_identify",
        ".toml, the parameters, or .json"),
    "throttle validate": Command(
        "run a fitted model against a log: free run, 5, 20 and 50 ms ahead, residual tests",
        "fit.toml steps.csv --json", "throttle_identify"),
    "throttle track": Command(
        "run a controller on the virtual throttle along a reference; -o FILE.csv writes the run",
        "--controller guided --reference step:40:42 --plant-scale coulomb_nm=1.2 --json", "throttle_track",
        ".json or .csv"),
    "throttle tune": Command(
        "tune a controller for throttles around a preset, with one cost and budget for every kind",
        "--controller pid --preset P2 --budget 60 --throttles 8 --json", "throttle_track"),
    "throttle export": Command(
        "write a controller as C++ for a target, with the samples of a tracked run as its test",
        "pid --preset P2 --float -o target", "throttle_track", "a folder: settings, step, test vectors, CMake"),
    "workbench": Command(
        "pages in a browser of this machine: drop pressure files, check them, find the best timing, seek, make maps",
        "", "workbench"),
    "rig": Command("experiments in process, over a CAN bus and on a bench"),
    "rig run": Command(
        "run an experiment: identify or track on a throttle, seek or map on an engine; in process, over a bus, on a "
        "record or on a bench", "track.toml --mode hil --folder runs/first", "rig_run"),
    "rig check": Command(
        "check an experiment, its map, DBC, envelope and bus, and say what would run; nothing is sent",
        "track.toml --mode bench --connection socketcan:can0 --pace real_time --json", "rig_run"),
    "rig record": Command(
        "listen on a bus and write every frame into a record, until Ctrl-C; nothing is sent",
        "bench.rec --bus socketcan:can0 --duration-s 60", "rig_run"),
    "rig replay": Command(
        "give the measurements of a recorded run to its controller again, and compare every output bit for bit; exit "
        "code 1 where one differs", "mgdd-runs/first --json", "rig_run"),
    "rig export": Command("write a record in the format of other tools", "run.rec run.mf4", "rig_run"),
    "rig selftest": Command(
        "let a process that drives a simulated throttle over a bus die in six ways, and time the plate's way to "
        "limp-home; exit code 1 above 0.4 s", "--json", "rig"),
    "rig watch": Command(
        "serve a live page on this machine alone, with a stop button that opens the bridge, until Ctrl-C",
        "mgdd-runs/first", "rig_run"),
    "rig hub": Command(
        "join processes of this machine by a bus of the socketcand protocol, until Ctrl-C or its parent ends",
        "--port 29536 --fault drop:p=0.01", "rig"),
    "rig node": Command(
        "serve a virtual throttle or engine bench behind a bus, until Ctrl-C or its parent ends",
        "--map etb --bus 'socketcand:can0?host=127.0.0.1&port=29536' --truth truth.csv", "rig"),
    "study": Command("run a study: a table over seeds, with figures", "sensor-delay --figures figures", "study"),
    "data": Command("files of a test cell: look into one, convert it; public data sets"),
    "data info": Command(
        "show format and columns of a file, what each is taken for, and what is doubtful",
        "bench.tdms --firing-tdc-deg 360", "data"),
    "data convert": Command(
        "cut a file of a test cell into cycles and write all its channels",
        "bench.mf4 --firing-tdc-deg 360 -o bench.nc", "data", ".nc, .csv or .parquet"),
    "data list": Command("name the public data sets, with licence and place", "", "data"),
    "data get": Command("write a public data set, a numbered file for each of its records",
                        "hd_diesel_128x144 -o diesel.csv", "data", ".nc, .csv or .parquet"),
    "preset": Command("named engines and throttles: list, show, copy"),
    "preset list": Command("name the shipped presets", "--kind throttle", "preset"),
    "preset show": Command("show every value of a preset with its unit and source", "puma_single --json", "preset"),
    "preset copy": Command("write a preset into a new file, which --preset reads after you changed it",
                           "puma_single mine.toml", "preset"),
    "doctor": Command("print versions, SIMD level, extras and data sets", "--json", "doctor"),
    "completion": Command("print a script that completes commands, options and choices in a shell", "bash",
                          "completion"),
}
# Other words for a command.
_ALSO = {
    "engine simulate": "run cycle", "engine analyze": "analyse analysis plot report heat-release tdc indicate",
    "engine check": "trust",
    "engine calibrate": "fit calibration", "engine optimum": "optimise optimize best", "engine seek": "search",
    "engine sweep": "grid", "map optimize": "optimise optimum build make", "map export": "convert write",
    "map fit": "build make", "map seek": "search", "map trade-off": "pareto", "map show": "plot", "map diff": "compare",
    "map design": "doe",
    "throttle identify": "fit", "throttle track": "control run step", "throttle excite": "signal",
    "rig record": "monitor log", "data info": "read", "data get": "download",
    "data list": "datasets --list-datasets",
    "preset list": "presets --list-presets", "study": "studies", "rig selftest": "self-test test",
    "doctor": "info version",
}
# fmt: on
_EPILOG = """exit codes: 0 done, 1 a self-test or replay that failed, 2 bad input or usage, 3 no convergence or no
feasible answer, 130 interrupted.

examples:
  mgdd demo
  mgdd engine simulate --preset puma_single --soc-cad -6 --json
  mgdd engine optimum --limit p_max_bar=95
  mgdd map design --over soc_cad=-16:4 --over fuel_mg=6:30 --points 32 -o design.csv
  mgdd throttle simulate --preset P1 --duty 0.6 --json
  mgdd study --list
"""


def root_parser() -> Parser:
    """Make the parser of `mgdd`; what stands below it is made when it is asked for."""
    parser = Parser(
        prog="mgdd", epilog=_EPILOG,
        description="Model-guided data-driven optimization and control for internal combustion engine systems.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("-V", "-v", "--version", action="version", version=f"mgdd {__version__}")
    parser.example = "mgdd engine simulate"
    parser.set_defaults(parser=parser)
    _add_below(parser, "")
    return parser


def _add_below(parser: Parser, above: str) -> None:
    """Add the commands of a group, without their options."""
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", prog=parser.prog)
    for name, command in COMMANDS.items():
        group, _, own = name.rpartition(" ")
        if group == above:
            below = commands.add_parser(own, help=command.text, description=command.text)
            below.later = lambda own, name=name: _fill(own, name)


def _fill(parser: Parser, name: str) -> None:
    """Add the commands of a group, or the options of a command, which its module knows."""
    command = COMMANDS[name]
    first = name if command.module else next(each for each in COMMANDS if each.startswith(f"{name} "))
    parser.example = f"mgdd {first} {COMMANDS[first].example}".rstrip()
    parser.epilog, parser.formatter_class = f"example:\n  {parser.example}", argparse.RawDescriptionHelpFormatter
    parser.set_defaults(parser=parser)
    if not command.module:
        _add_below(parser, name)
        return
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("-o", "--output", metavar="FILE", help=f"write the result to FILE ({command.endings})")
    parser.add_argument("--out", dest="output", help=argparse.SUPPRESS)  # else it is one with --outputs
    parser.add_argument("--quiet", action="store_true", help="no progress on stderr")
    add, run = importlib.import_module(f"mgdd.cli.{command.module}").COMMANDS[name.rpartition(" ")[2]]
    parser.set_defaults(run=run, endings=tuple(re.findall(r"\.[a-z]+", command.endings)))
    if add is not None:
        add(parser)


def understood(words: Sequence[str], parser: Parser) -> list[str]:
    """Give the words as the parser takes them: `help` behind, options of every command too, a verb behind its group."""
    rest, front, named = list(words), list[str](), list[str]()
    while rest and len(named) < 2:
        if rest[0] in ("-o", "--output", "--out"):
            front, rest = front + rest[:2], rest[2:]
        elif rest[0] in ("--json", "--quiet"):
            front.append(rest.pop(0))
        elif rest[0].startswith("-") and (named or not _meant("", rest[0])):
            break
        else:
            named.append(rest.pop(0))
    if "help" in named:
        named.remove("help")
        rest.append("--help")
    if len(named) == 2 and named[0] not in COMMANDS and named[1] in COMMANDS:
        named.reverse()
    group = named[0] if named and named[0] in COMMANDS else ""
    if len(named) == 1 and group and not COMMANDS[group].module and rest and not {"-h", "--help"} & {*rest}:
        parser.error(f"{group}: which command? {group} has {_below(group)}")
    at = 1 if group else 0
    if len(named) == at or (group and COMMANDS[group].module):
        return [*named, *rest, *front]
    found = _meant(group, named[at])
    others = [] if found else _meant("", named[at])  # of another group
    if len(found) > 1 or others:
        ways = " or ".join(f"mgdd {name}" for name in found or others)
        own = f"{group} has {_below(group)}; elsewhere there is" if others and group else "write"
        parser.error(f"{' '.join(named[: at + 1])}: {own} {ways}")
    named[: at + 1] = found[0].split() if found else named[: at + 1]
    return [*named, *rest, *front]


def _below(group: str) -> str:
    """List the commands of a group."""
    return ", ".join(name.rpartition(" ")[2] for name in COMMANDS if name.startswith(f"{group} "))


def _meant(group: str, word: str) -> list[str]:
    """Name the commands, of a group or of all, that a word means."""
    names = [name for name in COMMANDS if name.startswith(f"{group} " if group else "")]
    return [name for name in names if word == name.rpartition(" ")[2] or word in _ALSO.get(name, "").split()]
