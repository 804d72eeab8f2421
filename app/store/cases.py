"""Queries on cases: predictions that are kept to be asked again. Each runs on the caller's transaction."""

from datetime import UTC, datetime

from sqlalchemy import Connection, delete, insert, select

from app.store import predictions, tables

_CASES = tables.cases


def keep(connection: Connection, prediction_id: str) -> None:
    """Make the prediction a case, also if it is one; it is not deleted for its age or size. Raises NotFoundError."""
    predictions.get(connection, prediction_id)
    if not is_case(connection, prediction_id):
        connection.execute(insert(_CASES).values(prediction_id=prediction_id, created_at=datetime.now(UTC)))


def drop(connection: Connection, prediction_id: str) -> None:
    """Let the prediction be no case any more; it stays. Raises NotFoundError."""
    predictions.get(connection, prediction_id)
    connection.execute(delete(_CASES).where(_CASES.c.prediction_id == prediction_id))


def is_case(connection: Connection, prediction_id: str) -> bool:
    """Whether the prediction is one."""
    return connection.scalar(select(_CASES.c.created_at).where(_CASES.c.prediction_id == prediction_id)) is not None
