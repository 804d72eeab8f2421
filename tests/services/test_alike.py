"""Several objects of one name: numbered by place, distinguished by words of place and by where a hand went."""

import asyncio

import numpy as np
import pytest

from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.pipeline.errors import InstructionError, ObjectSetError, UngroundedInstructionError
from app.services.predict.request import PredictOptions, PredictRequest
from app.services.teach.upload import UploadEpisode
from app.services.teach.upload_checks import Upload

from ..pipeline.recordings import pick_and_place, resting

LEFT_M, RIGHT_M, PLATE_M, SPONGE_M, APPLE_M = np.array(
    [[0.3, 0.2, 0.02], [0.3, -0.2, 0.02], [0.42, -0.2, 0.02], [0.1, 0.0, 0.02], [0.15, 0.2, 0.02]]
)
BESIDE_PLATE_M = PLATE_M + np.array([0, 0.12, 0])


def queries(bowls_m, plate_m=PLATE_M, sponge_m=SPONGE_M, **others_m):
    named = [*(("bowl", place_m) for place_m in bowls_m), ("plate", plate_m), ("sponge", sponge_m), *others_m.items()]
    return tuple(ObjectQuery(name, tuple(map(float, place_m))) for name, place_m in named)


def moved(instruction, from_m, to_m, objects):
    motion = pick_and_place(from_m, to_m + np.array([0, 0, 0.05]), move=resting, start_m=(0.2, 0.0, 0.5))
    return Upload("tidy", Episode(instruction, motion.at(20)), objects, {})


@pytest.mark.parametrize(
    ("instruction", "from_m", "to_m", "kept"),
    [
        ("put the left bowl on the sponge", LEFT_M, SPONGE_M, "put the bowl 1 on the sponge"),
        ("put the bowl next to the plate on the sponge", RIGHT_M, SPONGE_M, "put the bowl 2 on the sponge"),
        ("pick up the bowl nearest to the plate", RIGHT_M, SPONGE_M, "pick up the bowl 2"),
        ("pick up a bowl", RIGHT_M, SPONGE_M, "pick up the bowl 2"),
        ("put the bowl next to the plate", LEFT_M, BESIDE_PLATE_M, "put the bowl 1 next to the plate"),
        ("stack the left bowl on the right bowl", LEFT_M, RIGHT_M, "stack the bowl 1 on the bowl 2"),
        ("put the apple in the bowl next to the plate", APPLE_M, RIGHT_M, "put the apple in the bowl 2"),
        ("put the apple on the plate", APPLE_M, PLATE_M, "put the apple on the plate"),
    ],
)
def test_a_demonstration_says_which_one_by_its_words_and_its_hand(store, instruction, from_m, to_m, kept):
    answer = UploadEpisode(store)(moved(instruction, from_m, to_m, queries((RIGHT_M, LEFT_M), apple=APPLE_M)))
    assert answer.instruction == kept
    assert answer.uploaded_instruction == (None if kept == instruction else instruction)
    numbered = next(finding for finding in answer.findings if finding["code"] == "numbered-by-place")
    assert "bowl 1 at (0.30, 0.20, 0.02), bowl 2 at (0.30, -0.20, 0.02)" in numbered["message"]


