"""What the reader sees runs: notebooks, the examples of every docstring and page, the docs build itself."""

import doctest
import importlib
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

import nbformat
import pytest

import mgdd_studies
import study_cache
from mgdd import datasets
from public_objects import MODULES

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tools"))
run_notebooks = importlib.import_module("run_notebooks")
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
DEAR_PAGES = {"tour.md", "getting_started.md", "calibration.md", "from_log_to_controller.md"}  # they calibrate
NUMBER = re.compile(r"\d+(?:\.\d+)?")
FENCE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


def test_there_is_something_to_run() -> None:
    assert NOTEBOOKS
    assert "mgdd.engine" in MODULES
    assert FENCE.search(PAGES[0].read_text(encoding="utf-8")), "README.md shows no Python"


NEEDS = {"14_what_do_25000_cycles_teach.ipynb": "h2df_502"}  # a data set that is not in the package


@pytest.mark.slow
@pytest.mark.notebook
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_notebook_runs_and_prints_what_it_shows(path: Path, tmp_path: Path) -> None:
    """Words are the same, a number is off by one in its last digit at most; `tools/run_notebooks.py` renews both."""
    if (needed := NEEDS.get(path.name)) and needed not in datasets.names():
        pytest.skip(f"the data set {needed} is not at hand")
    shown, fresh = nbformat.read(path, as_version=4), run_notebooks.executed(path, tmp_path)
    for kept, new in zip(shown.cells, fresh.cells, strict=True):
        figures = [sum("image/png" in each.get("data", {}) for each in cell.get("outputs", [])) for cell in (kept, new)]
        assert figures[0] == figures[1]
    for kept, new in zip(run_notebooks.printed(shown), run_notebooks.printed(fresh), strict=True):
        assert NUMBER.sub("#", kept) == NUMBER.sub("#", new)
        for before, after in zip(NUMBER.findall(kept), NUMBER.findall(new), strict=True):
            last = 10.0 ** -len(before.partition(".")[2])
            assert abs(float(before) - float(after)) <= 1.01 * last, f"{after} is {before} in the notebook"


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow if name.startswith("mgdd_studies.") else []) for name in MODULES],
)
def test_docstring_examples(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(name)
    if name.startswith("mgdd_studies."):  # a study that a test has run with the same options is not run again
        monkeypatch.setattr(mgdd_studies, "run_study", study_cache.study)
    result = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0, f"{result.failed} of {result.attempted} examples of {name} failed: see above"


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, id=page.name, marks=pytest.mark.slow if page.name in DEAR_PAGES else []) for page in PAGES],
)
def test_page_examples(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The Python blocks of a page run from top to bottom as one program."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": page.name}
    for block in FENCE.findall(page.read_text(encoding="utf-8")):
        if block.startswith(">>>"):
            examples = doctest.DocTestParser().get_doctest(block, names, page.name, str(page), 0)
            runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
            assert runner.run(examples, clear_globs=False).failed == 0
            names.update(examples.globs)
        else:
            exec(compile(block, str(page), "exec"), names)  # noqa: S102


@pytest.mark.slow
@pytest.mark.docs
def test_docs_build_without_a_warning(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sphinx", "-W", "-n", "--keep-going", "-q", "-b", "html"]
    folders = ["-d", str(tmp_path / "doctrees"), str(ROOT / "docs"), str(tmp_path / "html")]
    run = subprocess.run([*command, *folders], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    assert (tmp_path / "html" / "index.html").is_file()
    check_without_a_network(tmp_path / "html")
    check_links(tmp_path / "html")


def check_links(site: Path) -> None:
    """Every link to a page, a file or a heading of the documentation has its target."""
    pages = {page: page.read_text(encoding="utf-8") for page in site.resolve().rglob("*.html")}
    anchors = {page: set(re.findall(r"\s(?:id|name)=\"([^\"]+)\"", text)) for page, text in pages.items()}
    links = [(page, link) for page, text in pages.items() for link in re.findall(r"<a [^>]*href=\"([^\"]+)\"", text)]
    own = [(page, *unquote(link).partition("#")) for page, link in links if not re.match(r"[a-z]+:", link)]
    assert len(own) > 10_000
    for page, path, _, heading in own:
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{page.name}: {path}"
        assert not heading or heading in anchors.get(target, {heading}), f"{page.name}: {path}#{heading}"


def check_without_a_network(site: Path) -> None:
    """Equations are drawn by a MathJax that lies beside the pages, and nothing else is loaded from elsewhere."""
    loads = re.compile(
        r"<(?:script|img|iframe)[^>]*\ssrc=\"([^\"]+)\"|<link[^>]*rel=\"stylesheet\"[^>]*href=\"([^\"]+)\""
    )
    pages = {page: page.read_text(encoding="utf-8") for page in site.rglob("*.html")}
    equations = {page for page, text in pages.items() if 'class="math' in text}
    assert len(equations) > 10
    for page, text in pages.items():
        files = [source or sheet for source, sheet in loads.findall(text)]
        assert not [file for file in files if "//" in file], page.name
        drawn = [page.parent / file for file in files if "mathjax" in file]
        assert all(file.is_file() for file in drawn)
        assert bool(drawn) == (page in equations), page.name
    fonts = site / "_static" / "mathjax" / "output" / "chtml" / "fonts" / "woff-v2"
    assert len(list(fonts.glob("*.woff"))) > 10
