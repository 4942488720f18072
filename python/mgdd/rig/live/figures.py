"""What figures in a browser have in common, on the live page and on the workbench."""

from __future__ import annotations

from typing import Any

# Distinct to the colour-blind, too, on white and on black.
COLOURS = ("#1f83c9", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
_LONGEST = 34  # letters of a label


def plain(text: str) -> str:
    """Cut what stands on a canvas, and keep it from being taken for mathematics, as Bokeh does between dollars."""
    short = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
    return short.replace("$$", "$ $").replace("\\[", "\\ [").replace("\\(", "\\ (")


def with_legend(figure: Any, columns: int = 3) -> Any:
    """Put the legend above the axes, where it hides nothing; a click on an entry hides its line."""
    if figure.legend:
        legend = figure.legend[0]
        legend.update(
            orientation="horizontal", ncols=columns, click_policy="hide", label_text_font_size="12px", padding=2,
            margin=0, spacing=8, border_line_color=None, background_fill_alpha=0.0,
        )  # fmt: skip
        figure.add_layout(legend, "above")
    return figure
