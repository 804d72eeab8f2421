import threading
from dataclasses import replace

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.pipeline.errors import ObjectSetError
from app.services.teach.upload import UploadEpisode
from app.services.teach.upload_checks import Upload
from app.store import episodes, tasks
from app.store.errors import NotFoundError
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import Trajectory
from tests.episodes import pick_trajectory

PLACE_M = (0.1, 0.1, 0.78)


def upload(*names, place_m=PLACE_M, **more):
    episode = Episode("pick up the cube", pick_trajectory(place_m))
    return Upload("pick", episode, tuple(ObjectQuery(name, place_m) for name in names), {}, **more)


def jointless():
    """An upload of which no rule can tell where joints rest."""
    moved = pick_trajectory(PLACE_M)
    alone = Trajectory(np.zeros((len(moved), 0)), moved.positions_m, moved.quaternions_xyzw, moved.gripper_open)
    return replace(upload("cube"), episode=Episode("pick up the cube", alone))


def respond(record, settings):
    return {"id": record.id, "objects": [item.name for item in record.objects]}


def test_first_episode_fixes_the_objects_and_their_order(store):
    use_case = UploadEpisode(store)
    use_case(upload("cube", "plate"), respond)
    assert use_case(upload("plate", "cube"), respond)["objects"] == ["cube", "plate"]
    with pytest.raises(ObjectSetError, match="not of this task: bowl"):
        use_case(upload("cube", "bowl"), respond)  # which stands where the hand acts


def test_first_uploads_at_once_agree_on_the_objects(store):
    use_case, outcomes, gate = UploadEpisode(store), [], threading.Barrier(6)

    def first(names):
        gate.wait()
        try:
            outcomes.append(tuple(sorted(use_case(upload(*names), respond)["objects"])))
        except ObjectSetError:
            outcomes.append(None)

    threads = [threading.Thread(target=first, args=(names,)) for names in [("cube",), ("plate",)] * 3]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert outcomes.count(None) == 3
    assert len(set(outcomes)) == 2


def test_a_failing_answer_stores_nothing(store):
    def failing(record, settings):
        raise InvalidInputError("answer", "cannot be made")

    with pytest.raises(InvalidInputError):
        UploadEpisode(store)(upload("cube"), failing)
    with store.read() as connection, pytest.raises(NotFoundError):
        tasks.get(connection, "pick")


def test_other_writers_do_not_wait_for_the_answer(store):
    def elsewhere():
        with store.write() as connection:
            tasks.get_or_create(connection, "other", {})

    def slow(record, settings):
        writer = threading.Thread(target=elsewhere)
        writer.start()
        writer.join(timeout=5)
        assert not writer.is_alive()
        return respond(record, settings)

    UploadEpisode(store)(upload("cube"), slow)
    with store.read() as connection:
        assert [task.name for task in tasks.list_all(connection)] == ["other", "pick"]


def test_the_answer_is_of_the_workspace_that_the_task_then_has(store):
    use_case = UploadEpisode(store)
    use_case(upload("cube"), respond)
    boxes = []

    def meanwhile(record, settings):
        boxes.append(settings.workspace)
        if len(boxes) == 1:  # another robot's upload widens the workspace
            use_case(upload("cube", place_m=(1.5, 0.1, 0.78)), respond)
        return {**respond(record, settings), "max": settings.workspace.max[0]}

    answer = use_case(upload("cube"), meanwhile)
    with store.read() as connection:
        stored = tasks.get(connection, "pick").settings["workspace"]
        assert episodes.number_of(connection, "pick") == 3
    assert (boxes[0].max[0] < 1.5, len(boxes)) == (True, 2)
    assert (answer["max"], answer["max"] > 1.5) == (stored["max"][0], True)
