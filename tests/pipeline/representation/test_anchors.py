import numpy as np
import pytest

from app.pipeline.episode import in_order
from app.pipeline.order.order import Order
from app.pipeline.representation.anchors import (
    Anchor,
    choose_anchors,
    object_rotation,
    relative_action,
    tilted_objects,
)

from ..scenes import action, demonstration, pose, rotated

CUP, PLATE, LID = "cup", "plate", "lid"
PLACES = [((0.1, 0.2, 0.7), 10), ((0.3, -0.1, 0.7), 75), ((0.2, 0.0, 0.7), -40)]
LEVEL = frozenset()


def at_cup(offset_m, follows_yaw, others=True, place=0):
    """A demonstration of one action at an offset from the cup, along the world's or the cup's axes."""
    position_m, yaw_deg = PLACES[place]
    turn_deg = yaw_deg if follows_yaw else 0
    target_m = np.array(position_m) + rotated(0, 0, turn_deg).apply(offset_m)
    objects = [pose(PLATE, (0.1 * place, 0.3, 0.7), 5 * place)] if others else []
    return demonstration(
        "lift the cup",
        [*objects, pose(CUP, position_m, yaw_deg)],
        [action(target_m, (180, 0, 20 + turn_deg), gripper_open=False)],
    )


@pytest.mark.parametrize("offset_m", [(0.05, 0.02, 0.1), (0, 0, 0.1)], ids=["beside", "above: only rotations differ"])
@pytest.mark.parametrize(("follows_yaw", "frame"), [(False, "w"), (True, "o")])
def test_the_pair_that_spreads_least_is_chosen(offset_m, follows_yaw, frame):
    group = [at_cup(offset_m, follows_yaw, place=k) for k in range(3)]
    assert choose_anchors(group, LEVEL) == [[Anchor(CUP, frame)] * 3]


def test_relative_actions_of_yaw_following_demonstrations_are_equal():
    for place in range(3):
        offset_m, rotation = relative_action(at_cup((0.05, 0.02, 0.1), True, place=place), 0, Anchor(CUP, "o"), LEVEL)
        np.testing.assert_allclose(offset_m, [0.05, 0.02, 0.1], atol=1e-12)
        assert (rotated(180, 0, 20).inv() * rotation).magnitude() < 1e-7


def test_a_tilted_objects_frame_turns_fully():
    tilt = rotated(0, -60, 30)
    target_m = np.array([0, 0, 1]) + tilt.apply([0.1, 0, 0])
    shown = demonstration("close the lid", [pose(LID, (0, 0, 1), tilt)], [action(target_m)])
    assert tilted_objects([shown]) == {LID}
    fully, _ = relative_action(shown, 0, Anchor(LID, "o"), frozenset({LID}))
    np.testing.assert_allclose(fully, [0.1, 0, 0], atol=1e-12)
    by_yaw, _ = relative_action(shown, 0, Anchor(LID, "o"), LEVEL)
    np.testing.assert_allclose(by_yaw, [0.05, 0, 0.1 * np.sin(np.pi / 3)], atol=1e-12)


@pytest.mark.parametrize(("tilt_deg", "tilted"), [(4.9, False), (5.1, True), (-60, True), (180, True)])
def test_an_object_that_leans_in_any_demonstration_is_tilted(tilt_deg, tilted):
    upright = demonstration("close", [pose(LID, (0, 0, 1), 30), pose(CUP, (0, 0, 1))], [])
    leaning = demonstration("close", [pose(LID, (0, 0, 1), rotated(tilt_deg, 0, 70)), pose(CUP, (0, 0, 1))], [])
    assert tilted_objects([upright, leaning]) == ({LID} if tilted else set())


def test_object_rotation():
    tilt = rotated(20, 0, 50)
    lid = pose(LID, (0, 0, 1), tilt)
    assert object_rotation(lid, "w", frozenset({LID})).magnitude() == 0
    assert object_rotation(pose(LID, (0, 0, 1)), "o", LEVEL).magnitude() == 0
    np.testing.assert_allclose(object_rotation(lid, "o", LEVEL).as_rotvec(degrees=True), [0, 0, 50])
    assert (object_rotation(lid, "o", frozenset({LID})).inv() * tilt).magnitude() < 1e-7


@pytest.mark.parametrize("without", [[0], [1], [0, 1, 2]])
def test_the_objects_own_frame_needs_its_rotation_in_every_demonstration(without):
    group = [at_cup((0.05, 0.02, 0.1), True, place=k) for k in range(3)]
    for k in without:
        position_m, _ = PLACES[k]
        group[k] = demonstration("lift the cup", [pose(CUP, position_m), group[k].objects[0]], group[k].actions)
    ((first, *_),) = choose_anchors(group, LEVEL)
    assert first != Anchor(CUP, "o")


def tidying(plate_yaw_deg, *actions):
    objects = [pose(PLATE, (0, 0.3, 0.7), plate_yaw_deg), pose(CUP, (0.1, 0.2, 0.7), 10)]
    return [demonstration("tidy up", objects, actions)]


