"""What a check keeps of a task, for the next one who asks."""

import gc
import weakref

from app.services.teach import check
from tests.services.test_upload_episode import upload


def test_a_check_that_is_kept_holds_no_trajectories(scripted, monkeypatch):
    """Those of 32 tasks with 30 long recordings each would be gigabytes."""
    services, read, trajectories = scripted("[]"), check.recordings_of, []
    for _ in range(3):
        services.upload_episode(upload("cube"))

    def watched(*arguments):
        found = read(*arguments)
        trajectories.extend(weakref.ref(item.motion.trajectory) for item in found)
        return found

    monkeypatch.setattr(check, "recordings_of", watched)
    first = services.check_task.without_model("pick")
    gc.collect()
    assert [trajectory() for trajectory in trajectories] == [None] * 3
    assert services.check_task.without_model("pick") is first
