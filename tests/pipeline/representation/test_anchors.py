from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.representation.anchor_choice import choose_anchors
from app.pipeline.representation.anchors import Anchor, anchor_pose, relative_row, tilted_objects

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
    assert choose_anchors(group, LEVEL) == [(Anchor(CUP, frame),) * 3]


PLACE_TURNS = {"w": False, "o": True, "ow": True, "wo": False}
HAND_TURNS = {"w": False, "o": True, "ow": False, "wo": True}
YAWS_DEG = (-60, -35, -5, 15, 40, 70, 90, 110, 130, 150)


def pressed(frame, number, off_m=0.04, noise_m=0.0, random=None, odd_m=0.0):
    """Demonstrations that press beside the cup's middle, each half along its own axes; the last is off by `odd_m`."""
    shown = []
    for k, yaw_deg in enumerate(YAWS_DEG[:number]):
        cup_m, turn = np.array([0.04 * k, 0.3 - 0.05 * k, 0.7]), rotated(0, 0, yaw_deg)
        noise = (0 if random is None else random.normal(0, noise_m, 3)) + np.array([0, odd_m * (k == number - 1), 0])
        way_m = turn.apply([off_m, 0, 0.1]) if PLACE_TURNS[frame] else np.array([off_m, 0, 0.1])
        hand_deg = (180, 0, 20 + (yaw_deg if HAND_TURNS[frame] else 0))
        shown.append(
            demonstration("press the cup", [pose(CUP, cup_m, yaw_deg)], [action(cup_m + way_m + noise, hand_deg)])
        )
    return shown


@pytest.mark.parametrize("frame", PLACE_TURNS)
@pytest.mark.parametrize("number", [3, 5, 10])
@pytest.mark.parametrize("off_m", [0.02, 0.04, 0.1])
def test_place_and_rotation_each_have_the_frame_in_which_they_agree(frame, number, off_m):
    assert choose_anchors(pressed(frame, number, off_m), LEVEL) == [(Anchor(CUP, frame),) * number]


@pytest.mark.parametrize("number", [3, 4, 5, 10])
@pytest.mark.parametrize("off_m", [0.0, 0.04])
@pytest.mark.parametrize("frame", ["w", "o"])
def test_noise_chooses_no_mixed_frame(number, off_m, frame):
    random = np.random.default_rng(number)
    for noise_m in (0.004, 0.01, 0.0168) * 5:
        ((anchor, *_),) = choose_anchors(pressed(frame, number, off_m, noise_m, random), LEVEL)
        assert anchor.frame in ("w", "o")


def test_a_tilted_object_has_mixed_frames():
    tilts = [rotated(0, tilt_deg, yaw_deg) for tilt_deg, yaw_deg in ((-60, 30), (-80, -50), (-40, 0), (-30, 80))]
    places_m = [np.array([0, 0.1 * k, 1]) for k in range(4)]
    shown = [
        demonstration("close it", [pose(LID, place_m, tilt)], [action(place_m + tilt.apply([0.1, 0, 0]))])
        for place_m, tilt in zip(places_m, tilts, strict=True)
    ]
    assert choose_anchors(shown, tilted_objects(shown)) == [(Anchor(LID, "ow", tilted=frozenset({LID})),) * 4]


def test_a_tilted_objects_frame_turns_fully():
    tilt = rotated(0, -60, 30)
    target_m = np.array([0, 0, 1]) + tilt.apply([0.1, 0, 0])
    shown = demonstration("close the lid", [pose(LID, (0, 0, 1), tilt)], [action(target_m)])
    assert tilted_objects([shown]) == {LID}
    (fully,), _ = relative_row([shown], 0, (Anchor(LID, "o", tilted=frozenset({LID})),))
    np.testing.assert_allclose(fully, [0.1, 0, 0], atol=1e-12)
    (by_yaw,), _ = relative_row([shown], 0, (Anchor(LID, "o"),))
    np.testing.assert_allclose(by_yaw, [0.05, 0, 0.1 * np.sin(np.pi / 3)], atol=1e-12)