@pytest.mark.parametrize(
    ("instruction", "from_m", "to_m", "message"),
    [
        ("put the left bowl on the sponge", RIGHT_M, SPONGE_M, "means bowl 1, but the hand goes to bowl 2"),
        ("put bowl 2 on the sponge", LEFT_M, SPONGE_M, "means bowl 2, but the hand goes to bowl 1"),
        ("put the apple in the left bowl", APPLE_M, RIGHT_M, "means bowl 1, but the hand goes to bowl 2"),
        ("stack the left bowl on the right bowl", RIGHT_M, LEFT_M, "bowl 1, then bowl 2, but the hand goes to bowl 2"),
        ("push the bowl to the left of the plate", LEFT_M, BESIDE_PLATE_M, "may mean 'push the bowl 1' or"),
        ("put the nearest bowl on the sponge", LEFT_M, SPONGE_M, "does not say clearly which bowl"),
        ("stack the bowl on the bowl", LEFT_M, RIGHT_M, "does not say clearly which bowl"),
        ("clean up", RIGHT_M, SPONGE_M, "does not say clearly which bowl"),
        ("pick it up", RIGHT_M, SPONGE_M, "means no bowl, but the hand goes to bowl 2"),
        ("pick up the bowl", (LEFT_M + RIGHT_M) / 2, SPONGE_M, "does not say clearly which bowl"),
        ("pick up the left bowl, not the right bowl", LEFT_M, SPONGE_M, "does not say clearly which bowl"),
    ],
)
def test_a_demonstration_that_leaves_open_which_one_it_means_is_refused(store, instruction, from_m, to_m, message):
    with pytest.raises(UngroundedInstructionError, match=message):
        UploadEpisode(store)(moved(instruction, from_m, to_m, queries((LEFT_M, RIGHT_M), apple=APPLE_M)))


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
    """Ten demonstrations, each about one of two bowls by some word of place; the list has any order."""
    services, random, taught = nearest, np.random.default_rng(5), 0
    for number in range(60):
        bowls_m, plate_m, sponge_m = random_scene(random)
        phrase, which = list(WORDS.items())[number % len(WORDS)]
        scene = queries(bowls_m, plate_m, sponge_m)
        upload = moved(f"put {phrase} on the sponge", bowls_m[which(bowls_m, plate_m)], sponge_m, scene[::-1])
        try:
            services.upload_episode(upload)
        except UngroundedInstructionError:
            continue  # nearly alike
        if (taught := taught + 1) == 10:
            return services
    raise AssertionError("too few scenes are clear")


def grasped_m(services, phrase, objects, **options):
    request = PredictRequest("tidy", f"put {phrase} on the sponge", objects, options=PredictOptions(**options))
    prediction = asyncio.run(services.predict_actions(request))
    assert "numbered-by-place" in [finding.code for finding in prediction.findings]
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
    ("phrase", "bowls_m", "message"),
    [
        ("the left bowl", ([0.45, 0.005, 0.02], [0.2, -0.005, 0.02]), "may be bowl"),
        ("bowl 1", ([0.45, 0.005, 0.02], [0.2, -0.005, 0.02]), "may be another bowl at the next look"),
        ("the bowl nearest to the plate", ([0.42, 0.0, 0.02], [0.42, -0.39, 0.02]), "may be bowl"),
        ("the bowl next to the plate", ([0.42, 0.05, 0.02], [0.42, -0.38, 0.02]), "may be bowl"),
    ],
)
def test_two_that_qualify_nearly_alike_are_refused(services, phrase, bowls_m, message):
    with pytest.raises(UngroundedInstructionError, match=message):
        grasped_m(services, phrase, queries(np.array(bowls_m)))


def test_a_third_one_is_refused_where_it_is_meant_and_else_left_alone(services):
    far_left_m, between_m = np.array([0.3, 0.4, 0.02]), np.array([0.3, 0.0, 0.02])
    assert np.allclose(grasped_m(services, "the leftmost bowl", queries((LEFT_M, far_left_m, RIGHT_M))), far_left_m)
    with pytest.raises(UngroundedInstructionError):
        grasped_m(services, "the rightmost bowl", queries((LEFT_M, between_m, RIGHT_M)))


@pytest.mark.parametrize(
    ("objects", "options", "message"),
    [
        (queries((LEFT_M, LEFT_M)), {}, "one object that was found twice"),
        ((*queries((LEFT_M, RIGHT_M)), ObjectQuery("bowl 1", (0.5, 0.5, 0.02))), {}, "bowl 1 is there already"),
        ((*queries((LEFT_M,)), ObjectQuery("bowl")), {}, "not known beforehand"),
        (queries((LEFT_M,)), {}, "missing: bowl 2, bowl 1"),
    ],
)
def test_objects_that_no_place_numbers_are_refused(services, objects, options, message):
    with pytest.raises(ObjectSetError, match=message):
        grasped_m(services, "the left bowl", objects, **options)


def test_a_task_of_one_bowl_says_that_it_has_one(nearest):
    nearest.upload_episode(moved("put the bowl on the sponge", LEFT_M, SPONGE_M, queries((LEFT_M,))))
    with pytest.raises(ObjectSetError, match="given twice: bowl, of which demonstrations have one"):
        grasped_m(nearest, "the left bowl", queries((LEFT_M, RIGHT_M)))
