"""Actions that follow their objects: the same pose relative to where these are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from roboprompt_client.errors import UnsafeActionError
from roboprompt_client.runs.reanchoring import ActionAnchor, anchor_from_json, has_moved, reanchored
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

DOWN = Rotation.from_euler("x", np.pi)


def turned(yaw_deg, tilt_deg=0.0):
    return Rotation.from_euler("z", yaw_deg, degrees=True) * Rotation.from_euler("y", tilt_deg, degrees=True)


def seen(name, x_m=0.0, yaw_deg=0.0, tilt_deg=0.0):
    return {name: ObjectPose(name, np.array([x_m, 0.0, 0.8]), turned(yaw_deg, tilt_deg).as_quat())}


def placed(pose, offset_m, frame, axes=None):
    """An action at an offset along an object's axes, gripper down, and its anchor."""
    axes = axes or (Rotation.identity() if frame == "w" else Rotation.from_quat(pose.quaternion_xyzw))
    action = EndEffectorAction(pose.position_m + axes.apply(offset_m), (axes * DOWN).as_quat(), True)
    return action, ActionAnchor(pose.name, frame, np.array(offset_m), DOWN.as_quat())


def follow(before, now, frame, offset_m=(0.1, 0.0, 0.05), symmetry=None):
    (pose,) = before.values()
    action, anchor = placed(pose, offset_m, frame)
    (moved,) = reanchored([action], [anchor], before, now, symmetry or {})
    return action, moved


def assert_same_pose(action, other):
    np.testing.assert_allclose(action.position_m, other.position_m, atol=1e-9)
    turn = Rotation.from_quat(action.quaternion_xyzw).inv() * Rotation.from_quat(other.quaternion_xyzw)
    assert turn.magnitude() < 1e-6


def test_an_action_keeps_its_pose_relative_to_a_moved_and_turned_object():
    now = seen("drawer", 0.03, 50)
    _, moved = follow(seen("drawer", 0, 20), now, "o")
    assert_same_pose(moved, placed(now["drawer"], (0.1, 0.0, 0.05), "o")[0])


def test_in_world_axes_only_the_place_follows():
    action, moved = follow(seen("plate", 0, 20), seen("plate", 0.03, 80), "w")
    np.testing.assert_allclose(moved.position_m - action.position_m, [0.03, 0, 0], atol=1e-12)
    np.testing.assert_allclose(moved.quaternion_xyzw, action.quaternion_xyzw, atol=1e-12)


@pytest.mark.parametrize("tilt_deg", [0, 3, 40])
@pytest.mark.parametrize(("frame", "place_turns", "hand_turns"), [("ow", True, False), ("wo", False, True)])
def test_place_and_rotation_may_turn_apart(frame, place_turns, hand_turns, tilt_deg):
    """Of an object that leans by little, as of an upright one, only the yaw counts."""
    before, now = seen("mug", 0, 20, tilt_deg), seen("mug", 0.03, 80, tilt_deg)
    own = [turned(yaw_deg, tilt_deg if tilt_deg > 5 else 0) for yaw_deg in (20, 80)]
    poses, offset_m = (before["mug"], now["mug"]), np.array([0.04, 0.0, 0.05])
    was, is_ = (
        EndEffectorAction(
            pose.position_m + (axes.apply(offset_m) if place_turns else offset_m),
            ((axes if hand_turns else Rotation.identity()) * DOWN).as_quat(),
            True,
        )
        for pose, axes in zip(poses, own, strict=True)
    )
    (moved,) = reanchored([was], [ActionAnchor("mug", frame, offset_m, DOWN.as_quat())], before, now, {})
    assert_same_pose(moved, is_)


