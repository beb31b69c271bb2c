"""What a person sees: results on stdout, progress and one-line errors on stderr."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

WIDTH = 160  # characters of a table that goes into a file


class _Plain(Console):
    """Prints texts as they are: a name out of a stranger's file is no markup, and moves no cursor."""

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(visible(text), **{**options, "markup": False, "emoji": False})


def visible(text: str) -> str:
    """Return a text with what a terminal would obey, or show as nothing, written out."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() or each in "\n\t" else repr(each)[1:-1] for each in text)


def styled(text: str, style: str) -> Text:
    """Return a text to be printed in a style, "bold" for instance."""
    return Text(visible(text), style)


def output() -> Console:
    """Return the console of results; plain text where stdout is no terminal."""
    return _Plain(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else WIDTH)


def say(text: str | Text) -> None:
    """Print a line about what is being done, on stderr."""
    _Plain(stderr=True, highlight=False, soft_wrap=True).print(text)


@contextmanager
def progress(what: str, total: float | None = None) -> Iterator[Advance]:
    """Show a bar on stderr while the block runs; yield what moves it."""
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=30), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty()) as bar:
        yield Advance(bar, bar.add_task(what, total=total))


class Advance:
    """Moves one bar: call it with how much is done of the total, in the total's unit."""

    def __init__(self, bar: Progress, task: int) -> None:
        self._bar, self._task = bar, task

    def __call__(self, done: float, what: str | None = None) -> None:
        """Set how much is done and, if given, what is being done now."""
        if what is None:
            self._bar.update(self._task, completed=done)  # type: ignore[arg-type]
        else:
            self._bar.update(self._task, completed=done, description=what)  # type: ignore[arg-type]


def table(
    title: str, columns: tuple[str, ...], rows: Sequence[tuple[str | Text, ...]], right: tuple[int, ...] = ()
) -> Table:
    """Return a rich table; `right` are the numbers of the columns set flush right."""
    made = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False, padding=(0, 2))
    for index, name in enumerate(columns):
        made.add_column(name, justify="right" if index in right else "left", style="bold" if index == 0 else "")
    for row in rows:
        made.add_row(*row)
    return made
