"""What the command line says while it works and when it fails, and the keys of its JSON."""

import io
import json
import logging
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mgdd.cli import main, output
from mgdd.cli.output import show
from mgdd.cli.progress import _INTERVAL_S, Progress, gated_streams
from mgdd.errors import DataError, Error, ParameterError
from mgdd.report import Table
from mgdd_studies import command
from typed import Capsys


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_long_step_speaks_without_a_terminal() -> None:
    out = io.StringIO()
    with Progress(quiet=False, stream=out, interval_s=0.05) as progress:
        time.sleep(0.12)
        step = progress.expect(7)
        step("fit the model")
        time.sleep(0.2)
    lines = out.getvalue().splitlines()
    assert lines[0].startswith("mgdd: working (0 s)")
    assert lines[-1].startswith("mgdd: fit the model (step 1 of about 7, ")
    said = len(lines)
    time.sleep(0.1)
    assert len(out.getvalue().splitlines()) == said
    assert _INTERVAL_S <= 15.0


@pytest.mark.parametrize("stream", [io.StringIO(), Terminal()])
def test_quiet_and_short_commands_say_nothing(stream: io.StringIO) -> None:
    with Progress(quiet=True, stream=stream, interval_s=0.01) as progress:
        progress.expect(3)("one")
        time.sleep(0.05)
    with Progress(quiet=False, stream=io.StringIO()) as progress:
        progress("one")
    assert stream.getvalue() == ""


def test_a_terminal_gets_a_bar_that_goes_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    out = Terminal()
    with Progress(quiet=False, stream=out) as progress:
        step = progress.expect(2)
        for text in ("first", "second", "third"):
            step(text)
            time.sleep(0.15)
        print("a result", file=out)
    text = out.getvalue()
    assert "second" in text
    assert text.rstrip().endswith("\x1b[2K")  # the line of the bar is wiped


