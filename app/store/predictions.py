"""Queries on predictions, and on cases, which are kept to be asked again. Each runs on the caller's transaction."""

from datetime import UTC, datetime
from typing import Any
from uuid import uuid4

from sqlalchemy import Connection, Row, delete, insert, select, update
from sqlalchemy.exc import IntegrityError

from app.store import tables
from app.store.database import lock
from app.store.errors import NotFoundError
from app.store.filters import PredictionFilter, fetch_page
from app.store.records import Page, PredictionDraft, PredictionRecord
from app.store.visibility import present

_PREDICTIONS, _CASES = tables.predictions, tables.cases
_INSERT = insert(_PREDICTIONS).returning(_PREDICTIONS.c.sequence)
EVERY = PredictionFilter()


def add(connection: Connection, draft: PredictionDraft) -> PredictionRecord:
    """Store a prediction, of the key whose request this is; raises NotFoundError if its task was deleted meanwhile."""
    values = {**vars(draft), "id": uuid4().hex, "created_at": datetime.now(UTC), "key_id": present().key_id or None}
    try:
        sequence = connection.execute(_INSERT, {**values, "cameras": draft.cameras or None}).scalar_one()
    except IntegrityError as error:
        raise NotFoundError("task", draft.task) from error
    return PredictionRecord(**values, sequence=sequence, outcome_success=None, outcome_note=None, outcome_at=None)


def get(connection: Connection, prediction_id: str) -> PredictionRecord:
    """The prediction; raises NotFoundError."""
    row = connection.execute(select(_PREDICTIONS).where(_PREDICTIONS.c.id == prediction_id)).first()
    if row is None or not present().has_prediction(row.task, row.key_id):
        raise NotFoundError("prediction", prediction_id)
    return _record(row)


def list_page(
    connection: Connection, chosen: PredictionFilter = EVERY, limit: int = 50, cursor: int | None = None
) -> Page[PredictionRecord]:
    """The visible predictions that fit, newest first."""
    return fetch_page(connection, _PREDICTIONS, chosen.narrow(select(_PREDICTIONS)), limit, cursor, _record)


def record_outcome(connection: Connection, prediction_id: str, success: bool, note: str | None) -> PredictionRecord:
    """Record an outcome; a later one replaces an earlier one. Raises NotFoundError, ForbiddenError."""
    present().require_own(get(connection, prediction_id).key_id)
    values = {"outcome_success": success, "outcome_note": note, "outcome_at": datetime.now(UTC)}
    connection.execute(update(_PREDICTIONS).where(_PREDICTIONS.c.id == prediction_id).values(values))
    return get(connection, prediction_id)


def keep_as_case(connection: Connection, prediction_id: str) -> None:
    """Make the prediction a case, also if it is one; it is not deleted for its age or size. Raises NotFoundError."""
    get(connection, prediction_id)
    lock(connection, f"case {prediction_id}")  # of two requests at once the second finds it
    if is_case(connection, prediction_id):
        return
    try:
        connection.execute(insert(_CASES).values(prediction_id=prediction_id, created_at=datetime.now(UTC)))
    except IntegrityError as error:  # it was deleted meanwhile
        raise NotFoundError("prediction", prediction_id) from error


def drop_case(connection: Connection, prediction_id: str) -> None:
    """Stop keeping the prediction as a case; the prediction stays. Raises NotFoundError."""
    get(connection, prediction_id)
    connection.execute(delete(_CASES).where(_CASES.c.prediction_id == prediction_id))


def is_case(connection: Connection, prediction_id: str) -> bool:
    """Whether the prediction is one."""
    return connection.scalar(select(_CASES.c.created_at).where(_CASES.c.prediction_id == prediction_id)) is not None


def _record(row: Row[Any]) -> PredictionRecord:
    return PredictionRecord(**{**row._mapping, "cameras": row.cameras or ()})