@pytest.mark.parametrize(("frame", "hand_turns"), [("ow", False), ("o", True)])
def test_axes_toward_another_object_turn_with_the_direction_to_it(frame, hand_turns):
    """The goal goes from beside the block in x to beside it in y; how the block itself turns does not count."""
    before = seen("block") | seen("goal", 0.3)
    now = seen("block", 0.1, 77) | {"goal": ObjectPose("goal", np.array([0.1, 0.3, 0.8]), None)}
    behind = ActionAnchor("block", frame, np.array([-0.08, 0.0, 0.02]), DOWN.as_quat(), toward="goal")
    action = EndEffectorAction(np.array([-0.08, 0.0, 0.82]), DOWN.as_quat(), False)
    (moved,) = reanchored([action], [behind], before, now, {})
    hand = turned(90) * DOWN if hand_turns else DOWN
    assert_same_pose(moved, EndEffectorAction(np.array([0.1, -0.08, 0.82]), hand.as_quat(), False))


@pytest.mark.parametrize("goal", [{}, seen("goal", 0.304)])
def test_an_object_that_is_not_seen_or_hardly_moves_stands_where_it_was(goal):
    before, behind_m = seen("block") | seen("goal", 0.3), np.array([-0.08, 0.0, 0.82])
    behind = ActionAnchor("block", "ow", np.array([-0.08, 0.0, 0.02]), DOWN.as_quat(), toward="goal")
    action = EndEffectorAction(behind_m, DOWN.as_quat(), False)
    assert reanchored([action], [behind], before, seen("block") | goal, {}) == (action,)
    moved_m = np.array([0.3, -0.3, 0.8])  # the direction to the goal is then y
    now = {"block": ObjectPose("block", moved_m, None)} | goal
    (moved,) = reanchored([action], [behind], before, now, {})
    np.testing.assert_allclose(moved.position_m - moved_m, [0.0, -0.08, 0.02], atol=1e-9)


def test_the_axes_toward_an_object_without_a_pose_before_do_not_turn():
    behind = ActionAnchor("block", "ow", np.zeros(3), DOWN.as_quat(), toward="goal")
    action = EndEffectorAction(np.array([-0.08, 0.0, 0.82]), DOWN.as_quat(), False)
    (moved,) = reanchored([action], [behind], seen("block"), seen("block", 0.1, 90) | seen("goal", 0.3), {})
    np.testing.assert_allclose(moved.position_m, [0.02, 0.0, 0.82], atol=1e-9)


def test_an_action_at_a_round_object_that_stays_is_the_same_instance():
    for yaw_deg in range(0, 360, 7):  # of some rotations the inverse undoes them up to rounding only
        jar = seen("jar", 0, yaw_deg, 40)
        action, moved = follow(jar, seen("jar", 0.001, yaw_deg, 40), "o", symmetry={"jar": 0.0})
        assert moved is action


def test_below_the_threshold_nothing_changes():
    before, now = seen("cube", 0, 0), seen("cube", 0.004, 2)
    action, moved = follow(before, now, "o")
    assert moved is action
    action, moved = follow(before, seen("cube", 0.006, 2), "o")
    assert moved.position_m[0] - action.position_m[0] == pytest.approx(0.006, abs=1e-3)


@pytest.mark.parametrize(
    ("symmetry_deg", "seen_deg", "turn_deg"),
    [(90, 100, 10), (90, -85, 5), (180, 170, -10), (0, 137, 0), (None, 137, 137)],
)
def test_a_symmetric_object_turns_actions_by_the_least_angle(symmetry_deg, seen_deg, turn_deg):
    symmetry = {} if symmetry_deg is None else {"cube": symmetry_deg}
    before, now = seen("cube", 0, 0), seen("cube", 0.03, seen_deg)
    _, moved = follow(before, now, "o", symmetry=symmetry)
    assert_same_pose(moved, placed(seen("cube", 0.03, turn_deg)["cube"], (0.1, 0.0, 0.05), "o")[0])


def test_a_turn_that_the_symmetry_hides_is_no_motion():
    (old,), (new,) = seen("cube", 0, 40).values(), seen("cube", 0, -50).values()
    assert not has_moved(old, new, 90)
    assert has_moved(old, new, None)


