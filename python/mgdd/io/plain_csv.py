"""The one writer of plain CSV, which any reader takes without options: a header, then rows in full precision."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mgdd.io.whole_file import write_whole_text

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike

__all__ = ["write_columns"]


def write_columns(columns: Mapping[str, ArrayLike], path: str | os.PathLike[str]) -> None:
    r"""Write columns of one length; numbers come back bit for bit, texts stand as they are.

    Parameters
    ----------
    columns : mapping of str to array_like
        By name, which says the unit by its ending; a text holds no comma, quote or line break.
    path : path-like
        The file; an existing one is replaced.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io.plain_csv import write_columns
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "map.csv"
    ...     write_columns({"fuel_mg": [6.0, 20.0], "source": ["idle", "model"]}, file)
    ...     file.read_text()
    'fuel_mg,source\n6.0,idle\n20.0,model\n'
    """
    cells = [
        column.tolist() if column.dtype.kind == "U" else [repr(value) for value in column.astype(np.float64).tolist()]
        for column in map(np.asarray, columns.values())
    ]
    rows = [",".join(columns), *(",".join(row) for row in zip(*cells, strict=True))]
    write_whole_text(path, "\n".join(rows) + "\n")
