"""A tamper-evident log: each entry holds the SHA-256 of the one before.

An entry that is changed, left out or put in between breaks the chain from there on. Entries cut off at the end leave no
trace in the log itself, only a digest that was kept elsewhere shows it.
"""

import hashlib
import itertools
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, insert, select

from app.store import tables
from app.store.database import lock
from app.store.visibility import present

NO_DIGEST = "0" * 64  # in the first entry, which has none before it
_LOG = tables.audit_log
_LOCK = "roboprompt audit log"


@dataclass(frozen=True)
class AuditEntry:
    """An entry of the log."""

    number: int  # 1, 2, 3
    at: datetime
    actor: str  # `Visibility.actor`
    action: str  # e.g. `key.created`
    subject: str  # what it was done to: an id or a name
    details: str  # JSON, with what an entry of its action holds
    previous: str  # digest of the entry before
    digest: str  # of all the others

    def expected_digest(self) -> str:
        """Return the digest of the present content; another `digest` shows that the entry was changed."""
        values = {**asdict(self), "at": self.at.astimezone(UTC).isoformat(timespec="microseconds")}
        del values["digest"]
        return hashlib.sha256(json.dumps(values, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


class BrokenChainError(Exception):
    """The log is not what was written; `number` is that of the first entry that shows it."""

    def __init__(self, number: int, reason: str) -> None:
        super().__init__(f"entry {number}: {reason}")
        self.number = number


def record(connection: Connection, action: str, subject: str, details: Mapping[str, Any] | None = None) -> None:
    """Add an entry with details in JSON; call it last in the transaction, so that both are stored or neither."""
    lock(connection, _LOCK)
    last = connection.execute(select(_LOG.c.number, _LOG.c.digest).order_by(_LOG.c.number.desc()).limit(1)).first()
    text = json.dumps(details or {}, sort_keys=True, separators=(",", ":"))
    # As text even if it was changed to another type: the log goes on, and `verified` shows where it broke.
    number, previous = (1, NO_DIGEST) if last is None else (last.number + 1, str(last.digest))
    entry = AuditEntry(number, datetime.now(UTC), present().actor, action, subject, text, previous, "")
    values = {**asdict(entry), "digest": entry.expected_digest()}
    connection.execute(insert(_LOG).values(values))


def newest(connection: Connection) -> AuditEntry | None:
    """Return the last entry, or None."""
    row = connection.execute(select(_LOG).order_by(_LOG.c.number.desc()).limit(1)).first()
    return None if row is None else AuditEntry(**row._mapping)


def entries(connection: Connection) -> Iterator[AuditEntry]:
    """Every entry, oldest first."""
    query = select(_LOG).order_by(_LOG.c.number).execution_options(yield_per=1000)
    return (AuditEntry(**row._mapping) for row in connection.execute(query))


def verified(log: Iterable[AuditEntry]) -> Iterator[AuditEntry]:
    """The entries, each after it was compared with the one before; raises BrokenChainError at the first change."""
    previous = NO_DIGEST
    following = iter(log)
    for number in itertools.count(1):
        try:
            if (entry := next(following, None)) is None:
                return
            expected = entry.expected_digest()
        except (TypeError, ValueError, AttributeError) as error:  # e.g. bytes in the place of a text or a time
            raise BrokenChainError(number, "was changed: it holds values of other types") from error
        if entry.number != number:
            raise BrokenChainError(number, f"is missing: entry {entry.number} comes next")
        if entry.previous != previous:
            raise BrokenChainError(number, "does not follow the entry before it, which was changed or replaced")
        if expected != entry.digest:
            raise BrokenChainError(number, "was changed: its content does not match its digest")
        previous = entry.digest
        yield entry