def test_every_command_has_it(monkeypatch: pytest.MonkeyPatch, capsys: Capsys) -> None:
    monkeypatch.setattr(Progress.__init__, "__kwdefaults__", {"stream": None, "interval_s": 0.05})
    assert main(["study", "sensor-delay", "--quick", "--seeds", "2", "--json"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["study"] == "sensor-delay"
    assert "mgdd: " in captured.err
    assert " of about 10, " in captured.err
    assert main(["study", "sensor-delay", "--quick", "--seeds", "2", "--json", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def failed(capsys: Capsys, *argv: str, code: int) -> dict[str, Any]:
    assert main([*argv, "--json"]) == code
    captured = capsys.readouterr()
    content = json.loads(captured.out)
    assert list(content) == ["error"]
    error: dict[str, Any] = content["error"]
    assert list(error) == ["type", "field", "value", "bound", "message"]
    assert captured.err.strip().endswith(error["message"])
    assert main(list(argv)) == code
    assert capsys.readouterr().out == ""
    return error


def test_errors_of_json_commands_are_json(capsys: Capsys, tmp_path: Path) -> None:
    error = failed(capsys, "engine", "simulate", "--set", "bore_mm=-90", code=2)
    assert (error["type"], error["message"]) == ("ParameterError", "bore_mm = -90 mm: must be > 0 and <= 2000")
    error = failed(capsys, "engine", "analyze", str(tmp_path / "none.csv"), "--preset", "puma_single", code=2)
    assert error["type"] == "FileNotFoundError"
    error = failed(
        capsys, "engine", "optimum", "--burn-duration-cad", "30", "--limit", "p_max_bar=10", code=3
    )  # fmt: skip
    assert error["type"] == "ConvergenceError"


def test_a_wrong_command_line_too(capsys: Capsys) -> None:
    for argv in (["engine", "simulate", "--soc-cad", "x", "--json"], ["engine", "simulate", "--no-such", "--json"]):
        with pytest.raises(SystemExit) as caught:
            main(argv)
        assert caught.value.code == 2
        captured = capsys.readouterr()
        error = json.loads(captured.out)["error"]
        assert error["type"] == "UsageError"
        assert error["message"] in captured.err
        assert captured.err.startswith("mgdd engine simulate: error: ")
        with pytest.raises(SystemExit):
            main(argv[:-1])
        assert capsys.readouterr().out == ""


def test_fields_of_an_error_are_passed_on() -> None:
    error = ParameterError("bore_mm = -90 mm: must be > 0")
    error.field, error.value, error.bound = "bore_mm", -90.0, "> 0"  # type: ignore[attr-defined]
    assert output.error_of(error, "m") == {
        "type": "ParameterError", "field": "bore_mm", "value": -90.0, "bound": "> 0", "message": "m",
    }  # fmt: skip
    error.value = object  # type: ignore[attr-defined]
    assert output.error_of(error, "m")["value"] == "<class 'object'>"


def test_a_result_that_was_printed_stands_alone(monkeypatch: pytest.MonkeyPatch, capsys: Capsys) -> None:
    from mgdd.errors import ConvergenceError

    real = command.emit

    def then_fail(*args: Any, **how: Any) -> None:
        real(*args, **how)
        raise ConvergenceError("did not converge")

    monkeypatch.setattr(command, "emit", then_fail)
    assert main(["study", "--list", "--json"]) == 3
    captured = capsys.readouterr()
    assert list(json.loads(captured.out)) == ["studies"]
    assert "did not converge" in captured.err


def test_ctrl_c_before_a_result_is_an_error(monkeypatch: pytest.MonkeyPatch, capsys: Capsys) -> None:
    def press(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "run_study", press)
    assert main(["study", "sensor-delay", "--json"]) == 130
    assert json.loads(capsys.readouterr().out)["error"]["type"] == "KeyboardInterrupt"


def test_a_table_has_every_cell_as_it_is_with_numbers_to_the_right() -> None:
    table = Table(columns=("who [-]", "x"), rows=(("[bold]a", "1.5"), ("a\nname", "–")))
    assert output.show(["head", table, "foot"]).splitlines() == [
        "head",
        "who [-]    x",
        "[bold]a  1.5",
        "a\\nname    –",
        "foot",
    ]


ACTING = "\x1b]0;x\x07\x1b[2J\x00\x9b31m\u202e"


@pytest.mark.parametrize(
    "text",
    [
        "crank_angle_cad,p{}_bar\n" + "\n".join(f"{k},{k}" for k in range(-30, 31)),
        "a{},b\n1,2\n2,3\n",
        "a,b{0}\n1,x{0}\n",
        "time_s,duty,angle_deg{}\n0,0,0\n",
    ],
)
@pytest.mark.parametrize("command", ["engine analyze", "data info", "map show", "throttle identify"])
def test_a_heading_does_not_act(command: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / f"n{ACTING.replace(chr(0), '')}.csv"
    file.write_text(text.format(ACTING.replace("\0", "")), encoding="utf-8")
    main([*command.split(), str(file)])
    said = capsys.readouterr()
    assert "\\x1b" in said.out + said.err
    assert not set(ACTING) & set(said.out + said.err) - set("]0;x[2J31m")


def test_usage_errors_do_not_act() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mgdd", "engine", "\x1b[31m"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert "\x1b" not in done.stderr


def test_warnings_logs_and_tables_do_not_act(capsys: pytest.CaptureFixture[str]) -> None:
    with gated_streams():
        handler = logging.StreamHandler(sys.stderr)
        logging.getLogger("mgdd.test").addHandler(handler)
        logging.getLogger("mgdd.test").warning("%s", ACTING)
        logging.getLogger("mgdd.test").removeHandler(handler)
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            sys.stderr.write(warnings.formatwarning(ACTING, UserWarning, "f", 1, line=""))
        sys.stdout.write(show([ACTING, Table(columns=("a", ACTING), rows=(("1", f"{ACTING}\n2"),))]))
    said = capsys.readouterr()
    assert not {"\x1b", "\x07", "\0", "\x9b", "\u202e"} & set(said.out + said.err)
    assert "\\n2" in said.out


def test_a_message_is_short_and_plain_whatever_it_quotes() -> None:
    for text in (
        f"a.dbc: {ACTING} " + "word " * 2000,
        "a.dbc: " + "x" * 9000 + ": save it again",
        "'" + "y " * 999 + "'",
    ):
        message = str(DataError(text))
        assert len(message) < 400
        assert "\x1b" not in message
        assert message[-6:] == text[-6:]
    assert str(Error("as it was: µ, °CA, tab\t, line\nend")) == "as it was: µ, °CA, tab\t, line\nend"


# --- Ctrl-C where a result is drawn ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "command",
    [
        ["study", "sensor-delay", "--quick", "--figures", "figures"],
        ["study", "sensor-delay", "--quick", "--report", "page"],
        ["throttle", "simulate", "--preset", "P1", "--duty", "0.6", "--figure", "run.png"],
    ],
)
def test_ctrl_c_while_a_figure_is_written_leaves_the_result(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", stop)
    assert main([*command, "-o", "result.json"]) == 130
    assert (tmp_path / "result.json").stat().st_size > 100
    assert "the result is printed" in capsys.readouterr().err


KEYS = Path(__file__).parents[2] / "data" / "json_keys.json"
WRITTEN: dict[str, str] = json.loads(KEYS.read_text(encoding="utf-8"))


def paths(value: Any, above: str = "") -> Iterator[str]:
    """Name every number and text by the keys that lead to it; an entry of a list is like its first."""
    if isinstance(value, dict) and value:
        for key, below in value.items():
            yield from paths(below, f"{above}.{key}" if above else str(key))
    elif isinstance(value, list) and value:
        yield from paths(value[0], f"{above}[]")
    else:
        yield above


@pytest.mark.parametrize("command", WRITTEN)
def test_keys_stay(command: str, capsys: Capsys) -> None:
    assert main([*command.split(), "--json"]) == 0
    assert sorted(paths(json.loads(capsys.readouterr().out))) == WRITTEN[command].split(" ")
