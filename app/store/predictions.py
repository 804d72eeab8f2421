"""Queries on predictions. Each runs on the caller's transaction."""

from datetime import UTC, datetime
from typing import Any
from uuid import uuid4

from sqlalchemy import Connection, Row, delete, insert, select, update
from sqlalchemy.exc import IntegrityError

from app.store import tables
from app.store.errors import NotFoundError
from app.store.filters import PredictionFilter, fetch_page
from app.store.records import Page, PredictionDraft, PredictionRecord

_PREDICTIONS = tables.predictions
_INSERT = insert(_PREDICTIONS).returning(_PREDICTIONS.c.sequence)
EVERY = PredictionFilter()


def add(connection: Connection, draft: PredictionDraft) -> PredictionRecord:
    """Store a prediction; raises NotFoundError if its task was deleted meanwhile."""
    values = {**vars(draft), "id": uuid4().hex, "created_at": datetime.now(UTC)}
    try:
        sequence = connection.execute(_INSERT, {**values, "cameras": draft.cameras or None}).scalar_one()
    except IntegrityError as error:
        raise NotFoundError("task", draft.task) from error
    return PredictionRecord(**values, sequence=sequence, outcome_success=None, outcome_note=None, outcome_at=None)


def get(connection: Connection, prediction_id: str) -> PredictionRecord:
    """The prediction; raises NotFoundError."""
    row = connection.execute(select(_PREDICTIONS).where(_PREDICTIONS.c.id == prediction_id)).first()
    if row is None:
        raise NotFoundError("prediction", prediction_id)
    return _record(row)


def list_page(
    connection: Connection, chosen: PredictionFilter = EVERY, limit: int = 50, cursor: int | None = None
) -> Page[PredictionRecord]:
    """The predictions that fit, newest first."""
    return fetch_page(connection, _PREDICTIONS, chosen.narrow(select(_PREDICTIONS)), limit, cursor, _record)


def record_outcome(connection: Connection, prediction_id: str, success: bool, note: str | None) -> PredictionRecord:
    """Record an outcome; a later one replaces an earlier one. Raises NotFoundError."""
    values = {"outcome_success": success, "outcome_note": note, "outcome_at": datetime.now(UTC)}
    connection.execute(update(_PREDICTIONS).where(_PREDICTIONS.c.id == prediction_id).values(values))
    return get(connection, prediction_id)


def remove(connection: Connection, prediction_id: str) -> None:
    """Delete a prediction with its outcome; an episode that carried it out keeps its id. Raises NotFoundError."""
    if connection.execute(delete(_PREDICTIONS).where(_PREDICTIONS.c.id == prediction_id)).rowcount == 0:
        raise NotFoundError("prediction", prediction_id)


def _record(row: Row[Any]) -> PredictionRecord:
    return PredictionRecord(**{**row._mapping, "cameras": row.cameras or ()})
