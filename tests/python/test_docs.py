"""What the pages say is true: tables are recomputed, names are complete, citations have an entry.

A table below ``<!-- checked: NAME -->`` (in the README: ``numbers``) is compared, label by label and number by
number, with what ``NAME`` in `tools/docs_tables.py` computes now; a printed number may be off by one in its last digit.
In the same way ``<!-- number: NAME -->`` goes before a single number.
"""

import importlib
import inspect
import itertools
import re
import shlex
import sys
from pathlib import Path

import pytest

import mgdd
from public_objects import ROOMS

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tools"))
docs_tables = importlib.import_module("docs_tables")
DOCS = ROOT / "docs"
PAGES = [*sorted(DOCS.glob("*.md")), *ROOT.glob("README.md")]
TABLE = re.compile(r"<!-- (?:checked|numbers): (\w+) -->\n+((?:\|.*\n)+)")
NUMBER = re.compile(r"[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
MARKED = re.compile(r"<!-- number: (\w+) -->\s*\W*?(" + NUMBER.pattern + ")")
CITATION = re.compile(
    r"\b([A-ZÅ][\w-]+)(?: et al\.|(?:, [A-Z][\w-]+)*,? and (?:[A-Z][\w-]+ )*[A-Z][\w-]+)?,? \(?((?:18|19|20)\d\d)\b"
)
# Names before a year that are not authors.
NO_AUTHORS = {"CODATA", "Atmosphere", "Paper"}


def printed_numbers(text: str) -> list[tuple[float, float]]:
    """Find the numbers in a text, each with one unit of its last digit."""
    found = []
    for match in NUMBER.findall(text):
        plain = match.replace("−", "-")
        mantissa, _, exponent = plain.partition("e")
        decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
        found.append((float(plain), 10.0**-decimals))
    return found


def tables_of(page: Path) -> list[tuple[str, dict[str, str]]]:
    """Find the checked tables of a page: name, and the text of each row by its label."""
    tables = []
    for name, text in TABLE.findall(page.read_text(encoding="utf-8")):
        rows = [[cell.strip() for cell in line.strip().strip("|").split(" | ")] for line in text.splitlines()]
        head, _, *body = rows
        if NUMBER.fullmatch(head[1]):
            body.insert(0, head)
        width = docs_tables.LABEL_COLUMNS.get(name, 1)
        tables.append((name, {" ".join(row[:width]): " | ".join(row[width:]) for row in body}))
    return tables


TABLES = [(page, name, rows) for page in PAGES for name, rows in tables_of(page)]


# Whole studies, and the calibration of all models.
DEAR = {
    "esc_cases", "esc_components", "guided_bench", "guided_plane", "guided_start", "ignition_plane", "learning",
    "members", "model_stages", "seekers", "sensor_fits", "sensors", "throttle_faults", "timing",
}  # fmt: skip


@pytest.mark.parametrize(
    ("page", "name", "rows"),
    [
        pytest.param(page, name, rows, id=f"{page.name}-{name}", marks=pytest.mark.slow if name in DEAR else [])
        for page, name, rows in TABLES
    ],
)
def test_table_holds(page: Path, name: str, rows: dict[str, str]) -> None:
    truth = getattr(docs_tables, name)()
    assert list(rows) == list(truth), f"rows of {name} in {page.name}"
    for label, values in truth.items():
        printed = printed_numbers(rows[label])
        assert len(printed) == len(values), f"{name}, row {label!r}: computed {values}"
        for (number, last), value in zip(printed, values, strict=True):
            assert abs(number - value) <= 1.0001 * last, f"{name}, row {label!r}: {number} is {value}"


def test_every_computed_table_is_printed() -> None:
    printed = {name for _, name, _ in TABLES}
    assert printed == set(docs_tables.__all__)


def test_independent_program_agrees() -> None:
    for label, (reference, found) in docs_tables.golden().items():
        assert found == pytest.approx(reference, rel=5e-4), label


def test_readme_numbers_hold() -> None:
    for page in PAGES:
        for name, text in MARKED.findall(page.read_text(encoding="utf-8")):
            assert name in docs_tables.NUMBERS, f"{page.name}: no function computes {name!r}"
            (number, last), value = printed_numbers(text)[0], docs_tables.NUMBERS[name]()
            assert abs(number - value) <= 1.0001 * last, f"{page.name}: {name} = {number} is {value}"


# --- the way from the landing page --------------------------------------------------------------------------
# A question, the links from page to page, the heading there, and what the answer must hold.
CLICKS = {
    "how do I read my pressure file": (("howto",), "Read my pressure file", "io.read_pressure("),
    "tune a PID for my throttle": (("howto",), "Tune a PID for my throttle", 'tuned_controller("pid"'),
    "my own model as a guide": (("howto",), "Use my own model as a guide", "CurveSeeking("),
    "which seeker when": (("howto",), "Choose a seeker", "| several inputs |"),
    "my DBC": (("howto",), "Run on my rig with my DBC", "which signal of the DBC"),
    "does it run on Windows": (("getting_started",), "Install", "Windows"),
    "a map as DCM": (("howto",), "Bring a map into the control unit", '.dcm"'),
    "what does trust mean": (("glossary",), "Guidance", "\nTrust\n"),
    "Ctrl-C in a study": (("howto",), "Troubleshooting", "Ctrl-C"),
    "equation 2-6": (("explanation", "theory_engine"), "Which equation is where", "| 2-6 |"),
}


@pytest.mark.parametrize("question", CLICKS)
def test_a_question_is_answered_two_clicks_from_the_landing_page(question: str) -> None:
    pages, heading, answer = CLICKS[question]
    for here, there in itertools.pairwise(("index", *pages)):
        text = _page(here)
        listed = "\n".join(re.findall(r"```\{toctree\}\n(.*?)```", text, re.DOTALL)).split()
        assert f"]({there}.md" in text or there in listed, f"{here}.md has no link to {there}.md"
    sections = re.split(r"^#+ (?=\S)", _page(pages[-1]), flags=re.MULTILINE)
    assert any(section.startswith(heading) and answer in section for section in sections)


# --- names --------------------------------------------------------------------------------------------------


def public() -> list[tuple[str, str, object]]:
    modules = [(room, importlib.import_module(room)) for room in ROOMS]
    return [(room, name, getattr(module, name)) for room, module in modules for name in module.__all__]


def test_rooms_say_what_is_public() -> None:
    assert {f"mgdd.{name}" for name in mgdd.__all__} - {"mgdd.__version__", "mgdd.cmake_dir"} <= set(ROOMS)
    for room in ROOMS:
        assert importlib.import_module(room).__all__, f"{room} has no __all__"


def test_reference_has_every_public_module() -> None:
    _, *sections = re.split(r"^## (?=mgdd)", _page("api"), flags=re.MULTILINE)
    assert sorted(section.split()[0] for section in sections) == sorted(["mgdd", *ROOMS])
    assert all(section.count("<!-- names -->") == 1 for section in sections)


@pytest.mark.parametrize(("room", "name", "item"), public(), ids=lambda value: value if isinstance(value, str) else "")
def test_public_docstring_is_complete(room: str, name: str, item: object) -> None:
    if not callable(item):
        pytest.skip("a constant; the reference documents it")
    text = inspect.getdoc(item) or ""
    summary = text.split("\n\n")[0].replace("\n", " ")
    assert summary.endswith("."), f"{room}.{name}: no summary"
    if isinstance(item, type) and issubclass(item, Exception):
        return
    assert re.search(r"^Examples\n-{8}$", text, re.MULTILINE), f"{room}.{name}: no example"
    try:
        called = not getattr(item, "_is_protocol", False)  # a protocol is implemented, not called
        takes_arguments = called and bool(inspect.signature(item).parameters)
    except ValueError:  # a class of the core; its fields document themselves
        takes_arguments = not hasattr(item, "fields")
    section = re.search(r"^(Parameters|Attributes)\n-{10}$", text, re.MULTILINE)
    assert section or not takes_arguments or hasattr(item, "fields"), f"{room}.{name}: no Parameters"


# --- sources ------------------------------------------------------------------------------------------------
def bibliography() -> dict[str, tuple[str, str]]:
    """Read references.bib: first author's family name and year, by key."""
    text = (ROOT / "references.bib").read_text(encoding="utf-8")
    for tex, letter in (('{\\"u}', "ü"), ('{\\"o}', "ö"), ("{\\'e}", "é"), ("{\\AA}", "Å")):
        text = text.replace(tex, letter)
    entries = {}
    for key, body in re.findall(r"^@\w+\{(\w+),(.*?)^\}", text, re.MULTILINE | re.DOTALL):
        author = re.search(r"author\s*=\s*\{(.*?)\},$", body, re.MULTILINE | re.DOTALL)
        year = re.search(r"year\s*=\s*\{(\d+)\}", body)
        entries[key] = (author[1].split(",")[0].split()[-1] if author else "", year[1] if year else "")
    return entries


def test_every_cited_key_has_an_entry() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    cited = re.findall(r"\[([^]]*)\]\(#ref-(\w+)\)", text)
    assert len(cited) > 100
    known = bibliography()
    for words, key in cited:
        assert key in known, f"{key} is not in references.bib"
        assert re.findall(r"\b(?:18|19|20)\d\d\b", words) in ([], [known[key][1]]), f"{words} is not {key}"


def test_every_author_and_year_in_the_sources_has_an_entry() -> None:
    known = set(bibliography().values())
    missing = {}
    for folder, patterns in (
        ("cpp", ("*.hpp", "*.cpp")),
        ("python", ("*.py", "*.toml")),
        ("docs", ("*.md",)),
    ):
        files = {f for p in patterns for f in (ROOT / folder).rglob(p) if "generated" not in f.parts}
        for file in sorted(files):
            text = re.sub(r"\s*\n\s*(?://+|#)?\s*", " ", file.read_text(encoding="utf-8"))
            for match in CITATION.finditer(text):
                if match.groups() not in known and match[1] not in NO_AUTHORS:
                    missing[match[0]] = file.relative_to(ROOT).as_posix()
    assert not missing, "cited, but not in references.bib"


def test_code_named_beside_an_equation_exists() -> None:
    rows = re.findall(r"^\| 2-\d+.*?\| `([\w:]+)` in `(\S+)` \|", _page("theory_engine"), re.MULTILINE)
    assert len(rows) >= 9
    for name, file in rows:
        folder = ROOT / "cpp" if file.startswith("src/") else ROOT / "cpp" / "include" / "mgdd"
        assert re.search(rf"\b{name.split('::')[-1]}\(", (folder / file).read_text(encoding="utf-8")), name


# --- commands -----------------------------------------------------------------------------------------------
@pytest.mark.slow
def test_commands_of_getting_started_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mgdd.cli import main

    monkeypatch.chdir(tmp_path)
    text = _page("getting_started")
    python = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    exec(compile("\n".join(python), "getting_started.md", "exec"), {})  # noqa: S102
    lines = [
        line
        for block in re.findall(r"^```shell\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
        for line in block.replace("\\\n", "").splitlines()
    ]
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("mgdd engine")]
    assert len(commands) >= 5
    for command in commands:
        assert main(command) == 0, command
    assert (tmp_path / "fit.json").is_file()


def test_commands_of_maps_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The chain of the page runs in an empty folder, and what the page shows is what it prints."""
    from mgdd.cli import main

    monkeypatch.chdir(tmp_path)
    (section,) = re.findall(r"^## From the command line\n(.*?)^## ", _page("maps"), re.MULTILINE | re.DOTALL)
    (block,) = re.findall(r"^```shell\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    (shown,) = re.findall(r"^```text\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    commands = [shlex.split(line)[1:] for line in block.replace("\\\n", "").splitlines()]
    assert {command[1] for command in commands if command[0] == "map"} == {
        "design", "fit", "predict", "optimize", "smooth", "show", "diff", "trade-off", "export",
    }  # fmt: skip
    for command in commands:
        assert main(command) == 0, command
    assert shown in capsys.readouterr().out
    (grid,) = re.findall(r"`mgdd (engine sweep --over [^`]*)`", section)
    assert main(shlex.split(grid)) == 0
    assert main(commands[5]) == 0
    capsys.readouterr()


def _page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")
