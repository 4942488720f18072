"""Sphinx: `make docs`. Needs no network; notebooks come from ../notebooks."""

from __future__ import annotations

import contextlib
import filecmp
import importlib
import io
import json
import re
import shutil
import textwrap
import unicodedata
from pathlib import Path
from types import ModuleType
from typing import Any

import numpydoc.docscrape_sphinx

import mgdd
from mgdd.cli import main
from mgdd.results.labels import VARIABLES

HERE = Path(__file__).parent

project = "mgdd"
author = "The mgdd developers"
copyright = "2026, The mgdd developers"
version = release = mgdd.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",  # carries MathJax and its fonts: equations are drawn without a network
    "sphinx_copybutton",
    "numpydoc",
    "myst_nb",
    "sphinx_codeautolink",
    "matplotlib.sphinxext.plot_directive",
]
templates_path = ["_templates"]
exclude_patterns = ["_build", "_templates", "**.ipynb_checkpoints"]

# --- pages --------------------------------------------------------------------------------------------------
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

nb_execution_mode = "off"  # notebooks carry their outputs, which the test suite compares with fresh ones

codeautolink_concat_default = True  # the blocks of a page are one program
plot_include_source = True
plot_html_show_formats = plot_html_show_source_link = False
plot_formats = [("png", 90)]


def copy_notebooks() -> None:
    """Bring ../notebooks into docs/notebooks: Sphinx reads only what stands below its own folder."""
    target = HERE / "notebooks"
    target.mkdir(exist_ok=True)
    sources = {path.name: path for path in (HERE.parent / "notebooks").glob("*.ipynb")}
    for old in target.glob("*.ipynb"):
        if old.name not in sources:
            old.unlink()
    for name, path in sources.items():
        if not (target / name).exists() or not filecmp.cmp(path, target / name, shallow=False):
            shutil.copyfile(path, target / name)


copy_notebooks()
shutil.rmtree(HERE / "generated", ignore_errors=True)  # a page of a name that is gone would be an orphan

# --- reference ----------------------------------------------------------------------------------------------
autodoc_typehints = "none"  # the docstrings name type, shape and unit
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_use_plots = True  # the examples of mgdd.plot are drawn
numpydoc.docscrape_sphinx.IMPORT_MATPLOTLIB_RE = r"from mgdd import .*\bplot\b"
nitpick_ignore_regex = [
    (r"py:.*", r"(?!mgdd(_studies)?\.).*"),  # other projects: no inventories without a network
    (r"py:.*", r"mgdd\._core.*"),  # documented where it is offered, in mgdd.<room>
]


def names_of(module: str) -> list[str]:
    """Give the public names of a module that are no modules themselves."""
    room = importlib.import_module(module)
    return [name for name in room.__all__ if name != "__version__" and not isinstance(getattr(room, name), ModuleType)]


def summary_of(module: str, folder: str = "generated") -> str:
    """Write the table of a module's names, each with a page of its own in ``folder``."""
    names = "".join(f"   {name}\n" for name in API[module])
    return f".. currentmodule:: {module}\n\n.. autosummary::\n   :toctree: {folder}\n\n{names}\n"


SECTIONS = re.compile(r"^(?=## mgdd)", re.MULTILINE)
_, *sections = SECTIONS.split((HERE / "api.md").read_text(encoding="utf-8"))
API = {module: names_of(module) for module in (section.split()[1] for section in sections)}
# Autosummary finds the pages to write in files, not in what `insert_generated` makes of them.
(HERE / "_build").mkdir(exist_ok=True)
(HERE / "_build" / "names.rst").write_text("".join(summary_of(each, "../generated") for each in API), encoding="utf-8")
autosummary_generate = ["_build/names.rst"]

