"""What the store can refuse; a branch of the tree in `app.pipeline.errors`."""

from collections.abc import Sequence

from roboprompt_client.errors import RoboPromptError


class StoreError(RoboPromptError):
    """The store cannot do what was asked.

    ├── NotFoundError          nothing of that kind and id is stored
    ├── ConflictError          the request contradicts what is stored
    ├── ForbiddenError         the key that asks may not see or do this
    │   └── ForbiddenTaskError the key is for other tasks
    ├── StoreUnavailableError  disk full, read-only, locked or unreachable: a later attempt may succeed
    ├── SchemaVersionError     the database was written by newer code
    └── CorruptDataError       a stored value is damaged or gone
    """


class NotFoundError(StoreError):
    """Nothing of that kind and id is stored.

    Args:
        kind: `task`, `episode` or `prediction`.
        id: the name or id that was asked for.
    """

    def __init__(self, kind: str, id: str) -> None:  # noqa: A002
        super().__init__(f"there is no {kind} {id!r}")
        self.kind = kind
        self.id = id


class ConflictError(StoreError):
    """The request contradicts what is stored; the message says what and how to go on."""


class ForbiddenError(StoreError):
    """The key that asks may not see or do this; the message says what would be needed."""


class ForbiddenTaskError(ForbiddenError):
    """The key that asks is for other tasks.

    Args:
        task: the one that was asked for.
        allowed: those that the key is for.
        field: of the request, where the task is named.
    """

    def __init__(self, task: str, allowed: Sequence[str], field: str = "task") -> None:
        super().__init__(f"the key is not for the task {task!r}, only for {', '.join(map(repr, allowed))}")
        self.task = task
        self.allowed = tuple(allowed)
        self.field = field

    def __reduce__(self) -> tuple[type["ForbiddenTaskError"], tuple[str, tuple[str, ...], str]]:
        """See `InvalidInputError`."""
        return type(self), (self.task, self.allowed, self.field)


class StoreUnavailableError(StoreError):
    """Database or disk does not answer as it should: full, read-only, locked, unreachable."""


class SchemaVersionError(StoreError):
    """The database was written by newer code than this."""


class CorruptDataError(StoreError):
    """A stored value is damaged or gone.

    Args:
        kind: `trajectory`, `blob` or `database`.
        id: which one.
        reason: what is wrong with it.
    """

    def __init__(self, kind: str, id: str, reason: str) -> None:  # noqa: A002
        super().__init__(f"stored {kind} {id} is damaged: {reason}; restore it from a backup")
        self.kind = kind
        self.id = id
        self.reason = reason

    def __reduce__(self) -> tuple[type["CorruptDataError"], tuple[str, str, str]]:
        """See `InvalidInputError`."""
        return type(self), (self.kind, self.id, self.reason)
