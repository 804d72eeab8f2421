"""Which bounds of motion a task had before a change and has after it, in the audit log."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection

from app.store import audit

BOUNDS = ("workspace", "motion_limits")  # settings that decide which actions are unsafe


def record_limits(
    connection: Connection,
    task: str,
    before: Mapping[str, Any],
    after: Mapping[str, Any],
    *,
    action: str = "limits.changed",
    actor: str | None = None,
) -> None:
    """Add an entry if the settings' bounds differ.

    Args:
        before, after: settings, as JSON.
    """
    changed = [name for name in BOUNDS if before.get(name) != after.get(name)]
    if changed:
        details = {when: {name: values.get(name) for name in changed} for when, values in _both(before, after)}
        audit.record(connection, action, task, details, actor)


def _both(before: Mapping[str, Any], after: Mapping[str, Any]) -> tuple[tuple[str, Mapping[str, Any]], ...]:
    return ("before", before), ("after", after)
