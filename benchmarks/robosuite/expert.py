"""Scripted experts: where the hand goes in a scene, and what its gripper does there.

A hand that points down may grasp turned by half a turn as well, and a cube has four sides: the expert takes the turn
that is nearest to where its hand is. Nothing else of a scene decides what it does.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.robosuite.arm import Floats
from benchmarks.robosuite.scene import Scene
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

DOWN = Rotation.from_euler("x", np.pi)
ABOVE_M = np.array([0.0, 0.0, 0.12])
CUBES_APART_M = 0.047  # their centers, stacked
HANDLE_M = 0.06  # of the square nut's handle from its hole
HANDLE_DIRECTIONS_RAD = (np.pi / 2, np.pi, 3 * np.pi / 2)
PEG_TOP_M, ON_PEG_M = 0.14, 0.03  # of the nut over the peg's body
LIFTED_M = np.array([0.0, 0.0, 0.15])
# Of a door, in its latch's frame: where the handle is taken, the way out of the door, and the hinge.
HANDLE_END_M, OUTWARDS, HINGE_M = np.array([0.11, -0.10, 0.0]), np.array([0.0, -1.0, 0.0]), np.array([0.43, 0.0, 0.0])
LATCH_RAD, OPENED_RAD = np.radians(80), (0.15, 0.3, 0.42)


def plan(task: str, scene: Scene) -> list[EndEffectorAction]:
    """The expert's poses."""
    objects = scene.objects()
    experts = {"lift": _lift, "stack": _stack, "square_nut": _square_nut, "round_nut": _round_nut, "door": _door}
    return experts.get(task, _into_bin)(objects, scene)


def _lift(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    grasp = _nearest(scene.hand, _yaw(objects[0]), np.pi / 2)
    return [*_grasp(objects[0].position_m, grasp), _action(objects[0].position_m + LIFTED_M, grasp, is_open=False)]


def _stack(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    moved, base = objects
    grasp = _nearest(scene.hand, _yaw(moved), np.pi / 2)
    release = _nearest(grasp, _yaw(base), np.pi / 2)
    top_m = base.position_m + _up(CUBES_APART_M)
    return [*_grasp(moved.position_m, grasp), *_carry(moved.position_m, grasp, top_m, release)]


def _into_bin(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    """Takes a box over its thin side, the can as the hand is."""
    moved, goal = objects
    yaw_rad, above_m = {
        "can": (0.0, 0.02),
        "milk": (_yaw(moved), 0.05),
        "bread": (_yaw(moved), -0.005),
        "cereal": (_yaw(moved) + np.pi / 2, 0.06),
    }[moved.name]
    grasp, held_m = _nearest(scene.hand, yaw_rad, np.pi), moved.position_m + _up(above_m)
    return [*_grasp(held_m, grasp), *_carry(held_m, grasp, goal.position_m + _up(0.08), grasp)]


def _square_nut(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    """The nut's hole is square: the handle may point in four directions, and the expert takes the nearest.

    Pointing away from the arm the handle is beyond its reach.
    """
    nut, peg = objects
    turns_rad = (np.array(HANDLE_DIRECTIONS_RAD) - _yaw(nut) + np.pi) % (2 * np.pi) - np.pi
    return _nut_on_peg(nut, peg, float(turns_rad[np.abs(turns_rad).argmin()]), scene.hand)


def _round_nut(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    nut, peg = objects
    return _nut_on_peg(nut, peg, 0.0, scene.hand)


def _nut_on_peg(nut: ObjectPose, peg: ObjectPose, turned_rad: float, hand: Rotation) -> list[EndEffectorAction]:
    """Takes the nut by its handle and puts it over the peg, turned by that angle."""
    turn, handle_m = Rotation.from_euler("z", turned_rad), Rotation.from_euler("z", _yaw(nut)).apply([HANDLE_M, 0, 0])
    grasp = _nearest(hand, _yaw(nut) + np.pi / 2, np.pi)  # the fingers close along their x axis
    release, held_m, placed_m = turn * grasp, nut.position_m + handle_m, peg.position_m + turn.apply(handle_m)
    over_m, on_m = placed_m + _up(PEG_TOP_M), placed_m + _up(ON_PEG_M)
    return [
        *_grasp(held_m, grasp),
        _action(held_m + LIFTED_M, grasp, is_open=False),
        _action(over_m, release, is_open=False),
        _action(on_m, release, is_open=False),
        _action(on_m, release, is_open=True),
        _action(on_m + LIFTED_M, release, is_open=True),
    ]


def _door(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    """Takes the handle's end from the front, turns it up and pulls the door open about its hinge."""
    (latch,) = objects
    door = Rotation.from_euler("z", _yaw(latch))
    outwards = door.apply(OUTWARDS)
    front = Rotation.from_matrix(np.column_stack([[0, 0, 1], np.cross(-outwards, [0, 0, 1]), -outwards]))
    hand = min((front, front * Rotation.from_euler("z", np.pi)), key=lambda way: (way * scene.hand.inv()).magnitude())
    handle_m, hinge_m = (latch.position_m + door.apply(part) for part in (HANDLE_END_M, HINGE_M))
    up = Rotation.from_rotvec(outwards * LATCH_RAD)
    turned_m = latch.position_m + up.apply(handle_m - latch.position_m)
    swings = [Rotation.from_euler("z", angle_rad) for angle_rad in OPENED_RAD]
    return [
        _action(handle_m + 0.1 * outwards, hand),
        _action(handle_m, hand),
        _action(handle_m, hand, is_open=False),
        _action(turned_m, up * hand, is_open=False),
        *(_action(hinge_m + swing.apply(turned_m - hinge_m), swing * up * hand, is_open=False) for swing in swings),
    ]


def _up(height_m: float) -> Floats:
    return np.array([0.0, 0.0, height_m])


def _grasp(held_m: Floats, hand: Rotation) -> list[EndEffectorAction]:
    return [_action(held_m + ABOVE_M, hand), _action(held_m, hand), _action(held_m, hand, is_open=False)]


def _carry(held_m: Floats, grasp: Rotation, placed_m: Floats, release: Rotation) -> list[EndEffectorAction]:
    return [
        _action(held_m + LIFTED_M, grasp, is_open=False),
        _action(placed_m + ABOVE_M, release, is_open=False),
        _action(placed_m, release, is_open=False),
        _action(placed_m, release, is_open=True),
        _action(placed_m + ABOVE_M, release, is_open=True),
    ]


def _action(position_m: Floats, hand: Rotation, *, is_open: bool = True) -> EndEffectorAction:
    return EndEffectorAction(np.asarray(position_m), hand.as_quat(canonical=True), is_open)


def _yaw(pose: ObjectPose) -> float:
    assert pose.quaternion_xyzw is not None
    axis = Rotation.from_quat(pose.quaternion_xyzw).apply([1, 0, 0])
    return float(np.arctan2(axis[1], axis[0]))


def _nearest(hand: Rotation, yaw_rad: float, symmetry_rad: float) -> Rotation:
    """The hand that points down, at that yaw or whole symmetries away, that takes the least turning."""
    ways = [Rotation.from_euler("z", yaw_rad + k * symmetry_rad) * DOWN for k in range(round(2 * np.pi / symmetry_rad))]
    return min(ways, key=lambda way: float((way * hand.inv()).magnitude()))