@pytest.mark.parametrize(
    ("tilts_deg", "tilted"),
    [
        ((5.1, 5.1), True),
        ((5.1, -12, 0), True),
        ((0, 11, 0), False),  # noise of one pose
        ((0, -13, 0), True),
        ((0, 180, 0), True),
        ((4.9, -4.9), False),
    ],
)
def test_an_object_that_leans_in_most_demonstrations_or_clearly_in_one_is_tilted(tilts_deg, tilted):
    scenes = [
        demonstration("close", [pose(LID, (0, 0, 1), rotated(tilt_deg, 0, 70)), pose(CUP, (0, 0, 1))], [])
        for tilt_deg in tilts_deg
    ]
    assert tilted_objects(scenes) == ({LID} if tilted else set())


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
    assert choose_anchors(shown, LEVEL) == [(Anchor(CUP, "o"),), (Anchor(PLATE, "o"),)]


def test_of_a_single_demonstration_a_hand_square_to_the_world_keeps_to_it():
    """A round button has any yaw; the hand does not turn with it."""
    shown = [demonstration("push", [pose(CUP, (0.1, 0.2, 0.7), 33)], [action((0.1, 0.2, 0.75))])]
    assert choose_anchors(shown, LEVEL) == [(Anchor(CUP, "w"),)]


def test_of_equal_pairs_the_previous_rows_goes_on():
    def shown(yaw_deg, first_follows):
        # the second action turns half as far as the cup: it fits the world's axes and the cup's alike
        cup, turn = pose(CUP, (0.1, 0.2, 0.7), yaw_deg), rotated(0, 0, yaw_deg * first_follows)
        beside = action(cup.position_m + turn.apply([0.3, 0, 0]), (180, 0, yaw_deg * first_follows))
        return demonstration("lift the cup", [cup], [beside, action((0.1, 0.2, 0.8), (180, 0, yaw_deg / 2))])

    for first_follows, frame in ((False, "w"), (True, "o")):
        group = [shown(yaw_deg, first_follows) for yaw_deg in (0, 10, -10)]
        assert choose_anchors(group, LEVEL) == [(Anchor(CUP, frame),) * 3] * 2


def test_anchors_follow_the_order_of_mention():
    def shown(named, other, place):
        (x, y, z), _ = PLACES[place]
        objects = {named: (x, y, z), other: (0.5, 0.1 * place, z)}
        listed = [pose(name, objects[name]) for name in ("red", "blue")]
        return demonstration(f"push the {named}", listed, [action((x, y, z + 0.1))])

    group = [shown("red", "blue", 0), shown("blue", "red", 1), shown("blue", "red", 2)]
    assert choose_anchors(group, LEVEL) == [(Anchor("red", "w"), Anchor("blue", "w"), Anchor("blue", "w"))]


def picked_up(cup_m, yaw_deg, offsets_m, hand_deg=30, released_m=(0.4, 0.3, 0.72), near=()):
    """The cup is taken from above and put down; the hand is turned alike in the world."""
    held = [action(np.add(cup_m, offset_m), (180, 0, hand_deg), gripper_open=k == 0) for k, offset_m in offsets_m]
    down = [action(released_m, (180, 0, hand_deg))]
    return demonstration("lift the cup", [pose(CUP, cup_m, yaw_deg), *near], [*held, *down])


HOVER_GRASP_LIFT = ((0, (0.012, 0, 0.1)), (1, (0.0, 0, 0.0)), (1, (0.0, 0.0, 0.12)))


@pytest.mark.parametrize(
    ("apart_deg", "frame"),
    [
        (0.0, "w"),  # a round object, or one whose rotation nothing observes
        (1e-3, "o"),  # one measured yaw: the frame that also serves a single demonstration
        (4.9, "o"),
        (5.1, "w"),  # two yaws: the hand did not turn with it
    ],
)
def test_a_hand_follows_the_axes_of_an_object_that_was_always_turned_alike(apart_deg, frame):
    group = [picked_up((0.1 * k, 0.05 * k, 0.7), 57 + apart_deg * (k == 2), HOVER_GRASP_LIFT) for k in range(3)]
    chosen = choose_anchors(group, LEVEL, beyond_objects=True)
    assert [anchors[0] for anchors in chosen[:3]] == [Anchor(CUP, frame)] * 3


def at_heights(number, noise_m=0.0):
    """Cups at several heights, each lifted to one height of the world; a plate stands elsewhere."""
    random = np.random.default_rng(3)
    group = []
    for k in range(number):
        cup_m = np.array([0.04 * k, 0.2 - 0.05 * k, 0.70 + 0.012 * (k * 7 % 10)])
        places_m = cup_m + random.normal(0, noise_m, (3, 3)) + [[0, 0, 0.1], [0, 0, 0], [0, 0, 0]]
        places_m[2, 2] = 1.1
        rows = [action(place_m, gripper_open=place == 0) for place, place_m in enumerate(places_m)]
        group.append(demonstration("lift the cup", [pose(CUP, cup_m, 9 * k), pose(PLATE, (0.5, 0.07 * k, 0.7))], rows))
    return group


