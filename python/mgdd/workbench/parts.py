"""What views are made of: text as HTML that is escaped, tables, badges, fields of a form, and a job with its bar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from mgdd.errors import DataError, Error
from mgdd.io.extras import import_extra
from mgdd.workbench.calls import Script
from mgdd.workbench.jobs import Job

if TYPE_CHECKING:
    from mgdd.workbench.session import Session

_TICK_MS = 60
_STYLE = """
:host { font: 14px/1.5 system-ui, sans-serif; color: var(--panel-on-background-color); }
h2 { font-size: 17px; margin: 0 0 4px; } p { margin: 2px 0; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 4px 10px 4px 0; text-align: left; border-bottom: 1px solid var(--panel-border-color);
  vertical-align: top; } td.n, th.n { text-align: right; white-space: nowrap; } th { font-weight: 600; }
.badge { display: inline-block; padding: 0 8px; border-radius: 10px; color: white; white-space: nowrap;
  font-size: 13px; }
.good { background: #2e7d32; } .open { background: #5f6b7a; } .doubt { background: #b25e00; }
.fail { background: #c62828; } .quiet { opacity: .75; } .bad { color: #d32f2f; font-weight: 600; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; background: var(--panel-surface-color); padding: 8px;
  margin: 4px 0; border-radius: 4px; font-size: 12.5px; }
.check { padding: 6px 0; border-bottom: 1px solid var(--panel-border-color); }
@media (max-width: 600px) { th { display: none; } tr { display: block; padding: 4px 0; } td, td.n { display: flex;
  justify-content: space-between; gap: 12px; border: 0; padding: 1px 0; text-align: right; white-space: normal; }
  td::before { content: attr(title); opacity: .75; text-align: left; }
  tr { border-bottom: 1px solid var(--panel-border-color); } }
.check b { display: inline-block; min-width: 9em; margin-right: 6px; }
"""
_BADGES = {"no fault found": "good", "open": "open", "doubt": "doubt", "fail": "fail"}


def panel() -> Any:
    """Import Panel."""
    return import_extra("panel", "workbench", "the workbench")


def page(html: str = "", **options: Any) -> Any:
    """Make a piece of HTML; whoever gives it has escaped what is not ours."""
    return panel().pane.HTML(html, stylesheets=[_STYLE], sizing_mode="stretch_width", margin=(4, 8), **options)


def side(*items: Any) -> Any:
    """Set items side by side, as many as fit."""
    return panel().FlexBox(*items, gap="0 4px", align_items="end", sizing_mode="stretch_width")


def column(*items: Any) -> Any:
    """Set items below each other."""
    return panel().Column(*items, sizing_mode="stretch_width")


def card(title: str, *items: Any, collapsed: bool = True) -> Any:
    """Set items below a title that opens and closes them."""
    return panel().Card(*items, title=title, collapsed=collapsed, sizing_mode="stretch_width", margin=(6, 8))


def button(name: str, does: Callable[[], object], *, first: bool = False) -> Any:
    """Make a button; the first of a page is the one that is meant."""
    colour = "primary" if first else "default"
    made = panel().widgets.Button(label=name, color=colour, min_width=110, align="end")
    made.on_click(lambda _: does())
    return made


def save(name: str, content: bytes) -> Any:
    """Make the button that saves what was made."""
    return panel().widgets.FileDownload(
        file=BytesIO(content), filename=name, label=f"Save {name}", color="success", width=190, align="end"
    )


def pre(lines: str) -> str:
    """Write lines as they stand."""
    return f"<pre>{escape(lines)}</pre>"


def text(line: str, kind: str = "") -> str:
    """Write a line of text as HTML."""
    return f"<p class='{kind}'>{escape(line)}</p>"


def badge(verdict: str) -> str:
    """Write a verdict on its colour."""
    return f"<span class='badge {_BADGES.get(verdict, 'open')}'>{escape(verdict)}</span>"


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """Write a table; cells are HTML, heads are text."""
    heads = [escape(each) for each in columns]

    def cell(tag: str, place: int, content: str) -> str:
        title = f" title='{heads[place]}'" if tag == "td" else ""
        return f"<{tag}{' class=n' if place in numbers else ''}{title}>{content}</{tag}>"

    head = "".join(cell("th", place, each) for place, each in enumerate(heads))
    body = "".join(f"<tr>{''.join(cell('td', k, each) for k, each in enumerate(row))}</tr>" for row in rows)
    return f"<div class=wide><table><tr>{head}</tr>{body}</table></div>"


def number(value: Any, form: str = ".4g") -> str:
    """Write a number; a dash for none."""
    return "–" if value is None or value != value else format(float(value), form)


class SameAs:
    """The command and the Python that do what the view did."""

    def __init__(self) -> None:
        self._page = page()
        self.script: Script | None = None
        self.layout = card("The same as a command and in Python", self._page)

    def show(self, script: Script) -> None:
        """Show a script."""
        self.script = script
        self._page.object = pre(script.shell) + pre(script.python)


class View:
    """What every page has: the session, its piece of work, and the command and Python that do the same."""

    title = ""

    def __init__(self, session: Session, *, stops: bool = False) -> None:
        self.session, self.same = session, SameAs()
        self.work = Work(stops=stops, hidden=f"{session.folder}/")

    def run(self, what: str, function: Callable[..., Any], script: Script, *given: Any, **how: Any) -> None:
        """Show a script, and begin it; `how` as `Work.begin`."""
        self.same.show(script)
        self.work.begin(what, function, script, *given, **how)

    def close(self) -> None:
        """End what runs."""
        self.work.end()

    def take(self, name: str, content: bytes) -> Path | None:
        """Take a file that is not one of pressure; None, and a sentence, where it cannot be."""
        try:
            path = self.session.take(name, content).path
        except DataError as error:
            self.work.say(str(error), "bad")
            return None
        self.session.files.pop(path.name)
        return path


class Work:
    """One piece of work at a time, with its bar, a button that ends it, and the sentence where it fails.

    What ends by itself with what is finished `stops`; what is `hidden` is left out of sentences, as a folder is.
    """

    def __init__(self, *, stops: bool = False, hidden: str = "\0") -> None:
        widgets = panel().widgets
        self._bar = widgets.Progress(active=True, value=-1, sizing_mode="stretch_width", height=8, visible=False)
        self._said = page()
        self._button = button("Stop" if stops else "Cancel", self.leave)
        self._button.visible = False
        self._hidden, self._stops, self._job, self._ticks = hidden, stops, cast("Job | None", None), cast("Any", None)
        self.layout = column(panel().Row(self._button, self._bar, sizing_mode="stretch_width"), self._said)

    @property
    def busy(self) -> bool:
        """Whether something runs."""
        return self._job is not None

    def say(self, line: str, kind: str = "") -> None:
        """Show a sentence."""
        self._said.object = text(line.replace(self._hidden, ""), kind) if line else ""

    def begin(
        self,
        what: str,
        function: Callable[..., Any],
        *given: Any,
        done: Callable[[Any], None],
        told: Callable[[list[Any]], None] | None = None,
        failed: Callable[[str], None] | None = None,
        seconds: float = float("inf"),
    ) -> None:
        """Begin; what ran before is ended."""
        self.end("another one was begun")
        self.say(what)
        self._bar.visible = self._button.visible = True
        self._job = Job(function, given, seconds=seconds)
        self._what, self._done, self._told, self._failed = what, done, told, failed
        self._ticks = panel().state.add_periodic_callback(self.look, _TICK_MS, start=panel().state.curdoc is not None)

    def look(self) -> None:
        """Take what the work has reported, and its end."""
        job = self._job
        if job is None:
            return
        told = job.look()
        if told and self._told is None:
            self.say(f"{self._what}: {told[-1]}")
        elif told and self._told is not None:
            self._told(told)
        if job.over:
            self._leave()
            self.say(job.error, "bad" if job.error else "")
            if job.error and self._failed is not None:
                self._failed(job.error.replace(self._hidden, ""))
            elif not job.error:
                self.say("stopped: what is finished is shown" if job.interrupted else "")
                self._shown(job.result)

    def _shown(self, result: Any) -> None:
        try:
            self._done(result)
        except Error as error:
            self.say(str(error), "bad")

    def leave(self) -> None:
        """Stop with what is finished where the work can, else end it."""
        if self._job is not None and self._stops:
            self._job.stop()
        else:
            self.end("cancelled")

    def end(self, why: str = "the window was closed") -> None:
        """End what runs."""
        if self._job is not None:
            self._job.end(why)
            self.look()

    def _leave(self) -> None:
        self._job = None
        self._bar.visible = self._button.visible = False
        if self._ticks is not None and self._ticks.running:
            self._ticks.stop()
