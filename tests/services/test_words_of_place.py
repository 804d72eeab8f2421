"""Several objects of one kind have names of their own; words of place choose between them."""

import asyncio
import re

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.pipeline.errors import InstructionError, ObjectSetError, UngroundedInstructionError
from app.services.predict.request import PredictRequest
from app.services.teach.upload_checks import Upload

from ..pipeline.recordings import pick_and_place, resting

LEFT_M, RIGHT_M, PLATE_M, SPONGE_M = np.array(
    [[0.3, 0.2, 0.02], [0.3, -0.2, 0.02], [0.42, -0.2, 0.02], [0.1, 0.0, 0.02]]
)


def queries(bowls_m, plate_m=PLATE_M, sponge_m=SPONGE_M):
    bowls = ((f"bowl {number}", place_m) for number, place_m in enumerate(bowls_m, start=1))
    named = (*bowls, ("plate", plate_m), ("sponge", sponge_m))
    return tuple(ObjectQuery(name, tuple(map(float, place_m))) for name, place_m in named)


def moved(instruction, from_m, to_m, objects):
    motion = pick_and_place(from_m, to_m + np.array([0, 0, 0.05]), move=resting, start_m=(0.2, 0.0, 0.5))
    return Upload("tidy", Episode(instruction, motion.at(20)), objects, {})


def left(bowls_m, plate_m):
    return int(np.argmax(bowls_m[:, 1]))


def beside_plate(bowls_m, plate_m):
    return int(np.argmin(np.linalg.norm(bowls_m - plate_m, axis=1)))


def farthest_from_plate(bowls_m, plate_m):
    return int(np.argmax(np.linalg.norm(bowls_m - plate_m, axis=1)))


def nearest_to_robot(bowls_m, plate_m):
    return int(np.argmin(np.linalg.norm(bowls_m[:, :2], axis=1)))


WORDS = {
    "the left bowl": left,
    "the leftmost bowl": left,
    "the bowl on the left": left,
    "the bowl next to the plate": beside_plate,
    "the bowl nearest to the plate": beside_plate,
    "the bowl farthest from the plate": farthest_from_plate,
    "the bowl closest to the robot": nearest_to_robot,
}
UNCLEAR = (
    "the bowl", "a bowl", "any bowl", "the other bowl", "both bowls", "one of the bowls", "the front bowl",
    "my left bowl", "the small bowl", "bowl number two", "the bowl or the plate", "the bowl not next to the plate",
    "the last bowl", "the third bowl from the left", "the bowl next to the bowl", "the left or right bowl",
    "the bowl next to the fork",
)  # fmt: skip


def random_scene(random):
    """Two bowls, a plate and a sponge, 12 cm apart or more."""
    while True:
        places_m = random.uniform([0.1, -0.35, 0.02], [0.5, 0.35, 0.02], (4, 3))
        apart_m = np.linalg.norm(places_m[:, None] - places_m[None], axis=2) + np.eye(4)
        if apart_m.min() > 0.12:
            return places_m[:2], places_m[2], places_m[3]


@pytest.fixture
def services(nearest):
    """Ten demonstrations, each about one of two bowls by its name."""
    random = np.random.default_rng(5)
    for number in range(10):
        bowls_m, plate_m, sponge_m = random_scene(random)
        scene, which = queries(bowls_m, plate_m, sponge_m), number % 2
        nearest.upload_episode(moved(f"put bowl {which + 1} on the sponge", bowls_m[which], sponge_m, scene))
    return nearest


def grasped_m(services, phrase, objects):
    request = PredictRequest("tidy", f"put {phrase} on the sponge", objects)
    prediction = asyncio.run(services.predict_actions(request))
    return next(item.action.position_m for item in prediction.reply.actions if not item.action.gripper_open)


def test_words_of_place_take_the_hand_to_the_object_that_they_mean(services):
    random, answered = np.random.default_rng(6), 0
    for number in range(3 * len(WORDS)):
        bowls_m, plate_m, sponge_m = random_scene(random)
        phrase, which = list(WORDS.items())[number % len(WORDS)]
        try:
            at_m = grasped_m(services, phrase, queries(bowls_m, plate_m, sponge_m))
        except UngroundedInstructionError:
            continue
        answered += 1
        assert np.allclose(at_m, bowls_m[which(bowls_m, plate_m)], atol=0.02), (phrase, bowls_m, plate_m)
    assert answered >= 2 * len(WORDS)


def test_words_that_leave_open_which_one_is_meant_are_refused(services):
    for phrase in UNCLEAR:
        with pytest.raises(InstructionError):
            grasped_m(services, phrase, queries((LEFT_M, RIGHT_M)))


@pytest.mark.parametrize(
    ("phrase", "bowls_m"),
    [
        ("the left bowl", ([0.45, 0.005, 0.02], [0.2, -0.005, 0.02])),
        ("the bowl nearest to the plate", ([0.42, 0.0, 0.02], [0.42, -0.39, 0.02])),
    ],
)
def test_two_that_qualify_nearly_alike_are_refused(services, phrase, bowls_m):
    with pytest.raises(UngroundedInstructionError, match="may be bowl"):
        grasped_m(services, phrase, queries(np.array(bowls_m)))


def test_one_name_for_two_objects_is_refused(services):
    bowls = tuple(ObjectQuery("bowl", tuple(place_m)) for place_m in (LEFT_M, RIGHT_M))
    twice = (*bowls, *queries(())[:2])
    for use in (lambda: grasped_m(services, "bowl 2", twice), lambda: moved("pick up bowl 2", LEFT_M, SPONGE_M, twice)):
        with pytest.raises(ObjectSetError, match=re.escape("given twice: bowl (name them 'bowl 1', 'bowl 2')")):
            use()
