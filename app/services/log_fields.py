"""What a request is about, for the lines that are logged while it is answered."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_fields: ContextVar[dict[str, str] | None] = ContextVar("log_fields", default=None)


@contextmanager
def request_fields(request_id: str) -> Iterator[dict[str, str]]:
    """Fields of one request, also in the threads that it uses."""
    token = _fields.set(fields := {"request_id": request_id})
    try:
        yield fields
    finally:
        _fields.reset(token)


def note(**fields: str) -> None:
    """Add fields to the request that is answered here, if any: `note(task="open_drawer")`."""
    if (current := _fields.get()) is not None:
        current.update(fields)


def current_fields() -> dict[str, str]:
    """Those of the request that is answered here."""
    return _fields.get() or {}
