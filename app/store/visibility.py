"""Who asks, and what they may see. `app.api.access` sets it and the queries apply it, so that no route can omit it."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Select

from app.store import tables
from app.store.errors import ForbiddenError, ForbiddenTaskError

NO_KEY = ""  # in the place of a key's id: the command line, or a service that requires no keys
_PREDICTIONS = tables.predictions


@dataclass(frozen=True)
class Visibility:
    """The rows that one key may see; without arguments all."""

    key_id: str = NO_KEY  # whose request it is
    tasks: tuple[str, ...] | None = None  # the only tasks that the key is for; None: any
    reads: bool = True  # whether predictions that others asked for, and demonstrations, which prompts hold, are seen
    judges_others: bool = True  # whether the outcome of others' predictions may be recorded
    actor: str = "local"  # who asks, as the audit log has it; without a key the command line, or a service without keys

    def has_task(self, name: str) -> bool:
        return self.tasks is None or name in self.tasks

    def require_task(self, name: str) -> None:
        """Refuse a task that the key is not for, whether or not there is one; raises ForbiddenTaskError."""
        if self.tasks is not None and name not in self.tasks:
            raise ForbiddenTaskError(name, self.tasks)

    def has_prediction(self, task: str, key_id: str | None) -> bool:
        return self.has_task(task) and (self.reads or key_id == self.key_id)

    def require_own(self, key_id: str | None) -> None:
        """Refuse to record the outcome of what another key asked for; raises ForbiddenError."""
        if not self.judges_others and key_id != self.key_id:
            raise ForbiddenError("another key asked for this prediction: that key records its outcome, or an admin key")

    def require_demonstrations(self) -> None:
        """Refuse to show demonstrations to a key that may not read them; raises ForbiddenError."""
        if not self.reads:
            raise ForbiddenError("a dry run shows the demonstrations: this needs a key with the scope read, too")


_EVERYTHING = Visibility()
_present: ContextVar[Visibility] = ContextVar("visibility", default=_EVERYTHING)


def present() -> Visibility:
    """Return the visibility of the present request."""
    return _present.get()


@contextmanager
def seeing(visibility: Visibility) -> Iterator[None]:
    """Restrict the queries inside the block to this visibility, and log them as its actor's."""
    token = _present.set(visibility)
    try:
        yield
    finally:
        _present.reset(token)


def of_visible_tasks(query: Select[Any], task: ColumnElement[Any], name: str | None = None) -> Select[Any]:
    """Return `query` narrowed to a task, or to all visible tasks; raise ForbiddenTaskError."""
    if name is not None:
        present().require_task(name)
        return query.where(task == name)
    tasks = present().tasks
    return query if tasks is None else query.where(task.in_(tasks))


def of_visible_predictions(query: Select[Any], task: str | None = None) -> Select[Any]:
    """Return `query` narrowed to the visible predictions of a task or of all; raise ForbiddenTaskError."""
    query = of_visible_tasks(query, _PREDICTIONS.c.task, task)
    visibility = present()
    return query if visibility.reads else query.where(_PREDICTIONS.c.key_id == visibility.key_id)
