"""How much a dataset may take: a small file can say that it unpacks to any size."""

from dataclasses import dataclass

from app.datasets.errors import DamagedError

MEGABYTE = 1_000_000
MAX_UNPACKED_BYTES = 500 * MEGABYTE
REMEDY = "--max-unpacked-mb allows more, if you trust where it comes from"


@dataclass(frozen=True)
class ReadLimits:
    """Bounds of what is read for one episode, and for the list of episodes.

    Attributes:
        unpacked_bytes: what its files hold when they are unpacked.
        seconds: until it is read.
    """

    unpacked_bytes: int = MAX_UNPACKED_BYTES
    seconds: float = 300.0

    @property
    def memory_bytes(self) -> int:
        """What the process that reads may take beside its code: what is unpacked, a copy of it, and room to work."""
        return 2 * self.unpacked_bytes + 500 * MEGABYTE


class Budget:
    """Counts unpacked bytes and refuses those that are too many.

    Args:
        where: the file, for messages.
    """

    def __init__(self, where: object, limits: ReadLimits) -> None:
        self._where = where
        self._limit_bytes = limits.unpacked_bytes
        self._taken_bytes = 0

    @property
    def left_bytes(self) -> int:
        """What may still be taken."""
        return self._limit_bytes - self._taken_bytes

    def take(self, num_bytes: int, where: object = None) -> None:
        """Count what is about to be unpacked, or was.

        Args:
            where: instead of the budget's own place.

        Raises:
            DamagedError: if it is more than what is left, or no size at all.
        """
        if num_bytes < 0:
            raise DamagedError(where or self._where, f"says that it holds {num_bytes} bytes")
        if num_bytes > self.left_bytes:
            limit = f"{self._limit_bytes / MEGABYTE:g} MB"
            raise DamagedError(where or self._where, f"unpacks to more than {limit}: {REMEDY}")
        self._taken_bytes += num_bytes
