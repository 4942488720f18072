"""What a terminal would obey is written out, wherever a text of a file, a name or a library leaves."""

from __future__ import annotations

import logging
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from mgdd.cli import main
from mgdd.cli.output import Table, show
from mgdd.cli.progress import gated_streams
from mgdd.errors import DataError, Error

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
