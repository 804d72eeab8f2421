import threading
from dataclasses import replace

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.pipeline.errors import ObjectSetError, UngroundedInstructionError
from app.services.teach.upload import UploadEpisode
from app.services.teach.upload_checks import Upload
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


def names(record):
    return tuple(item.name for item in record.objects)


def test_first_episode_fixes_the_objects_and_their_order(store):
    use_case = UploadEpisode(store)
    use_case(upload("cube", "plate"))
    assert names(use_case(upload("plate", "cube"))) == ("cube", "plate")
    with pytest.raises(ObjectSetError, match="not of this task: bowl"):
        use_case(upload("cube", "bowl"))  # which stands where the hand acts


def test_first_uploads_at_once_agree_on_the_objects(store):
    use_case, outcomes, gate = UploadEpisode(store), [], threading.Barrier(6)

    def first(objects):
        gate.wait()
        try:
            outcomes.append(names(use_case(upload(*objects))))
        except ObjectSetError:
            outcomes.append(None)

    threads = [threading.Thread(target=first, args=(objects,)) for objects in [("cube",), ("plate",)] * 3]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert outcomes.count(None) == 3
    assert len(set(outcomes)) == 2


def test_an_instruction_that_is_too_involved_to_be_read_is_refused(scripted):
    long = "push " + "the red cup and " * 28 + "the blue cup"
    given = replace(upload("red cup", "blue cup"), episode=Episode(long, pick_trajectory(PLACE_M)))
    with pytest.raises(UngroundedInstructionError, match="is too involved"):
        scripted("[]").upload_episode(given)
