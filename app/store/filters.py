"""Filters of episodes and predictions, the same for the API's lists and those of the pages; pages of lists."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any, Literal, get_args

from sqlalchemy import ColumnElement, Connection, Row, Select, Table, Text, and_, cast, func, or_

from app.store import tables
from app.store.records import Fate, Page, T

FATES: tuple[Fate, ...] = get_args(Fate)  # the order of a list with failures first

_E, _P = tables.episodes, tables.predictions
_NO_OUTCOME = _P.c.outcome_success.is_(None)
OF_FATE: dict[Fate, ColumnElement[bool]] = {
    "failure": _P.c.outcome_success.is_(False),
    "refused": and_(_NO_OUTCOME, _P.c.status != "ok"),
    "unknown": and_(_NO_OUTCOME, _P.c.status == "ok"),
    "success": _P.c.outcome_success.is_(True),
}
Outcome = Literal["success", "failure", "unknown"]
_OUTCOMES: dict[Outcome, bool | None] = {"success": True, "failure": False, "unknown": None}
num_demonstrations = func.json_array_length(_P.c.demonstration_ids)
_duration_s = (_E.c.num_frames - 1) / _E.c.control_frequency_hz


@dataclass(frozen=True, kw_only=True)
class Filter:
    """What episodes and predictions are filtered by; a field that is None filters nothing.

    Attributes:
        created_from, created_to: the earliest and the latest moment.
    """

    task: str | None = None
    created_from: datetime | None = None
    created_to: datetime | None = None

    @property
    def is_set(self) -> bool:
        """Whether anything but the task is filtered by."""
        return any(getattr(self, item.name) not in (None, ()) for item in fields(self) if item.name != "task")

    def _common(self, table: Table) -> list[ColumnElement[bool]]:
        conditions = [] if self.task is None else [table.c.task == self.task]
        if self.created_from is not None:
            conditions.append(table.c.created_at >= self.created_from)
        if self.created_to is not None:
            conditions.append(table.c.created_at <= self.created_to)
        return conditions


@dataclass(frozen=True, kw_only=True)
class EpisodeFilter(Filter):
    """A filter of episodes.

    Attributes:
        containing: text of the instruction or the note, in any case.
        left_out: only those that are left out of prompts, or are not.
        upload_key: the `Idempotency-Key` of the upload.
        min_duration_s, max_duration_s: of the recording.
    """

    containing: str | None = None
    left_out: bool | None = None
    upload_key: str | None = None
    min_duration_s: float | None = None
    max_duration_s: float | None = None

    def narrow(self, query: Select[Any]) -> Select[Any]:
        """`query` on episodes, of those that fit."""
        conditions = self._common(_E)
        if self.containing:
            texts = (_E.c.instruction, _E.c.note)
            conditions.append(or_(*(text.icontains(self.containing, autoescape=True) for text in texts)))
        if self.left_out is not None:
            conditions.append(_E.c.left_out.is_(self.left_out))
        if self.upload_key is not None:
            conditions.append(_E.c.upload_key == self.upload_key)
        if self.min_duration_s is not None:
            conditions.append(_duration_s >= self.min_duration_s)
        if self.max_duration_s is not None:
            conditions.append(_duration_s <= self.max_duration_s)
        return query.where(*conditions)


@dataclass(frozen=True, kw_only=True)
class PredictionFilter(Filter):
    """A filter of predictions.

    Attributes:
        outcome: what was reported; `unknown`: nothing.
        fate: the same, where predictions without actions and without a report are `refused`.
        finding: code of a finding.
    """

    model: str | None = None
    representation: str | None = None
    prompt_format: str | None = None
    num_demonstrations: int | None = None
    outcome: Outcome | None = None
    fate: Fate | None = None
    finding: str | None = None

    def narrow(self, query: Select[Any]) -> Select[Any]:
        """`query` on predictions, of those that fit."""
        conditions = self._common(_P)
        for name in ("model", "representation", "prompt_format"):
            if (value := getattr(self, name)) is not None:
                conditions.append(_P.c[name] == value)
        if self.num_demonstrations is not None:
            conditions.append(num_demonstrations == self.num_demonstrations)
        if self.outcome is not None:
            conditions.append(_P.c.outcome_success.is_(_OUTCOMES[self.outcome]))
        if self.fate is not None:
            conditions.append(OF_FATE[self.fate])
        if self.finding is not None:
            conditions.append(cast(_P.c.findings, Text).contains(f'"code":"{self.finding}"', autoescape=True))
        return query.where(*conditions)


def fetch_page(
    connection: Connection,
    table: Table,
    query: Select[Any],
    limit: int,
    cursor: int | None,
    record_of: Callable[[Row[Any]], T],
) -> Page[T]:
    """At most `limit` rows of `query`, newest first, that are older than `cursor`.

    By the last row's number and not by offset: rows that come do not shift a page.

    Args:
        query: selects `sequence` of `table` among others.
    """
    if cursor is not None:
        query = query.where(table.c.sequence < cursor)
    rows = list(connection.execute(query.order_by(table.c.sequence.desc()).limit(limit + 1)))
    return Page(tuple(map(record_of, rows[:limit])), rows[limit - 1].sequence if len(rows) > limit else None)
