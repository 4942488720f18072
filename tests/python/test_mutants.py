"""The mutation tool: what it changes, what it leaves alone, and the interval that it prints."""

import ast
import importlib
import json
import re
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

CPP = """\
// a comment with x + 1
#define LIMIT 3
template <class T>
double next(const Plant& c, double duty) {
  const double effective = larger(larger(duty, -duty) - c.dead_band, 0.0);
  if (c.open_deg < duty) throw ParameterError("duty = " + text(duty) + ": must be < " + text(c.open_deg));
  const double share = above ? c.spring_above : c.spring_below;
  c.air = in.torque;
  for (int i = 0; i < 3; ++i)
    total += share * effective;
  return total / c.closed_deg;
}
"""
PYTHON = '''\
"""A text with 1 + 1."""
import math

SKIP_S = 0.05


def worth(lower: float | None, upper: float = 2.0) -> float:
    """Say 3 < 4."""
    if lower is None and upper > 1.0:
        raise ValueError(f"lower = {lower}: must be < {upper + 1}")
    rows[0] = upper
    return upper - math.floor(SKIP_S * min(lower, upper))
'''


@pytest.fixture
def tools(root: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(root / "tools"))
    return importlib.import_module("mutants")


def changes(tools: Any, path: str, text: str, **options: Any) -> set[tuple[int, str]]:
    return {(mutant.line, mutant.after.strip()) for mutant in tools.candidates(path, text, **options)}


def test_a_change_is_one_valid_line(tools: Any) -> None:
    for path, text in (("a.cpp", CPP), ("a.py", PYTHON)):
        lines = text.splitlines()
        found = tools.candidates(path, text)
        assert len({(mutant.line, mutant.after) for mutant in found}) == len(found) > 15
        for mutant in found:
            assert mutant.before == lines[mutant.line - 1] != mutant.after
            assert "\n" not in mutant.after
            if path == "a.py":
                ast.parse("\n".join([*lines[: mutant.line - 1], mutant.after, *lines[mutant.line :]]))


def test_what_a_reader_would_break_by_hand_is_among_the_changes(tools: Any) -> None:
    found = changes(tools, "a.cpp", CPP)
    assert (5, "const double effective = larger(larger(duty, -duty) + c.dead_band, 0.0);") in found
    assert (5, "const double effective = larger(larger(duty, duty) - c.dead_band, 0.0);") in found
    assert (5, "const double effective = larger(larger(duty, -duty) - c.dead_band, 1.0);") in found
    assert (7, "const double share = above ? c.spring_below : c.spring_below;") in found
    assert (8, "c.air = -(in.torque);") in found
    assert (8, ";") in found
    assert (9, "for (int i = 0; i <= 3; ++i)") in found
    assert (10, "total -= share * effective;") in found
    assert (10, "total += share / effective;") in found
    found = changes(tools, "a.py", PYTHON)
    assert (4, "SKIP_S = 0.1") in found
    assert (9, "if lower is None or upper > 1.0:") in found
    assert (9, "if not (lower is None and upper > 1.0):") in found
    assert (11, "pass") in found
    assert (12, "return upper + math.floor(SKIP_S * min(lower, upper))") in found
    assert (12, "return upper - math.ceil(SKIP_S * min(lower, upper))") in found
    assert (12, "return upper - math.floor(SKIP_S * max(lower, upper))") in found


def test_texts_types_and_listed_lines_are_left_alone(tools: Any) -> None:
    assert {line for line, _ in changes(tools, "a.cpp", CPP)} == {5, 7, 8, 9, 10, 11}
    assert {line for line, _ in changes(tools, "a.py", PYTHON)} == {4, 7, 9, 11, 12}
    assert all("None" in after for line, after in changes(tools, "a.py", PYTHON) if line == 7), "annotations stay"
    assert not any(line == 8 for line, _ in changes(tools, "a.cpp", CPP, skip=[re.compile(r"\bair\b")]))


