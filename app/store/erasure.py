"""Deletion of predictions and tasks with all that refers to them, and of predictions beyond the operator's age.

Each query runs on the caller's transaction; `keep_house` has its own. Images stay until no other row refers to them
either, see `Store.sweep`. What an episode carried out may be a prediction that is gone: it keeps the id.
"""

import logging
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection, delete, select

from app.store import tables
from app.store.errors import NotFoundError
from app.store.store import Store

_TASKS, _EPISODES, _PREDICTIONS, _LABELS = tables.tasks, tables.episodes, tables.predictions, tables.labels
BATCH = 500  # predictions in a transaction: others want to write, too
logger = logging.getLogger(__name__)


def erase_prediction(connection: Connection, prediction_id: str) -> None:
    """Delete a prediction with its outcome; raises NotFoundError."""
    if not connection.execute(delete(_PREDICTIONS).where(_PREDICTIONS.c.id == prediction_id)).rowcount:
        raise NotFoundError("prediction", prediction_id)


def erase_task(connection: Connection, name: str) -> None:
    """Delete a task with its episodes, predictions and labels; raises NotFoundError."""
    # A request that adds an episode or a prediction waits, and then finds no task.
    if connection.execute(select(_TASKS.c.name).where(_TASKS.c.name == name).with_for_update()).first() is None:
        raise NotFoundError("task", name)
    for table in (_PREDICTIONS, _EPISODES, _LABELS):
        connection.execute(delete(table).where(table.c.task == name))
    connection.execute(delete(_TASKS).where(_TASKS.c.name == name))


def keep_house(store: Store, max_age: timedelta | None = None) -> int:
    """Delete predictions beyond the age, then sweep, unless another process has done so within the hour.

    Args:
        max_age: of a prediction; None: any.

    Returns:
        How many images were removed: those that were put within the hour stay.
    """
    return store.sweep_once(lambda: None if max_age is None else _erase_before(store, datetime.now(UTC) - max_age))


def _erase_before(store: Store, moment: datetime) -> None:
    """Delete the predictions that were made before."""
    oldest = select(_PREDICTIONS.c.id).where(_PREDICTIONS.c.created_at < moment).limit(BATCH)
    erased, last = 0, -1
    while last:
        with store.write() as connection:
            ids = tuple(connection.scalars(oldest))
            last = connection.execute(delete(_PREDICTIONS).where(_PREDICTIONS.c.id.in_(ids))).rowcount
        erased += last
    if erased:
        logger.info("%d predictions were deleted for their age", erased)
