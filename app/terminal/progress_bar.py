"""A bar for what takes long: nothing is shown of what is refused before it begins."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn


@contextmanager
def progress_bar(what: str, amount: str, *, stays: bool = True) -> Iterator[Callable[[float, float], None]]:
    """Show on the standard error how far something is, from the first time that it is told.

    Args:
        what: is done, for people.
        amount: in rich's words, such as ``{task.completed:.0f} s``.
        stays: the bar, once all is done.

    Yields:
        To be told how much is done, and how much there is.
    """
    columns = TextColumn("{task.description}"), BarColumn(), TextColumn(amount), TimeRemainingColumn()
    progress = Progress(*columns, console=Console(stderr=True), transient=not stays)
    task = progress.add_task(what, total=None)

    def tell(done: float, whole: float) -> None:
        progress.update(task, completed=done, total=whole)
        progress.start()  # once is enough

    try:
        yield tell
    finally:
        if progress.live.is_started:
            progress.stop()
