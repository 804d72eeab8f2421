"""A progress bar with the time left, for commands that handle one thing after another."""

from collections.abc import Iterable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

T = TypeVar("T")
PACE_S = 60.0  # the time left follows from the pace of the last minute


def counted(items: Iterable[T], total: int, doing: str, console: Console) -> Iterator[T]:
    """The items, while a bar counts them."""
    columns = (TextColumn(doing), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, speed_estimate_period=PACE_S) as progress:
        bar = progress.add_task(doing, total=total)
        for item in items:
            yield item
            progress.advance(bar)