def test_a_seed_gives_one_order_and_one_change_per_line(tools: Any, tmp_path: Path) -> None:
    files = [tmp_path / "a.cpp", tmp_path / "a.py"]
    for file, text in zip(files, (CPP, PYTHON), strict=True):
        file.write_text(text, encoding="utf-8")
    one = tools.sample(tmp_path, files, "throttle:0")
    assert one == tools.sample(tmp_path, files, "throttle:0")
    assert one != tools.sample(tmp_path, files, "throttle:1")
    assert len({(mutant.path, mutant.line) for mutant in one}) == len(one) == 11


def test_every_source_of_the_package_can_be_changed(tools: Any, root: Path) -> None:
    files = [*(root / "python/mgdd").rglob("*.py"), *(root / "cpp").rglob("*.[ch]pp")]
    some = tools.sample(root, files, "all")[::40]
    assert {Path(mutant.path).suffix for mutant in some} >= {".py", ".cpp", ".hpp"}
    for mutant in some:
        if mutant.path.endswith(".py"):
            lines = (root / mutant.path).read_text(encoding="utf-8").splitlines()
            ast.parse("\n".join([*lines[: mutant.line - 1], mutant.after, *lines[mutant.line :]]))


def test_the_interval_and_what_a_run_keeps(tools: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mutate = importlib.import_module("mutate")
    runs = importlib.import_module("mutant_runs")
    assert mutate.interval(0.9, 40) == pytest.approx((0.7694, 0.9604), abs=1e-4)
    assert mutate.interval(1.0, 40)[1] == 1.0
    monkeypatch.setattr(mutate, "ROOT", tmp_path)
    (tmp_path / "a.py").write_text(PYTHON, encoding="utf-8")
    died, lived = tools.sample(tmp_path, [tmp_path / "a.py"], "x")[:2]
    ledger = mutate.Ledger(tmp_path / "x.json", "tests of today")
    rows = [ledger.add(died, runs.Outcome("killed", "t", 1.0)), ledger.add(lived, runs.Outcome("survived", "", 1.0))]
    head = mutate.summary("x", 0, rows, 3)
    assert (head["n"], head["share"], head["equivalent"]) == (2, 0.5, 3)
    assert lived.after.strip() in mutate.table(head, rows)
    ledger.save(head, rows)
    assert json.loads((tmp_path / "x.json").read_text(encoding="utf-8"))["survived"] == 1
    same = mutate.Ledger(tmp_path / "x.json", "tests of today")
    assert (same.find(died), same.find(lived)) == (rows[0], rows[1])
    better = mutate.Ledger(tmp_path / "x.json", "tests of tomorrow")
    assert better.find(died) == rows[0], "a better test still kills it"
    assert better.find(lived) is None, "but may kill this one too"
    (tmp_path / "a.py").write_text(PYTHON + "\n", encoding="utf-8")
    assert mutate.Ledger(tmp_path / "x.json", "tests of today").find(died) is None


@pytest.mark.usefixtures("tools")
def test_a_run_prepares_once_and_has_its_copy_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mutate = importlib.import_module("mutate")
    runs = importlib.import_module("mutant_runs")
    source = tmp_path / "a.py"
    source.write_text(PYTHON, encoding="utf-8")
    prepared = []

    class Runner:
        def __init__(self, _root: Path, scratch: Path, *_: Any) -> None:
            self.scratch = scratch

        def sources(self) -> list[Path]:
            return [source]

        def tests(self) -> list[Path]:
            return []

        def prepare(self) -> None:
            prepared.append(self.scratch)
            with pytest.raises(RuntimeError, match="another run uses"):
                mutate._alone(self.scratch)

        def run(self, _mutant: Any) -> Any:
            return runs.Outcome("killed", "t", 1.0)

    monkeypatch.setattr(mutate, "ROOT", tmp_path)
    monkeypatch.setattr(mutate, "FOLDER", tmp_path / "mutants")
    monkeypatch.setattr(mutate, "Python", Runner)
    monkeypatch.setattr("sys.argv", ["mutate.py", "mgdd.a", "-n", "4"])
    assert mutate.main() == 0
    assert prepared == [tmp_path / "mutants" / "python"]
