"""Deletion of predictions and tasks with all that refers to them, and of predictions beyond the operator's limits.

Each query runs on the caller's transaction; `keep_house` has its own. Images stay until no other row refers to them
either, see `Store.sweep`. What an episode carried out may be a prediction that is gone: it keeps the id.
"""

import logging
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection, Select, Text, cast, delete, func, select

from app.store import tables
from app.store.blobs import digests_in
from app.store.errors import NotFoundError
from app.store.store import Store

_TASKS, _EPISODES, _PREDICTIONS, _LABELS = tables.tasks, tables.episodes, tables.predictions, tables.labels
BATCH = 500  # predictions in a transaction: others want to write, too
logger = logging.getLogger(__name__)
_TEXTS = ("request", "prompt_system", "prompt_user", "reply_text", "actions", "objects")


def erase_prediction(connection: Connection, prediction_id: str) -> None:
    """Delete a prediction with its outcome; raises NotFoundError."""
    if not erase_predictions(connection, [prediction_id]):
        raise NotFoundError("prediction", prediction_id)


def erase_predictions(connection: Connection, ids: Sequence[str] | Select[tuple[str]]) -> int:
    """As `erase_prediction`, those that are there; returns how many."""
    return connection.execute(delete(_PREDICTIONS).where(_PREDICTIONS.c.id.in_(ids))).rowcount


def erase_task(connection: Connection, name: str) -> None:
    """Delete a task with its episodes, predictions and labels; raises NotFoundError."""
    # A request that adds an episode or a prediction waits, and then finds no task.
    if connection.execute(select(_TASKS.c.name).where(_TASKS.c.name == name).with_for_update()).first() is None:
        raise NotFoundError("task", name)
    """Delete a task with its episodes, predictions and labels; raises NotFoundError."""
    # A request that adds an episode or a prediction waits, and then finds no task.
    if connection.execute(select(_TASKS.c.name).where(_TASKS.c.name == name).with_for_update()).first() is None:
        raise NotFoundError("task", name)
    predictions = select(_PREDICTIONS.c.id).where(_PREDICTIONS.c.task == name)
    erase_predictions(connection, predictions)
    for table in (_EPISODES, _LABELS):
        connection.execute(delete(table).where(table.c.task == name))
    connection.execute(delete(_TASKS).where(_TASKS.c.name == name))


def predictions_before(connection: Connection, moment: datetime, limit: int) -> tuple[str, ...]:
    """The ids of at most `limit` predictions that were made before, oldest first."""
    query = select(_PREDICTIONS.c.id).where(_PREDICTIONS.c.created_at < moment)
    return tuple(connection.scalars(query.order_by(_PREDICTIONS.c.sequence).limit(limit)))


def predictions_beyond(connection: Connection, max_bytes: int, blob_bytes: Mapping[str, int]) -> tuple[str, ...]:
    """The ids of the oldest predictions, without which the others have at most `max_bytes`, oldest first.

    Counted are their texts and their images, an image once and one that an episode has, too, not at all.

    Args:
        blob_bytes: the sizes of images by digest.
    """
    counted = set(digests_in(connection.scalars(select(cast(_EPISODES.c.cameras, Text)))))
    lengths = (func.coalesce(func.length(cast(_PREDICTIONS.c[name], Text)), 0) for name in _TEXTS)
    columns = (_PREDICTIONS.c.id, cast(_PREDICTIONS.c.cameras, Text), *lengths)
    query = select(*columns).order_by(_PREDICTIONS.c.sequence.desc()).execution_options(yield_per=1000)
    total, beyond = 0, []
    for id_, cameras, *texts in connection.execute(query):
        images = set(digests_in([cameras or ""])) - counted
        counted |= images
        total += sum(texts) + sum(blob_bytes.get(digest, 0) for digest in images)
        if total > max_bytes:
            beyond.append(id_)
    return tuple(reversed(beyond))


def keep_house(store: Store, max_age: timedelta | None = None, max_bytes: int | None = None) -> int:
    """Delete predictions beyond the limits, then sweep, unless another process has done so within the hour.

    Args:
        max_age: of a prediction; None: any.
        max_bytes: of all predictions with their images; the oldest go first. None: any number.

    Returns:
        How many images were removed: those that were put within the hour stay.
    """

    def forget() -> None:
        forgotten = 0
        if max_age is not None:
            while ids := _older_than(store, datetime.now(UTC) - max_age):
                forgotten += _erase(store, ids)
        if max_bytes is not None:
            sizes = store.blobs.sizes()
            with store.read() as connection:
                beyond = predictions_beyond(connection, max_bytes, sizes)
            forgotten += sum(_erase(store, beyond[at : at + BATCH]) for at in range(0, len(beyond), BATCH))
        if forgotten:
            logger.info("%d predictions were deleted, as the settings demand", forgotten)

    return store.sweep_once(forget)


def _older_than(store: Store, moment: datetime) -> tuple[str, ...]:
    with store.read() as connection:
        return predictions_before(connection, moment, BATCH)


def _erase(store: Store, ids: tuple[str, ...]) -> int:
    """Delete predictions; return how many."""
    with store.write() as connection:
        return erase_predictions(connection, ids)