def test_a_tilted_object_turns_actions_fully_and_an_upright_one_about_the_vertical():
    lid = seen("lid", 0, 30, 40)
    opened = seen("lid", 0, 30, 10)
    _, moved = follow(lid, opened, "o")
    assert_same_pose(moved, placed(opened["lid"], (0.1, 0.0, 0.05), "o")[0])
    _, moved = follow(seen("box", 0, 30), seen("box", 0.03, 30, 4), "o")
    assert_same_pose(moved, placed(seen("box", 0.03, 30)["box"], (0.1, 0.0, 0.05), "o")[0])


def test_only_actions_at_moved_objects_follow():
    before = {**seen("cube", 0), **seen("plate", 0.2)}
    now = {**seen("cube", 0.03), **seen("plate", 0.2)}
    on_cube, cube = placed(before["cube"], (0, 0, 0.1), "o")
    on_plate, plate = placed(before["plate"], (0, 0, 0.1), "o")
    world = ActionAnchor(None, "world", np.zeros(3), np.array([0, 0, 0, 1.0]))
    actions = [on_cube, on_plate, on_cube, on_cube]
    followed = reanchored(actions, [cube, plate, world, None], before, now, {})
    assert [new is old for new, old in zip(followed, actions, strict=True)] == [False, True, True, True]
    assert reanchored(actions[:1], [cube], before, {}, {}) == (on_cube,)
    assert reanchored(actions[:1], [cube], {}, now, {}) == (on_cube,)


def test_axes_that_follow_the_world_stay_and_those_of_another_object_follow_it():
    before = {**seen("cube", 0), **seen("plate", 0.2)}
    now = {
        "cube": ObjectPose("cube", np.array([0.03, 0.02, 0.01])),
        "plate": ObjectPose("plate", np.array([0.3, 0, 0])),
    }
    was = EndEffectorAction(before["cube"].position_m + np.array([0, 0, 0.1]), DOWN.as_quat(), True)
    anchor = ActionAnchor("cube", "w", np.array([0, 0, 0.1]), DOWN.as_quat(), {0: "plate", 2: None})
    (moved,) = reanchored([was], [anchor], before, now, {})
    gone_m = now["plate"].position_m[0] - before["plate"].position_m[0]
    y_m = was.position_m[1] + 0.02 - before["cube"].position_m[1]
    np.testing.assert_allclose(moved.position_m, [was.position_m[0] + gone_m, y_m, was.position_m[2]])


def test_a_pose_without_rotation_moves_actions_without_turning_them():
    before, now = {"cube": ObjectPose("cube", np.zeros(3))}, {"cube": ObjectPose("cube", np.array([0, 0.02, 0]))}
    action, anchor = placed(before["cube"], (0, 0, 0.1), "w")
    (moved,) = reanchored([action], [anchor], before, now, {"cube": 90})
    np.testing.assert_allclose(moved.position_m, [0, 0.02, 0.1])


def test_what_is_held_by_a_handle_keeps_its_place_at_another_object_as_it_is_turned():
    mug, coaster = seen("mug", 0, 20), {"coaster": ObjectPose("coaster", np.array([0.3, 0.1, 0.8]))}
    turned_mug, moved_coaster = seen("mug", 0.02, 50), {"coaster": ObjectPose("coaster", np.array([0.32, 0.1, 0.8]))}
    along = dict.fromkeys(range(3), "coaster")
    at_mug, anchor = placed(mug["mug"], (0.06, 0, 0), "o")
    to_coaster_m = coaster["coaster"].position_m - mug["mug"].position_m
    action = EndEffectorAction(at_mug.position_m + to_coaster_m, at_mug.quaternion_xyzw, True)
    (moved,) = reanchored([action], [replace(anchor, along=along)], mug | coaster, turned_mug | moved_coaster, {})
    expected_m = moved_coaster["coaster"].position_m + turned(50).apply((0.06, 0, 0))
    np.testing.assert_allclose(moved.position_m, expected_m)


