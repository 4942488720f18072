"""Options that come from the library: names, kinds, choices, defaults and help of its signatures and numpydoc."""

import argparse
import importlib
import inspect
import shlex
from collections.abc import Iterator
from typing import Literal

import pytest

from mgdd.cli import main
from mgdd.cli.commands import COMMANDS, root_parser
from mgdd.cli.from_library import Options
from mgdd.cli.parser import Parser
from typed import Capsys


def made(
    first: float,
    second_hz: float = 2.5,
    *,
    kind: str = "plain",
    way: Literal["up", "down"] = "up",
    column: int | str | None = None,
    window: tuple[float, float] | None = None,
    open_end: bool = False,
    count: int = 3,
) -> None:
    """Make something.

    Parameters
    ----------
    first : float
        First number [bar]. More of it.
    second_hz : float
        NMR frequency [Hz], 50 % of `count`; a lot.
    kind : {"plain", "odd"}
        Which ``plain`` kind.
    way, column : str, optional
        Where. None: nowhere.
    window : tuple of float, optional
        From and to [s].
    open_end : bool
        Leave it open.
    count : int
        How many.

    Returns
    -------
    None
        Nothing : at all
    """


MADE = Options(made, "first", "second_hz", "kind", "way", "column", "window", "open_end", count="n")


@pytest.fixture
def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="made")
    MADE.add(parser, "group")
    return parser


def test_what_is_not_given_is_left_to_the_library(parser: argparse.ArgumentParser) -> None:
    args = parser.parse_args(["--first", "1"])
    assert MADE.given(args) == {"first": 1.0}
    own = {name: each.default for name, each in inspect.signature(made).parameters.items() if name != "first"}
    assert MADE.of(args) == {"first": 1.0, **own}


def test_what_is_given_has_the_kind_of_the_annotation(parser: argparse.ArgumentParser) -> None:
    given = "--first 1 --second-hz 2 --kind odd --way down --column 4 --window 1 2 --open-end --n 7"
    assert MADE.given(parser.parse_args(given.split())) == {
        "first": 1.0, "second_hz": 2.0, "kind": "odd", "way": "down", "column": 4, "window": (1.0, 2.0),
        "open_end": True, "count": 7,
    }  # fmt: skip
    assert MADE.given(parser.parse_args(["--first", "1", "--column", "p"]))["column"] == "p"


@pytest.mark.parametrize("wrong", ["", "--first 1 --kind other", "--first 1 --way sideways", "--first 1 --n 1.5"])
def test_what_does_not_fit_is_refused(wrong: str, parser: argparse.ArgumentParser) -> None:
    with pytest.raises(SystemExit):
        parser.parse_args(wrong.split())


def test_help_is_that_of_the_numpydoc(parser: argparse.ArgumentParser) -> None:
    said = " ".join(parser.format_help().split())
    assert "--first X first number [bar] --second-hz" in said
    assert "NMR frequency [Hz], 50 % of --n; a lot (default: 2.5)" in said
    assert "which plain kind (default: plain)" in said
    assert "--column COLUMN where; left out: nowhere" in said
    assert "leave it open --n N how many (default: 3)" in said
    assert "default: None" not in said


def option_sets() -> list[Options]:
    """Every set of options of the package."""
    names = {f"mgdd.cli.{command.module}" for command in COMMANDS.values() if command.module}
    modules = [importlib.import_module(name) for name in (*names, "mgdd.cli.options", "mgdd_studies.command")]
    values = [value for module in modules for value in vars(module).values()]
    each = [own for value in values for own in (value.values() if isinstance(value, dict) else (value,))]
    return list({id(own): own for own in each if isinstance(own, Options)}.values())


def actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in (parser.filled() if isinstance(parser, Parser) else parser)._actions:
        yield action
        if isinstance(action.choices, dict):
            for below in dict.fromkeys(action.choices.values()):
                yield from actions(below)


def test_every_option_of_the_library_names_a_parameter_with_help() -> None:
    sets = option_sets()
    assert len(sets) > 40
    assert sum(len(each.options) for each in sets) > 120
    for each in sets:
        parser = argparse.ArgumentParser()
        each.add(parser)
        for action in parser._actions[1:]:
            assert action.default is None, (each.call, action.dest)
            assert action.help, (each.call, action.dest)
            assert "As in" not in action.help, (each.call, action.dest)
        assert set(each.options) <= set(inspect.signature(each.call).parameters)


def test_choices_of_the_library_hold_its_default() -> None:
    for each in option_sets():
        parser = argparse.ArgumentParser()
        each.add(parser)
        by_option = {action.dest: action for action in parser._actions}
        for name, option in each.options.items():
            choices, default = by_option[option].choices, inspect.signature(each.call).parameters[name].default
            if choices is not None and default not in (None, inspect.Parameter.empty):
                assert default in choices, (each.call, name)


def test_choices_that_are_documented_are_those_that_are_checked() -> None:
    from mgdd.design.points import METHODS
    from mgdd.identify.throttle.excitation import EXCITATIONS
    from mgdd.identify.throttle.fits import CHOICES
    from mgdd.io.angle_column import ANGLE_UNITS
    from mgdd.io.pressure_checks import PRESSURE_UNITS
    from mgdd.surrogate.polynomial import MODELS
    from mgdd.surrogate.response_fit import KINDS, SELECTIONS

    offered = {tuple(action.choices) for action in actions(root_parser()) if action.choices is not None}
    for known in (METHODS, EXCITATIONS, CHOICES, PRESSURE_UNITS, ANGLE_UNITS, MODELS, KINDS, SELECTIONS):
        assert tuple(known) in offered, known


@pytest.mark.parametrize("name", COMMANDS)
def test_help_ends_with_an_example_that_its_command_takes(name: str, capsys: Capsys) -> None:
    with pytest.raises(SystemExit, match="0"):
        main([*name.split(), "--help"])
    example = capsys.readouterr().out.partition("example:\n  mgdd ")[2]
    if COMMANDS[name].module:
        assert root_parser().parse_args(shlex.split(example)).run


@pytest.mark.parametrize(
    ("argv", "near"),
    [
        ("stdy", "study"),
        ("engine simulat", "simulate"),
        ("engine simulate --integrator trapzoid", "trapezoid"),
        ("engine simulate --soc-cd 3", "--soc-cad"),
        ("map fit t.csv --response p --kind gausian_process", "gaussian_process"),
        ("engine optimum --limit p_mx_bar=95", "p_max_bar"),
        ("engine seek --limit p_mx_bar=95", "p_max_bar"),
        ("map design --over soc_cad=-16:4 --points 4 --limit p_mx_bar=130", "p_max_bar"),
        ("engine seek --method bounded", "--seeker' or '--seeker-set"),
        ("engine seek --bounds 3", "--input"),
        ("study sensor-dela", "sensor-delay"),
        ("engine simulate --preset puma_sing", "puma_single"),
        ("preset show puma_sing", "puma_single"),
        ("throttle demand --pedal-percent 3 --speed-rpm 900 --set bre_mm=3", "bore_mm"),
    ],
)
def test_the_nearest_name_is_asked_for(argv: str, near: str, capsys: Capsys) -> None:
    try:
        code = main(argv.split())
    except SystemExit as stop:
        code = int(str(stop.code))
    assert code == 2
    assert f"did you mean '{near}'?" in capsys.readouterr().err


def test_nothing_near_is_not_asked_for(capsys: Capsys) -> None:
    with pytest.raises(SystemExit):
        main(["engine", "xyz"])
    assert "did you mean" not in capsys.readouterr().err
