"""Sphinx: `make docs`. Needs no network; notebooks come from ../notebooks."""

from __future__ import annotations

import filecmp
import json
import shutil
from pathlib import Path
from typing import Any

import mgdd

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
autosummary_generate = True
autodoc_typehints = "none"  # the docstrings name type, shape and unit
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
nitpick_ignore_regex = [
    (r"py:.*", r"(?!mgdd(_studies)?\.).*"),  # other projects: no inventories without a network
    (r"py:.*", r"mgdd\._core.*"),  # documented where it is offered, in mgdd.<room>
]

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
    """Let Sphinx call `list_versions`."""
    app.connect("build-finished", list_versions)


html_static_path = ["_static"]
html_css_files = ["mgdd.css"]