def test_a_place_between_two_objects_follows_both_by_its_share():
    before = {name: ObjectPose(name, np.array(place_m)) for name, place_m in (("cup", [0, 0, 0]), ("plate", [1, 0, 0]))}
    now = {
        name: ObjectPose(name, np.array(place_m)) for name, place_m in (("cup", [0, 0.1, 0]), ("plate", [1, 0.2, 0]))
    }
    sent = {"object": "cup", "frame": "w", "along": {"x": "plate", "y": "plate"}, "share": 0.3}
    anchor = anchor_from_json(0, {"anchor": {**SENT, **sent}})
    action, _ = placed(before["cup"], (0.3, 0, 0.1), "w")
    (moved,) = reanchored([action], [anchor], before, now, {})
    np.testing.assert_allclose(moved.position_m, [0.3, 0.13, 0.1])


SENT = {
    "object": "cube",
    "frame": "o",
    "offset_m": [0, 0, 0.1],
    "rotation_xyzw": [1, 0, 0, 0],
    "tolerance_m": 0.01,
    "tolerance_deg": 5,
}


def test_anchors_as_the_service_sends_them():
    anchor = anchor_from_json(0, {"anchor": SENT})
    assert (anchor.object_name, anchor.frame) == ("cube", "o")
    assert anchor_from_json(0, {"anchor": {**SENT, "object": None, "frame": "world"}}).object_name is None
    sent = anchor_from_json(0, {"anchor": {**SENT, "along": {"z": None, "x": "plate"}, "share": 0.3}})
    assert (sent.along, sent.share) == ({2: None, 0: "plate"}, 0.3)
    assert (sent.toward, anchor_from_json(0, {"anchor": {**SENT, "toward": "goal"}}).toward) == (None, "goal")
    assert anchor_from_json(0, {"anchor": None}) is None
    assert anchor_from_json(0, {}) is None


def test_a_hand_that_turns_with_another_object_than_its_place():
    """A lid is held over a jar: its place follows the jar, its turn the lid; axes may be another object's, too."""
    before, now = seen("jar") | seen("lid", 0.2), seen("jar", 0.1) | seen("lid", 0.2, 90)
    was = EndEffectorAction(before["jar"].position_m + np.array([0.05, 0.0, 0.1]), DOWN.as_quat(), True)
    sent = {**SENT, "object": "jar", "frame": "w"}
    for names, place_m in (
        ({"hand": ["lid"]}, (0.05, 0.0, 0.1)),
        ({"axes": ["lid"], "hand": ["lid"]}, (0.0, 0.05, 0.1)),
    ):
        anchor = anchor_from_json(0, {"anchor": {**sent, **names}})
        assert anchor.others == {"lid"}
        (moved,) = reanchored([was], [anchor], before, now, {})
        np.testing.assert_allclose(moved.position_m, now["jar"].position_m + place_m, atol=1e-9)
        turned = Rotation.from_quat(moved.quaternion_xyzw) * DOWN.inv()
        np.testing.assert_allclose(turned.as_euler("xyz", degrees=True), (0, 0, 90), atol=1e-6)
    free = anchor_from_json(0, {"anchor": {**SENT, "object": None, "frame": "world", "hand": ["lid"]}})
    (moved,) = reanchored([was], [free], before, now, {})
    np.testing.assert_allclose(moved.position_m, was.position_m)
    assert not np.allclose(moved.quaternion_xyzw, was.quaternion_xyzw)


@pytest.mark.parametrize(
    "wrong",
    [
        {"object": None},
        {"frame": "x"},
        {"frame": "world"},
        {"offset_m": [0, 0]},
        {"offset_m": [0, 0, float("nan")]},
        {"rotation_xyzw": [0, 0, 0, 0]},
        {"share": 0},
        {"share": "half"},
        {"toward": 3},
    ],
)
def test_what_is_no_anchor_is_refused(wrong):
    with pytest.raises(UnsafeActionError, match="action 3: anchor"):
        anchor_from_json(3, {"anchor": {**SENT, **wrong}})
