"""What is typed as first guessed: it is a command, or one line says what to type; and how little is loaded for it."""

import argparse
import subprocess
import sys

import pytest

from mgdd.cli import main
from mgdd.cli.commands import COMMANDS, root_parser, understood
from mgdd.cli.parser import UsageError
from typed import Capsys

VERBS = {name.rpartition(" ")[2] for name in COMMANDS}
# What is typed, and the command that it is, or what the one line names.
GUESSES = """
simulate -> mgdd engine simulate or mgdd throttle simulate
analyze p.csv = engine analyze
check -> mgdd engine check or mgdd rig check
seek -> mgdd engine seek or mgdd map seek
seek map --over speed_rpm=1000:2000:3 = map seek
map search --over speed_rpm=1000:2000:3 = map seek
map seek --cycles 9 -> '--visits'
calibrate a.csv = engine calibrate
sweep -o x.csv -> as in mgdd engine sweep --over
sweep --over soc_cad=-9:3:5 -o x.csv = engine sweep
presets = preset list
--list-presets = preset list
presets --json = preset list
preset copy P1 = preset copy
datasets = data list
studies --list = study
convert -> mgdd map export or mgdd data convert
map convert smooth.nc -o map.dcm = map export
map export --format dcm -> '--output'
map optimise t.nc --maximize p --along soc_cad = map optimize
map plot smooth.nc = map show
engine optimise = engine optimum
engine run = engine simulate
engine run --engine puma_single -> '--preset'
engine simulate puma_single -> as in mgdd engine simulate --preset puma_single
engine simulate --out x.json = engine simulate
engine simulate --speed 1500 = engine simulate
engine simulate --rpm 1500 -> '--speed-rpm'
engine simulate -v -> as in mgdd engine simulate
engine simulate --output x.csv = engine simulate
engine analyze -> as in mgdd engine analyze mean.csv
engine analyze x.csv --report p.html --interactive -> pages of --report show the values under the pointer
engine seek --method newton -> '--seeker' or '--seeker-set'
engine seek --iterations 20 -> '--cycles'
engine optimum --limits p_max_bar=95 -> '--limit'
--json engine optimum = engine optimum
engine --json optimum = engine optimum
-o x.json engine optimum = engine optimum
engine optimum --json = engine optimum
throttle identify log.csv = throttle identify
throttle tune = throttle tune
throttle control = throttle track
engine tune -> mgdd throttle tune
map build -> mgdd map fit or mgdd map optimize
throttle track --preset P2 = throttle track
engine seek --guide -> one of none, curve, calibrated
engine sweep --soc -20:5:1 -> --over soc_cad=LOW:HIGH:COUNT
engine simulate --soc -20:5:1 -> below zero it is --soc-cad=-
map seek --speed 1000,1500,2000 -> --over speed_rpm=LOW:HIGH:COUNT
map --speed 1000,1500 -> map: which command? map has design, fit,
version = doctor
engine plot p.csv = engine analyze
engine tdc p.csv = engine analyze
report p.csv = engine analyze
engine export m.nc -> engine has simulate, analyze, check, calibrate, optimum, seek, sweep; elsewhere there is mgdd map
throttle fit log.csv = throttle identify
throttle step = throttle track
throttle track --step 10:50 -> '--reference step:FROM:TO'
engine analyze p.csv --bore 128 -> '--set bore_mm=X'
engine optimum --max-pressure 120 -> '--limit p_max_bar=X'
map export m.nc --dcm -> '--output FILE.dcm'
engine sweep --soc=-20:5:1 -> --over soc_cad=LOW:HIGH:COUNT
selftest = rig selftest
download hd_diesel_128x144 -o d.csv = data get
engin simulate -> 'engine'
study list = study
"""


@pytest.mark.parametrize("line", GUESSES.strip().splitlines())
def test_a_first_guess_works_or_one_line_leads_on(line: str) -> None:
    works = " = " in line
    typed, _, wanted = line.partition(" = " if works else " -> ")
    parser = root_parser()
    if works:
        args = parser.parse_args(understood(typed.split(), parser))
        assert args.parser.prog == f"mgdd {wanted}"
        assert args.json is ("--json" in typed)
        assert "x." not in typed or args.output in typed.split()
    else:
        with pytest.raises(UsageError) as caught:
            parser.parse_args(understood(typed.split(), parser))
        assert wanted in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("verb", sorted(VERBS))
def test_a_verb_alone_is_its_command_or_names_all_that_have_it(verb: str) -> None:
    own = [name for name in COMMANDS if name.rpartition(" ")[2] == verb]
    try:
        said = " ".join(understood([verb], root_parser()))
    except UsageError as error:
        said = str(error)
    assert said == own[0] or all(f"mgdd {name}" in said for name in own)


@pytest.mark.parametrize("typed", ["help engine", "engine help", "engine --help"])
def test_help_is_a_word_too(typed: str, capsys: Capsys) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(typed.split())
    assert "usage: mgdd engine [-h] COMMAND" in capsys.readouterr().out


def test_a_wrong_option_is_one_line(capsys: Capsys) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["engine", "simulate", "--soc-cda", "3"])
    assert capsys.readouterr().err.splitlines() == [
        "mgdd engine simulate: error: unrecognized arguments: --soc-cda 3; did you mean '--soc-cad'?"
    ]


@pytest.mark.parametrize("typed", ["--version", "-V", "--help", "help engine", "engin"])
def test_little_is_loaded_where_no_command_runs(typed: str) -> None:
    code = (
        "import sys, mgdd; before = len(sys.modules); from mgdd.cli import main\n"
        f"try: main({typed.split()})\nexcept SystemExit: pass\n"
        "print(len(sys.modules) - before, 'numpy' in sys.modules, file=sys.stderr)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    count, numpy = run.stderr.split()[-2:]
    assert int(count) < 40
    assert numpy == "False"


def test_only_the_command_that_is_asked_gets_its_options() -> None:
    parser = root_parser()
    parser.parse_args(["engine", "optimum"])
    groups = next(action.choices for action in parser._actions if isinstance(action.choices, dict))
    verbs = next(action.choices for action in groups["engine"]._actions if isinstance(action.choices, dict))
    filled = [own for own in (*groups.values(), *verbs.values()) if isinstance(own, argparse.ArgumentParser)]
    assert [own.prog for own in filled if len(own._actions) > 1] == ["mgdd engine", "mgdd engine optimum"]
