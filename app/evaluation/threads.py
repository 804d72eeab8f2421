"""Work side by side that waits for other processes."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from typing import TypeVar

Item = TypeVar("Item")


def in_threads(
    work: Callable[[Item], None], items: Sequence[Item], threads: int, on_done: Callable[[Future[None]], None]
) -> None:
    """Work on the items, in their order; stopped by Ctrl-C or an error of `on_done`, what is under way still ends."""
    with ThreadPoolExecutor(threads) as pool:
        try:
            for future in as_completed([pool.submit(work, item) for item in items]):
                on_done(future)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
