from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.skill import turns
from app.pipeline.skill.skill import fit
from tests.pipeline.skill.shown import DOWN, HOME_M, WORDS, drawn, home, posed, recording, recordings, scene, stops_of

CUP, COASTER = np.array([0.2, 0.1, 0.82]), np.array([0.25, -0.1, 0.8])
SIDE = turns.exp(np.array([np.pi / 2, 0, 0]))


def higher(place_m, by_m):
    return place_m + np.array([0.0, 0.0, by_m])


def dangers(skill, here=None):
    found = skill.of_demonstrations if here is None else skill.of_scene(here)
    return {doubt.code for doubt in found if doubt.danger}


@pytest.fixture(scope="module", params=[2, 3, 6])
def skill(request):
    return fit(recordings(request.param))


def placed(cup=CUP, coaster=COASTER, cup_turn=None, hand=None):
    one = posed("cup", cup, 0.2) if cup_turn is None else replace(posed("cup", cup), quaternion_xyzw=cup_turn)
    return scene([one, posed("coaster", coaster, 0.1)], hand)


def test_right_demonstrations_and_scenes_are_not_doubted(skill):
    assert dangers(skill) == set()
    assert dangers(skill, placed()) == set()
    assert dangers(skill, placed(hand=home(HOME_M + 0.1))) == set()


@pytest.mark.parametrize(
    "strange",
    [
        placed(cup_turn=DOWN), placed(cup_turn=SIDE), placed(higher(CUP, 0.3)), placed(coaster=higher(COASTER, 0.25)),
        placed(higher(COASTER, 0.02)), placed(COASTER, CUP), placed(hand=home(HOME_M + 1.0)),
        placed(hand=home(higher(HOME_M, -0.8))), placed(hand=home(HOME_M, turns.exp(np.array([0, np.pi / 2, 0])))),
    ],
    ids=["upside down", "lies", "higher", "coaster higher", "in one place", "exchanged", "far", "below", "turned"],
)  # fmt: skip
def test_a_strange_scene_is_noticed_from_two_demonstrations_on(skill, strange):
    if len(skill.recordings) == 2 and not np.array_equal(strange.start, HOME_M):
        assert dangers(skill, strange) >= {"unusual-scene"}
    assert dangers(skill, strange)


def test_one_doubt_names_object_coordinate_value_range_and_remedy(skill):
    (doubt,) = [doubt for doubt in skill.of_scene(placed(higher(CUP, 0.06))) if doubt.danger]
    assert doubt.where == "objects[cup]"
    assert doubt.message.startswith("cup: height is 0.880 m, demonstrations have 0.8")
    assert "check its pose" in doubt.message
    assert doubt.numbers["low"] < 0.82 < doubt.numbers["high"] < doubt.numbers["value"] == pytest.approx(0.88)


def test_the_one_demonstration_that_was_changed_is_named():
    def one_is_off(number, objects, stops):
        return objects, [(p + (number == 4) * np.array([0.0, 0.05, 0.0]), q, o) for p, q, o in stops]

    assert fit(recordings(8)).left_out() == []
    assert {one.about for one in fit(recordings(8, change=one_is_off)).left_out()} == {"4"}


def changed(change, number=10):
    return dangers(fit(recordings(number, change=change)))


def test_quaternions_with_w_first_are_named():
    found = changed(lambda n, objects, stops: (objects, [(p, q[[3, 0, 1, 2]], o) for p, q, o in stops]))
    assert "another-convention" in found


def test_a_turned_base_is_named():
    z = turns.about_z(np.pi / 2)
    found = changed(
        lambda n, objects, stops: (objects, [(turns.rotated(z, p), turns.product(z, q), o) for p, q, o in stops])
    )
    assert "another-convention" in found


def test_an_inverted_gripper_is_named():
    found = changed(lambda n, objects, stops: (objects, [(p, q, not o) for p, q, o in stops]))
    assert "another-convention" in found


def test_exchanged_names_are_noticed():
    def exchanged(number, objects, stops):
        cup, coaster = objects
        return (replace(coaster, name="cup"), replace(cup, name="coaster")), stops

    assert changed(exchanged) & {"names-exchanged", "unlike-words"}


def test_a_goal_that_is_not_the_one_of_the_words_is_noticed():
    def to_plate(number, objects, stops):
        random = np.random.default_rng(number)
        plate = posed("plate", (random.uniform(-0.5, -0.1), random.uniform(-0.3, 0.3), 0.8))
        return (*objects, plate), stops_of(objects[0], plate)

    assert "unlike-words" in changed(to_plate)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_acts_in_another_order_than_the_words_are_noticed(order):
    def press(number):
        objects = [replace(pose, name=name) for pose, name in zip(drawn_of(number), ("red", "blue"), strict=True)]
        over = [objects[k].position_m + np.array([0, 0, high]) for k in order for high in (0.12, 0.02, 0.12)]
        stops = [(HOME_M, DOWN, False), *((place, DOWN, False) for place in over)]
        return recording(objects, stops, number, words="press the red, then press the blue")

    found = dangers(fit([press(number) for number in range(6)]))
    assert found == ({"unlike-words"} if order == (1, 0) else set())


def drawn_of(seed):
    return drawn(np.random.default_rng(seed))


def test_a_missing_grasp_is_noticed():
    found = changed(lambda n, objects, stops: (objects, [(p, q, True) for p, q, _ in stops]))
    assert "unlike-words" in found


def test_rotations_that_follow_what_is_not_measured_are_too_uncertain_to_act():
    def unmeasured(number, objects, stops):
        yaw = np.random.default_rng(number).uniform(-0.65, 0.65)
        hand = turns.product(turns.about_z(yaw), DOWN)
        plain = tuple(replace(pose, quaternion_xyzw=None) for pose in objects)
        return plain, [(p, hand if k else q, o) for k, (p, q, o) in enumerate(stops)]

    assert "uncertain-act" in changed(unmeasured)


def test_a_drawer_whose_origin_is_far_from_its_handle_is_right():
    def drawer(number, objects, stops):
        place = np.array([0.5, 0.1 * np.sin(number), 0.9])
        hand = turns.product(turns.about_z(0.0), DOWN)
        handle = place - (0.3, 0.0, 0.0)
        ways = [((-0.1, 0, 0.05), True), ((0, 0, 0), False), ((-0.15, 0, 0), False), ((-0.15, 0, 0), True)]
        there = [(handle + way, hand, o) for way, o in ways]
        return (posed("drawer", place),), [(HOME_M, DOWN, True), *there, (there[-1][0] - (0.1, 0, 0), hand, True)]

    items = [recording(*drawer(n, None, None), n, words="open the drawer") for n in range(8)]
    assert dangers(fit(items)) == set()


def test_old_poses_are_noticed():
    first = recordings(6)
    skill = fit(first)
    again = [posed(*of) for of in zip(first[0].scene.names, first[0].scene.place, strict=True)]
    assert "measured-twice" in dangers(skill, scene(again))


def test_a_doubt_is_the_same_for_any_order_of_demonstrations():
    def w_first(number, objects, stops):
        return objects, [(p, q[[3, 0, 1, 2]], o) for p, q, o in stops]

    items = recordings(6, change=w_first)
    assert [d.code for d in fit(items).of_demonstrations] == [d.code for d in fit(items[::-1]).of_demonstrations]


def test_words_are_those_of_the_recordings():
    assert fit(recordings(2)).form == WORDS.replace("cup", "<0>").replace("coaster", "<1>")