# --- look ---------------------------------------------------------------------------------------------------
html_theme = "pydata_sphinx_theme"
html_title = f"mgdd {release}"
html_theme_options = {
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    # Each version lies in a folder of one site; `list_versions` writes the list of them beside the folders.
    "switcher": {"json_url": "../switcher.json", "version_match": release},
    "check_switcher": False,
    "navbar_end": ["version-switcher", "theme-switcher"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_show_sourcelink = False
html_search_scorer = str(HERE / "_static" / "search_scorer.js")


KEYS = json.loads((HERE.parent / "tests" / "data" / "json_keys.json").read_text(encoding="utf-8"))


def help_of(command: str) -> str:
    """Print what a command says of itself and the keys of its JSON, folded; the usage line repeats its options."""
    with contextlib.redirect_stdout(io.StringIO()) as text, contextlib.suppress(SystemExit):
        main([*command.split(), "--help"])
    shown = text.getvalue().partition("\n\n")[2]
    for call, keys in KEYS.items():
        if f"{call} ".startswith(f"{command} "):
            shown += f"\nkeys of mgdd {call} --json:\n{textwrap.fill(keys, 100)}\n"
    return f"<details><summary>mgdd {command} --help</summary>\n\n```text\n{shown}```\n\n</details>\n\n"


ACCENTS = {'"': "\u0308", "'": "\u0301", "v": "\u030c"}


def plain(text: str) -> str:
    """Write the letters of BibTeX as Unicode, in one line."""
    text = re.sub(r"\\(['\"v]) ?(\w)", lambda accent: accent[2] + ACCENTS[accent[1]], text.replace("\\AA", "Å"))
    text = unicodedata.normalize("NFC", re.sub(r"[{}\\]", "", text).replace("--", "–"))
    return " ".join(text.split())


SHOWN = (
    "journal",
    "booktitle",
    "series",
    "school",
    "publisher",
    "howpublished",
    "type",
    "volume",
    "number",
    "pages",
    "note",
)


def list_references() -> str:
    """Write ``references.bib`` as paragraphs with the targets ``ref-KEY``, by author and year."""
    text = (HERE.parent / "references.bib").read_text(encoding="utf-8")
    paragraphs = {}
    for key, body in re.findall(r"^@\w+\{(\w+),(.*?)^\}", text, re.MULTILINE | re.DOTALL):
        fields = re.findall(r"^ +(\w+) *= \{(.*?)\},?$", body, re.MULTILINE | re.DOTALL)
        entry = {name: plain(value) for name, value in fields}
        if {"volume", "number"} <= entry.keys():
            entry["volume"] += f"({entry.pop('number')})"
        link = [f"<{entry['url']}>"] if "url" in entry else []
        place = ", ".join([entry[name] for name in SHOWN if name in entry] + link)
        author = entry["author"].replace(" and others", " et al.").replace(" and ", "; ")
        author += f" ({entry['year']})" if "year" in entry else ""
        order = unicodedata.normalize("NFD", author).lower() + key
        paragraphs[order] = f"(ref-{key})=\n{author}: *{entry['title']}*. {place}.\n"
    return "\n".join(paragraphs[order] for order in sorted(paragraphs))


def insert_generated(_: Any, page: str, source: list[str]) -> None:
    """Put into the pages what the package knows: the help below each command, names, variables, sources."""
    if page == "api":
        head, *sections = SECTIONS.split(source[0])
        made = [f"```{{eval-rst}}\n{summary_of(section.split()[1])}```" for section in sections]
        source[0] = head + "".join(map(str.replace, sections, ["<!-- names -->"] * len(made), made))
    if page == "cli":
        head, *sections = re.split(r"^(?=## mgdd )", source[0], flags=re.MULTILINE)
        for section in sections:
            first, *others = section.splitlines()[0].removeprefix("## mgdd ").split(", ")
            room = first.rpartition(" ")[0]
            head += section.rstrip() + "\n\n" + "".join(map(help_of, [first, *(f"{room} {each}" for each in others)]))
        source[0] = head
    if page == "formats":
        rows = "".join(f"| `{name}` | {label.units} | {label.long_name} |\n" for name, label in VARIABLES.items())
        source[0] = source[0].replace("<!-- variables -->\n", f"| name | unit | meaning |\n| --- | --- | --- |\n{rows}")
    if page == "bibliography":
        source[0] = source[0].replace("<!-- references -->\n", list_references())


def list_versions(app: Any, error: Exception | None) -> None:
    """List what lies beside this build, for the menu of versions: a build in SITE/0.1.0 is served as /0.1.0/."""
    if error is None and app.builder.format == "html":
        found = sorted(Path(app.outdir).parent.glob("*/objects.inv"))
        heads = {each.parent.name: each.read_bytes().splitlines()[2].decode() for each in found}
        text = json.dumps([
            {"version": head.removeprefix("# Version: "), "url": f"/{folder}/"} for folder, head in heads.items()
        ])  # fmt: skip
        (Path(app.outdir).parent / "switcher.json").write_text(text, encoding="utf-8")


def setup(app: Any) -> None:
    """Let Sphinx call the functions above."""
    app.connect("source-read", insert_generated)
    app.connect("build-finished", list_versions)


# The side bar of the API: its modules, and the names of the one that is open.
html_context = {"api": API}
html_sidebars = {"api": ["api-nav.html"], "generated/*": ["api-nav.html"]}
html_static_path = ["_static"]
html_css_files = ["mgdd.css"]
