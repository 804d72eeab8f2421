"""Delete an episode: the task's workspace becomes what the remaining ones span."""

from app.services.task_settings import TaskSettings
from app.services.teach.configure import record_limits
from app.services.teach.room import remaining
from app.store import episodes, tasks
from app.store.store import Store


def remove_episode(store: Store, episode_id: str) -> str:
    """Delete the episode; its images go with the next sweep.

    Returns:
        The task.

    Raises:
        NotFoundError: if there is none of that id.
    """
    with store.write() as connection:
        name = episodes.remove(connection, episode_id)
        before = tasks.get(connection, name).settings
        settings = TaskSettings.model_validate(before)
        if settings.workspace.preset == "auto":
            after = remaining(settings, episodes.demonstrations(connection, name)).model_dump(mode="json")
            tasks.update_settings(connection, name, after)
            record_limits(connection, name, before, after)
    return name