@pytest.mark.parametrize(("number", "noise_m"), [(3, 0.0), (5, 0.002), (10, 0.004)])
def test_a_lift_may_end_at_a_height_of_the_world(number, noise_m):
    *at_cup, lifted = choose_anchors(at_heights(number, noise_m), LEVEL, beyond_objects=True)
    assert {anchors[0] for anchors in at_cup} == {Anchor(CUP, "w")}
    assert lifted == (Anchor(CUP, "w", ((2, ""),)),) * number


def test_a_place_may_have_x_of_one_object_and_y_of_another_and_is_found_again_in_another_scene():
    places = [
        ((0.1, 0.3), (0.4, -0.2)),
        ((0.3, 0.1), (0.2, 0.25)),
        ((0.2, -0.1), (0.5, 0.05)),
        ((0.4, 0.2), (0.1, 0.1)),
    ]
    group = [
        demonstration(
            "press between the cup and the plate",
            [pose(CUP, (*cup, 0.7)), pose(PLATE, (*plate, 0.7))],
            [action((cup[0], plate[1], 0.75))],
        )
        for cup, plate in places
    ]
    ((anchor, *_),) = choose_anchors(group, LEVEL, beyond_objects=True)
    assert anchor == Anchor(PLATE, "w", ((0, CUP),))
    assert anchor.names == (PLATE, CUP)
    scene = replace(group[0], objects=(pose(CUP, (0.15, 0, 0.7)), pose(PLATE, (0, -0.3, 0.7))))
    np.testing.assert_allclose(anchor_pose(anchor, scene).origin_m, [0.15, -0.3, 0.7])


def placed(number, tenths, noise_m=0.0, seed=0):
    """A lid is taken, and let go of between a cup and a plate, or somewhere if `tenths` is None; it stays turned."""
    random, group = np.random.default_rng(seed), []
    for _ in range(number):
        lid_m, cup_m, plate_m = (random.uniform([x_m, -0.3, 0.7], [x_m + 0.2, 0.3, 0.7]) for x_m in (0.0, 0.3, 0.6))
        turn_deg = float(random.uniform(-60, 60))
        at_m = random.uniform(0.3, 0.6, 3) if tenths is None else cup_m + tenths / 10 * (plate_m - cup_m)
        at_m = at_m + random.normal(0, noise_m, 3)
        stops = [(lid_m, True), (lid_m, False), (np.add(at_m, (0, 0, 0.1)), False), (at_m, True)]
        rows = [action(stop_m, (180, 0, turn_deg), is_open) for stop_m, is_open in stops]
        objects = [pose(LID, lid_m, turn_deg), pose(CUP, cup_m), pose(PLATE, plate_m)]
        group.append(demonstration("put the lid between the cup and the plate", objects, rows))
    return group


def upright(group):
    """The same with hands that never turn."""
    rows = [tuple(action(a.position_m, gripper_open=a.gripper_open) for a in d.actions) for d in group]
    return [replace(d, actions=own) for d, own in zip(group, rows, strict=True)]


@pytest.mark.parametrize(("tenths", "number", "noise_m"), [(5, 5, 0.0), (3, 10, 0.003), (8, 10, 0.003)])
def test_a_place_may_be_between_two_objects(tenths, number, noise_m):
    *at_lid, hover, release = choose_anchors(upright(placed(number, tenths, noise_m)), LEVEL, beyond_objects=True)
    assert {anchors[0].object_name for anchors in at_lid} == {LID}
    assert hover[0].tenths == release[0].tenths == tenths
    (anchor, *_), scene = release, placed(1, None, seed=9)[0]
    cup_m, plate_m = scene.object(CUP).position_m, scene.object(PLATE).position_m
    expected_m = cup_m + tenths / 10 * (plate_m - cup_m)
    np.testing.assert_allclose(anchor_pose(anchor, scene).origin_m[:2], expected_m[:2])


def test_what_is_let_go_of_as_it_was_taken_stays_turned():
    *_, release = choose_anchors(placed(10, 10), LEVEL, beyond_objects=True)
    assert release[0] == Anchor(LID, "wo", ((0, PLATE), (1, PLATE), (2, PLATE)))
    *_, release = choose_anchors(upright(placed(10, 10)), LEVEL, beyond_objects=True)
    assert release[0] == Anchor(PLATE, "w")
