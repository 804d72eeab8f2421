"""Objects that no row follows and no words name come and go; the actions are as without them."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.pipeline.errors import InstructionError, ObjectSetError
from app.services.predict.request import PredictRequest
from app.services.teach.upload_checks import Upload
from app.store import tasks

from ..pipeline.recordings import pick_and_place, resting
from .conftest import with_options

INSTRUCTION = "put the cube on the plate"
CLUTTER = ("milk", "orange juice", "salad dressing", "basket", "cube box", "tea", "fork", "ramekin")


def scene(random, *others):
    """Cube and plate, and others that stand far from both and from the way between."""
    cube_m, plate_m = random.uniform([[0.0, -0.3, 0.02], [0.0, 0.1, 0.02]], [[0.3, -0.1, 0.02], [0.3, 0.3, 0.02]])
    clutter_m = {name: (random.uniform(0.6, 0.7), 0.12 * k - 0.4, 0.05) for k, name in enumerate(others)}
    return queries({"cube": cube_m, "plate": plate_m, **clutter_m})


def queries(places_m):
    return tuple(ObjectQuery(name, tuple(map(float, place_m))) for name, place_m in places_m.items())


def recorded(objects, instruction=INSTRUCTION, grasps="cube"):
    at_m = {query.name: np.array(query.position_m) for query in objects}
    motion = pick_and_place(at_m[grasps], at_m["plate"] + [0, 0, 0.05], move=resting, start_m=(0.1, 0.0, 0.5))
    return Upload("tidy", Episode(instruction, motion.at(20)), objects, {})


@pytest.fixture
def services(nearest):
    """Ten demonstrations beside milk and tea."""
    services, random = nearest, np.random.default_rng(4)
    for _ in range(10):
        services.upload_episode(recorded(scene(random, "milk", "tea")))
    return services


def predicted(services, objects, instruction=INSTRUCTION):
    """The actions, and the findings by their codes."""
    request = PredictRequest("tidy", instruction, objects)
    prediction = asyncio.run(services.predict_actions(request))
    actions = [(*action.action.position_m.tolist(), action.action.gripper_open) for action in prediction.reply.actions]
    return actions, {finding.code: finding for finding in prediction.findings}


def names(services):
    with services.store.read() as connection:
        return tasks.get(connection, "tidy").object_names


def test_a_scene_is_answered_as_without_its_bystanders(services):
    usual, before = predicted(services, scene(np.random.default_rng(5), "milk", "tea"))
    assert before == {}
    for others in [(), ("milk",), *(CLUTTER[:number] for number in range(1, 9))]:
        actions, found = predicted(services, scene(np.random.default_rng(5), *others))
        assert actions == usual
        assert found["unusual-scene"].severity == "info"
        assert {finding.severity for finding in found.values()} == {"info"}


@pytest.mark.parametrize("missing", ["cube", "plate"])
def test_what_rows_follow_must_be_there(services, missing):
    objects = scene(np.random.default_rng(5), "milk", "tea")
    with pytest.raises(ObjectSetError, match=rf"missing: {missing} \("):
        predicted(services, tuple(replace(query, name="bowl") if query.name == missing else query for query in objects))


@pytest.mark.parametrize("selection", ["first", "recent", "random", "nearest"])
def test_a_scene_without_any_object_of_the_task_says_what_is_missing(services, selection):
    request = PredictRequest("tidy", INSTRUCTION, queries({"vase": (0.1, 0.2, 0.02)}))
    with pytest.raises(ObjectSetError, match="missing: cube, plate"):
        asyncio.run(services.predict_actions(with_options(request, selection=selection)))


@pytest.mark.parametrize("instruction", ["put the milk box on the plate", "put the cube in the basket"])
def test_words_that_mean_a_new_object_are_refused(services, instruction):
    with pytest.raises(InstructionError):
        predicted(services, scene(np.random.default_rng(5), "milk box", "basket"), instruction)


def test_a_new_object_on_the_way_is_watched(services):
    cube, plate = scene(np.random.default_rng(5))
    beside_m = np.add(cube.position_m, [0.02, 0.0, 0.05])
    _, found = predicted(services, (cube, plate, *queries({"vase": beside_m})))
    assert found["passes-close"].severity == "danger"


def test_uploads_may_have_other_bystanders(services):
    random = np.random.default_rng(6)
    services.upload_episode(recorded(scene(random, "fork", "milk")))
    assert names(services) == ("cube", "plate", "milk")
    usual = predicted(services, scene(np.random.default_rng(5), "milk"))[0]
    assert predicted(services, scene(np.random.default_rng(5), "tea"))[0] == usual
    assert len(asyncio.run(services.check_task("tidy")).skills.of_form("put the <0> on the <1>").plans) == 1


@pytest.mark.parametrize(
    ("objects", "instruction", "grasps"),
    [
        (("fork",), "put the fork on the plate", "cube"),  # words name it
        (("fork",), INSTRUCTION, "fork"),  # the hand closes on it
        (("fork", "Milk"), INSTRUCTION, "cube"),  # spelled otherwise
    ],
)
def test_an_upload_with_a_new_object_that_matters_is_refused(services, objects, instruction, grasps):
    with pytest.raises(ObjectSetError, match=r"not of this task: .*(fork|Milk)"):
        services.upload_episode(recorded(scene(np.random.default_rng(6), *objects), instruction, grasps))


def test_an_upload_that_prompts_leave_out_is_named(services):
    objects = scene(np.random.default_rng(7), "milk", "tea")
    item = recorded(objects)
    is_open = item.episode.trajectory.gripper_open.copy()
    held = np.flatnonzero(~is_open)
    is_open[held[len(held) // 2] :][:12] = True
    trajectory = replace(item.episode.trajectory, gripper_open=is_open)
    id_ = services.upload_episode(replace(item, episode=replace(item.episode, trajectory=trajectory))).id
    (found,) = services.known.doubts("tidy")
    assert (found.code, found.severity) == ("several-ways", "info")
    assert id_ in found.message
