"""Pages of a growing list, newest first, by the last row's number, not by offset: rows that come never shift them."""

from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from sqlalchemy import Connection, Row, Select, Table

T = TypeVar("T")


@dataclass(frozen=True)
class Page(Generic[T]):
    """Some items, newest first, and the cursor of those that follow; None at the end."""

    items: tuple[T, ...]
    next_cursor: int | None


def fetch_page(
    connection: Connection, table: Table, query: Select[Any], limit: int, cursor: int | None
) -> tuple[list[Row[Any]], int | None]:
    """At most `limit` rows of `query` on `table` that are older than `cursor`, and the cursor for the rest.

    Args:
        query: selects `sequence` among others.
    """
    if cursor is not None:
        query = query.where(table.c.sequence < cursor)
    rows = list(connection.execute(query.order_by(table.c.sequence.desc()).limit(limit + 1)))
    more = len(rows) > limit
    return rows[:limit], rows[limit - 1].sequence if more else None