def test_an_action_of_a_single_demonstration_belongs_to_the_nearest_object():
    shown = tidying(20, action((0.11, 0.2, 0.8), (180, 0, 100)), action((0.02, 0.31, 0.75), (180, 0, 20)))
    assert choose_anchors(shown, LEVEL) == [[Anchor(CUP, "o")], [Anchor(PLATE, "o")]]


def test_of_a_single_demonstration_a_hand_square_to_a_farther_object_belongs_to_that():
    beside_the_cup = (0.08, 0.22, 0.8)
    oblique = tidying(40, action(beside_the_cup, (180, 0, 130)))
    assert choose_anchors(oblique, LEVEL) == [[Anchor(PLATE, "o")]]
    square_to_both = tidying(100, action(beside_the_cup, (180, 0, 190)))
    assert choose_anchors(square_to_both, LEVEL) == [[Anchor(CUP, "o")]]


def test_of_a_single_demonstration_a_hand_square_to_the_world_keeps_to_it():
    """A round button has any yaw; the hand does not turn with it."""
    shown = [demonstration("push", [pose(CUP, (0.1, 0.2, 0.7), 33)], [action((0.1, 0.2, 0.75))])]
    assert choose_anchors(shown, LEVEL) == [[Anchor(CUP, "w")]]


def test_of_equal_pairs_the_previous_rows_goes_on():
    def shown(yaw_deg, first_follows):
        # the second action turns half as far as the cup: it fits the world's axes and the cup's alike
        cup, turn = pose(CUP, (0.1, 0.2, 0.7), yaw_deg), rotated(0, 0, yaw_deg * first_follows)
        beside = action(cup.position_m + turn.apply([0.3, 0, 0]), (180, 0, yaw_deg * first_follows))
        return demonstration("lift the cup", [cup], [beside, action((0.1, 0.2, 0.8), (180, 0, yaw_deg / 2))])

    for first_follows, frame in ((False, "w"), (True, "o")):
        group = [shown(yaw_deg, first_follows) for yaw_deg in (0, 10, -10)]
        assert choose_anchors(group, LEVEL) == [[Anchor(CUP, frame)] * 3] * 2


def test_anchors_follow_the_order_of_mention():
    def shown(named, other, place):
        (x, y, z), _ = PLACES[place]
        objects = {named: (x, y, z), other: (0.5, 0.1 * place, z)}
        listed = [pose(name, objects[name]) for name in ("red", "blue")]
        return demonstration(f"push the {named}", listed, [action((x, y, z + 0.1))])

    group = [shown("red", "blue", 0), shown("blue", "red", 1), shown("blue", "red", 2)]
    assert choose_anchors(group, LEVEL) == [[Anchor("red", "w"), Anchor("blue", "w"), Anchor("blue", "w")]]


def test_in_order():
    names = ("tray", "red", "blue")
    objects = [pose(name, (0, 0, 1)) for name in names]
    assert [p.name for p in in_order(objects, Order("put the blue on the red", names))] == ["blue", "red", "tray"]
    assert [p.name for p in in_order(objects, Order("tidy up", names))] == ["tray", "red", "blue"]


def picked_up(cup_m, yaw_deg, offsets_m, hand_deg=30, released_m=(0.4, 0.3, 0.72), near=()):
    """The cup is taken from above and put down; the hand is turned alike in the world."""
    held = [action(np.add(cup_m, offset_m), (180, 0, hand_deg), gripper_open=k == 0) for k, offset_m in offsets_m]
    down = [action(released_m, (180, 0, hand_deg))]
    return demonstration("lift the cup", [pose(CUP, cup_m, yaw_deg), *near], [*held, *down])


HOVER_GRASP_LIFT = ((0, (0.012, 0, 0.1)), (1, (0.0, 0, 0.0)), (1, (0.0, 0.0, 0.12)))


def test_hover_grasp_and_lift_are_in_one_frame_where_the_object_was_always_turned_alike():
    """By chance the hover keeps closer to the cup's own axes and the grasp to the world's."""
    random = np.random.default_rng(4)
    group = []
    for place in range(3):
        offsets_m = [(k, np.add(offset_m, random.normal(0, 0.006, 3))) for k, offset_m in HOVER_GRASP_LIFT]
        cup_m = (0.1 * place, 0.05 * place, 0.7)
        group.append(picked_up(cup_m, 57 + 4 * place, offsets_m, 30 + 8 * random.uniform()))
    hover, grasp, lift, _ = choose_anchors(group, LEVEL, beyond_objects=True)
    assert hover == grasp == lift


def test_what_the_hand_carries_does_not_follow_a_bystander():
    by_the_way = [*HOVER_GRASP_LIFT, (1, (0.1, 0.1, 0.12))]
    alone = picked_up(
        (0.1, 0.1, 0.7), 20, by_the_way, near=[pose(PLATE, (0.4, 0.3, 0.7), 30), pose(LID, (0.2, 0.2, 0.8), 30)]
    )
    names = [anchors[0].object_name for anchors in choose_anchors([alone], LEVEL, beyond_objects=True)]
    assert names[1] == CUP
    assert names[-1] == PLATE
    assert LID not in names[1:]
