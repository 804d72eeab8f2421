"""Recordings of a cube that is put on a plate, from seeds: with rests at the poses, or in one flow."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.keyframes import KeyframeRule, Motion, find_keyframes
from app.pipeline.plans import Recording
from roboprompt_client.trajectory import ObjectPose, Trajectory

HZ = 20.0
STEP_M = 0.0125  # a quarter of a metre in a second
REST = 6  # frames
SMOOTH = 7  # frames over which a flowing hand rounds its corners
HOME_M = (0.4, 0.0, 0.5)
DOWN = Rotation.from_rotvec([np.pi, 0, 0])
INSTRUCTION = "put the cube on the plate"
ABOVE_M = np.array([0.0, 0.0, 0.12])


def recorded(number, rule=None, *, flows=(), noise_m=0.0, without=(), instruction=INSTRUCTION, way_m=None, seed=3):
    """Demonstrations in scenes of their own.

    Args:
        flows: the places of those that do not rest.
        noise_m: standard deviation of each coordinate of the objects' poses.
        without: names of objects that are not seen.
        way_m: points over which the cube is carried, from the cube's place.
    """
    way_m = tuple(way_m or ())
    return list(_recorded(number, rule or KeyframeRule(), tuple(flows), noise_m, without, instruction, way_m, seed))


@cache
def _recorded(number, rule, flows, noise_m, without, instruction, way_m, seed):
    rng = np.random.default_rng(seed)
    seen = {"noise_m": noise_m, "without": without, "instruction": instruction}
    return [recording(f"e{k}", rng, rule, flows=k in flows, way_m=way_m, **seen) for k in range(number)]


def recording(id_, rng, rule, *, flows, way_m, noise_m, without, instruction):
    cube_m, plate_m = (rng.uniform([-0.2, low, 0.02], [0.2, low + 0.3, 0.02]) for low in (-0.35, 0.1))
    trajectory = motion(steps(cube_m, plate_m, way_m), flows=flows)
    objects = tuple(
        ObjectPose(name, place_m + rng.normal(0, noise_m, 3) if noise_m else place_m)
        for name, place_m in (("cube", cube_m), ("plate", plate_m), ("lamp", rng.uniform(-0.3, 0.3, 3)))
        if name not in without
    )
    recorded = Motion.of(trajectory, HZ)
    found = find_keyframes(recorded, rule)
    actions = tuple(trajectory.action_at(frame, gripper_open=is_open) for frame, is_open in found)
    demonstration = Demonstration(instruction, objects, actions, id_, start=trajectory.action_at(0))
    return Recording(demonstration, recorded, rule)


def steps(cube_m, plate_m, way_m):
    """Where the hand goes, and what the gripper does there."""
    over = [(cube_m + np.array(point_m), False) for point_m in way_m]
    return [
        (cube_m + ABOVE_M, True),
        (cube_m, False),
        (cube_m + ABOVE_M, False),
        *over,
        (plate_m + ABOVE_M, False),
        (plate_m, True),
        (plate_m + ABOVE_M, True),
    ]


def motion(poses, *, flows):
    positions_m, is_open, rests = [np.array(HOME_M)], [True], [False]
    for place_m, after in poses:
        before_m, state = positions_m[-1], is_open[-1]
        number = max(2, round(float(np.linalg.norm(place_m - before_m)) / STEP_M))
        for k in range(1, number + 1):
            positions_m.append(before_m + (place_m - before_m) * k / number)
            is_open.append(after if flows and k == number else state)
            rests.append(False)
        if not flows:
            positions_m += [place_m] * REST
            is_open += [state] * (REST // 2) + [after] * (REST // 2)
            rests += [True] * REST
    path_m = np.array(positions_m)
    if flows:
        path_m = uniform_filter1d(path_m, SMOOTH, axis=0, mode="nearest")
    speeds_rad_s = np.zeros((len(path_m), 7))
    speeds_rad_s[:, 0] = np.where(rests, 0.0, 0.6)
    return Trajectory(speeds_rad_s, path_m, np.tile(DOWN.as_quat(), (len(path_m), 1)), np.array(is_open, dtype=float))


def slipped(item):
    """The same with a second grasp: the gripper opens for a moment while it carries the cube."""
    return released(item, 8)


def released(item, *places):
    """The same with the gripper open for a moment, at so many frames after it closed."""
    is_open = item.motion.trajectory.gripper_open.copy()
    closed = int(np.flatnonzero(~is_open)[0])
    for place in places:
        is_open[closed + place : closed + place + 6] = True
    return with_trajectory(item, gripper_open=is_open)


def shifted(item, by_m):
    """The same scene with a hand that is elsewhere all the time."""
    positions_m = item.motion.trajectory.positions_m + np.array(by_m)
    return with_trajectory(item, positions_m=positions_m)


def moved_as(item, other):
    """The scene of one recording with the motion of another."""
    demonstration = replace(item.demonstration, start=other.demonstration.start)
    return replace(item, demonstration=demonstration, motion=other.motion)


def with_trajectory(item, **changes):
    return replace(item, motion=Motion.of(replace(item.motion.trajectory, **changes), HZ))


def grasped_from(item, side_deg, yaw_deg):
    """The same with the cube at a yaw, and a hand that is turned with it and by `side_deg` more."""
    cube, *others = item.demonstration.objects
    turned = replace(cube, quaternion_xyzw=Rotation.from_euler("z", yaw_deg, degrees=True).as_quat())
    hand = Rotation.from_euler("z", yaw_deg + side_deg, degrees=True) * DOWN
    quaternions_xyzw = np.tile(hand.as_quat(), (len(item.motion), 1))
    shown = replace(item.demonstration, objects=(turned, *others))
    return with_trajectory(replace(item, demonstration=shown), quaternions_xyzw=quaternions_xyzw)
