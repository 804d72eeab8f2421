"""Deletes predictions beyond the operator's limits, and images that nothing refers to."""

import logging
from datetime import UTC, datetime, timedelta

from app.store import audit, erasure
from app.store.store import Store

BATCH = 500  # predictions in a transaction: others want to write, too
logger = logging.getLogger(__name__)


def keep_house(store: Store, max_age: timedelta | None = None, max_bytes: int | None = None) -> int:
    """Delete predictions beyond the limits, then sweep, unless another process has done so within the hour.

    Synchronous: call it in a thread.

    Args:
        max_age: of a prediction; None: any.
        max_bytes: of all predictions with their images; the oldest go first. None: any number.

    Returns:
        How many images were removed: those that were put within the hour stay.

    Raises:
        StoreError: if the store fails.
    """

    def forget() -> None:
        forgotten = 0
        if max_age is not None:
            while ids := _older_than(store, datetime.now(UTC) - max_age):
                forgotten += _erase(store, ids)
        if max_bytes is not None:
            sizes = store.blobs.sizes()
            with store.read() as connection:
                beyond = erasure.predictions_beyond(connection, max_bytes, sizes)
            forgotten += sum(_erase(store, beyond[at : at + BATCH]) for at in range(0, len(beyond), BATCH))
        if forgotten:
            logger.info("%d predictions were deleted, as the settings demand", forgotten)

    return store.sweep_once(forget)


def _older_than(store: Store, moment: datetime) -> tuple[str, ...]:
    with store.read() as connection:
        return erasure.predictions_before(connection, moment, BATCH)


def _erase(store: Store, ids: tuple[str, ...]) -> int:
    """Delete predictions, with their entry in the audit log; return how many."""
    with store.write() as connection:
        number = erasure.erase_predictions(connection, erasure.without_cases(connection, ids))
        if number:
            audit.record(connection, "predictions.expired", "", {"predictions": number}, actor="retention")
    return number
