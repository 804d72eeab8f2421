"""Errors of the store."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from roboprompt_client.errors import RoboPromptError

logger = logging.getLogger(__name__)


class StoreError(RoboPromptError):
    """The store cannot do what was asked.

    ├── NotFoundError          nothing of that kind and id is stored
    ├── ConflictError          the request contradicts what is stored
    ├── StoreUnavailableError  disk full, read-only, locked or unreachable: a later attempt may succeed
    ├── SchemaVersionError     the database was written by newer code
    └── CorruptDataError       a stored value is damaged or gone
    """


class NotFoundError(StoreError):
    """Nothing of that kind (`task`, `episode`, ...) and id is stored."""

    def __init__(self, kind: str, id: str) -> None:  # noqa: A002
        super().__init__(kind, id)  # all that pickling keeps

    def __str__(self) -> str:
        return "there is no {} {!r}".format(*self.args)


class ConflictError(StoreError):
    """The request contradicts what is stored; the message says what and how to go on."""


class StoreUnavailableError(StoreError):
    """Database or disk does not answer as it should: full, read-only, locked, unreachable.

    Clients read the text, so that it names no path and no address once the store is open; see `unavailable`.
    """


# What to do, by what the system's and the database's texts say.
_REMEDIES = {
    ("full", "no space left", "quota", "too large"): "free space on the service's disk, then send the request again",
    ("read-only", "readonly", "permission denied"): "make the service's data writable, then send the request again",
    ("locked", "lock timeout", "in use"): "send the request again",
    ("disk i/o error",): "see whether the service's disk is full, read-only or failing, then send the request again",
}


def unavailable(what: str, reason: str, detail: str) -> StoreUnavailableError:
    """The error to raise, with what can be done about it.

    Args:
        what: does not answer, e.g. ``"database"``.
        reason: without paths and addresses.
        detail: for the log.
    """
    logger.warning("%s: %s", what, detail)
    remedy = next((remedy for words, remedy in _REMEDIES.items() if any(word in reason.lower() for word in words)), "")
    return StoreUnavailableError(f"{what}: {reason}{remedy and f': {remedy}'}")


@contextmanager
def disk_errors(what: str) -> Iterator[None]:
    """Map errors of the operating system as `unavailable` does."""
    try:
        yield
    except OSError as error:
        raise unavailable(what, error.strerror or type(error).__name__, str(error)) from error


class SchemaVersionError(StoreError):
    """The database was written by newer code than this."""


class CorruptDataError(StoreError):
    """A stored value of a kind (`trajectory`, `blob`, `database`) and id is damaged or gone, for a reason."""

    def __init__(self, kind: str, id: str, reason: str) -> None:  # noqa: A002
        super().__init__(kind, id, reason)

    def __str__(self) -> str:
        return "stored {} {} is damaged: {}; restore it from a backup".format(*self.args)
