"""Scripted experts: where the hand goes in a scene, and what its gripper does there.

A hand that points down may grasp turned by half a turn as well, and a cube has four sides: the expert takes the turn
that is nearest to where its hand is. Nothing else of a scene decides what it does.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.robosuite.scene import Floats, Scene
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

DOWN = Rotation.from_euler("x", np.pi)
ABOVE_M = np.array([0.0, 0.0, 0.12])
CUBES_APART_M = 0.047  # their centers, stacked
HANDLE_M = 0.06  # of the square nut's handle from its hole
HANDLE_DIRECTIONS_RAD = (np.pi / 2, np.pi, 3 * np.pi / 2)
PEG_TOP_M, ON_PEG_M = 0.14, 0.03  # of the nut over the peg's body
LIFTED_M = np.array([0.0, 0.0, 0.15])


def plan(task: str, scene: Scene) -> list[EndEffectorAction]:
    """The expert's poses."""
    objects = scene.objects()
    return {"lift": _lift, "stack": _stack, "can": _can, "square_nut": _square_nut}[task](objects, scene)


def _lift(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    grasp = _nearest(scene.hand, _yaw(objects[0]), np.pi / 2)
    return [*_grasp(objects[0].position_m, grasp), _action(objects[0].position_m + LIFTED_M, grasp, is_open=False)]


def _stack(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    moved, base = objects
    grasp = _nearest(scene.hand, _yaw(moved), np.pi / 2)
    release = _nearest(grasp, _yaw(base), np.pi / 2)
    top_m = base.position_m + _up(CUBES_APART_M)
    return [*_grasp(moved.position_m, grasp), *_carry(moved.position_m, grasp, top_m, release)]


def _can(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    can, goal = objects
    grasp = _nearest(scene.hand, 0.0, np.pi)
    held_m = can.position_m + _up(0.02)
    return [*_grasp(held_m, grasp), *_carry(held_m, grasp, goal.position_m + _up(0.08), grasp)]


def _square_nut(objects: tuple[ObjectPose, ...], scene: Scene) -> list[EndEffectorAction]:
    """The nut's hole is square: the handle may point in four directions, and the expert takes the nearest.

    Pointing away from the arm the handle is beyond its reach.
    """
    nut, peg = objects
    yaw_rad = _yaw(nut)
    grasp = _nearest(scene.hand, yaw_rad + np.pi / 2, np.pi)  # the fingers close along their x axis
    turns_rad = (np.array(HANDLE_DIRECTIONS_RAD) - yaw_rad + np.pi) % (2 * np.pi) - np.pi
    turned_rad = float(turns_rad[np.abs(turns_rad).argmin()])
    release = Rotation.from_euler("z", turned_rad) * grasp
    handle_m = Rotation.from_euler("z", yaw_rad).apply([HANDLE_M, 0, 0])
    held_m = nut.position_m + handle_m
    placed_m = peg.position_m + Rotation.from_euler("z", turned_rad).apply(handle_m)
    over_m, on_m = placed_m + _up(PEG_TOP_M), placed_m + _up(ON_PEG_M)
    return [
        *_grasp(held_m, grasp),
        _action(held_m + LIFTED_M, grasp, is_open=False),
        _action(over_m, release, is_open=False),
        _action(on_m, release, is_open=False),
        _action(on_m, release, is_open=True),
        _action(on_m + LIFTED_M, release, is_open=True),
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
