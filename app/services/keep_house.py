"""What the operator does not want to be kept is deleted, and images that nothing refers to."""

import logging
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from app.store import audit, erasure
from app.store.store import Store

BATCH = 500  # predictions in a transaction: others want to write, too
logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Retention:
    """How long predictions are kept; None: for ever.

    Attributes:
        max_age: since they were made.
        max_bytes: of all of them with their images; the oldest go first.
    """

    max_age: timedelta | None = None
    max_bytes: int | None = None


@dataclass(frozen=True)
class KeepHouse:
    """Deletes what is to be kept no longer. Synchronous: call it in a thread."""

    store: Store
    retention: Retention

    def __call__(self) -> int:
        """Delete predictions beyond the limits, then sweep, unless another process has done so within the hour.

        Returns how many images were removed: those that were put within the hour stay.

        Raises:
            StoreError: if the store fails.
        """
        return self.store.sweep_once(self._forget)

    def _forget(self) -> None:
        forgotten = 0
        if (max_age := self.retention.max_age) is not None:
            while ids := self._older_than(datetime.now(UTC) - max_age):
                forgotten += self._erase(ids)
        if (max_bytes := self.retention.max_bytes) is not None:
            sizes = self.store.blobs.sizes()
            with self.store.read() as connection:
                beyond = erasure.predictions_beyond(connection, max_bytes, sizes)
            forgotten += sum(self._erase(beyond[at : at + BATCH]) for at in range(0, len(beyond), BATCH))
        if forgotten:
            logger.info("%d predictions were deleted, as the settings demand", forgotten)

    def _older_than(self, moment: datetime) -> tuple[str, ...]:
        with self.store.read() as connection:
            return erasure.predictions_before(connection, moment, BATCH)

    def _erase(self, ids: tuple[str, ...]) -> int:
        """Delete predictions, with their entry in the audit log; return how many."""
        with self.store.write() as connection:
            number = erasure.erase_predictions(connection, erasure.without_cases(connection, ids))
            if number:
                audit.record(connection, "predictions.expired", "", {"predictions": number}, actor="retention")
        return number
