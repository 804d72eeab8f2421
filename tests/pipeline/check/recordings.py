"""Recordings of a cube that is put on a plate, from seeds: with rests at the poses, or in one flow."""

from dataclasses import replace
from functools import cache

import numpy as np
from app.pipeline.plans.recording import Recording
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.keyframes import KeyframeRule, Motion, find_keyframes
from roboprompt_client.types.poses import ObjectPose

from ..recordings import DOWN, arrival_s, flowing, resting

HZ = 20.0
SPEED_M_S = 0.25
HOME_M = (0.4, 0.0, 0.5)
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
    trajectory = motion(cube_m, plate_m, way_m, flows=flows)
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


def motion(cube_m, plate_m, way_m, *, flows):
    over = [cube_m + np.array(point_m) for point_m in way_m]
    stops_m = [HOME_M, cube_m + ABOVE_M, cube_m, cube_m + ABOVE_M, *over, plate_m + ABOVE_M, plate_m, plate_m + ABOVE_M]
    made = flowing(stops_m, SPEED_M_S) if flows else resting(stops_m, SPEED_M_S)
    switches = tuple(arrival_s(made, at_m) + made.rest_s / 2 for at_m in (cube_m, plate_m))
    return replace(made, switches=switches).at(HZ)


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
