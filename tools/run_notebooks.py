"""Run the notebooks and keep their outputs in them, so that a page of the repository shows the figures.

Run `python tools/run_notebooks.py [NOTEBOOK ...]` with the package installed; all of them take a minute. The test suite
runs each again and compares what it prints.
"""

from __future__ import annotations

import base64
import io
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbclient
import nbformat
from PIL import Image

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
_WIDGET = "application/vnd.jupyter.widget-view+json"  # dead without its kernel
_COLOURS = 32  # a figure of lines needs no more, and is a quarter as large


def executed(path: Path, folder: Path) -> Any:
    """Return the notebook with fresh outputs; what it writes goes into the folder."""
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(folder)}}
    client = nbclient.NotebookClient(
        notebook, timeout=300, iopub_timeout=120, kernel_name="python3", record_timing=False, resources=resources,
        coalesce_streams=True,
    )  # fmt: skip
    client.execute(env={**os.environ, "MPLBACKEND": "module://matplotlib_inline.backend_inline"})
    return notebook


def printed(notebook: Any) -> list[str]:
    """Give the text of each code cell: what it printed, and what its last line came to."""
    texts = []
    for cell in notebook.cells:
        outputs = cell.get("outputs", [])
        parts = [each.text for each in outputs if each.output_type == "stream" and each.name == "stdout"]
        parts += [each.data.get("text/plain", "") for each in outputs if each.output_type == "execute_result"]
        texts.append("".join(parts))
    return texts


def _kept(output: Any) -> Any:
    data = output.get("data", {})
    if "image/png" in data:
        small = io.BytesIO()
        figure = Image.open(io.BytesIO(base64.b64decode(data["image/png"]))).convert("RGB")
        figure.quantize(_COLOURS).save(small, "png", optimize=True)
        data["image/png"] = base64.b64encode(small.getvalue()).decode()
    return output


def main() -> None:
    """Run each notebook that is named, or all."""
    for path in [Path(name) for name in sys.argv[1:]] or sorted(NOTEBOOKS.glob("*.ipynb")):
        with tempfile.TemporaryDirectory() as folder:
            notebook = executed(path, Path(folder))
        for cell in notebook.cells:
            if cell.cell_type == "code":
                shown = (
                    each
                    for each in cell.outputs
                    if each.get("name") != "stderr" and _WIDGET not in each.get("data", {})
                )
                cell.outputs = [_kept(each) for each in shown]
        notebook.metadata.pop("widgets", None)
        nbformat.write(notebook, path)
        print(path.name, path.stat().st_size // 1024, "kB")


if __name__ == "__main__":
    main()
