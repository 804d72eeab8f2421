"""What was changed in a task's settings, and what would undo it."""

from itertools import pairwise
from typing import Any, NamedTuple

from sqlalchemy import Connection

from app.services.task_settings import TaskSettings
from app.store import replaced_settings, tasks
from app.store.replaced_settings import ReplacedSettings, differing


class SettingsChange(NamedTuple):
    """A change of a task's settings.

    Attributes:
        changed: values before and after it, by setting; of an object the members that differ.
        restore: the settings that would have to change now to be as they were before it; empty if they are.
    """

    replaced: ReplacedSettings
    changed: dict[str, tuple[Any, Any]]
    restore: dict[str, Any]


def settings_history(connection: Connection, name: str) -> list[SettingsChange]:
    """The changes of a task's settings, newest first.

    Raises:
        NotFoundError, ForbiddenTaskError: if there is no such task, or the key is not for it.
    """
    present = TaskSettings.of(connection, tasks.get(connection, name).name).model_dump(mode="json")
    earlier = replaced_settings.list_all(connection, name)
    # settings that this version has and an older one had not are at their defaults there
    before = [TaskSettings.model_validate(item.settings).model_dump(mode="json") for item in earlier]
    changes = []
    for item, (after, old) in zip(earlier, pairwise([present, *before]), strict=True):
        changed = {key: _narrowed(old[key], after[key]) for key in differing(old, after)}
        changes.append(SettingsChange(item, changed, {key: old[key] for key in differing(present, old)}))
    return changes


def _narrowed(before: Any, after: Any) -> tuple[Any, Any]:  # noqa: ANN401
    if not (isinstance(before, dict) and isinstance(after, dict)):
        return before, after
    names = [name for name in {**before, **after} if before.get(name) != after.get(name)]
    return {name: before.get(name) for name in names}, {name: after.get(name) for name in names}
